"""What is out of date of a campaign, found anew only when a file has changed."""

import threading

from validation.campaign.provenance import (
    RECORD,
    REPORT_FILE,
    REPORT_FILES,
    OutOfDate,
    earlier_record,
    earlier_steps,
    out_of_date,
    sources_of,
)
from validation.page.desk import Desk, version_of

MOST_FILES = 5_000
"""Files whose times are asked for each second. A judgement: 10 ms; of more, the first."""


class Standing:
    """Results and report of a campaign against the files that they were made from."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._found: tuple[str, list[OutOfDate]] = ("", [])
        self._watched: tuple[str, list[str]] = ("", [])
        self._finding = threading.Lock()

    def version(self) -> str:
        """A text that changes with every file that results or report come from, or are."""
        campaign = self._desk.campaign_as_opened
        record = campaign.results / RECORD
        at = version_of([record, *(campaign.folder / name for name in REPORT_FILES)])
        if at != self._watched[0]:
            steps = earlier_steps(earlier_record(campaign)).values()
            sources = sources_of(campaign, steps)
            names = [path for path in sources if path.is_file()]
            for folder in (path for path in sources if path.is_dir()):
                if folder != campaign.folder:
                    names += [path for path in sorted(folder.rglob("*")) if path.is_file()]
            inputs = {name for step in steps for name in step.inputs}
            names += [campaign.folder / name for name in sorted(inputs) if "\0" not in name]
            self._watched = (at, [str(path) for path in dict.fromkeys(names)][:MOST_FILES])
        return f"{at}/{hash(version_of(map(campaign.folder.joinpath, self._watched[1])))}"

    def old(self) -> list[OutOfDate]:
        """What is out of date; files are read only where one has changed since it was asked."""
        with self._finding:
            version = self.version()
            if version != self._found[0]:
                campaign = self._desk.campaign_as_opened
                steps = earlier_steps(earlier_record(campaign))
                self._found = (version, out_of_date(campaign, steps) if steps else [])
            return self._found[1]

    @property
    def ran(self) -> bool:
        """Whether there are results."""
        return (self._desk.campaign_as_opened.results / RECORD).is_file()

    def reason(self) -> str:
        """Why the report is out of date; '' where it is not."""
        return next((one.reason for one in self.old() if one.file == REPORT_FILE), "")
