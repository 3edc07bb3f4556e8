"""The tables [survey], [survey.entry] and [plan] of campaign.toml."""

from typing import Annotated, Literal

from pydantic import Field

from validation.campaign.folder import Finite, Name, Positive, Settings


class Motion(Settings):
    """A known motion between two surveyed stops (the accuracy experiment).

    From stop ``start`` to stop ``end``: ``dx``, ``dy`` in metres and ``dtheta`` in radians, along
    the axes of the first stop's robot frame (``frame`` 'robot') or of the GTV frame ('gtv').
    ``sigmas`` are their standard deviations, exact where not given.
    """

    start: Name
    end: Name
    dx: Finite
    dy: Finite
    dtheta: Finite
    frame: Literal["robot", "gtv"] = "gtv"
    sigmas: tuple[Positive, Positive, Positive] | None = None


class EntrySettings(Settings):
    """[survey.entry]: how readings are entered; paths are relative to the campaign folder.

    ``journal`` is the file that keeps every entry. ``poses`` are the stops to measure; where none
    are listed, those of the initial guesses, and any stop can be begun by its name. ``order`` is
    'spread' where the first three world points of each mark are to lie far apart, so that the
    following readings can be checked sharply, or 'listed'. ``second`` says what the other person's
    blind entry is: a new measurement from the other end ('measure'), the same display typed again
    ('type'), or not wanted ('none').
    A stop is good enough when the standard deviations of x and y are below ``pose_sigma`` (metres)
    and that of theta below ``heading_sigma`` (radians), each mark having readings to
    ``least_world_points`` or more.
    """

    journal: str = "survey/journal.jsonl"
    poses: list[Name] = Field(default_factory=list)
    order: Literal["spread", "listed"] = "spread"
    second: Literal["none", "type", "measure"] = "measure"
    pose_sigma: Positive = 0.003
    heading_sigma: Positive = 0.005
    least_world_points: Annotated[int, Field(ge=1, le=1000)] = 4


class SurveySettings(Settings):
    """Files and choices of the survey; paths are relative to the campaign folder.

    ``readings`` are the distances (from, to, distance, and if wanted time, observer, use, note);
    ``units`` is what those are in that state no unit: "m", "cm", "mm", "ft" or "in".
    ``world_points`` lists the names of the marked points on the walls. ``initial_guesses`` are
    poses measured roughly by hand (pose, x, y, theta), ``hand_points`` world points (world_point,
    x, y, and if wanted sigma). ``published_world_points`` and ``published_poses`` are coordinates
    taken over from elsewhere; ``published_sigmas`` are the standard deviations of x, y, theta of
    those poses, where the file states none. ``motions`` are known motions between two stops.
    ``labels`` maps a Vframe point's name as written in the readings to the point that it
    stands for, where the two differ. ``reading_sigma`` replaces the instrument's standard
    deviation. ``robust`` weighs large residuals down (Huber). With ``as_published`` the document's
    two filters are run too. ``known_lengths`` (true, reading, and if wanted sigma) check the
    instrument, ``walls`` (wall_a, wall_b, position, distance) whether walls are parallel,
    ``published_motions`` are known motions whose measured values were printed elsewhere.
    ``convergence_starts`` first guesses are tried for every unknown, none where it is 0. ``entry``
    is about typing readings in the room.
    """

    readings: str = "survey/readings.csv"
    units: Literal["m", "cm", "mm", "ft", "in"] = "m"
    initial_guesses: str = "survey/initial_guesses.csv"
    hand_points: str = "survey/hand_points.csv"
    published_world_points: str = "survey/published_world_points.csv"
    published_poses: str = "survey/published_poses.csv"
    published_sigmas: tuple[Positive, Positive, Positive] | None = None
    world_points: list[Name] = Field(default_factory=list)
    labels: dict[Name, Name] = Field(default_factory=dict)
    reading_sigma: Positive | None = None
    known_lengths: str = "survey/known_lengths.csv"
    walls: str = "survey/walls.csv"
    published_motions: str = "survey/published_motions.csv"
    robust: bool = False
    as_published: bool = False
    convergence_starts: Annotated[int, Field(ge=0, le=100_000)] = 300
    motions: list[Motion] = Field(default_factory=list)
    entry: EntrySettings = EntrySettings()


class PlanSettings(Settings):
    """What is planned before anybody goes to the room; paths are relative to the campaign folder.

    ``world_points`` has the columns world_point, x, y; ``poses`` pose, x, y, theta;
    ``not_visible`` from, to: pairs that cannot be read, '7/*' standing for all marks of stop 7.
    ``repeat`` is how often every visible pair is read. ``confidence`` and ``power`` say what
    'detectable' means.
    """

    world_points: str = "survey/planned_points.csv"
    poses: str = "survey/initial_guesses.csv"
    not_visible: str = "survey/not_visible.csv"
    repeat: Annotated[int, Field(ge=1, le=100)] = 1
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    power: Annotated[float, Field(gt=0.5, lt=1)] = 0.8
