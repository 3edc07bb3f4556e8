"""Whether a calibration is good enough, and what the images lack if it is not."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from vision_gt.network.intrinsics import Calibration
from vision_gt.optics.camera import project_with_jacobians, undistort

LEAST_COVERAGE = 0.5
"""Share of the cells of an image. A judgement: where no corner was, the lens is extrapolated."""
LEAST_TILT = float(np.deg2rad(25))
"""A board that faces the camera says nothing of the focal length, which goes with the distance. A
judgement: what it says grows with the square of the tilt, and 30 degrees and more are asked for."""
LEAST_IMAGES = 8
"""A judgement: twice the least that give a lens, so that a bad one among them shows."""
MOST_SCATTER = 0.5
"""Pixels of a corner's coordinate. Corners of sharp rendered images scatter by 0.02, of the real
webcams at hand by 0.05 to 0.2; blur and wrong boards make more. A judgement."""
MOST_STATED = 0.4
"""Pixels that the image itself leaves open of a corner: 0.01 to 0.05 in sharp images, 0.5 with a
blur of 6 px and a motion of 13 px. A judgement: with so much the corners are a smear, and what the
motion shifts is not seen in their scatter."""
MOST_FOCAL = 0.003
"""Of the focal length, one standard deviation: 12 mm of a robot 4 m away, which is all that the
first users' system was to be good to."""


@dataclass(frozen=True)
class Shortcoming:
    """One thing that the images lack.

    Parameters
    ----------
    kind : {"few", "blur", "coverage", "tilt", "undetermined"}
        What.
    text : str
        What was found, and what to do.
    of : str
        What was measured.
    value : float
        How large it is.
    unit : str
        Of it.
    """

    kind: str
    text: str
    of: str
    value: float
    unit: str = ""


@dataclass(frozen=True)
class Verdict:
    """What a calibration is worth.

    Parameters
    ----------
    shortcomings : tuple of Shortcoming
        The worst first; empty for a good one.
    pixels : float
        How far, at the most, the lens may put a point wrong in the parts of the image where the
        board was shown: one standard deviation, what a turn of the camera absorbs left out.
    focal : float
        Standard deviation of the focal length, as a share of it.
    """

    shortcomings: tuple[Shortcoming, ...]
    pixels: float
    focal: float

    @property
    def word(self) -> str:
        """'good', 'weak', or 'not determined'."""
        kinds = {one.kind for one in self.shortcomings}
        if "undetermined" in kinds:
            return "not determined"
        return "weak" if kinds else "good"

    @property
    def text(self) -> str:
        """The verdict in words."""
        said = (
            f"Verdict: {self.word}. Where the board was shown, the lens puts no point wrong by "
            f"more than {self.pixels:.2g} px (one standard deviation); the focal length is known "
            f"to {100 * self.focal:.2g} %."
        )
        return " ".join([said, *(one.text for one in self.shortcomings)])


def calibration_verdict(found: Calibration) -> Verdict:
    """What a calibration is worth, and what its images lack.

    Parameters
    ----------
    found : Calibration
        Of one camera.
    """
    camera, coverage = found.camera, found.coverage
    focal = float(camera.sigmas[0] / camera.parameters[0])
    tilt = float(coverage.tilts.max())
    lacks = []
    if focal > MOST_FOCAL:
        said = (
            f"The images determine the focal length to {100 * focal:.2g} % only, where "
            f"{100 * MOST_FOCAL:g} % put a robot 4 m away 12 mm wrong. Tilt the board more, and "
            "show it near and far."
        )
        lacks.append(Shortcoming("undetermined", said, "focal length, share", focal))
    if found.sigma > MOST_SCATTER:
        said = (
            f"The corners scatter by {found.sigma:.2f} px. The images are blurred, or the board is "
            "not flat, or its squares are counted wrongly."
        )
        lacks.append(Shortcoming("blur", said, "scatter of a corner", found.sigma, "px"))
    elif (stated := _stated(found)) > MOST_STATED:
        said = (
            f"The images are blurred: each leaves {stated:.2f} px open of a corner. Hold the board "
            "still, focus, and give more light."
        )
        lacks.append(Shortcoming("blur", said, "standard deviation of a corner", stated, "px"))
    if coverage.share < LEAST_COVERAGE:
        said = (
            f"The board covered only {100 * coverage.share:.0f} % of the image, not {_where(found)}"
            ". Show it in all parts: elsewhere the distortion is not known."
        )
        lacks.append(Shortcoming("coverage", said, "share of the image", coverage.share))
    if tilt < LEAST_TILT:
        said = (
            f"The board was tilted by at most {np.rad2deg(tilt):.0f} degrees. The focal length "
            "needs tilts of 30 degrees and more."
        )
        lacks.append(Shortcoming("tilt", said, "largest tilt", tilt, "rad"))
    if len(found.views) < LEAST_IMAGES:
        said = f"There are only {len(found.views)} images; take 12 or more."
        count = float(len(found.views))
        lacks.append(Shortcoming("few", said, "images", count, "images"))
    return Verdict(tuple(lacks), _pixels(found), focal)


def _stated(found: Calibration) -> float:
    """The median standard deviation of a corner by its image, pixels; 0 where none is known."""
    known = [view.sigmas for view in found.views if view.sigmas is not None]
    return float(np.median(np.concatenate(known))) if known else 0.0


def _where(found: Calibration) -> str:
    """The parts of the image, of nine, that hold fewest corners."""
    counts = found.coverage.counts
    rows = np.array_split(counts, 3, axis=0)
    cells = [[part.sum() for part in np.array_split(row, 3, axis=1)] for row in rows]
    names = [
        f"{down} {across}".strip() if down or across else "middle"
        for down in ("top", "", "bottom")
        for across in ("left", "", "right")
    ]
    empty = [name for name, n in zip(names, np.ravel(cells), strict=True) if n == 0]
    return ", ".join(empty) if empty else "all of each part"


def _pixels(found: Calibration) -> float:
    """Largest standard deviation of a seen point by the lens, pixels, turns left out."""
    camera, counts = found.camera, found.coverage.counts
    down, across = np.nonzero(counts)
    cells = np.array(counts.shape[::-1])
    pixels = (np.column_stack([across, down]) + 0.5) / cells * np.array(camera.size) - 0.5
    straight = undistort(pixels, camera.parameters)[:, :2]
    rays = np.column_stack([straight, np.ones(len(straight))])
    _, by_point, by_lens = project_with_jacobians(rays, camera.parameters)
    # A turn by phi moves a ray r by phi x r.
    turns = np.stack([np.cross(np.eye(3), ray) for ray in rays]).swapaxes(1, 2)
    by_turn = (by_point @ turns).reshape(-1, 3)
    J: Array = by_lens.reshape(-1, by_lens.shape[-1])
    left = J - by_turn @ np.linalg.lstsq(by_turn, J, rcond=None)[0]
    variances = np.einsum("ni,ij,nj->n", left, camera.covariance, left).reshape(-1, 2)
    return float(np.sqrt(variances.sum(1).max()))
