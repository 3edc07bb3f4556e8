"""`python -m laser_gt.panel.making CAMPAIGN`: all matches made and kept, in a process of its own.

The page stays quick and small meanwhile, and then finds what was kept.
"""

import os
import sys
from pathlib import Path

from validation.errors import GtvalError
from validation.page.running import tell


def main(folder: str) -> int:
    """Exit status; progress and errors as lines of JSON."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from laser_gt.campaign.result_files import kept_files  # noqa: PLC0415  (after the setting)
    from laser_gt.campaign.solve import solve_campaign  # noqa: PLC0415
    from validation.campaign.folder import load_campaign  # noqa: PLC0415
    from validation.solving import solve_validation  # noqa: PLC0415
    from validation.systems import installed_systems  # noqa: PLC0415
    from validation.text_files.writing import write_files  # noqa: PLC0415

    try:
        campaign = solve_validation(load_campaign(Path(folder)), installed_systems())
        outcome = solve_campaign(
            campaign,
            lambda what, share: tell(what=what, share=round(share, 3)),
            engines=("scanmatch",),
            as_published=False,
            need_poses=False,
        )
        write_files(campaign.results, kept_files(outcome))
    except GtvalError as error:
        tell(error=str(error))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
