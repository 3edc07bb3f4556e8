"""The [vision] table of campaign.toml."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from validation.campaign.folder import Finite, Name, NotNegative, Positive, Settings

Vector = tuple[Finite, Finite, Finite]
Matrix = tuple[Vector, Vector, Vector]
SixSigmas = tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative, NotNegative]
_PRINTED_IDS = (3, 6, 14, 30, 89, 200)
Count = Annotated[int, Field(ge=3, le=60)]


class BoardSettings(Settings):
    """A chessboard, or with ``family`` (of 4 x 4 codes, such as '4X4_100') a ChArUco board.

    ``columns`` and ``rows`` count squares, ``square`` is the side of one in metres; the markers
    of a ChArUco board have the ids from ``first_id`` on.
    """

    columns: Count = 10
    rows: Count = 6
    square: Positive = 0.1
    family: str = ""
    first_id: Annotated[int, Field(ge=0)] = 0


class Placement(Settings):
    """A transform: ``translation`` in metres and ``rotation`` as the rows of its matrix."""

    translation: Vector
    rotation: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @model_validator(mode="after")
    def _is_rotation(self) -> "Placement":
        rows = self.rotation
        for i, row in enumerate(rows):
            for j, other in enumerate(rows):
                product = sum(x * y for x, y in zip(row, other, strict=True))
                if abs(product - (i == j)) > 1e-3:
                    raise ValueError("the rotation's rows must be orthogonal and of length 1")
        (a, b, c), (d, e, f), (g, h, k) = rows
        if a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) < 0:
            raise ValueError("the rotation is mirrored (its determinant is -1)")
        return self


class BarSettings(Settings):
    """The double pattern: two boards on a rigid bar.

    ``second_on_first`` is where the second board's frame is in the first one's, as built;
    ``sigmas`` say how well that is known, three in metres and three in radians (zeros: exact).
    The camera named first in ``pairs`` sees the first board, for boards that look alike.
    """

    first: BoardSettings = BoardSettings(family="4X4_100")
    second: BoardSettings = BoardSettings(family="4X4_100", first_id=30)
    second_on_first: Placement = Placement(translation=(1.5, 0.0, 0.0))
    sigmas: SixSigmas = (0.003, 0.003, 0.003, 0.004, 0.004, 0.004)
    pairs: list[tuple[Name, Name]] = Field(default_factory=list)


class ReferenceSettings(Settings):
    """The pattern that lies on the floor in a known place of the Vframe.

    ``position`` is its first inner corner, ``heading`` the direction of its rows (radians),
    ``height`` the thickness of the board. ``sigmas`` say how well it was laid: x, y, z in
    metres, and rotations about x, y, z in radians. ``origin_near`` is a pixel near its first
    corner, needed for a board that looks the same after half a turn.
    """

    board: BoardSettings = BoardSettings()
    position: tuple[Finite, Finite] = (0.2, 0.0)
    heading: Finite = 0.0
    height: Finite = 0.0
    sigmas: tuple[Positive, Positive, Positive, Positive, Positive, Positive] = (
        0.001,
        0.001,
        0.001,
        0.001,
        0.001,
        0.001,
    )
    origin_near: tuple[Finite, Finite] | None = None


class MarkerSettings(Settings):
    """The markers on the robot.

    ``sides`` maps ids to lengths in metres. ``dima`` is the marker whose place on the robot was
    measured: ``dima_on_robot`` with ``dima_sigmas``. ``hand_measured`` are places of the others
    as measured by hand, for comparison only.
    """

    family: str = "ARTOOLKITPLUS_SIMPLE"
    border: Annotated[int, Field(ge=1, le=4)] = 1
    sides: dict[str, Positive] = Field(
        default_factory=lambda: {str(n): 0.160 if n == 14 else 0.156 for n in _PRINTED_IDS}
    )
    dima: int = 14
    dima_on_robot: Placement = Placement(
        translation=(-0.143, 0.098, 0.018),
        rotation=((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    )
    dima_sigmas: SixSigmas = (0.0005, 0.0005, 0.0005, 0.001, 0.001, 0.001)
    hand_measured: dict[str, Placement] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ids(self) -> "MarkerSettings":
        if bad := [n for n in [*self.sides, *self.hand_measured] if not n.isdigit()]:
            raise ValueError(f"marker ids are whole numbers, not {bad[0]!r}")
        if str(self.dima) not in self.sides:
            raise ValueError(f"the dima-marker {self.dima} has no side in 'sides'")
        if unknown := set(self.hand_measured) - set(self.sides):
            raise ValueError(f"hand-measured marker {min(unknown)} has no side in 'sides'")
        return self

    @property
    def side_of(self) -> dict[int, float]:
        """Sides by number."""
        return {int(number): side for number, side in self.sides.items()}


class FloorSettings(Settings):
    """The floor that the robot stands on: standard deviations of height (m) and tilt (rad)."""

    height: Positive = 0.003
    tilt: Positive = 0.005


class TableSettings(Settings):
    """A board on a table over validated poses, to check the cameras.

    ``height`` is the table's, metres. ``corner`` is where the board's first inner corner is in
    the robot frame of the pose (x, y in metres) and ``heading`` the direction of its rows there
    (radians), as aligned by the plumb-lines.
    """

    board: BoardSettings = BoardSettings()
    height: Finite = 0.720
    corner: tuple[Finite, Finite] = (0.0, 0.0)
    heading: Finite = 0.0


class VisionSettings(Settings):
    """Folders and choices of the vision system; paths are relative to the campaign folder.

    ``images`` holds the folders calibration/CAMERA, network, bar, reference, layout/CAMERA,
    poses/CAMERA and steadiness. ``cameras`` are those of the network; by default all that have
    a folder of poses. Intrinsic parameters come from ``camera_files`` (by camera) or from the
    calibration images.
    """

    images: str = "vision"
    cameras: list[Name] = Field(default_factory=list)
    camera_files: dict[Name, str] = Field(default_factory=dict)
    board: BoardSettings = BoardSettings()
    bar: BarSettings = BarSettings()
    reference: ReferenceSettings = ReferenceSettings()
    markers: MarkerSettings = MarkerSettings()
    floor: FloorSettings = FloorSettings()
    table: TableSettings = TableSettings()
    on_floor: bool = False
    merge_cameras: bool = False
    averaged_network: bool = False
    detector: Literal["fitted", "classic", "sector"] = "fitted"
    as_published: bool = False
