"""Mistakes that people make with cameras, markers and boards, and what has to be said of each."""

import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from data_samples.rendering.campaign import render_all, robot_photographs
from data_samples.rooms.cameras import CHESSBOARD, VisionTruth
from trials.vision_rooms import Room, edit
from validation.poses.angles import Array
from validation.text_files.writing import write_files
from vision_gt.optics.camera import project
from vision_gt.optics.transforms import perturbed
from vision_gt.optics.written_cameras import write_camera

PRINTED = 0.97
NOTHING = ""
"""Where nothing is wrong."""
REFUSED = "refused"
"""Code of what is said where nothing is solved."""


@dataclass(frozen=True)
class Expected:
    """What has to be said: a code, words of the text, and for a move among which stops it was.

    Code and words are regular expressions.
    """

    code: str
    words: tuple[str, ...]
    error: bool = False
    since: str = ""
    stops: tuple[str, ...] = ()

    def moment(self, said: str) -> bool:
        """Whether the move is put between stops between which it was."""
        told = re.search(r"between stop (\S+) and stop (\w+)", said)
        if not self.since or told is None:
            return not self.since
        before, after, true = (self.stops.index(s) for s in (told[1], told[2], self.since))
        return before < true <= after


@dataclass(frozen=True)
class Case:
    """A copy of a good campaign that is to be spoilt."""

    room: Room
    folder: Path
    rng: np.random.Generator


Mistake = Callable[[Case], Expected]


class ImpossibleError(Exception):
    """A mistake that cannot be made in a room."""


Editor = Callable[[Path, Callable[[str], str]], None]


def behind(pattern: str) -> Editor:
    """What changes the second group of a pattern in campaign.toml."""

    def change(folder: Path, by: Callable[[str], str]) -> None:
        edit(folder, pattern, lambda m: m[1] + by(m[2]))

    return change


def times(share: float) -> Callable[[str], str]:
    """What writes a length a share larger."""
    return lambda length: f"{float(length) * share:.6f}"


bar_size = behind(r"((?:first|second) = \{[^}]*square = )([\d.]+)")
bar_family = behind(r'((?:first|second) = \{[^}]*family = )("[^"]*")')
reference_size = behind(r"(\[vision\.reference\][^\[]*?square = )([\d.]+)")
marker_family = behind(r'(\[vision\.markers\]\nfamily = )("[^"]*")')


def side(folder: Path, marker: int, by: float) -> None:
    """Another side of a marker, in the list of sides."""
    behind(rf'(\nsides = \{{[^}}]*?"{marker}" = )([\d.]+)')(folder, times(by))


def bar_print(case: Case) -> Expected:
    bar_size(case.folder, times(1 / PRINTED))
    return Expected("print_size", ("bar's boards", "3.0"), error=True)


def reference_print(case: Case) -> Expected:
    reference_size(case.folder, times(1 / PRINTED))
    return Expected("print_size", ("reference pattern", "3.0|2.9"), error=True)


def marker_prints(case: Case) -> Expected:
    for number in case.room.truth.layout.numbers:
        side(case.folder, number, 1 / PRINTED)
    return Expected("print_size", ("all markers", "3.0|2.9"), error=True)


def marker_side(case: Case) -> Expected:
    read = [n for n in case.room.truth.layout.numbers if case.room.stops_with(n)]
    number = int(case.rng.choice(read))
    side(case.folder, number, 1.05)
    return Expected("print_size", (f"side of marker {number} ", "4.[78]"))


def from_files(case: Case, lenses: dict[str, str], focal: float = 1.0) -> None:
    """Lenses from files, those of a good run, in place of calibration images."""
    for camera, other in lenses.items():
        lens = next(c for c in case.room.seen.cameras if c.name == other)
        parameters = lens.parameters.copy()
        parameters[:2] *= focal if camera == "1" else 1.0
        data = write_camera(".yaml", "opencv", replace(lens, parameters=parameters))
        (case.folder / f"lens_{camera}.yaml").write_bytes(data)
        shutil.rmtree(case.folder / "vision/calibration" / camera)
    names = ", ".join(f'"{camera}" = "lens_{camera}.yaml"' for camera in lenses)
    edit(case.folder, r"\n\[vision\]\n", f"\n[vision]\ncamera_files = {{ {names} }}\n")


def files_right(case: Case) -> Expected:
    from_files(case, {"1": "1", "2": "2"})
    return Expected(NOTHING, ())


def files_exchanged(case: Case) -> Expected:
    from_files(case, {"1": "2", "2": "1"})
    return Expected("exchanged", ("files of cameras",))


def focal_length(case: Case) -> Expected:
    from_files(case, {"1": "1", "2": "2"}, focal=1.02)
    return Expected("focal_length", ("camera 1 ", "1.9|2.0"))


def stops_exchanged(case: Case) -> Expected:
    both = [s for s in case.room.stops_of("1") if s in case.room.stops_of("2")]
    if len(both) < 2:
        raise ImpossibleError("no two stops are seen by cameras 1 and 2")
    a, b = case.rng.choice(both, 2, replace=False)
    one, other = (case.folder / f"vision/poses/1/pose{stop}.png" for stop in (a, b))
    first = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(first)
    # Of two cameras only the survey tells which one's.
    either = "|".join(f"The images of stops {x} and {y} " for x, y in ((a, b), (b, a)))
    return Expected("exchanged", (either, "of camera 1 are"), error=True)


def cameras_exchanged(case: Case) -> Expected:
    poses = case.folder / "vision/poses"
    (poses / "1").rename(poses / "was")
    (poses / "2").rename(poses / "1")
    (poses / "was").rename(poses / "2")
    return Expected("exchanged", ("images of the stops of cameras",))


def stops_again(case: Case, truth: VisionTruth, since: str) -> None:
    """The images of the stops from one on, of a room that has changed."""
    order = list(case.room.seen.stops)
    later = {f"pose{s}.png" for s in order[order.index(since) :]}
    taken = [
        p
        for p in robot_photographs(truth, case.rng)
        if Path(p.name).name in later and (case.folder / p.name).exists()
    ]
    write_files(case.folder, dict(render_all(taken, int(case.rng.integers(2**31)))))


def since_of(seen: list[str]) -> str:
    """A stop in the middle; two have to show that something moved."""
    return seen[min(len(seen) // 2, len(seen) - 2)]


def change(rng: np.random.Generator, length: float, angle: float) -> Array:
    """(6,) of a length and an angle in directions drawn at random."""
    drawn = rng.standard_normal((2, 3))
    drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
    return np.asarray((drawn * np.array([[length], [angle]])).ravel())


def camera_moved(case: Case) -> Expected:
    since = since_of(stops := case.room.stops_of("1"))
    truth, i = case.room.truth, [c.name for c in case.room.truth.cameras].index("1")
    moved = list(truth.T_gtv_camera)
    moved[i] = perturbed(moved[i], change(case.rng, 0.005, 0.006))
    poses = type(truth.T_gtv_camera).concatenate(moved)
    stops_again(case, replace(truth, T_gtv_camera=poses), since)
    return Expected("camera_moved", ("Camera 1 ",), since=since, stops=tuple(stops))


def marker_moved(case: Case) -> Expected:
    counts = {n: len(case.room.stops_with(n)) for n in case.room.truth.layout.numbers}
    number = max(counts, key=lambda n: counts[n])
    since = since_of(stops := case.room.stops_with(number))
    truth = case.room.truth
    off = np.zeros((len(counts), 6))
    off[truth.layout.index(number)] = change(case.rng, 0.015, 0.04)
    layout = replace(truth.layout, T_robot_marker=perturbed(truth.layout.T_robot_marker, off))
    stops_again(case, replace(truth, layout=layout), since)
    return Expected("marker_moved", (f"Marker {number} ",), since=since, stops=tuple(stops))


def reference_turned(case: Case) -> Expected:
    edit(case.folder, r"(\[vision\.reference\][^\n]*\n)", r"\1heading = 1.570796" + "\n")
    return Expected("reference_turned", ("turned by (90|270)",), error=True)


def reference_corner(case: Case) -> Expected:
    truth, name = case.room.truth, next((case.folder / "vision/reference").glob("*.png")).stem
    i = [c.name for c in truth.cameras].index(name)
    far = truth.T_gtv_camera[i].inv().apply(truth.T_gtv_reference.apply(CHESSBOARD.corners[-1:]))
    x, y = project(far, truth.cameras[i].parameters)[0]
    edit(case.folder, r"origin_near = \[.*\]", f"origin_near = [{x:.0f}, {y:.0f}]")
    return Expected("reference_turned", ("turned by 180",), error=True)


def grey(path: Path) -> Array:
    """An image."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return np.asarray(image, dtype=float)


def shimmer(image: Array, rng: np.random.Generator) -> Array:
    """An image as through hot air: every place moves by 0.4 px, by itself."""
    drawn = [cv2.GaussianBlur(rng.standard_normal(image.shape), (0, 0), 4.0) for _ in "xy"]
    x, y = (0.4 * one / one.std() for one in drawn)
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    places = (u + x).astype(np.float32), (v + y).astype(np.float32)
    return np.asarray(cv2.remap(image, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT))


def grain(image: Array, rng: np.random.Generator) -> Array:
    """An image with the noise of a dark room."""
    return image + 12.0 * rng.standard_normal(image.shape)


def worse(
    case: Case, names: Sequence[str], by: Callable[[Array, np.random.Generator], Array]
) -> None:
    """All images of some cameras made worse."""
    for path in sorted((case.folder / "vision").rglob("*.png")):
        if path.parent.name in names or path.stem.split("-")[0] in names:
            image = np.clip(np.rint(by(grey(path), case.rng)), 0, 255)
            cv2.imwrite(str(path), image.astype(np.uint8))


def noise_of_one(case: Case) -> Expected:
    worse(case, "1", shimmer)
    return Expected("corner_noise", ("camera 1",))


def noise_of_all(case: Case) -> Expected:
    worse(case, [c.name for c in case.room.truth.cameras], shimmer)
    return Expected("corner_noise", ("all cameras",))


def grain_of_one(case: Case) -> Expected:
    worse(case, "1", grain)
    return Expected("corner_noise", ("camera 1",))


def reference_height(case: Case) -> Expected:
    edit(case.folder, r"(\[vision\.reference\][^\n]*\n)", r"\1height = 0.03" + "\n")
    return off_height("lower", "higher")


def dima_height(case: Case) -> Expected:
    stated = behind(r"(dima_on_robot = \{ translation = \[[^,]*, [^,]*, )([-\d.]+)")
    stated(case.folder, lambda z: f"{float(z) + 0.03:.6f}")
    return off_height("higher", "lower")


def off_height(reference: str, dima: str) -> Expected:
    """That one of both heights is off by 30 mm: images do not tell which, and no pose moves."""
    by = r"(2[789]|3[0123])\.\d mm"
    either = f"reference pattern lies {by} {reference}|Marker .* sits {by} {dima}"
    return Expected("reference_place|dima_place", (either,))


def bar_swapped(case: Case) -> Expected:
    other = {"0": "30", "30": "0"}
    edit(case.folder, r"first_id = (\d+)", lambda m: f"first_id = {other[m[1]]}")
    # Where cameras are linked by one way only, what the snapshots say keeps them apart.
    return Expected("exchanged|part_missing", ("two boards of the bar",))


def bar_and_marker_prints(case: Case) -> Expected:
    bar_size(case.folder, times(1 / PRINTED))
    marker_prints(case)
    return Expected("print_size", ("bar's boards and the sides of all markers",), error=True)


def bar_dictionary(case: Case) -> Expected:
    bar_family(case.folder, lambda _: '"5X5_100"')
    return Expected("image", ("4X4_.* where 5X5_100 was stated",), error=True)


def bar_ids(case: Case) -> Expected:
    edit(case.folder, r"first_id = 30", "first_id = 40")
    return Expected("image", ("ids begin at 30 or near, not at 40",))


def bar_layout(case: Case) -> Expected:
    edit(
        case.folder, r"((?:first|second) = \{ )columns = 10, rows = 6", r"\1columns = 6, rows = 10"
    )
    return Expected("image", ("rows and columns exchanged",), error=True)


def board_squares(case: Case) -> Expected:
    edit(case.folder, r"(\[vision\.board\][^\n]*\n)columns = 10", r"\1columns = 9")
    return Expected(REFUSED, ("10 x 6 .* 9 x 6 .*stated",), error=True)


def marker_dictionary(case: Case) -> Expected:
    marker_family(case.folder, lambda _: '"4X4_250"')
    return Expected(REFUSED, ("ARTOOLKITPLUS_SIMPLE",), error=True)


MISTAKES: dict[str, Mistake] = {
    one.__name__: one
    for one in (
        bar_print,
        reference_print,
        marker_prints,
        marker_side,
        files_right,
        files_exchanged,
        focal_length,
        camera_moved,
        marker_moved,
        stops_exchanged,
        cameras_exchanged,
        reference_turned,
        reference_corner,
        noise_of_one,
        noise_of_all,
        grain_of_one,
        reference_height,
        dima_height,
        bar_swapped,
        bar_and_marker_prints,
        bar_dictionary,
        bar_ids,
        bar_layout,
        board_squares,
        marker_dictionary,
    )
}
