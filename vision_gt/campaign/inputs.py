"""Boards and transforms as the [vision] table of campaign.toml describes them."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from vision_gt.network.adjustment import KnownBody
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.settings import BoardSettings, Placement, VisionSettings


def made_board(settings: BoardSettings) -> Board:
    """The board that settings describe."""
    family = Family(settings.family) if settings.family else None
    return Board(settings.columns, settings.rows, settings.square, family, settings.first_id)


def placed(settings: Placement) -> RigidTransform:
    """The transform that settings describe."""
    rotation = Rotation.from_matrix(np.array(settings.rotation))
    return RigidTransform.from_components(np.array(settings.translation), rotation)


def known_reference(settings: VisionSettings) -> KnownBody:
    """Where the reference pattern lies, face up, and how well that is known."""
    reference = settings.reference
    lying = Rotation.from_rotvec([0, 0, reference.heading]) * Rotation.from_rotvec([np.pi, 0, 0])
    place = [*reference.position, reference.height]
    covariance = np.diag(np.square(reference.sigmas))
    return KnownBody(RigidTransform.from_components(place, lying), covariance)
