"""What was seen in a good campaign, spoilt as people and devices spoil it."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from vision_gt.causes.evidence import BAR, CALIBRATION, REFERENCE_BOARD, Seen
from vision_gt.network.solution import REFERENCE
from vision_gt.optics.camera import project, undistort
from vision_gt.optics.transforms import perturbed
from vision_gt.robot.marker_poses import marker_corners


def of_kind(view):
    """What a board was shown for."""
    if view.body == REFERENCE:
        return REFERENCE_BOARD
    return CALIBRATION if view.body.startswith("calibration/") else BAR


def boards_printed(seen: Seen, kinds, share: float) -> Seen:
    """Boards that are printed (1 + share) times as large as campaign.toml has them."""
    boards = tuple(
        replace(v, board=replace(v.board, square=v.board.square / (1 + share)))
        if of_kind(v) in kinds
        else v
        for v in seen.boards
    )
    return replace(seen, boards=boards)


def markers_printed(seen: Seen, share: float, only: int | None = None) -> Seen:
    """Markers that are printed (1 + share) times as large as campaign.toml has them."""
    wrong = np.array([only in (None, number) for number in seen.layout.numbers])
    sides = seen.layout.sides / np.where(wrong, 1 + share, 1.0)
    return replace(seen, layout=replace(seen.layout, sides=sides))


def bar_built(seen: Seen, off) -> Seen:
    """A bar that was stated wrongly."""
    T = seen.bar.T_first_second * RigidTransform.from_translation(off)
    return replace(seen, bar=replace(seen.bar, T_first_second=T))


def reference_raised(seen: Seen, height: float) -> Seen:
    """A reference pattern that was stated higher than it lies."""
    lifted = RigidTransform.from_translation([0.0, 0.0, height])
    T = lifted * seen.reference.T_gtv_body
    return replace(seen, reference=replace(seen.reference, T_gtv_body=T))


def dima_raised(seen: Seen, height: float) -> Seen:
    """A dima-marker that was stated higher on the robot than it is."""
    number, T, covariance = seen.dima
    lifted = RigidTransform.from_translation([0.0, 0.0, height]) * T
    return replace(seen, dima=(number, lifted, covariance))


def lens_from_file(seen: Seen, name: str, share: float) -> Seen:
    """All lenses from files, exact but for one focal length."""
    cameras = []
    for camera in seen.cameras:
        parameters = camera.parameters.copy()
        if camera.name == name:
            parameters[:2] *= 1 + share
        cameras.append(replace(camera, parameters=parameters, covariance=np.zeros((9, 9))))
    boards = tuple(view for view in seen.boards if of_kind(view) != CALIBRATION)
    return replace(seen, cameras=tuple(cameras), boards=boards, from_files=seen.names)


def camera_turned(seen: Seen, name: str, since: str, turn) -> Seen:
    """A camera that was turned by a rotation vector before a stop."""
    camera = seen.cameras[seen.names.index(name)]
    R = Rotation.from_rotvec(turn).as_matrix()
    order = list(seen.stops)

    def shifted(view):
        rays = np.column_stack([undistort(view.corners, camera.parameters), np.ones(4)])
        return replace(view, corners=project(rays @ R.T, camera.parameters))

    stops = {
        stop: [
            replace(s, views=tuple(shifted(v) for v in s.views))
            if s.camera == name and order.index(stop) >= order.index(since)
            else s
            for s in sightings
        ]
        for stop, sightings in seen.stops.items()
    }
    return replace(seen, stops=stops)


def rougher(seen: Seen, name: str, sigma: float, rng: np.random.Generator) -> Seen:
    """Corners of a camera whose images have more noise, as the detector states it."""

    def marker(view):
        more = sigma * rng.standard_normal(view.corners.shape)
        covariances = view.covariances + sigma**2 * np.eye(2)
        return replace(view, corners=view.corners + more, covariances=covariances)

    def board(view):
        pixels = view.pixels + sigma * rng.standard_normal(view.pixels.shape)
        return replace(view, pixels=pixels, sigmas=np.hypot(view.sigmas, sigma))

    stops = {
        stop: [
            replace(s, views=tuple(map(marker, s.views))) if s.camera == name else s for s in listed
        ]
        for stop, listed in seen.stops.items()
    }
    boards = tuple(board(v) if v.camera == name else v for v in seen.boards)
    return replace(seen, stops=stops, boards=boards)


def marker_shifted(seen: Seen, number: int, since: str, change) -> Seen:
    """A marker that moved on the robot before a stop."""
    order = list(seen.stops)
    place = seen.layout.index(number)
    points = marker_corners(float(seen.layout.sides[place]))
    T_robot_marker = seen.layout.T_robot_marker[place]
    first = {stop: T for (_, stop), T in reversed(list(seen.T_gtv_robot.items()))}

    def shifted(view, camera, stop):
        if view.number != number or order.index(stop) < order.index(since):
            return view
        i = seen.names.index(camera)
        T = seen.T_gtv_camera[i].inv() * first[stop]
        lens = seen.cameras[i].parameters
        was = project((T * T_robot_marker).apply(points), lens)
        now = project((T * perturbed(T_robot_marker, change)).apply(points), lens)
        return replace(view, corners=view.corners + now - was)

    stops = {
        stop: [replace(s, views=tuple(shifted(v, s.camera, stop) for v in s.views)) for s in listed]
        for stop, listed in seen.stops.items()
    }
    return replace(seen, stops=stops)


def stops_exchanged(seen: Seen, camera: str, a: str, b: str) -> Seen:
    """Images of two stops of one camera, each under the other's name."""
    own = {s: next(o for o in seen.stops[s] if o.camera == camera) for s in (a, b)}
    other = {a: b, b: a}
    stops = {
        stop: [own[other[stop]] if stop in other and s.camera == camera else s for s in listed]
        for stop, listed in seen.stops.items()
    }
    at = {
        (c, other[s] if c == camera and s in other else s): T
        for (c, s), T in seen.T_gtv_robot.items()
    }
    return replace(seen, stops=stops, T_gtv_robot=at)
