"""Transforms from several images: the largest group that agrees, and chains of them."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array

Name = TypeVar("Name", str, int)


def distances(stack: RigidTransform, far: tuple[float, float]) -> Array:
    """(n, n) distances of n transforms from each other, 1 where they no longer agree.

    Parameters
    ----------
    stack : RigidTransform
        All of them.
    far : (float, float)
        Metres and radians from which on two of them do not agree.
    """
    t, R = stack.translation, stack.rotation.as_matrix()
    lengths = np.linalg.norm(t[:, None] - t, axis=-1) / far[0]
    traces = np.einsum("aij,bij->ab", R, R)
    angles = np.arccos(np.clip((traces - 1) / 2, -1, 1)) / far[1]
    return np.asarray(np.maximum(lengths, angles))


def largest_agreement(
    stack: RigidTransform, owner: npt.NDArray[np.intp], far: tuple[float, float]
) -> tuple[list[int], int]:
    """The largest group of transforms that agree, one at most from each owner.

    Parameters
    ----------
    stack : RigidTransform
        n candidates.
    owner : (n,) array of int
        The image that each comes from: one of its candidates is right.
    far : (float, float)
        As for `distances`.

    Returns
    -------
    rows : list of int
        The group.
    rival : int
        Owners that another group, apart from this one, has at the most.
    """
    apart = distances(stack, far)
    owners = np.unique(owner)
    # For each candidate: how far is the nearest of every owner, one at most.
    nearest = np.stack([np.minimum(apart[:, owner == k].min(1), 1.0) for k in owners], axis=1)
    best = int(np.argmin(nearest.sum(1)))
    rows = []
    for k in owners:
        own = np.flatnonzero(owner == k)
        row = int(own[np.argmin(apart[best, own])])
        if apart[best, row] < 1:
            rows.append(row)
    support = (nearest < 1).sum(1)
    return rows, int(support[apart[best] > 1].max(initial=0))


def strongest_tree(
    root: Name, links: Iterable[tuple[Name, Name, RigidTransform, int]]
) -> tuple[dict[Name, RigidTransform], dict[Name, Name]]:
    """All that links reach from a root, over the tree of the strongest ones (Prim's).

    Parameters
    ----------
    root : str or int
        Where chains begin.
    links : iterable of (first, second, T_first_second, strength)
        Between two names.

    Returns
    -------
    reached : dict of name to RigidTransform
        T_root_name.
    parents : dict of name to name
        The one through which each is chained; the root has none.
    """
    reached = {root: RigidTransform.identity()}
    parents: dict[Name, Name] = {}
    left = list(links)
    while True:
        open_ended = [link for link in left if (link[0] in reached) != (link[1] in reached)]
        if not open_ended:
            return reached, parents
        first, second, T, _ = max(open_ended, key=lambda link: link[3])
        if first in reached:
            reached[second], parents[second] = reached[first] * T, first
        else:
            reached[first], parents[first] = reached[second] * T.inv(), second


def chain_to_root(name: Name, parents: Mapping[Name, Name]) -> tuple[Name, ...]:
    """Names from one to the root of a tree."""
    chain = [name]
    while chain[-1] in parents:
        chain.append(parents[chain[-1]])
    return tuple(chain)
