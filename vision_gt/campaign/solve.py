"""From a campaign folder to robot poses: everything that the vision system does, in order."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.pose_table import PoseTable
from validation.systems import Progress, no_progress
from vision_gt.campaign.inputs import known_reference, made_board, placed
from vision_gt.campaign.outcome import StopPose, VisionOutcome
from vision_gt.campaign.pose_tables import chosen_pose, counting, pose_table, published_table
from vision_gt.choices import Choices
from vision_gt.images.files import CampaignImages, campaign_images
from vision_gt.images.jobs import BoardJob, Found, Job, MarkerJob, detect_all
from vision_gt.images.markers import Detection
from vision_gt.network.adjustment import Bar, Network
from vision_gt.network.intrinsics import Calibration, calibrate
from vision_gt.network.solution import NetworkInput, NetworkSolution, solve_network
from vision_gt.optics.camera import Camera
from vision_gt.optics.camera_files import read_cameras
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.robot.layout import Frame, Layout, LayoutFit, fit_layout
from vision_gt.robot.robot_pose import (
    Floor,
    Sighting,
    published_pose,
    robot_pose,
)
from vision_gt.settings import VisionSettings
from vision_gt.steadiness_run import camera_steadiness


def solve_campaign(
    campaign: Campaign, progress: Progress = no_progress, choices: Choices | None = None
) -> VisionOutcome:
    """Cameras, markers and robot poses of a campaign.

    Parameters
    ----------
    campaign : Campaign
        With images below its [vision] folder.
    progress : callable
        Told what is being done.
    choices : Choices, optional
        Of the command line.

    Raises
    ------
    GtvalError
        If files are bad, or do not determine cameras, markers or poses.
    """
    choices = choices or Choices()
    settings = choices.applied(campaign.section("vision", VisionSettings))
    run = _Run(campaign, settings, campaign_images(campaign.folder / settings.images), progress)
    run.workers = choices.workers
    return run.solve()


class _Run:
    """One campaign's way through the steps."""

    def __init__(
        self,
        campaign: Campaign,
        settings: VisionSettings,
        images: CampaignImages,
        progress: Progress,
    ) -> None:
        self.campaign, self.settings, self.images = campaign, settings, images
        self.progress = progress
        self.workers: int | None = None
        self.family = Family(settings.markers.family, settings.markers.border)
        self.oddities: list[tuple[str, str]] = []
        self.names = tuple(settings.cameras) or tuple(images.poses)

    def solve(self) -> VisionOutcome:
        """All steps."""
        self._check_images()
        boards = self._detect_boards()
        calibrations, cameras = self._cameras(boards)
        solution = self._network(boards, calibrations, cameras)
        by_name = {**cameras, **{c.name: c for c in solution.network.cameras}}
        frames, detections = self._detect_markers(by_name)
        layout = self._layout(frames, by_name)
        self.progress("poses", 0.9)
        stops = self._stops(detections, solution.network, layout.layout)
        published = (
            self._published(solution, layout, by_name) if self.settings.as_published else None
        )
        return VisionOutcome(
            self.settings,
            calibrations,
            solution,
            layout,
            stops,
            detections,
            pose_table(stops, solution.network, layout.layout),
            published,
            camera_steadiness(self.names, self.images, boards, by_name),
            tuple(self.oddities),
        )

    def _check_images(self) -> None:
        """Raise for cameras without what they need."""
        folder = self.campaign.folder / self.settings.images
        problems = [
            Problem(
                folder / "calibration" / name,
                f"camera {name} has neither calibration images nor an entry in vision.camera_files",
            )
            for name in self.names
            if name not in self.images.calibration and name not in self.settings.camera_files
        ]
        if not self.images.reference:
            problems.append(
                Problem(folder / "reference", "no image of the reference pattern (CAMERA.png)")
            )
        if not self.images.movie:
            problems.append(
                Problem(folder / "layout", "no movie around the robot (layout/CAMERA/*.png)")
            )
        problems += [
            Problem(path, f"there is no camera '{name}' ({', '.join(self.names)})")
            for name, path in self.images.reference.items()
            if name not in self.names
        ]
        if problems:
            raise InputError(problems)

    # ---- boards -------------------------------------------------------------------------

    def _detect_boards(self) -> dict[str, list[BoardView]]:
        """Views of all boards, by what the image was taken for."""
        jobs = self._board_jobs()
        found = detect_all(
            [job for _, job in jobs],
            self.workers,
            lambda share: self.progress("looking for boards", 0.45 * share),
        )
        self._raise_faults(found)
        views: dict[str, list[BoardView]] = {}
        sizes: dict[str, dict[tuple[int, int], Path]] = {}
        for (purpose, job), one in zip(jobs, found, strict=True):
            self._note(one, "the board")
            sizes.setdefault(job.camera, {}).setdefault(one.size, one.path)
            views.setdefault(purpose, []).extend(one.boards)
            if not one.boards and not one.note:
                self.oddities.append((self._shown(one.path), "the board was not found"))
        self._check_sizes(sizes)
        self.sizes = {camera: next(iter(by_size)) for camera, by_size in sizes.items()}
        return views

    def _board_jobs(self) -> list[tuple[str, BoardJob]]:
        settings, images = self.settings, self.images
        single = [(0, made_board(settings.board))]
        bar = self._bar_boards()
        reference = [(0, made_board(settings.reference.board))]
        kind = settings.detector
        jobs = [
            (
                "calibration",
                BoardJob(path, camera, f"calibration/{camera}/{path.stem}", single, kind),
            )
            for camera, paths in images.calibration.items()
            for path in paths
            if camera not in settings.camera_files
        ]
        for snapshot in images.network:
            for camera, path in snapshot.images.items():
                boards = self._boards_for(camera, list(snapshot.images), bar)
                jobs.append(("network", BoardJob(path, camera, snapshot.name, boards, kind)))
        jobs += [
            ("bar", BoardJob(path, camera, f"bar/{path.stem}", bar, kind))
            for camera, path in images.bar
        ]
        jobs += [
            ("reference", BoardJob(path, camera, "reference", reference, kind))
            for camera, path in images.reference.items()
        ]
        for purpose, folder in (("before", images.before), ("after", images.after)):
            jobs += [
                (purpose, BoardJob(path, camera, purpose, single, kind))
                for camera, path in folder.items()
            ]
        return jobs

    def _bar_boards(self) -> list[tuple[int, Board]]:
        bar = self.settings.bar
        return [(0, made_board(bar.first)), (1, made_board(bar.second))]

    def _boards_for(
        self, camera: str, pair: Sequence[str], bar: list[tuple[int, Board]]
    ) -> list[tuple[int, Board]]:
        """Which boards a camera may see: both where ids tell them apart, else its own."""
        if all(board.family is not None for _, board in bar):
            return bar
        for first, second in self.settings.bar.pairs:
            if {first, second} == set(pair):
                return [bar[0] if camera == first else bar[1]]
        order = [name for name in self.names if name in pair]
        return [bar[0] if order and camera == order[0] else bar[1]]

    def _note(self, found: Found, what: str) -> None:
        """Remember what is odd about an image."""
        said = {
            "blank": "blank: nothing but noise (a covered lens, no light?)",
            "mirrored": f"{what} is only found in the mirror image: the print, or the image, is "
            "mirrored",
        }
        if found.note:
            self.oddities.append((self._shown(found.path), said[found.note]))

    def _shown(self, path: Path) -> str:
        return str(path.relative_to(self.campaign.folder))

    def _raise_faults(self, found: Sequence[Found]) -> None:
        faults = [Problem(one.path, one.fault) for one in found if one.fault]
        if faults:
            raise InputError(faults)

    def _check_sizes(self, sizes: Mapping[str, Mapping[tuple[int, int], Path]]) -> None:
        """Raise where one camera's images differ in size."""
        problems = []
        for camera, by_size in sizes.items():
            (usual, example), *others = by_size.items()
            problems += [
                Problem(
                    path,
                    f"{size[0]} x {size[1]} pixels, but {example.name} of camera {camera} has "
                    f"{usual[0]} x {usual[1]}",
                )
                for size, path in others
            ]
        if problems:
            raise InputError(problems)

    # ---- cameras ------------------------------------------------------------------------

    def _cameras(
        self, boards: Mapping[str, Sequence[BoardView]]
    ) -> tuple[dict[str, Calibration], dict[str, Camera]]:
        """Intrinsic parameters of all cameras, from files or from images."""
        calibrations: dict[str, Calibration] = {}
        cameras: dict[str, Camera] = {}
        faults = []
        wanted = [*self.names, *(name for name in self.images.movie if name not in self.names)]
        for number, name in enumerate(wanted):
            self.progress(f"calibrating camera {name}", 0.45 + 0.1 * number / len(wanted))
            try:
                if name in self.settings.camera_files:
                    cameras[name] = self._camera_from_file(name)
                    continue
                views = [v for v in boards.get("calibration", ()) if v.camera == name]
                calibrations[name] = self._calibrated(name, views)
                cameras[name] = calibrations[name].camera
            except GtvalError as error:
                faults.append(str(error))
        if faults:
            raise GtvalError("\n".join(faults))
        return calibrations, cameras

    def _camera_from_file(self, name: str) -> Camera:
        path = self.campaign.folder / self.settings.camera_files[name]
        found = read_cameras(path)
        chosen = next((c for c in found if c.name == name), found[0] if len(found) == 1 else None)
        if chosen is None:
            names = ", ".join(c.name for c in found)
            raise InputError([Problem(path, f"it has no camera '{name}' (it has {names})")])
        size = self.sizes.get(name, chosen.size)
        if size != chosen.size:
            raise InputError(
                [
                    Problem(
                        path,
                        f"made for {chosen.size[0]} x {chosen.size[1]} pixels, but the images of "
                        f"camera {name} have {size[0]} x {size[1]}",
                    )
                ]
            )
        return replace(chosen, name=name)

    def _calibrated(self, name: str, views: Sequence[BoardView]) -> Calibration:
        images = self.images.calibration.get(name, ())
        board = made_board(self.settings.board)
        if images and not views:
            raise GtvalError(
                f"camera {name}: none of its {len(images)} calibration images shows a board of "
                f"{board.columns} x {board.rows} squares; count the squares (not the inner "
                "corners) of yours and correct vision.board"
            )
        return calibrate(name, self.sizes[name], views)

    def _network(
        self,
        boards: Mapping[str, Sequence[BoardView]],
        calibrations: Mapping[str, Calibration],
        cameras: Mapping[str, Camera],
    ) -> NetworkSolution:
        """The network; calibration images take part in its adjustment."""
        self.progress("adjusting the camera network", 0.55)
        settings = self.settings
        names = self.names
        chosen = [v for name in names if name in calibrations for v in calibrations[name].views]
        origin = settings.reference.origin_near
        given = NetworkInput(
            cameras=tuple(cameras[name] for name in names),
            snapshots=tuple(v for v in boards.get("network", ()) if v.camera in names),
            both=tuple(v for v in boards.get("bar", ()) if v.camera in names),
            reference=tuple(boards.get("reference", ())),
            calibration=tuple(chosen) if len(calibrations) >= len(names) else (),
            bar=Bar(placed(settings.bar.second_on_first), np.array(settings.bar.sigmas)),
            known_reference=known_reference(settings),
            origin_near=None if origin is None else np.array(origin),
        )
        return solve_network(given, joint=not settings.averaged_network)

    # ---- markers ------------------------------------------------------------------------

    def _marker_job(self, path: Path, camera: Camera | None) -> MarkerJob:
        return MarkerJob(path, self.family, tuple(self.settings.markers.side_of), camera)

    def _detect_markers(
        self, cameras: Mapping[str, Camera]
    ) -> tuple[list[tuple[str, Frame]], dict[tuple[str, str], Detection]]:
        """Markers in the movie, and in the images of the stops by camera and stop."""
        movie = [(name, path) for name, paths in self.images.movie.items() for path in paths]
        stops = [
            (name, pose, path)
            for name in self.names
            for pose, path in self.images.poses.get(name, {}).items()
        ]
        jobs: list[Job] = [self._marker_job(path, cameras[name]) for name, path in movie]
        jobs += [self._marker_job(path, cameras[name]) for name, _, path in stops]
        found = detect_all(
            jobs,
            self.workers,
            lambda share: self.progress("looking for markers", 0.65 + 0.2 * share),
        )
        self._raise_faults(found)
        for one in found:
            self._note(one, "the marker")
            for number in one.markers.duplicates:
                self.oddities.append(
                    (self._shown(one.path), f"marker {number} is seen twice; neither is used")
                )
        frames = [
            (name, Frame(path.stem, one.markers.views))
            for (name, path), one in zip(movie, found, strict=False)
        ]
        detections = {
            (name, pose): one.markers
            for (name, pose, _), one in zip(stops, found[len(movie) :], strict=True)
        }
        return frames, detections

    def _layout(
        self, frames: Sequence[tuple[str, Frame]], cameras: Mapping[str, Camera]
    ) -> LayoutFit:
        """The layout from the camera that took most of the movie."""
        self.progress("marker layout", 0.87)
        taken = [name for name, _ in frames]
        camera = max(dict.fromkeys(taken), key=taken.count)
        markers = self.settings.markers
        dima = (
            markers.dima,
            placed(markers.dima_on_robot),
            np.diag(np.square(markers.dima_sigmas)),
        )
        own = [frame for name, frame in frames if name == camera]
        return fit_layout(own, cameras[camera], markers.side_of, dima)

    # ---- poses --------------------------------------------------------------------------

    def _stops(
        self, detections: Mapping[tuple[str, str], Detection], network: Network, layout: Layout
    ) -> tuple[StopPose, ...]:
        """Poses of all stops."""
        floor = self.settings.floor
        bound = Floor(floor.height, floor.tilt) if self.settings.on_floor else None
        names = dict.fromkeys(pose for images in self.images.poses.values() for pose in images)
        stops = []
        for pose in sorted(names, key=counting):
            sightings = [
                Sighting(camera, detection.views)
                for (camera, stop), detection in detections.items()
                if stop == pose and detection.views
            ]
            single = {s.camera: robot_pose([s], network, layout, bound) for s in sightings}
            by_camera = {name: found for name, found in single.items() if found is not None}
            chosen = chosen_pose(
                sightings, by_camera, self.settings.merge_cameras, network, layout, bound
            )
            stops.append(StopPose(pose, by_camera, chosen))
        return tuple(stops)

    def _published(
        self, solution: NetworkSolution, layout: LayoutFit, cameras: Mapping[str, Camera]
    ) -> PoseTable | None:
        """The document's way: stock corners, averaged network and layout, single markers."""
        jobs: list[Job] = []
        owners = []
        for name in self.names:
            for pose, path in self.images.poses.get(name, {}).items():
                jobs.append(replace(self._marker_job(path, cameras[name]), refinement="none"))
                owners.append((pose, name))
        found = detect_all(jobs, self.workers)
        numbers = layout.layout.numbers
        chained = Layout(
            numbers, layout.layout.sides, layout.chained, np.zeros((6 * len(numbers),) * 2)
        )
        by_pose: dict[str, list[tuple[str, RigidTransform]]] = {}
        network = solution.averaged
        for (pose, name), one in zip(owners, found, strict=True):
            if one.markers.views:
                i = network.index(name)
                T = published_pose(
                    Sighting(name, one.markers.views),
                    network.cameras[i],
                    network.T_gtv_camera[i],
                    chained,
                )
                if T is not None:
                    by_pose.setdefault(pose, []).append((name, T))
        return published_table(by_pose)
