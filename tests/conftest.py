"""Settings that all tests share, and small samples of all kinds of campaigns."""

import math
import shutil
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import settings

# How long an example takes says more of the machine than of the code.
settings.register_profile("gtval", deadline=None)
settings.load_profile("gtval")


def pytest_make_parametrize_id(val):
    """A short name for long text: a test's name is in the environment of all that it starts."""
    if isinstance(val, (str, bytes)) and len(val) > 200:
        return f"{type(val).__name__} of {len(val)}: {val[:40]!r}"
    return None


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Folders of a solved demo, a room with laser scans, a drive with sensors, and of files."""
    from data_samples.sky.constellation import gps_rows
    from data_samples.sky.texts import yuma_text
    from validation.cli import main
    from vision_gt.example_settings import PLAN_EXAMPLE

    root = tmp_path_factory.mktemp("samples")
    for line in (
        "demo ad23",
        "simulate room --stops 6 --world-points 8 --laser",
        "simulate-drive drive --loops 1 --scans --sensors",
        "simulate-motion motion --minutes 2",
        "simulate-motion scanned --minutes 0.5 --laser",
    ):
        command, name, *options = line.split()
        done = CliRunner().invoke(main, [command, str(root / name), *options])
        assert done.exit_code == 0, done.output
    shutil.copytree(root / "room", root / "decided")
    shutil.copytree(root / "room", root / "entered")
    done = CliRunner().invoke(main, ["enter", str(root / "entered")], input="q\n")
    assert done.exit_code == 0, done.output
    shutil.copytree(root / "drive", root / "solved")
    done = CliRunner().invoke(main, ["rtk", "solve", str(root / "solved")])
    assert done.exit_code == 0, done.output
    files = root / "files"
    files.mkdir()
    times = (root / "drive/sensors/imu.csv").read_text().splitlines()[1:200:20]
    (files / "times.csv").write_text("time\n" + "".join(f"{t.split(',')[0]}\n" for t in times))
    rows = [
        f"{1712739600 + k},{45.478 + 5e-8 * (k % 5):.8f},{9.232 + 7e-8 * (k % 7):.8f},"
        f"{160 + 0.01 * (k % 3)},fixed"
        for k in range(60)
    ]
    (files / "study.toml").write_text("seeds = 2\n[room]\nstops = 3\nworld_points = 6\n")
    (files / "standing.csv").write_text("time,latitude,longitude,height,fix\n" + "\n".join(rows))
    turn = [0.1 * k for k in range(60)]
    rows = [f"{t:.1f},{math.sin(t):.4f},{math.cos(t):.4f},{-t:.4f}\n" for t in turn]
    (files / "camera.csv").write_text("time,x,y,theta\n" + "".join(rows))
    moves = [f"{1e9 + k / 10} {k / 50} 0 0.1 0 0 0 1\n" for k in range(20)]
    (files / "motion.tum").write_text("".join(moves))
    (files / "sky.alm").write_text(yuma_text(gps_rows(date(2026, 11, 30))))
    (files / "hall").mkdir()
    (files / "hall" / "campaign.toml").write_text(f'name = "hall"\n\n{PLAN_EXAMPLE}')
    lens = (root / "drive/sensors/left_camera_lens.txt").read_text().strip()
    folders = (
        "ad23",
        "room",
        "decided",
        "entered",
        "drive",
        "motion",
        "scanned",
        "files",
        "solved",
    )
    names = {name: str(root / name) for name in folders}
    return {**names, "lens": lens}


@pytest.fixture(scope="session")
def vision_sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign of two cameras and three stops."""
    import numpy as np

    from data_samples.rendering.files import images_of, make_room_with_cameras, vision_texts
    from data_samples.rooms.cameras import VisionSettings
    from data_samples.rooms.campaign_files import write_campaign
    from data_samples.rooms.rooms import RoomSettings
    from data_samples.rooms.simulate import SimulationSettings, simulate_survey

    folder = tmp_path_factory.mktemp("vision") / "campaign"
    rng = np.random.default_rng(11)
    sizes = RoomSettings(stops=3, runs=1, clearance=2.3, world_points=8)
    few = VisionSettings(cameras=2, calibration=5, snapshots=5, both=2, movie=8)
    room, cameras = make_room_with_cameras(sizes, few, rng)
    texts = vision_texts(cameras, rng)
    simulated = simulate_survey(room, SimulationSettings(), rng)
    write_campaign(folder, simulated, 11, texts, images_of(cameras, rng, 1))
    return folder


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """A cluster of Dask with two workers, each a process."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as made:
        yield made
