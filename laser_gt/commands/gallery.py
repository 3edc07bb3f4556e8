"""The gallery for manual inspection: one page, all matches, before and after.

AD2.3, "Manual Inspection": every match was plotted in two colours and looked at. Here the page
shows first those that wait for a decision. What is decided goes into laser/decisions.csv, by the
command that stands under each pair or by any other hand, and the next run obeys.
"""

import html
import shlex
from collections.abc import Mapping, Sequence

from laser_gt.campaign.sections import worst_first
from laser_gt.matching.verdicts import VERDICTS, Match
from laser_gt.scans.evidence import Prepared

STYLE = """
body { font-family: system-ui, sans-serif; margin: 1.5rem auto; padding: 0 1rem;
  max-width: 62rem; color: #222; }
article { border-top: 1px solid #bbb; padding: 0.8rem 0; }
img { max-width: 100%; height: auto; }
h2 { font-size: 1.05rem; margin: 0.2rem 0; }
.accepted { color: #00664b; } .imprecise { color: #005a8c; } .may { color: #8a5a00; }
.refuted { color: #555; }
code { background: #f2f2f2; padding: 0.1rem 0.3rem; }
nav a { margin-right: 1rem; }
"""


def gallery(
    matches: Sequence[Match], sweeps: Mapping[str, Prepared], campaign: str, most: int = 200
) -> str:
    """The page as HTML that needs no other file.

    Parameters
    ----------
    matches : sequence of Match
        Of all pairs.
    sweeps : mapping of str to Prepared
        The scans of each stop.
    campaign : str
        The folder, as commands should name it.
    most : int
        Pairs drawn; the ones that wait for a decision come first.
    """
    ordered = worst_first(matches)
    count = {verdict: sum(m.verdict == verdict for m in matches) for verdict in VERDICTS}
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width'>",
        f"<title>Matches to inspect</title><style>{STYLE}</style></head><body>",
        "<h1>Matches to inspect</h1>",
        (
            f"<p>{count['may be wrong']} may be wrong: decide on them. {count['refuted']} are "
            f"refuted, {count['imprecise']} imprecise, {count['accepted']} accepted. "
            "The reference scan is orange (sensor: triangle), "
            "the other blue (square). Right: they must lie on each other where both could see.</p>"
        ),
    ]
    if len(ordered) > most:
        parts.append(f"<p>The first {most} of {len(ordered)} are shown.</p>")
    parts += [_article(one, sweeps, campaign) for one in ordered[:most]]
    parts.append("</body></html>")
    return "\n".join(parts)


def _article(match: Match, sweeps: Mapping[str, Prepared], campaign: str) -> str:
    """One pair."""
    pair = f"{match.reference} - {match.moving}"
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in match.reasons)
    command = shlex.join(["gtval", "laser", "decide", campaign, match.reference, match.moving])
    x, y, theta = match.pose
    return (
        f"<article id='{html.escape(pair)}'><h2>{html.escape(pair)}: "
        f"<span class='{match.verdict.split()[0]}'>{match.verdict}</span></h2>"
        f"<img alt='The two scans before and after alignment' src='{_picture(match, sweeps)}'>"
        f"<ul>{reasons or '<li>nothing speaks against it</li>'}</ul>"
        f"<p>Pose {x:.4f} m, {y:.4f} m, {theta:.4f} rad; standard deviation "
        f"{match.sigma_length * 1e3:.1f} mm, {match.sigma_angle * 1e3:.1f} mrad; "
        f"{match.explained:.0%} of the points explained, {match.violating:.1%} in free space; "
        f"fitness {match.fitness:.3f} m².</p>"
        f"<p><code>{html.escape(command)} accept</code> or <code>reject</code> or "
        f"<code>guess X Y THETA</code></p></article>"
    )


def _picture(match: Match, sweeps: Mapping[str, Prepared]) -> str:
    """The figure as a data address."""
    from laser_gt.campaign.figures import match_figure
    from validation.figures.writing import figure_bytes, web_image

    figure = match_figure(match, sweeps[match.reference], sweeps[match.moving])
    return web_image(figure_bytes(figure, ".png", "the picture of a match", dots_per_inch=80))
