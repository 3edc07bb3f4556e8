"""The [rtk] table of campaign.toml."""

from itertools import combinations
from typing import Annotated, Literal

from pydantic import Field, model_validator

from validation.campaign.folder import Finite, Name, NotNegative, Positive, Settings

Six = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Three = tuple[Finite, Finite, Finite]


class Receiver(Settings):
    """One receiver and its record.

    ``height`` is the z of its antenna in the vehicle frame. ``label`` is the name inside a
    rawlog, where it differs. ``position`` (x, y, z) is needed from the fourth receiver on.
    """

    name: Name
    file: str
    height: Finite = 0.0
    label: str = ""
    format: Literal["auto", "nmea", "rtklib", "rawlog", "csv"] = "auto"
    date: str = ""
    position: Three | None = None


class Origin(Settings):
    """Origin of the local frame, in degrees and metres above the ellipsoid."""

    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=360)]
    height: Annotated[float, Field(ge=-1000, le=20000)]


class Sensor(Settings):
    """A sensor on the vehicle: x, y, z in metres, yaw, pitch, roll in radians.

    The default sigmas are 2 mm and 0.1 degrees, those of the files published with the Malaga
    data.
    """

    name: Name
    pose: Six
    sigmas: tuple[Positive, Positive, Positive, Positive, Positive, Positive] = (
        *(0.002, 0.002, 0.002),
        *(0.001745, 0.001745, 0.001745),
    )


class KnownOffsets(Settings):
    """Offsets known beforehand, as [rtk.known_offsets]: a name of a receiver to x, y, z in metres.

    ``up`` says to which frame they belong; it must be that of [rtk].
    """

    values: dict[Name, Three]
    sigma: Positive
    up: Literal["ellipsoid", "geocentric"]


def reversed_pair(pair: str) -> str:
    """'b - a' of 'a - b'."""
    return " - ".join(reversed(pair.split(" - ")))


class KnownDistances(Settings):
    """Tape-measured distances: 'rear - left' to metres, with one standard deviation."""

    values: dict[str, Positive]
    sigma: Positive = 0.01

    def of_pair(self, pair: str, default: float) -> float:
        """The distance of 'a - b', which may have been stated as 'b - a'."""
        return self.values.get(pair, self.values.get(reversed_pair(pair), default))


class RtkSettings(Settings):
    """Receivers in the order rear, front left, front right, then others; paths in the campaign.

    ``sigma`` replaces the noise found from the residuals, ``eta`` is the ratio of vertical to
    horizontal noise. Pauses longer than ``max_gap`` seconds are gaps. ``confidence`` is that of
    the consistency bound.
    """

    receivers: list[Receiver] = Field(default_factory=list)
    origin: Origin | None = None
    up: Literal["ellipsoid", "geocentric"] = "ellipsoid"
    eta: Positive = 1.75
    sigma: Positive | None = None
    robust: bool = True
    simultaneous: Positive = 0.005
    max_gap: Positive = 2.0
    skip_damaged: bool = False
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.99
    known_offsets: KnownOffsets | None = None
    known_distances: KnownDistances | None = None
    sensors: list[Sensor] = Field(default_factory=list)
    largest_offset_sigma: Positive = 0.01
    largest_distance_sigma: NotNegative = 0.01

    @model_validator(mode="after")
    def _names(self) -> "RtkSettings":
        names = [receiver.name for receiver in self.receivers]
        if len(set(names)) < len(names):
            raise ValueError("two receivers have the same name")
        if 0 < len(names) < 3:
            raise ValueError("at least three receivers are needed for a pose in space")
        if any(receiver.position is None for receiver in self.receivers[3:]):
            raise ValueError("from the fourth receiver on a rough position is needed")
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
        if len({sensor.name for sensor in self.sensors}) < len(self.sensors):
            raise ValueError("two sensors have the same name")
        return self
