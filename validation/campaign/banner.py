"""What a report says of itself once its numbers are no longer those of the results."""

import html

from validation.campaign.folder import Campaign

PLACE = "<!-- out of date -->"
"""Where the report's template has room for it."""


def marked_report(campaign: Campaign, reason: str) -> dict[str, str]:
    """The report of an earlier run with a warning at its top; nothing where there is none.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    reason : str
        What has happened since.
    """
    path = campaign.report / "report.html"
    try:
        page = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    said = html.escape(f"This report is out of date: {reason}. `gtval run` makes it anew.")
    start = page.find(PLACE)
    if start < 0:
        return {}
    rest = page[start + len(PLACE) :]
    if rest.startswith('<p class="alarm" role="alert">'):
        rest = rest[rest.index("</p>") + len("</p>") :]
    marked = f'{page[:start]}{PLACE}<p class="alarm" role="alert">{said}</p>{rest}'
    return {f"{campaign.report.name}/{path.name}": marked}
