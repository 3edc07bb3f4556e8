"""The table check of a campaign: images and earlier results to readings."""

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.pose_table import from_csv
from vision_gt.campaign.inputs import made_board
from vision_gt.images.files import images_of_poses
from vision_gt.images.jobs import BoardJob, detect_all
from vision_gt.network.stored import read_network
from vision_gt.network.table_check import TableReading, check_table
from vision_gt.settings import VisionSettings


def table_readings(campaign: Campaign, workers: int | None = None) -> list[TableReading]:
    """Boards on the table, found in the images of vision/table, beside the validation poses.

    Raises
    ------
    GtvalError
        If results or images are missing or bad.
    """
    settings = campaign.section("vision", VisionSettings)
    network = read_network(campaign.results)
    validation = from_csv(campaign.results / "poses_survey.csv", system="survey")
    folder = campaign.folder / settings.images / "table"
    images = images_of_poses(folder)
    board = made_board(settings.table.board)
    jobs = [
        (pose, BoardJob(path, camera, pose, [(0, board)], settings.detector))
        for camera, paths in images.items()
        for pose, path in paths.items()
    ]
    if not jobs:
        raise InputError([Problem(folder, "no images (CAMERA/poseX.png) of a board on a table")])
    unknown = sorted(set(images) - set(network.names))
    if unknown:
        raise GtvalError(f"{folder}: the results have no camera {', '.join(unknown)}")
    found = detect_all([job for _, job in jobs], workers)
    problems = [
        Problem(one.path, one.fault or "the board was not found")
        for one in found
        if one.fault or not one.boards
    ]
    if problems:
        raise InputError(problems)
    views = [(pose, one.boards[0]) for (pose, _), one in zip(jobs, found, strict=True)]
    table = settings.table
    return check_table(views, network, validation, (*table.corner, table.heading, table.height))
