"""The pictures of the plan in outdoor.md, made by gtval: run `make images` after a change."""

import tempfile
from datetime import date
from pathlib import Path

import numpy as np

from data_samples.sky.constellation import gps_rows, midnight
from data_samples.sky.texts import yuma_text
from rtk_gt.planning.almanacs.reading import read_almanac
from rtk_gt.planning.figures import over_time_figure, sky_figure
from rtk_gt.planning.horizon import Horizon, typed_horizon
from rtk_gt.planning.plan import Place, Wanted, sky_plan
from validation.figures.writing import write_figure
from validation.poses.earth_frames import LocalFrame

IMAGES = Path(__file__).parent / "images"
DAY = date(2026, 11, 30)


def main() -> None:
    """Write docs/images/outdoor_*.png."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sky.alm"
        path.write_text(yuma_text(gps_rows(DAY, 27)), encoding="utf-8")
        almanac = read_almanac(path, DAY)
    times = midnight(DAY) + np.arange(0.0, 86401.0, 300.0)
    frame = LocalFrame.from_degrees(45.5, 9.2, 150.0)
    wanted = Wanted(np.radians(10.0).item(), 5, 6.0)
    open_sky = sky_plan(almanac, times, wanted, Place("Milan", frame))
    write_figure(IMAGES / "outdoor_sky.png", sky_figure(open_sky))
    wall = Horizon(typed_horizon([(60, 0), (60, 50), (120, 50), (120, 0)]))
    base, rover = Place("base", frame), Place("passage", frame, wall)
    write_figure(
        IMAGES / "outdoor_plan.png",
        over_time_figure(sky_plan(almanac, times, wanted, rover, base)),
    )


if __name__ == "__main__":
    main()
