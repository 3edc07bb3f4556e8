"""What a report says of itself once its numbers are no longer those of the results."""

import html
from collections.abc import Iterable

from validation.campaign.folder import Campaign
from validation.campaign.provenance import REPORT_FILE, OutOfDate

START, END = "<!-- out of date -->", "<!-- /out of date -->"
"""Between them the report's template has room for it."""


def marked_report(campaign: Campaign, old: Iterable[OutOfDate] = ()) -> dict[str, str]:
    """The report of an earlier run with a warning at its top, or without the one it had.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    old : iterable of OutOfDate
        What is out of date, the report or not.

    Returns
    -------
    dict of str to str
        The page by its path in the folder; empty where there is nothing to change.
    """
    try:
        page = (campaign.folder / REPORT_FILE).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    before, place, after = page.partition(START)
    _, end, after = after.partition(END)
    if not (place and end):
        return {}
    mark = ""
    for late in (one for one in old if one.file == REPORT_FILE):
        strong = "<strong>This report is out of date.</strong>"
        said = html.escape(
            f"{late.reason[0].upper()}{late.reason[1:]}. Run `gtval run` to make it anew."
        )
        mark = f'<p class="alarm" role="alert">{strong} {said}</p>'
    marked = f"{before}{START}{mark}{END}{after}"
    return {REPORT_FILE: marked} if marked != page else {}
