"""One receiver's positions in the form that all systems share: table, files, facts, report."""

import numpy as np

from rtk_gt.campaign.lasting_findings import JUMP_COLUMNS, jump_rows
from rtk_gt.positions.findings import positions_findings
from rtk_gt.positions.outcome import PositionsOutcome
from rtk_gt.positions.sections import positions_overview, positions_sections
from rtk_gt.positions.trajectories import fixed_trajectory
from rtk_gt.receivers.fixes import FIX_NAMES
from validation.poses.pose_table import SPATIAL, PoseTable
from validation.results import SystemResult
from validation.text_files.csv_text import csv_text
from validation.text_files.writing import Content

POSITION = SPATIAL[:3]


def positions_result(outcome: PositionsOutcome) -> SystemResult:
    """What a run keeps and shows of one receiver's record."""
    fixed = bool(outcome.fixed.any())
    table = fixed_table(outcome) if outcome.headings is None else heading_table(outcome)
    return SystemResult(
        tables=[table] if fixed else [],
        findings=positions_findings(outcome),
        sections=positions_sections(outcome),
        files=_files(outcome),
        facts=_facts(outcome),
        overview=positions_overview(outcome),
        without_poses=not fixed,
        trajectories=[fixed_trajectory(outcome)] if outcome.fixed.sum() > 1 else [],
    )


def fixed_table(outcome: PositionsOutcome) -> PoseTable:
    """The RTK-fixed positions; the stops are named by their times."""
    rows, times = outcome.fixed, outcome.record.times
    return PoseTable(
        system="rtk",
        ids=tuple(f"{time:.3f}" for time in times[rows]),
        poses=outcome.positions[rows],
        covariances=outcome.covariances[rows],
        components=POSITION,
        sources=tuple(
            f"RTK fixed{', ' if said else ''}{said}"
            for said, good in zip(outcome.remarks, rows, strict=True)
            if good
        ),
        provenance={
            "frame": str(outcome.frame), "published_as": "times are seconds UTC since 1970",
        },
    )  # fmt: skip


def heading_table(outcome: PositionsOutcome) -> PoseTable:
    """Positions of the first antenna and headings, where both receivers are RTK-fixed."""
    found = outcome.headings
    assert found is not None
    return PoseTable(
        system="rtk",
        ids=tuple(f"{time:.3f}" for time in found.times),
        poses=found.poses,
        covariances=found.covariances,
        components=SPATIAL[:4],
        sources=("RTK fixed",) * len(found.times),
        factor=found.shared_factor,
        provenance={
            "frame": str(outcome.frame), "published_as": "times are seconds UTC since 1970",
        },
    )  # fmt: skip


def _files(outcome: PositionsOutcome) -> dict[str, Content]:
    gaps = sorted(outcome.coverage.gaps, key=lambda gap: gap.start)
    rows = ([gap.start, gap.duration, gap.length] for gap in gaps)
    files: dict[str, Content] = {
        "rtk_positions.csv": _all_positions(outcome),
        "rtk_gaps.csv": csv_text(["start", "duration", "length"], rows),
    }
    if outcome.lasting:
        files["rtk_jumps.csv"] = csv_text(JUMP_COLUMNS, jump_rows(outcome))
    return files


def _all_positions(outcome: PositionsOutcome) -> str:
    """Each fix with its kind, covariance, satellites and place on the Earth."""
    record = outcome.record
    header = ["time", "x", "y", "z", "xx", "xy", "xz", "yy", "yz", "zz", "fix"]
    header += ["satellites", "hdop", "latitude", "longitude", "height", "remark"]
    upper = outcome.covariances[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    degrees, remarks = np.degrees(record.geodetic[:, :2]), outcome.remarks
    rows = (
        [
            float(record.times[k]),
            *outcome.positions[k].tolist(),
            *("" if np.isnan(value) else float(value) for value in upper[k]),
            FIX_NAMES[int(record.kinds[k])],
            "" if record.satellites[k] < 0 else int(record.satellites[k]),
            "" if np.isnan(record.hdop[k]) else float(record.hdop[k]),
            *degrees[k].tolist(),
            float(record.geodetic[k, 2]),
            remarks[k],
        ]
        for k in range(len(record))
    )
    return csv_text(header, rows)


def _facts(outcome: PositionsOutcome) -> dict[str, object]:
    """What `--json` and run.json hold of one receiver's record."""
    found = outcome.coverage
    return {
        "frame": str(outcome.frame),
        "receiver": outcome.record.receiver,
        "epochs": outcome.record.epochs,
        "fixed": int(outcome.record.fixed.sum()),
        "left_out": int((outcome.record.fixed & outcome.left_out).sum()),
        "share_of_epochs": outcome.fixed_share,
        "share_of_time": found.share_of_time,
        "share_of_length": found.share_of_length,
        "longest_gap": found.gaps[0].duration if found.gaps else 0.0,
        "kinds": outcome.kinds,
        "areas": outcome.areas,
        "host_clock": outcome.clock,
        "jumps": [
            {
                "receivers": [outcome.steps.receivers[k] for k in one.receivers],
                "start": one.start,
                "end": None if one.stays else one.end,
                "size": one.size,
                "covariance": one.covariance,
            }
            for one in outcome.lasting
        ],
        "tolerated": dict(outcome.record.tolerated),
        "headings": _heading_facts(outcome),
        "odometry": _overlay_facts(outcome),
    }


def _heading_facts(outcome: PositionsOutcome) -> dict[str, object] | None:
    found = outcome.headings
    if found is None:
        return None
    return {
        "poses": len(found.times),
        "offset": found.offsets.offsets.values[1],
        "offset_sigmas": found.offsets.offset_sigmas[1],
        "distance": float(found.offsets.distances[0]),
        "yaw_sigma": float(np.sqrt(np.median(found.covariances[:, 3, 3]))),
        "off_motion": found.off_motion,
    }


def _overlay_facts(outcome: PositionsOutcome) -> dict[str, object] | None:
    found = outcome.overlay
    if found is None:
        return None
    return {
        "delay": found.clock.delay_s,
        "delay_low": found.clock.low_s,
        "delay_high": found.clock.high_s,
        "rms": found.rms,
        "matched": found.matched,
        "lengths": found.lengths,
    }
