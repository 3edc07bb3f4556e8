"""Almanacs, places and logs that the tests of planning share."""

from datetime import UTC, date, datetime

import numpy as np

from data_samples.sky.constellation import galileo_rows, gps_rows
from data_samples.sky.texts import almanac_text
from rtk_gt.planning.almanacs.reading import midnight, read_almanac
from rtk_gt.planning.plan import Place, Wanted, sky_plan
from validation.poses.earth_frames import LocalFrame

DAY = date(2026, 11, 30)
MILAN = Place("Milan", LocalFrame.from_degrees(45.5, 9.2, 150.0))
WANTED = Wanted(np.radians(10.0), 5, 6.0)


def times(step=300.0, day=DAY):
    """A day's times."""
    return midnight(day) + np.arange(0.0, 86400.0 + step / 2, step)


def almanac(folder, form="yuma", rows=None, day=DAY):
    """An almanac of the nominal constellation, written and read."""
    path = folder / f"sky.{form}"
    path.write_text(almanac_text(rows or gps_rows(day, 27), form), encoding="utf-8")
    return read_almanac(path, day)


def both_systems(day=DAY):
    return {**gps_rows(day, 27), **galileo_rows(day)}


def milan_plan(folder, *, at=None, rover=MILAN, base=None, wanted=WANTED, **options):
    at = times() if at is None else at
    return sky_plan(almanac(folder, **options), at, wanted, rover, base)


def gga(time, latitude, longitude, satellites, hdop, kind=4):
    """A GGA sentence with its checksum."""
    stamp = datetime.fromtimestamp(time, tz=UTC)
    body = (
        f"GPGGA,{stamp:%H%M%S}.00,{_angle(latitude, 2)},N,{_angle(longitude, 3)},E,{kind},"
        f"{satellites:02d},{hdop:.1f},150.0,M,0.0,M,1.0,0000"
    )
    return _summed(body)


def zda(time):
    stamp = datetime.fromtimestamp(time, tz=UTC)
    return _summed(f"GPZDA,{stamp:%H%M%S}.00,{stamp:%d,%m,%Y},00,00")


def _angle(degrees, digits):
    whole = int(degrees)
    return f"{whole:0{digits}d}{60 * (degrees - whole):07.4f}"


def _summed(body):
    value = 0
    for one in body.encode():
        value ^= one
    return f"${body}*{value:02X}"


def log_of(plan, seconds=10.0):
    """NMEA of a receiver that uses what a plan says, each of its times held for its minute."""
    lines = [zda(plan.times[0])]
    for time, count, hdop in zip(plan.times, plan.count, plan.dop.horizontal, strict=True):
        if count >= 4 and np.isfinite(hdop):
            lines += [
                gga(time + k, 45.5, 9.2, count, min(hdop, 99.9))
                for k in np.arange(-30.0, 30.0, seconds)
            ]
    return "\n".join(lines) + "\n"
