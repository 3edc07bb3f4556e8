"""Tables and figures of the RTK system for the report and the terminal."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.campaign.pose_tables import sensor_pieces
from rtk_gt.offsets.estimate import distance_names
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.coverage import Coverage
from rtk_gt.path.interpolation import METHODS, NAMES, HoldOut
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, RTK_FLOAT
from rtk_gt.receivers.quality import inside
from validation.poses.angles import Array
from validation.results import Figure, Section, Table, Text

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

LONGEST_SHOWN = 10
Cells = list[str | int | float | None]


def rtk_sections(outcome: RtkOutcome) -> list[Section]:
    """Parts of the report, in reading order."""
    return [
        Section("RTK-GPS: what has ground truth", _coverage_blocks(outcome)),
        Section(
            "RTK-GPS: offsets and antennas",
            [
                offset_table(outcome),
                observability_table(outcome),
                distance_table(outcome),
                antenna_table(outcome),
                _figure(
                    "rtk_residuals",
                    "Measured distances of the antennas, and their squares, minus the constant "
                    "values, with the densities that the noise predicts.",
                    "Histograms of the residuals of each pair of antennas; their spread is in the "
                    "table of distances.",
                    "residual_histograms",
                    outcome.offsets,
                    outcome.noise,
                    outcome.antennas,
                ),
            ],
        ),
        Section("RTK-GPS: the path and its uncertainty", _path_blocks(outcome)),
        Section("RTK-GPS: consistency", _consistency_blocks(outcome)),
    ]


def rtk_overview(outcome: RtkOutcome) -> list[Table]:
    """What the terminal shows of a drive that is solved by itself."""
    return [
        coverage_table(outcome.coverage),
        offset_table(outcome),
        observability_table(outcome),
        distance_table(outcome),
        uncertainty_table(outcome),
    ]


def _figure(name: str, caption: str, alternative: str, function: str, *arguments: object) -> Figure:
    return Figure(name, caption, alternative, partial(_draw, function, *arguments))


def _draw(function: str, *arguments: object) -> "MatplotlibFigure":
    """A figure of `rtk_gt.campaign`, imported only when something is drawn."""
    from rtk_gt.campaign import figures, site_figures  # noqa: PLC0415

    room = site_figures if hasattr(site_figures, function) else figures
    draw: Callable[..., MatplotlibFigure] = getattr(room, function)
    return draw(*arguments)


def _coverage_blocks(outcome: RtkOutcome) -> list[Table | Figure | Text]:
    gap = outcome.settings.max_gap
    blocks: list[Table | Figure | Text] = [
        Text(
            "There is ground truth only where all receivers are RTK-fixed at the same time. "
            f"Pauses of up to {gap:g} s between two poses do not count as gaps."
        ),
        coverage_table(outcome.coverage),
        _figure(
            "rtk_fix_modes",
            "Fix kind of each receiver over time, and where that gives ground truth.",
            "A bar for each receiver, coloured by fix kind; the shares are in the table.",
            "fix_modes",
            outcome.records,
            outcome.path.times,
            gap,
        ),
        _figure(
            "rtk_map",
            "The drive from above: ground truth of the vehicle, and the fixes of one receiver "
            "with its offset added.",
            "Map of the drive in the local frame; gaps are listed in the table.",
            "track_map",
            outcome.records,
            outcome.steps,
            outcome.offsets,
            outcome.path,
            outcome.settings,
            outcome.campaign.folder,
        ),
    ]
    if outcome.areas:
        blocks.append(areas_table(outcome))
    if outcome.coverage.gaps:
        blocks.append(gap_table(outcome.coverage))
    if any((one.satellites >= 0).any() or np.isfinite(one.hdop).any() for one in outcome.records):
        blocks.append(
            _figure(
                "rtk_reception",
                "Satellites used and horizontal dilution of precision (HDOP).",
                "Curves of the number of satellites and of HDOP for each receiver over time.",
                "reception",
                outcome.records,
            )
        )
    if any(np.isfinite(record.covariances).any() for record in outcome.records):
        blocks.append(
            _figure(
                "rtk_stated_ellipses",
                "Typical error ellipses as the receivers state them, RTK fixed beside RTK float.",
                "Two panels with an ellipse for each receiver. `gtval rtk coverage --json` prints "
                "their semi-axes.",
                "stated_ellipses",
                outcome.records,
            )
        )
        blocks.append(
            _figure(
                "rtk_stated_over_time",
                "Errors that the receivers state over time (1 sigma), RTK fixed beside float.",
                "Points over time on a logarithmic scale, coloured by kind of fix; typical ones "
                "are in the ellipses.",
                "stated_over_time",
                outcome.records,
            )
        )
    return blocks


def areas_table(outcome: RtkOutcome) -> Table:
    """How the fixes and the poses of each named area are."""
    rows: list[Cells] = []
    sigmas = np.sqrt(np.diagonal(outcome.path.covariances, axis1=1, axis2=2)[:, :2].max(1))
    for name, corners in outcome.settings.outlines.items():
        here = inside(corners, outcome.path.poses[:, :2])
        typical = float(np.median(sigmas[here])) if here.any() else None
        for receiver, qualities in outcome.areas.items():
            (own,) = [one for one in qualities if one.area == name]
            share = {kind.kind: 100 * kind.share for kind in own.kinds}
            fixes = sum(kind.epochs for kind in own.kinds)
            fixed, floating = (share.get(FIX_NAMES[kind], 0.0) for kind in (RTK_FIXED, RTK_FLOAT))
            rows.append([name, receiver, fixes, fixed, floating, int(here.sum()), typical])
    columns = ["area", "receiver", "fixes", "RTK fixed [%]", "RTK float [%]", "poses"]
    return Table(
        "Quality by area",
        [*columns, "sigma level [m]"],
        rows,
        ["", "", "", ".1f", ".1f", "", ".4f"],
        "Shares of the fixes of each receiver in the area; poses of the vehicle there, and their "
        "median sigma.",
    )


def coverage_table(coverage: Coverage) -> Table:
    """Fix kinds, satellites and gaps of each receiver."""
    found = coverage.receivers
    kinds = [name for name in FIX_NAMES.values() if any(name in one.shares for one in found)]
    kinds.append("no record")
    columns = [
        *("receiver", "fixes", "every [s]", *(f"{kind} [%]" for kind in kinds)),
        *("satellites", "HDOP", "longest without fixed [s]"),
    ]
    rows: list[Cells] = []
    for one in found:
        satellites: str | None = None
        if one.satellites is not None:
            least, middle, most = one.satellites
            satellites = f"{middle:.0f} ({least:.0f} to {most:.0f})"
        hdop = None if one.hdop is None else f"{one.hdop[1]:.1f} (to {one.hdop[2]:.1f})"
        shares = [100 * one.shares.get(kind, 0.0) for kind in kinds]
        rows.append(
            [one.receiver, one.count, one.interval, *shares, satellites, hdop, one.longest_gap]
        )
    formats = ["", "", ".1f", *[".1f"] * len(kinds), "", "", ".1f"]
    note = "Shares of the drive's duration. Satellites and HDOP: median, and range."
    return Table("Fixes of each receiver", columns, rows, formats, note)


def gap_table(found: Coverage) -> Table:
    """The longest parts without ground truth."""
    rows = [[g.start - found.start, g.duration, g.length] for g in found.gaps[:LONGEST_SHOWN]]
    return Table(
        f"Longest gaps of the ground truth ({len(found.gaps)} in all)",
        ["from second", "duration [s]", "length [m]"],
        rows,
        [".1f", ".1f", ".1f"],
        f"Covered: {100 * found.share_of_time:.1f} % of {found.duration:.1f} s and "
        f"{100 * found.share_of_length:.1f} % of {found.length:.0f} m.",
    )


def offset_table(outcome: RtkOutcome) -> Table:
    """Offsets with standard deviations."""
    offsets = outcome.offsets
    rows: list[Cells] = [
        [name, *(float(v) for pair in zip(value, sigma, strict=True) for v in pair)]
        for name, value, sigma in zip(
            offsets.receivers, offsets.offsets.values, offsets.offset_sigmas, strict=True
        )
    ]
    columns = ["receiver"]
    columns += [text for axis in "xyz" for text in (f"{axis} [m]", f"sigma {axis} [m]")]
    note = (
        f"To be added to recorded positions in the frame: {offsets.offsets.frame}. The first "
        "receiver is the reference. A sigma of metres means: not determined."
    )
    return Table("Offsets between the receivers", columns, rows, ["", *[".4f"] * 6], note)


def observability_table(outcome: RtkOutcome) -> Table:
    """What the drive alone says of each direction of the offsets."""
    from rtk_gt.campaign.findings import direction_words  # noqa: PLC0415  (findings import the tables' data)

    offsets = outcome.offsets
    rows: list[Cells] = []
    for value, direction in zip(offsets.signal, offsets.directions.T, strict=True):
        sigma = None if value <= 0 else float(np.sqrt(offsets.correlation_time / value))
        limit = outcome.settings.largest_offset_sigma
        state = "undetermined" if sigma is None else "weak" if sigma > limit else "determined"
        rows.append([direction_words(direction, offsets.receivers), sigma, state])
    return Table(
        "What the drive alone determines",
        ["direction of the offsets", "sigma [m]", "state"],
        rows,
        ["", ".4f", ""],
        "Turning the vehicle determines the horizontal offsets, tilting it the vertical ones.",
    )


def distance_table(outcome: RtkOutcome) -> Table:
    """Distances of the antennas."""
    offsets = outcome.offsets
    good = offsets.residuals[offsets.weights > 0]
    rows: list[Cells] = [
        [name, float(d), float(s), float(rms), float(rms * 2 * d)]
        for name, d, s, rms in zip(
            distance_names(offsets.receivers),
            offsets.distances,
            offsets.distance_sigmas,
            np.sqrt(np.mean(good**2, axis=0)),
            strict=True,
        )
    ]
    return Table(
        "Distances of the antennas",
        ["pair", "distance [m]", "sigma [m]", "RMSE of d [m]", "RMSE of d² [m²]"],
        rows,
        ["", ".4f", ".4f", ".4f", ".4f"],
        f"{offsets.steps} steps, {int((offsets.weights == 0).sum())} of them left out as false. "
        f"Noise of one receiver: {1000 * outcome.noise.sigma:.1f} mm in x and y, "
        f"{1000 * outcome.noise.sigma * outcome.noise.eta:.1f} mm in z.",
    )


def antenna_table(outcome: RtkOutcome) -> Table:
    """Antenna positions on the vehicle."""
    rows: list[Cells] = [
        [name, *(float(v) for v in place)]
        for name, place in zip(outcome.offsets.receivers, outcome.antennas.positions, strict=True)
    ]
    return Table(
        "Antennas on the vehicle",
        ["receiver", "x [m]", "y [m]", "z [m]"],
        rows,
        ["", ".4f", ".4f", ".4f"],
        "x and y from the distances; the heights of the first three are stated.",
    )


def _path_blocks(outcome: RtkOutcome) -> list[Table | Figure | Text]:
    blocks: list[Table | Figure | Text] = [
        uncertainty_table(outcome),
        _figure(
            "rtk_pose",
            "Height and angles of the vehicle with 95 % bands.",
            "Curves over time; the values are in results/poses_rtk.csv.",
            "pose_over_time",
            outcome.path,
            outcome.settings.max_gap,
        ),
        _figure(
            "rtk_reference",
            "95 % ellipses of the pose at the origin (W*), from the receivers' noise alone.",
            "Ellipses of position and angles; the standard deviations are in the table.",
            "reference_ellipses",
            outcome.reference,
        ),
    ]
    if outcome.hold_out is not None:
        blocks.append(interpolation_table(outcome.hold_out))
    return blocks


def _variances(covariances: Array) -> Array:
    """(..., 6) of covariances (..., 6, 6), which are then not held any more."""
    return np.diagonal(covariances, axis1=-2, axis2=-1).copy()


def uncertainty_table(outcome: RtkOutcome) -> Table:
    """Typical standard deviations of a pose, with their parts."""
    path = outcome.path

    def typical(variances: Array) -> list[float]:
        sigmas = np.sqrt(np.median(np.atleast_2d(variances), axis=0))
        return [*(1000 * sigmas[:3]), *np.degrees(sigmas[3:])]

    rows: list[Cells] = [
        ["noise, at the origin (W*)", *typical(_variances(outcome.reference))],
        ["noise, on the path", *typical(_variances(path.noise_covariances))],
        ["errors that last", *typical(_variances(path.lasting_covariances))],
        ["offsets and distances", *typical(_variances(path.systematic_covariances))],
        ["together", *typical(_variances(path.covariances))],
    ]
    for name, sensor in outcome.sensors.items():
        pieces = [_variances(one.covariances) for one in sensor_pieces(outcome, sensor)]
        rows.append([f"sensor {name}", *typical(np.concatenate(pieces))])
    return Table(
        "Standard deviations of a pose (medians)",
        ["part", "x [mm]", "y [mm]", "z [mm]", "yaw [deg]", "pitch [deg]", "roll [deg]"],
        rows,
        ["", *[".1f"] * 3, *[".3f"] * 3],
        "Noise is new at each pose; errors that last are shared by poses near in time. Errors of "
        "offsets and distances are the same along the whole drive: averaging does not reduce them.",
    )


def reference_table(first: Array, simulated: Array, noise: GpsNoise, samples: int) -> Table:
    """Standard deviations of W* by both ways, and how far the variances differ."""
    variances = np.diagonal(first), np.diagonal(simulated)
    rows: list[Cells] = [
        [name, *(1000 * np.sqrt(of[:3])), *np.degrees(np.sqrt(of[3:]))]
        for name, of in zip(("first order", f"{samples:,} samples"), variances, strict=True)
    ]
    off = 100 * np.abs(variances[1] / variances[0] - 1).max()
    return Table(
        "Reference covariance W* of a pose at the origin",
        ["way", "x [mm]", "y [mm]", "z [mm]", "yaw [deg]", "pitch [deg]", "roll [deg]"],
        rows,
        ["", *[".3f"] * 3, *[".4f"] * 3],
        f"Noise of a receiver: {1000 * noise.sigma:.2f} mm in x and y, "
        f"{1000 * noise.eta * noise.sigma:.2f} mm in z. The variances differ by up to {off:.2f} %; "
        f"chance alone makes {100 * np.sqrt(2 / samples):.2f} % (one sigma). All numbers: --json.",
    )


def interpolation_table(found: HoldOut) -> Table:
    """Hold-out errors of the methods of interpolation."""
    rows: list[list[str | float | None]] = []
    for name in NAMES:
        angle = name in {"yaw", "pitch", "roll"}
        scale = float(np.degrees(1.0)) if angle else 1000.0
        errors = [scale * found.rms[name, method] for method in METHODS]
        rows.append([f"{name} [{'deg' if angle else 'mm'}]", *errors, found.chosen[name]])
    return Table(
        "Interpolation: error at poses left out",
        ["component", *METHODS, "best"],
        rows,
        ["", *[".2f"] * len(METHODS), ""],
        f"Root mean square over {found.count} poses, each predicted from its neighbours at twice "
        "the usual spacing; it contains the noise of the pose left out.",
    )


def _consistency_blocks(outcome: RtkOutcome) -> list[Table | Figure | Text]:
    found = outcome.consistency
    low, high = found.mean_square_interval
    table = Table(
        "Consistency of the antenna distances",
        ["what", "found", "expected"],
        [
            [
                "poses beyond the bound [%]",
                f"{100 * found.share_beyond:.2f}",
                f"{100 * (1 - found.confidence):.2f}",
            ],
            [
                "mean of q² / degrees of freedom",
                f"{found.mean_square:.3f}",
                f"{low:.3f} to {high:.3f}",
            ],
            ["poses worth one independent one", f"{found.correlation_time:.1f}", "1.0"],
            *(
                [f"mean error of {name} [mm]", f"{1000 * off:+.2f}", f"0 ± {1000 * sigma:.2f}"]
                for name, off, sigma in zip(
                    distance_names(outcome.offsets.receivers),
                    found.bias,
                    found.bias_sigma,
                    strict=True,
                )
            ),
        ],
        note="q is the Mahalanobis distance of the squared antenna distances from the constant "
        "ones; it tells false fixes and wrong noise, but not an error common to all antennas.",
    )
    picture = _figure(
        "rtk_quality",
        "The measure q of each pose and the bound that good poses keep.",
        f"{len(found.q)} points over time, {100 * found.share_beyond:.1f} % of them beyond.",
        "quality_over_time",
        found,
        outcome.path.times,
    )
    return [table, picture]
