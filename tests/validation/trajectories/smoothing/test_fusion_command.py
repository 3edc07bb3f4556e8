"""``gtval fuse``: files in, one table out."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner
from fusion_drives import drive

from validation.cli import main
from validation.errors import GtvalError
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.smoothing.clocked import clocked

pytest.importorskip(
    "validation.trajectories.formats.reading", reason="trajectories are read by another room"
)


@pytest.fixture
def files(tmp_path):
    made = drive(31, 0, seconds=60.0, cameras=2)
    clocks = {}
    for source in made.sources:
        own = source.trajectory
        rows = [
            f"{t!r},{x!r},{y!r},{a!r}"
            for t, (x, y, a) in zip(own.times.tolist(), own.poses.tolist(), strict=True)
        ]
        (tmp_path / f"{own.system}.csv").write_text("\n".join(["time,x,y,theta", *rows]) + "\n")
        clocks[own.system] = {
            "delay_s": source.delay_s,
            "low_s": source.delay_s - 0.001,
            "high_s": source.delay_s + 0.001,
            "at_s": source.at_s,
            "drift_ppm": 0.0,
        }
    (tmp_path / "sync.json").write_text(json.dumps({"sources": clocks}))
    return made, tmp_path


def run(*arguments):
    return CliRunner().invoke(main, ["fuse", *map(str, arguments)])


def test_two_cameras_become_one_table(files):
    made, folder = files
    cameras = [folder / "camera_1.csv", folder / "camera_2.csv"]
    options = ["--delays", folder / "sync.json", "--rate", "20"]
    done = run(*cameras, "--output", folder / "fused.csv", *options, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert set(told["sources"]) == {"camera_1", "camera_2"}
    lines = (folder / "fused.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == told["poses"]
    inside = [row for row in rows if row["supported"] == "1"]
    times = np.array([float(row["time"]) for row in inside])
    found = np.array([[float(row["x"]), float(row["y"])] for row in inside])
    assert np.sqrt(((found - made.at(times)[:, :2]) ** 2).sum(1).mean()) < 0.0035
    assert told["supported_share"] == pytest.approx(len(inside) / len(rows))


def test_a_clock_that_jumps_is_followed(files):
    made, folder = files
    own = made.sources[0].trajectory
    at, size = float(np.median(own.times)), 0.4
    late = own.times > at
    rows = [
        f"{t!r},{x!r},{y!r},{a!r}"
        for t, (x, y, a) in zip((own.times + size * late).tolist(), own.poses.tolist(), strict=True)
    ]
    (folder / "camera_1.csv").write_text("\n".join(["time,x,y,theta", *rows]) + "\n")
    clocks = json.loads((folder / "sync.json").read_text())
    clock = clocks["sources"]["camera_1"]
    keys = ("delay_s", "low_s", "high_s")
    later = {**clock, **{key: clock[key] - size for key in keys}}
    clock |= {"jumps": [{"stamp_s": at + size / 2}], "pieces": [dict(clock), later]}
    (folder / "sync.json").write_text(json.dumps(clocks))
    options = ["--delays", folder / "sync.json", "--rate", "20"]
    cameras = [folder / "camera_1.csv", folder / "camera_2.csv"]
    done = run(*cameras, "--output", folder / "fused.csv", *options, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert set(told["sources"]) == {"camera_1, part 1", "camera_1, part 2", "camera_2"}
    lines = (folder / "fused.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    inside = [row for row in rows if row["supported"] == "1"]
    times = np.array([float(row["time"]) for row in inside])
    found = np.array([[float(row["x"]), float(row["y"])] for row in inside])
    # As without a jump.
    assert np.sqrt(((found - made.at(times)[:, :2]) ** 2).sum(1).mean()) < 0.0035
    clock["pieces"].pop()
    (folder / "sync.json").write_text(json.dumps(clocks))
    done = run(*cameras, "--output", folder / "other.csv", *options)
    assert done.exit_code == 2
    assert "sources.camera_1.pieces" in done.output
    assert not (folder / "other.csv").exists()


def test_a_delay_that_is_not_known_is_an_error_with_its_place(files):
    _, folder = files
    clocks = json.loads((folder / "sync.json").read_text())
    clocks["sources"]["camera_1"]["delay_s"] = None
    (folder / "sync.json").write_text(json.dumps(clocks))
    done = run(
        folder / "camera_1.csv", "--output", folder / "f.csv", "--delays", folder / "sync.json"
    )
    assert done.exit_code == 2
    assert "sources.camera_1.delay_s" in done.output
    assert not (folder / "f.csv").exists()
    (folder / "sync.json").write_text("nothing")
    done = run(
        folder / "camera_1.csv", "--output", folder / "f.csv", "--delays", folder / "sync.json"
    )
    assert done.exit_code == 2
    assert "gtval sync" in done.output


def test_a_source_whose_delay_nothing_tells_is_refused(files):
    made, _ = files
    own = made.sources[0].trajectory
    untold = ClockEstimate(own.system, own.epoch, "not_determinable", "nothing moves")
    with pytest.raises(GtvalError, match="nothing moves"):
        clocked(own, untold)
