"""The [rtk] table of campaign.toml."""

from datetime import date as Day  # noqa: N812  (the key is called date)
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from rtk_gt.receivers.assumptions import CONFIDENCE, ETA, SIMULTANEOUS
from validation.campaign.folder import Finite, Name, Positive, Settings

if TYPE_CHECKING:
    from validation.poses.angles import Array

Six = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Three = tuple[Finite, Finite, Finite]
LARGEST_DISTANCE_SIGMA = 0.3
"""With distances less sure than this, in metres, antennas cannot be placed on the vehicle: a
judgement, a sixth of what they are apart on cars, which makes ten degrees of attitude."""


class Receiver(Settings):
    """One receiver and its record.

    ``name`` is what results call it, ``file`` its record, ``format`` the kind of that file where
    its content does not tell. ``label`` is the name inside a rawlog, where it differs, or the topic
    of a bag; ``date`` (UTC, YYYY-MM-DD) is that of the first sentence of a log without dates.
    ``all_fixed`` says that fixes whose kind a file cannot tell (GPX) are RTK-fixed.

    ``coordinates`` are what a table has: degrees, UTM with its ``zone``, or metres in the local
    frame of ``[rtk.origin]``. ``base`` is the receiver on the vehicle from which a rover of a
    moving base tells its place.

    ``height`` is the z of its antenna in the vehicle frame, metres, and needed of the first three
    receivers; ``position`` (x, y, z), to a decimetre or so, is needed from the fourth on; where the
    first three have one, too, the layout is theirs, not rear, front left and front right.
    """

    name: Name
    file: str
    height: Finite | None = None
    label: str = ""
    format: Literal["auto", "nmea", "rtklib", "rawlog", "csv", "ubx", "gpx", "novatel", "bag"] = (
        "auto"
    )
    date: Day | None = None
    all_fixed: bool = False
    coordinates: Literal["degrees", "utm", "local"] = "degrees"
    zone: str = ""
    base: str = ""
    position: Three | None = None


class Origin(Settings):
    """Origin of the local frame.

    ``latitude`` and ``longitude`` in degrees, ``height`` above the ellipsoid in metres.
    """

    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=360)]
    height: Annotated[float, Field(ge=-1000, le=20000)]


class Sensor(Settings):
    """A sensor on the vehicle.

    ``name`` is what results and commands call it, ``pose`` its x, y, z in metres and yaw, pitch,
    roll in radians in the vehicle frame. ``sigmas`` are the standard deviations of these six; where
    they are not stated 2 mm and 0.1 degrees are assumed, those of the files published with the
    Malaga data, and a finding says so.
    """

    name: Name
    pose: Six
    sigmas: tuple[Positive, Positive, Positive, Positive, Positive, Positive] = (
        *(0.002, 0.002, 0.002),
        *(0.001745, 0.001745, 0.001745),
    )


class Area(Settings):
    """A part of the site, as [[rtk.areas]], whose quality one or two receivers tell by itself.

    ``name`` is what results call it; ``corners`` are x, y of its outline in the local frame, in
    metres, in order.
    """

    name: Name
    corners: Annotated[list[tuple[Finite, Finite]], Field(min_length=3)]


class Aerial(Settings):
    """An aerial image or a map of the site, as [rtk.aerial], that is drawn under the paths.

    ``file`` is a PNG or JPEG whose sides run north and east; ``north_west`` and ``south_east`` are
    latitude and longitude of its corners, degrees.
    """

    file: str
    north_west: tuple[Finite, Finite]
    south_east: tuple[Finite, Finite]

    @model_validator(mode="after")
    def _corners(self) -> "Aerial":
        (north, west), (south, east) = self.north_west, self.south_east
        if not (90 >= north > south >= -90 and -180 <= west < east <= 360):
            raise ValueError(
                "north_west and south_east are latitude and longitude of the upper left and the "
                "lower right corner: the first must be farther north and farther west"
            )
        return self


class SkyPlace(Settings):
    """A place whose sky is planned, as [[rtk.plan.places]].

    ``name`` is what results call it; ``latitude`` and ``longitude`` in degrees, ``height`` of the
    antenna above the ellipsoid in metres. ``base`` says that the base station stands there.
    ``horizon`` is what hides the sky, as pairs of azimuth and elevation in degrees;
    ``horizon_file`` a file with such columns.
    """

    name: Name
    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=360)]
    height: Annotated[float, Field(ge=-1000, le=20000)]
    base: bool = False
    horizon: list[
        tuple[Annotated[float, Field(ge=0, le=360)], Annotated[float, Field(ge=-10, le=90)]]
    ] = Field(default_factory=list)
    horizon_file: str = ""

    @model_validator(mode="after")
    def _one_horizon(self) -> "SkyPlace":
        if self.horizon and self.horizon_file:
            raise ValueError("horizon and horizon_file are both stated; take one out")
        return self


class SkyBuilding(Settings):
    """A building that hides a part of the sky, as [[rtk.plan.buildings]].

    ``corners`` are x, y of its outline in the local frame, in metres, in order; ``height`` is that
    of its roof above the origin of that frame.
    """

    name: Name
    height: Finite
    corners: Annotated[list[tuple[Finite, Finite]], Field(min_length=3)]


class SkySettings(Settings):
    """The table [rtk.plan]: satellites over places, before the drive.

    ``almanac`` is a file; ``mask`` the elevation in degrees below which no satellite counts.
    ``satellites`` and ``pdop`` are the least number and the greatest PDOP of a good time: five as
    AD2.3 needs for RTK, and 6, which is common in surveying. ``systems`` are the letters of those
    that the receiver takes, all of the file if none is stated. ``places`` and ``buildings`` are
    lists.
    """

    almanac: str = ""
    mask: Annotated[float, Field(ge=0, lt=90)] = 10.0
    satellites: Annotated[int, Field(ge=4, le=60)] = 5
    pdop: Positive = 6.0
    systems: list[Literal["G", "E", "R", "C", "J", "X"]] = Field(default_factory=list)
    places: list[SkyPlace] = Field(default_factory=list)
    buildings: list[SkyBuilding] = Field(default_factory=list)

    @model_validator(mode="after")
    def _places(self) -> "SkySettings":
        if len({place.name for place in self.places}) < len(self.places):
            raise ValueError("two places have the same name")
        if sum(place.base for place in self.places) > 1:
            raise ValueError("two places are the base; expected one")
        return self


class KnownOffsets(Settings):
    """Offsets known beforehand, as [rtk.known_offsets].

    ``values`` are x, y, z in metres by the names of the receivers, ``sigma`` the standard deviation
    of each number. ``up`` says to which frame they belong; it must be that of [rtk].
    """

    values: dict[Name, Three]
    sigma: Positive
    up: Literal["ellipsoid", "geocentric"]


def reversed_pair(pair: str) -> str:
    """'b - a' of 'a - b'."""
    return " - ".join(reversed(pair.split(" - ")))


class KnownDistances(Settings):
    """Tape-measured distances, as [rtk.known_distances].

    ``values`` are metres by the pairs: 'rear - left'. ``sigma`` is the standard deviation of each;
    where it is not stated 1 cm is assumed, and a finding says so.
    """

    values: dict[str, Positive]
    sigma: Positive = 0.01

    def of_pair(self, pair: str, default: float) -> float:
        """The distance of 'a - b', which may have been stated as 'b - a'."""
        return self.values.get(pair, self.values.get(reversed_pair(pair), default))


class RtkSettings(Settings):
    """The table [rtk].

    ``receivers`` are in the order rear, front left, front right, then others; ``sensors`` are what
    else is on the vehicle; ``areas`` are named parts of the site, ``aerial`` is an image of it;
    ``odometry`` a trajectory that is laid over the positions of one or two receivers; ``plan`` is
    what `gtval rtk plan` needs. ``origin`` and ``up`` make the local frame: without an origin it is
    at the first fix, and up is the normal of the ellipsoid or the line from the Earth's centre.

    ``sigma`` (metres, horizontal, of one receiver) replaces the noise found from the residuals,
    ``eta`` is the ratio of vertical to horizontal noise; where it is not stated 1.75 is assumed,
    and a finding says so. ``robust`` takes out steps with false fixes. ``simultaneous``: stamps
    within so many seconds are one time. Pauses longer than ``max_gap`` seconds are gaps.
    ``skip_damaged`` says whether damaged sentences of NMEA logs are left out; by default they are
    where they are few. ``confidence`` is that of the
    consistency bound.

    ``common_sigma`` (metres, horizontal) and ``common_time`` (seconds) are of an error that all
    receivers share, of base station and atmosphere, which no drive shows; without them it is what
    the receivers state beyond what their distances show.

    ``known_offsets`` and ``known_distances`` are what is known beforehand. Offsets less sure than
    ``largest_offset_sigma`` metres count as open; where distances of antennas are less sure than
    ``largest_distance_sigma`` metres there is no path.
    """

    receivers: list[Receiver] = Field(default_factory=list)
    origin: Origin | None = None
    up: Literal["ellipsoid", "geocentric"] = "ellipsoid"
    eta: Positive = ETA
    sigma: Positive | None = None
    common_sigma: Positive | None = None
    common_time: Positive | None = None
    robust: bool = True
    simultaneous: Positive = SIMULTANEOUS
    max_gap: Positive = 2.0
    skip_damaged: bool | None = None
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = CONFIDENCE
    known_offsets: KnownOffsets | None = None
    known_distances: KnownDistances | None = None
    sensors: list[Sensor] = Field(default_factory=list)
    areas: list[Area] = Field(default_factory=list)
    aerial: Aerial | None = None
    odometry: str = ""
    plan: SkySettings = Field(default_factory=SkySettings)
    largest_offset_sigma: Positive = 0.01
    largest_distance_sigma: Positive = LARGEST_DISTANCE_SIGMA

    @property
    def outlines(self) -> "dict[str, Array]":
        """Corners (k, 2) of the named areas."""
        import numpy as np  # noqa: PLC0415  (settings are read where nothing is computed)

        return {area.name: np.array(area.corners) for area in self.areas}

    @model_validator(mode="after")
    def _bases(self) -> "RtkSettings":
        with_base = {one.name: one.base for one in self.receivers}
        for name, base in with_base.items():
            if base and with_base.get(base) != "":
                raise ValueError(f"base '{base}' of {name} is no receiver with a place of its own")
        for receiver in self.receivers:
            if (receiver.coordinates == "utm") != bool(receiver.zone):
                raise ValueError(
                    f'receiver {receiver.name}: coordinates = "utm" and zone (such as "32N") '
                    "belong together; state both or none"
                )
        return self

    @model_validator(mode="after")
    def _names(self) -> "RtkSettings":
        names = [receiver.name for receiver in self.receivers]
        if len(set(names)) < len(names):
            raise ValueError("two receivers have the same name")
        known = set(self.known_offsets.values) if self.known_offsets else set()
        if known - set(names):
            raise ValueError(
                f"known_offsets of no receiver: {', '.join(sorted(known - set(names)))}; expected "
                f"{', '.join(names)}"
            )
        if self.known_distances:
            pairs = [f"{a} - {b}" for a, b in combinations(names, 2)]
            for stated in self.known_distances.values:
                if stated not in pairs and reversed_pair(stated) not in pairs:
                    raise ValueError(
                        f"known_distances '{stated}' is no pair of receivers; expected one of "
                        f"{', '.join(pairs)}"
                    )
                if stated in pairs and reversed_pair(stated) in self.known_distances.values:
                    raise ValueError(f"known_distances '{stated}' is stated in both directions")
        if len({sensor.name for sensor in self.sensors}) < len(self.sensors):
            raise ValueError("two sensors have the same name")
        if len({area.name for area in self.areas}) < len(self.areas):
            raise ValueError("two areas have the same name")
        return self
