"""The [vision] table of campaign.toml."""

from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, Field, field_validator, model_validator

from validation.campaign.folder import Finite, Name, NotNegative, Positive, Settings
from validation.errors import GtvalError
from vision_gt.patterns.boards import LEAST_PLAIN, few_squares

T = TypeVar("T")
Vector = tuple[Finite, Finite, Finite]
Matrix = tuple[Vector, Vector, Vector]
SixSigmas = tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative, NotNegative]
FourSigmas = tuple[Positive, Positive, Positive, Positive]
SixPositive = tuple[Positive, Positive, Positive, Positive, Positive, Positive]
Count = Annotated[int, Field(ge=3, le=60)]
Pixels = Annotated[int, Field(ge=16, le=100_000)]
FieldOfView = Annotated[float, Field(gt=1, lt=170)]

MOST_SIDE, MOST_OFF = 3.0, 10.0
"""Metres: the side of a square or a marker, and the length from one board of a bar to the other or
from the robot to its marker. A judgement: no print and no robot is so large, and what is typed in
millimetres is larger from 3 mm and 10 mm on."""


def in_metres(side: float) -> float:
    """The side of a print; a ValueError where it cannot be in metres."""
    if side > MOST_SIDE:
        raise ValueError(f"{side:g} m is no side of a print; sides are in metres: {_typed(side)}")
    return side


def check_side(side: float) -> None:
    """Refuse the side of a print that an option states, where it cannot be in metres."""
    try:
        in_metres(side)
    except ValueError as error:
        raise GtvalError(str(error)) from None


def _typed(length: float) -> str:
    return f"typed in millimetres? Then it is {length / 1000:g}"


Side = Annotated[Positive, AfterValidator(in_metres)]


class BoardSettings(Settings):
    """A chessboard, or with ``family`` (such as '4X4_100') a ChArUco board.

    ``columns`` and ``rows`` count squares, ``square`` is the side of one in metres; the markers
    of a ChArUco board have the ids from ``first_id`` on and the side ``marker`` (three quarters
    of a square's where it is not stated). ``inverted`` is white on black, ``legacy`` the layout
    of OpenCV before 4.6.
    """

    columns: Count
    rows: Count
    square: Side
    family: str = ""
    first_id: Annotated[int, Field(ge=0)] = 0
    marker: Side | None = None
    inverted: bool = False
    legacy: bool = False

    @model_validator(mode="after")
    def _can_be_found(self) -> "BoardSettings":
        if not self.family and min(self.columns, self.rows) < LEAST_PLAIN:
            raise ValueError(few_squares(self.columns, self.rows))
        return self


class Placement(Settings):
    """A transform: ``translation`` in metres and ``rotation`` as the rows of its matrix."""

    translation: Vector
    rotation: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @field_validator("translation")
    @classmethod
    def _is_near(cls, translation: Vector) -> Vector:
        if (length := sum(x * x for x in translation) ** 0.5) > MOST_OFF:
            raise ValueError(f"{length:g} m is too far for a bar or a robot: {_typed(length)} m")
        return translation

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

    ``first`` and ``second`` are the boards. ``second_on_first`` is where the second board's frame
    is in the first one's, as built; ``sigmas`` say how well that is known, three in metres and
    three in radians (zeros: exact). For boards that look alike, ``pairs`` lists pairs of cameras:
    the camera named first sees the first board.
    """

    first: BoardSettings | None = None
    second: BoardSettings | None = None
    second_on_first: Placement | None = None
    sigmas: SixSigmas = (0.003, 0.003, 0.003, 0.004, 0.004, 0.004)
    pairs: list[tuple[Name, Name]] = Field(default_factory=list)


class ReferenceSettings(Settings):
    """The pattern that lies on the floor in a known place of the Vframe.

    ``board`` is the pattern. ``position`` is its first inner corner (x, y in metres), ``heading``
    the direction of its rows (radians), ``height`` the thickness of the board (metres).
    ``sigmas`` say how well it was laid: x, y, z in metres, and rotations about x, y, z in
    radians. ``origin_near`` is a pixel near its first corner, needed for a board that looks the
    same after half a turn.
    """

    board: BoardSettings | None = None
    position: tuple[Finite, Finite] | None = None
    heading: Finite = 0.0
    height: Finite = 0.0
    sigmas: SixPositive = (0.001, 0.001, 0.001, 0.001, 0.001, 0.001)
    origin_near: tuple[Finite, Finite] | None = None


class MarkerSettings(Settings):
    """The markers on the robot.

    ``family`` is their kind: 'ARTOOLKITPLUS_SIMPLE', or one of OpenCV's such as '6X6_250' or
    'APRILTAG_36H11'; ``border`` counts the black cells around the code. ``sides`` maps ids to
    lengths in metres. ``dima`` is the marker whose place on the robot was measured:
    ``dima_on_robot``, and with ``dima_sigmas`` how well (three in metres, three in radians).
    ``hand_measured`` are places of the others as measured by hand, for comparison only.
    """

    family: str = ""
    border: Annotated[int, Field(ge=1, le=4)] = 1
    sides: dict[str, Side] = Field(default_factory=dict)
    dima: int | None = None
    dima_on_robot: Placement | None = None
    dima_sigmas: SixSigmas = (0.0005, 0.0005, 0.0005, 0.001, 0.001, 0.001)
    hand_measured: dict[str, Placement] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ids(self) -> "MarkerSettings":
        if bad := [n for n in [*self.sides, *self.hand_measured] if not n.isdigit()]:
            raise ValueError(f"marker ids are whole numbers, not {bad[0]!r}")
        if self.dima is not None and self.sides and str(self.dima) not in self.sides:
            raise ValueError(f"the dima-marker {self.dima} has no side in 'sides'")
        if unknown := set(self.hand_measured) - set(self.sides):
            raise ValueError(f"hand-measured marker {min(unknown)} has no side in 'sides'")
        return self


class FloorSettings(Settings):
    """The floor that the robot stands on: standard deviations of height (m) and tilt (rad)."""

    height: Positive = 0.003
    tilt: Positive = 0.005


class TableSettings(Settings):
    """A board, a marker or both on a table over validated poses, to check the cameras.

    ``board`` is what lies on it, ``height`` the table's height, metres. ``corner`` is where the
    board's first inner corner is in the robot frame of the pose (x, y in metres) and ``heading``
    the direction of its rows there (radians), as aligned by the plumb-lines. ``marker`` is the id
    of a marker that lies there, of ``marker_side``, its middle at ``marker_middle`` and its x axis
    along ``marker_heading`` in the robot frame. ``sigmas`` say how well all was laid: x, y, height
    (metres) and heading (radians).
    """

    board: BoardSettings | None = None
    height: Finite | None = None
    corner: tuple[Finite, Finite] | None = None
    heading: Finite = 0.0
    marker: Annotated[int, Field(ge=0)] | None = None
    marker_side: Side | None = None
    marker_middle: tuple[Finite, Finite] | None = None
    marker_heading: Finite = 0.0
    sigmas: FourSigmas = (0.003, 0.003, 0.002, 0.01)


class DriveSettings(Settings):
    """A robot that drives, filmed by the cameras: images drive/CAMERA/TIME.png, or videos.

    ``odometry`` is a file of poses in time in any format of trajectories, relative to the campaign
    folder; its clock is that of the result. Without it that of a camera is. ``window`` is how late
    a camera may be, seconds. ``one_clock``: cameras whose delay is not told have the others' clock.
    ``unit`` is that of the times, where they do not tell it, and ``stamps`` what they are: when
    light fell on the sensor ('capture'), or when an image arrived ('receipt'). ``on_floor`` takes
    the robot as standing on the floor.
    """

    odometry: str = ""
    window: Positive = 5.0
    one_clock: bool = False
    unit: Literal["s", "ms", "us", "ns"] | None = None
    stamps: Literal["capture", "receipt", "unknown"] = "unknown"
    on_floor: bool = True


class PlaceSettings(Settings):
    """Where a board lies: its first inner corner (x, y in metres) and the direction of its rows.

    In the GTV frame, or in the robot frame of a surveyed ``stop``.
    """

    corner: tuple[Finite, Finite]
    heading: Finite = 0.0
    stop: str = ""


class SurveyCheckSettings(Settings):
    """A board on the floor at known places, seen by a camera: a cross-check of the survey.

    ``board`` is the board, ``height`` its thickness, ``places`` are where it was laid, by the names
    of the images; ``sigmas`` say how well: x, y, height (metres) and heading (radians).
    """

    board: BoardSettings | None = None
    height: Finite = 0.0
    sigmas: FourSigmas = (0.002, 0.002, 0.002, 0.004)
    places: dict[Name, PlaceSettings] = Field(default_factory=dict)


class DisplacementSettings(Settings):
    """The calibration board moved by a known ``distance`` (metres), good to ``sigma``."""

    distance: Positive | None = None
    sigma: Positive = 0.001


class PlannedCamera(Settings):
    """A camera before it is mounted.

    ``position`` is the foot of its pole (x, y in the GTV frame) and ``height`` how high it hangs
    above it, metres. ``pan_deg`` is the direction in which it looks, degrees from the x axis
    towards y. ``tilt_deg`` is how far it looks down from the horizontal; or ``depth`` says from
    where to where it is to see the floor, metres from the foot, and it is tilted for that.
    ``resolution``, ``field_of_view_deg`` and ``file`` stand for those of the plan.
    """

    name: Name
    position: tuple[Finite, Finite]
    height: Positive
    pan_deg: Finite
    tilt_deg: Annotated[float, Field(gt=-90, le=90)] | None = None
    depth: tuple[Positive, Positive] | None = None
    resolution: tuple[Pixels, Pixels] | None = None
    field_of_view_deg: FieldOfView | None = None
    file: str = ""

    @model_validator(mode="after")
    def _one_tilt(self) -> "PlannedCamera":
        if (self.tilt_deg is None) == (self.depth is None):
            raise ValueError("state tilt_deg or depth (one of them)")
        return self

    @field_validator("depth")
    @classmethod
    def _near_to_far(cls, depth: tuple[float, float] | None) -> tuple[float, float] | None:
        if depth is not None and depth[0] >= depth[1]:
            raise ValueError("depth is from near to far, such as [2.0, 5.0]")
        return depth


class CameraPlanSettings(Settings):
    """Cameras, a robot with markers and a floor, for `gtval vision plan`.

    ``cameras`` are written as [[vision.plan.cameras]]. Their images have ``resolution`` (pixels,
    across and down) and ``field_of_view_deg`` (across, degrees), or the lens of the camera file
    ``file`` (relative to the campaign folder). ``corner_sigma`` is the standard deviation of a
    marker's corner, pixels.

    The robot carries ``markers`` markers of ``marker_side``, evenly around the middle of its
    frame at ``marker_radius`` and ``marker_height`` (metres), each leaning by ``marker_lean_deg``:
    0 faces up, 90 outwards. ``marker_cells`` are the cells along a side, black border included.

    ``floor`` is the outline that has to be seen (x, y of its corners); without it, the rectangle
    around the stops and half a metre more. ``stops`` is a file (pose, x, y, theta). ``wanted`` is
    the standard deviation that a place should have, metres.
    """

    cameras: list[PlannedCamera] = Field(default_factory=list)
    resolution: tuple[Pixels, Pixels] | None = None
    field_of_view_deg: FieldOfView | None = None
    file: str = ""
    corner_sigma: Positive = 0.1
    marker_side: Side | None = None
    marker_height: NotNegative | None = None
    marker_lean_deg: Annotated[float, Field(ge=0, le=90)] = 0.0
    marker_radius: NotNegative = 0.0
    markers: Annotated[int, Field(ge=1, le=24)] = 1
    marker_cells: Annotated[int, Field(ge=4, le=20)] = 8
    floor: list[tuple[Finite, Finite]] = Field(default_factory=list)
    stops: str = "survey/initial_guesses.csv"
    wanted: Positive = 0.01


class PrintedSettings(Settings):
    """What a report of this camera network printed, shown beside what gtval finds, or alone.

    ``detections`` is a file (columns camera, pose, markers: the ids of those recognised, separated
    by spaces, one row an image), relative to the campaign folder; ``markers`` are the ids that were
    looked for, also those that no image shows. ``table_board`` (pose, x, y, z) and ``table_marker``
    (pose, x, y) say where the cameras saw a board and a marker on a table of ``table_height``
    metres that was put over validation poses.
    """

    detections: str = ""
    markers: list[Annotated[int, Field(ge=0)]] = Field(default_factory=list)
    table_board: str = ""
    table_marker: str = ""
    table_height: Finite | None = None

    @property
    def files(self) -> list[str]:
        """All files that are named."""
        return [name for name in (self.detections, self.table_board, self.table_marker) if name]


class VisionSettings(Settings):
    """What the vision system knows of a lab, and its choices.

    ``images`` is a folder below that of the campaign. It holds the folders calibration/CAMERA,
    network, bar, reference, layout/CAMERA, poses/CAMERA and steadiness. ``decisions`` is the file
    of what people decided about images. ``cameras`` are those of
    the network; by default all that have a folder of poses. Intrinsic parameters come from
    ``camera_files`` (by camera, relative to the campaign folder) or from the calibration images,
    which show ``board``; so do the images of steadiness. The other things that images show are
    ``bar``, ``reference``, ``markers``, ``table``, ``survey_check`` and ``displacement``; ``floor``
    is what the robot stands on;
    ``printed`` is what was printed of this network before, ``plan`` what is planned, ``drive`` what
    the cameras saw of a robot that drives.

    With ``on_floor`` poses of the robot are held to the floor, with ``merge_cameras`` all cameras
    that see a stop give one pose, with ``averaged_network`` the cameras are placed by averages
    and chains, as the document does, instead of by one adjustment. ``detector`` finds the corners
    of plain chessboards: 'fitted' by fits of this package, 'classic' and 'sector' by OpenCV's.
    With ``as_published`` poses by the document's way are computed too.
    """

    images: str = "vision"
    decisions: str = "vision/decisions.csv"
    cameras: list[Name] = Field(default_factory=list)
    camera_files: dict[Name, str] = Field(default_factory=dict)
    board: BoardSettings | None = None
    bar: BarSettings = BarSettings()
    reference: ReferenceSettings = ReferenceSettings()
    markers: MarkerSettings = MarkerSettings()
    floor: FloorSettings = FloorSettings()
    table: TableSettings = TableSettings()
    survey_check: SurveyCheckSettings = SurveyCheckSettings()
    displacement: DisplacementSettings = DisplacementSettings()
    printed: PrintedSettings = PrintedSettings()
    plan: CameraPlanSettings = CameraPlanSettings()
    drive: DriveSettings = DriveSettings()
    on_floor: bool = False
    merge_cameras: bool = False
    averaged_network: bool = False
    detector: Literal["fitted", "classic", "sector"] = "fitted"
    as_published: bool = False


def stated(fact: T | None) -> T:
    """A fact of the hardware that campaign.toml states.

    Raises
    ------
    GtvalError
        If it does not; which one is said before images are looked at.
    """
    if fact is None:
        raise GtvalError("campaign.toml does not state all of the hardware that images show")
    return fact
