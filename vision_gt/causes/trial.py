"""A problem solved and scored: how well it explains every board and marker in every image."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median
from vision_gt.causes.evidence import CALIBRATION, WALK, Evidence, Mask
from vision_gt.least_squares.adjustment import MAX_STEPS, Adjustment, Knowledge, adjust
from vision_gt.least_squares.setups import Setup, Views, part_slots

_SPARE = 30.0
"""Misfit (a chi-squared) beyond the expected one from which on a group counts by its logarithm. A
leg before a marker's side or the sun on it makes a misfit of hundreds in one image, and is no
cause; a cause shows in many. A judgement: of good groups one in ten thousand is there, and what
shows in one group alone cannot pass `LEAST_GAIN` in `vision_gt.causes.diagnosis` by much."""
_LEAST_FACTOR = 0.05
"""Of the stated noise: exact corners, as of a simulation, must not make weights infinite."""
_LEAST_CORNERS = 24
"""Corners by which a camera's noise is told. A judgement: to 15 per cent."""


@dataclass(frozen=True)
class Solved:
    """A problem with its solution.

    Parameters
    ----------
    evidence : Evidence
        What was solved.
    adjustment : Adjustment
        The solution.
    """

    evidence: Evidence
    adjustment: Adjustment

    @property
    def setup(self) -> Setup:
        """Where everything is."""
        return self.adjustment.setup

    @cached_property
    def misfits(self) -> Array:
        """(g,) squared unit-variance residuals of each group."""
        squares = (self.adjustment.residuals**2).sum(1)
        groups = len(self.evidence.groups)
        return np.asarray(np.bincount(self.evidence.group, squares, groups), dtype=float)

    @cached_property
    def counts(self) -> Array:
        """(g,) residuals of each group."""
        groups = len(self.evidence.groups)
        return np.asarray(2.0 * np.bincount(self.evidence.group, minlength=groups))

    @cached_property
    def body_misfits(self) -> Array:
        """(b,) how far each body is from where it was stated, as a chi-squared."""
        _, off = self.setup.change_from(self.evidence.setup)
        return np.asarray(np.einsum("bi,bij,bj->b", off, self.evidence.knowledge.bodies, off))

    @cached_property
    def score(self) -> float:
        """Misfit of everything, with what one group or one body can add bounded."""
        known = self.evidence.knowledge
        shared, _ = self.setup.change_from(self.evidence.setup)
        total = float(bounded(self.misfits, self.counts).sum())
        ranks = (np.diagonal(known.bodies, axis1=1, axis2=2) > 0).sum(1)
        total += float(bounded(self.body_misfits, ranks).sum())
        parts = [part_slots(self.setup, p) for p in range(1, len(self.setup.R_part))]
        for slots in parts:
            off = shared[slots]
            total += float(bounded(np.array(off @ known.shared[slots, slots] @ off), np.array(6)))
        # Cameras, and what ties new parts to old ones, are not bounded.
        rest = known.shared.copy()
        for slots in parts:
            rest[slots, slots] = 0
        return total + float(shared @ rest @ shared)

    @property
    def freedom(self) -> int:
        """Observations less unknowns."""
        return self.adjustment.freedom


def bounded(misfit: Array, expected: Array) -> Array:
    """Misfits that count by their logarithm from `_SPARE` more than expected on."""
    beyond = np.maximum(misfit - expected - _SPARE, 0.0)
    return np.where(beyond > 0, expected + _SPARE, misfit) + _SPARE * np.log1p(beyond / _SPARE)


def slope_of_bounded(misfit: Array, expected: Array) -> Array:
    """What one more unit of misfit adds to the bounded one."""
    beyond = np.maximum(misfit - expected - _SPARE, 0.0)
    return np.asarray(_SPARE / (_SPARE + beyond))


def solved(evidence: Evidence, begin: Setup | None = None, steps: int = MAX_STEPS) -> Solved:
    """The solution of a problem.

    Parameters
    ----------
    evidence : Evidence
        What is seen and known.
    begin : Setup, optional
        Where the search begins.
    steps : int
        At the most.

    Raises
    ------
    NotDeterminedError
        If something is left undetermined.
    """
    views, setup, known = evidence.views, evidence.setup, evidence.knowledge
    return Solved(evidence, adjust(views, setup, known, begin=begin, steps=steps))


@dataclass(frozen=True)
class Noise:
    """How much larger the corners' noise is than what the detector states.

    Parameters
    ----------
    kind : str
        'boards' or 'markers'.
    camera : str
        Whose images.
    factor : float
        1 where the stated one is right.
    corners : int
        It was told by.
    freedom : float
        Degrees of freedom that their poses leave: a marker's four corners have two.
    stated : float
        Median standard deviation of a coordinate as the detector states it, pixels.
    calibrated : bool
        Whether images of its calibration are among them: their boards are others, and nearer.
    """

    kind: str
    camera: str
    factor: float
    corners: int
    freedom: float
    stated: float
    calibrated: bool = False

    @property
    def sigma(self) -> float:
        """Standard deviation of the factor: a median deviation's, 1.17 / sqrt(n) of it."""
        return 1.17 * self.factor / float(np.sqrt(self.freedom))

    @property
    def scatter(self) -> float:
        """Standard deviation of a coordinate as the corners show it, pixels."""
        return self.factor * self.stated


def with_own_noise(evidence: Evidence) -> tuple[Evidence, tuple[Noise, ...]]:
    """The problem with the noise that each camera's corners show.

    Parameters
    ----------
    evidence : Evidence
        With the noise that the detector states.

    Notes
    -----
    Every board and every marker in every image gets a pose of its own, so that no mistake in
    lengths or places adds to the noise; the lens is taken as it is.
    """
    residuals, weights = _own_residuals(evidence)
    stated = np.sqrt(np.trace(evidence.views.covariance, axis1=1, axis2=2) / 2)
    told = []
    for kind, name, own in _by_camera(evidence):
        if own.sum() >= _LEAST_CORNERS:
            found = float(sigma_from_median(residuals[own].ravel()))
            found *= float(np.sqrt(2 * own.sum() / weights[own].sum()))
            usual, freedom = float(np.median(stated[own])), float(weights[own].sum())
            known = kind == "boards" and calibrated(evidence, name)
            told.append(Noise(kind, name, found, int(own.sum()), freedom, usual, known))
    return with_noise(evidence, told), tuple(told)


def with_noise(evidence: Evidence, noise: Sequence[Noise]) -> Evidence:
    """The problem with a noise told before.

    Parameters
    ----------
    evidence : Evidence
        With the noise that the detector states.
    noise : sequence of Noise
        How much larger it is.
    """
    factors = {(one.kind, one.camera): one.factor for one in noise}
    factor = np.ones(len(evidence.views))
    for kind, name, own in _by_camera(evidence):
        factor[own] = max(factors.get((kind, name), 1.0), _LEAST_FACTOR)
    covariance = evidence.views.covariance * factor[:, None, None] ** 2
    return replace(evidence, views=replace(evidence.views, covariance=covariance))


def _by_camera(evidence: Evidence) -> Iterator[tuple[str, str, Mask]]:
    """Which corners are of boards, and which of markers, of each camera and of the walk's."""
    boards = np.array([g.marker is None for g in evidence.groups])[evidence.group]
    for i, name in enumerate((*evidence.cameras, WALK)):
        seen = evidence.views.camera == i
        yield "boards", name, boards & seen
        yield "markers", name, ~boards & seen


def _own_residuals(evidence: Evidence) -> tuple[Array, Array]:
    """(n, 2) residuals with a pose for each group, and each corner's share of the freedom."""
    at, views = evidence.setup, evidence.views
    first = np.unique(evidence.group, return_index=True)[1]
    camera, body, part = views.camera[first], views.body[first], views.part[first]
    # Each group's thing as its camera sees it, so that the camera is the world.
    to_camera = np.swapaxes(at.R_camera[camera], 1, 2)
    R_world = at.R_body[body] @ at.R_part[part]
    t_world = (at.R_body[body] @ at.t_part[part][..., None])[..., 0] + at.t_body[body]
    still = Setup(
        np.broadcast_to(np.eye(3), at.R_camera.shape).copy(),
        np.zeros_like(at.t_camera),
        at.intrinsics,
        to_camera @ R_world,
        (to_camera @ (t_world - at.t_camera[camera])[..., None])[..., 0],
        np.eye(3)[None],
        np.zeros((1, 3)),
    )
    alone = Views(
        views.camera,
        evidence.group,
        np.zeros(len(views), dtype=np.intp),
        views.point,
        views.pixel,
        views.covariance,
    )
    # A pose that four corners hardly fix must not stop the rest.
    known = Knowledge.nothing(still)
    known.bodies[:] = 1e-2 * np.eye(6)
    done = adjust(alone, still, known)
    counts = 2.0 * np.bincount(evidence.group)
    share = (counts - 6) / counts
    return done.residuals, 2 * share[evidence.group]


def calibrated(evidence: Evidence, camera: str) -> bool:
    """Whether a camera's lens comes from images of this problem."""
    return any(g.kind == CALIBRATION and g.camera == camera for g in evidence.groups)
