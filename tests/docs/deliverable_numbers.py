"""Numbers of docs/deliverable.md, each computed from the AD2.3 campaign as a run leaves it."""

import csv
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from laser_gt.settings import LaserSettings
from survey.campaign.solve import solve_campaign
from survey.readings.instrument import reading_sigma
from survey.studies.walls import compare_walls
from validation.campaign.folder import Campaign, load_campaign
from validation.run import RunResult, run_campaign
from validation.run_files import write_results


class Demo:
    """The campaign, its run and its files."""

    def __init__(self, folder: Path) -> None:
        self.campaign: Campaign = load_campaign(folder)
        self.run: RunResult = run_campaign(self.campaign)
        write_results(self.run)
        outcome = solve_campaign(self.campaign)
        assert outcome.solution is not None
        assert outcome.as_published is not None
        self.survey, self.listing = outcome.solution, outcome.as_published
        self.published = outcome.published

    def rows(self, name: str) -> list[dict[str, str]]:
        """The rows of a file under results/, or of the campaign."""
        path = self.campaign.results / name
        with (path if path.exists() else self.campaign.folder / name).open(newline="") as stream:
            return list(csv.DictReader(stream))

    def finding(self, code: str, subject: str) -> str:
        """The text of a finding."""
        return next(
            one.text for one in self.run.findings if (one.code, one.subject) == (code, subject)
        )


def specification(demo: Demo) -> str:
    bare = demo.campaign.settings.instrument.model_copy(
        update={"setup_sigma": 0.0, "resolution": 0.0}
    )
    near, far = 2e3 * reading_sigma(bare, np.array([30.0, 50.0]))
    return f"±{near:.1f} mm to 30 m, ±{far:.0f} mm at 50 m"


def walls(_demo: Demo) -> str:
    at, distance = np.array([0.0, 3.0]), np.array([8.0, 8.02])
    return (
        f"2 cm over 3 m are {np.degrees(compare_walls('a', 'b', at, distance, at + 1).angle):.2f}°"
    )


def diagonal(demo: Demo) -> str:
    (only,) = demo.survey.vframe.tests
    off = 1e3 * (only.measured - only.expected)
    read = f"{only.measured:.3f} for {only.expected:.6f} m"
    return f"{read}: {off:+.1f} mm, p = {only.p_value:.2f}, 1 test"


def points(demo: Demo) -> str:
    return f"{len(demo.survey.world.points)} points"


def within(demo: Demo) -> str:
    comparison = demo.published
    assert comparison is not None
    good = ~comparison.inconsistent
    most = 1e3 * np.abs(comparison.difference[good]).max()
    return f"{good.sum()} of {len(good)} within {most:.2f} mm"


def origin(demo: Demo) -> str:
    lost = {name: off for name, off in demo.listing.lost_from_origin.items() if off > 1e-3}
    (name,) = lost
    found = sum(off < 1e-3 for off in demo.listing.own_from_origin.values())
    total = len(demo.listing.own_from_origin)
    strayed = f"point {name} ends {lost[name]:.1e} m off"
    return f"{total - 1} of {total}, {strayed}; gtval {found} of {total}"


def listing(demo: Demo) -> str:
    off = [
        np.abs(demo.listing.world[p.name].x - p.position).max() for p in demo.survey.world.points
    ]
    return f"at most {1e3 * max(off):.3f} mm from gtval"


def readings(demo: Demo) -> str:
    return f"{sum(row['to'].isdigit() for row in demo.rows('survey/readings.csv'))} readings"


def point_15(demo: Demo) -> str:
    comparison = demo.published
    assert comparison is not None
    (row,) = np.flatnonzero(comparison.inconsistent)
    dx, dy = 1e3 * comparison.difference[row]
    return f"point {comparison.names[row]} off by {dx:+.1f}, {dy:+.1f} mm, the others follow"


def ellipses(demo: Demo) -> str:
    long = [3e3 * np.sqrt(np.linalg.eigvalsh(p.covariance)[-1]) for p in demo.survey.world.points]
    return f"{min(long):.0f} to {max(long):.0f} mm (3 sigma, long axis)"


def regions(demo: Demo) -> str:
    found = demo.rows("convergence.csv")
    good = sum(row["elsewhere"] == row["nowhere"] == "0" for row in found)
    starts = sum(int(row["to_solution"]) for row in found)
    return f"all {starts} starts within 5 m, {good} of {len(found)} points"


def stops(demo: Demo) -> str:
    return f"{len(demo.rows('survey/published_poses.csv'))} stops"


def planned(demo: Demo) -> str:
    found = [
        1e3 * float(row["planned_position"])
        for row in demo.rows("plan_reached.csv")
        if row["kind"] == "stop"
    ]
    return f"predicted {min(found):.1f} to {max(found):.1f} mm (1 sigma in the plane)"


def motion(demo: Demo) -> str:
    (row,) = demo.rows("motions.csv")
    dx, dy = float(row["error_dx"]), float(row["error_dy"])
    return f"{dx:.6f}, {dy:.6f}, {np.degrees(float(row['error_dtheta'])):.6f}"


def chessboard(demo: Demo) -> str:
    text = demo.finding("printed_statistics", "table_chessboard")
    return text.partition("printed ones: ")[2].removesuffix(".")


def table_numbers(demo: Demo, what: str) -> str:
    own = [row for row in demo.rows("vision_printed_table.csv") if row["what"] == what]
    said = []
    for axis in ("dx", "dy"):
        values = np.array([float(row[axis]) for row in own])
        largest = np.abs(values).max()
        said.append(f"{values.mean():.5f} {values.std(ddof=1):.5f} {largest:.5f}")
    return "; ".join(said)


def printed(demo: Demo, *systems: str, kinds: tuple[str, ...] = ("mean", "std", "max_abs")) -> str:
    own = [
        row
        for row in demo.rows("printed_statistics.csv")
        if row["system"] in systems and row["number"] in kinds
    ]
    good = sum(row["verdict"] != "differs" for row in own)
    return f"{good} of {len(own)} to the last digit"


def vision(demo: Demo) -> str:
    used = demo.finding("printed_interval", "vision").partition("n = ")[2].partition(",")[0]
    return f"{printed(demo, 'vision')}; intervals used n = {used}"


def cells(demo: Demo, *systems: str) -> str:
    texts = [demo.finding("printed_errors", system) for system in systems]
    counts = [text.partition(" printed")[0].split(" of ") for text in texts]
    good, every = (sum(int(count[k]) for count in counts) for k in (0, 1))
    rest = f", {every - good} but for the last digit" if every > good else ""
    return f"{good} of {every} errors to the last digit{rest}"


def recognised(demo: Demo) -> str:
    text = demo.finding("success_rate", "vision")
    images, stops_ = text.partition("in ")[2].partition(" images")[0], text.rpartition("at ")[2]
    return f"{images} images, {stops_.removesuffix('.')}"


def genetic(_demo: Demo) -> str:
    settings = LaserSettings()
    return f"{settings.population} x {settings.generations}"


def explained(demo: Demo) -> str:
    row = next(row for row in demo.rows("statistics.csv") if row["system"] == "laser_genetic")
    text = demo.finding("systematic_error", "laser_genetic")
    x, y = (text.partition(f"mount {axis} ")[2].partition(" (")[0] for axis in "xy")
    return f"std x {float(row['std']):.5f} m; mount off by {x}, {y}"


def paired(demo: Demo) -> str:
    row = demo.rows("paired.csv")[0]
    mean, low, high = (1e3 * float(row[key]) for key in ("mean", "low", "high"))
    return f"vision less laser in x: {mean:+.0f} mm ({low:+.0f} to {high:+.0f})"


def conclusions(demo: Demo) -> str:
    found = Counter(row["verdict"] for row in demo.rows("conclusions.csv"))
    return ", ".join(f"{found[one]} {one}" for one in sorted(found))


COMPUTED: dict[int, Callable[[Demo], str]] = {
    1: specification,
    5: walls,
    6: diagonal,
    9: points,
    10: within,
    12: origin,
    13: listing,
    14: readings,
    15: point_15,
    16: ellipses,
    17: regions,
    20: stops,
    23: planned,
    25: lambda demo: f"{len(demo.rows('survey/initial_guesses.csv'))} poses",
    26: motion,
    39: lambda demo: (
        f"{cells(demo, 'table_chessboard')}; {table_numbers(demo, 'table_chessboard')}"
    ),
    40: chessboard,
    43: lambda demo: table_numbers(demo, "table_marker"),
    52: lambda demo: cells(demo, "vision"),
    53: vision,
    55: recognised,
    61: genetic,
    66: lambda demo: cells(demo, "laser_genetic", "laser_scanmatch"),
    67: lambda demo: printed(demo, "laser_genetic", "laser_scanmatch"),
    68: explained,
    70: lambda demo: printed(
        demo, "vision", "laser_genetic", "laser_scanmatch", kinds=("mean", "std")
    ),
    71: lambda demo: f"{paired(demo)}; {conclusions(demo)}",
}
"""By the number of the item."""
