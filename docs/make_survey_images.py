"""The pictures and numbers of survey.md, made by gtval itself: run `make images` after a change."""

import sys
from pathlib import Path

import numpy as np

from data_samples.rooms.rooms import Room, RoomSettings, make_room
from data_samples.rooms.simulate import SimulatedCampaign, SimulationSettings, simulate_survey
from survey.estimation.adjustment import Adjustment
from survey.estimation.geometry import mirror_in_line
from survey.estimation.solve import SurveySolution, solve_survey
from survey.figures.maps import Places, survey_map
from survey.figures.maps import Room as DrawnRoom
from survey.figures.residuals import residual_figure
from survey.figures.studies import convergence_map, instrument_figure, planning_map
from survey.studies.accuracy import detectable_motion
from survey.studies.convergence import explore_convergence
from survey.studies.convergence_problems import unknowns_of
from survey.studies.instrument_check import check_instrument
from survey.studies.planning import (
    best_extra_readings,
    diagonal_blocks,
    planned_adjustment,
    planned_readings,
    repeated_stop_covariance,
    world_names,
)
from validation.campaign.folder import Instrument, RobotFrame, Vframe
from validation.figures.writing import write_figure
from validation.poses.angles import Array

IMAGES = Path(__file__).parent / "images"
INSTRUMENT = Instrument(setup_sigma=0.002)
RIG = RobotFrame(shape_sigma=0.001, sides={"O-X": 0.6, "O-Y": 0.4, "X-Y": 0.7211})
STOPS = {
    "1": np.array([-1.0, -1.0, 0.3]),
    "2": np.array([3.0, 0.0, 2.0]),
    "3": np.array([1.0, 3.0, -1.0]),
    "4": np.array([-1.5, 5.0, 0.5]),
    "5": np.array([3.0, 6.0, 3.0]),
    "6": np.array([1.2, 1.2, 0.0]),
}
CORNERS = np.array([[-3.0, -2.0], [4.0, -2.0], [4.0, 8.0], [-3.0, 8.0]])


def all_around(count: int) -> dict[str, Array]:
    """World points at equal steps along the walls of a room of 7 m by 10 m."""
    sides = np.linalg.norm(np.roll(CORNERS, -1, axis=0) - CORNERS, axis=1)
    ends = np.append(0.0, np.cumsum(sides))
    at = (np.arange(count) + 0.5) * ends[-1] / count
    closed = np.append(CORNERS, CORNERS[:1], axis=0)
    places = np.stack([np.interp(at, ends, closed[:, i]) for i in range(2)], axis=-1)
    return {str(i + 1): place for i, place in enumerate(places)}


def one_wall(count: int) -> dict[str, Array]:
    """World points along the far short wall only."""
    across = -3.0 + 7.0 * (np.arange(count) + 0.5) / count
    return {str(i + 1): np.array([x, 8.0]) for i, x in enumerate(across)}


def planned(world: dict[str, Array], pole: float = 2.5) -> Adjustment:
    """The joint adjustment that a plan will have."""
    vframe = Vframe(pole_length=pole)
    readings = planned_readings(vframe, RIG, world, STOPS, INSTRUMENT)
    return planned_adjustment(vframe, RIG, world, STOPS, readings)


def print_plans() -> None:
    """Print the table of survey.md."""
    plans = [(f"{n} all around", all_around(n), 2.5) for n in (4, 6, 8, 12, 16, 32)]
    plans += [(f"{n} on one wall", one_wall(n), 2.5) for n in (8, 16)]
    plans += [(f"16 all around, poles of {a} m", all_around(16), a) for a in (1.5, 4.0)]
    lines = ["| world points | readings a stop | worst σ [mm] | shift seen [mm] | turn seen [°] |"]
    for name, world, pole in plans:
        found = planned(world, pole)
        blocks = diagonal_blocks(found, found.pose_rows(list(STOPS)), 3)
        sigma = 1e3 * np.sqrt(np.linalg.eigvalsh(blocks[:, :2, :2]).max())
        motions = np.array([repeated_stop_covariance(found, stop) for stop in STOPS])
        least = detectable_motion(motions)
        shift, turn = 1e3 * least.any_direction.max(), np.degrees(least.components[:, 2].max())
        lines.append(f"| {name} | {3 * len(world)} | {sigma:.1f} | {shift:.1f} | {turn:.2f} |")
    sys.stdout.write("\n".join(lines) + "\n")


def closed(corners: Array) -> list[tuple[float, float]]:
    """Corners as a line that comes back to the first."""
    return [(float(x), float(y)) for x, y in (*corners, corners[0])]


def drawn_room(room: Room) -> DrawnRoom:
    """What maps show of a simulated room."""
    walls = [closed(line) for line in (room.outline, *room.obstacles)]
    return DrawnRoom(list(room.vframe.points.items()), walls=walls)


def draw_planning() -> None:
    """survey_one_wall.png and survey_all_around.png: as many points, badly and well placed."""
    room = DrawnRoom(list(Vframe().points.items()), walls=[closed(CORNERS)])
    for name, world in (("one_wall", one_wall(8)), ("all_around", all_around(8))):
        found = planned(world)
        place = dict(zip(found.network.points, found.parameters.points, strict=True))
        names = world_names(found)
        points = Places(
            names,
            np.array([place[n] for n in names]),
            diagonal_blocks(found, found.point_rows(names), 2),
        )
        stops = list(STOPS)
        frames = Places(
            stops, found.parameters.poses, diagonal_blocks(found, found.pose_rows(stops), 3)
        )
        extra = best_extra_readings(found, INSTRUMENT, count=3)
        lines = [(str(i), place[e.start], place[e.end]) for i, e in enumerate(extra, 1)]
        write_figure(IMAGES / f"survey_{name}.png", planning_map(room, points, frames, lines))


def draw_mirror(room: Room, solution: SurveySolution) -> None:
    """survey_mirror.png: the room, and its image when X and Y are exchanged."""
    positions = solution.world.positions
    mirrored = mirror_in_line(positions, np.array([[0.0, 0.0], [2.5, 2.5]]))
    unknown = np.full((len(positions), 2, 2), np.nan)
    figure = survey_map(
        DrawnRoom(drawn_room(room).vframe), Places(solution.world.names, positions, unknown)
    )
    axes = figure.axes[0]
    axes.set_title("▲ labels right   ○ X and Y exchanged: fits just as well", fontsize=10)
    axes.plot(*np.array([[-4.0, -4.0], [8.0, 8.0]]).T, ":", color="black", linewidth=1)
    axes.plot(*mirrored.T, "o", mfc="none", color="#D55E00", ms=6)
    for name, place in zip(solution.world.names, mirrored, strict=True):
        axes.annotate(name, place, (6, 4), textcoords="offset points", fontsize=7, color="#D55E00")
    write_figure(IMAGES / "survey_mirror.png", figure)


def draw_survey(room: Room, survey: SimulatedCampaign, solution: SurveySolution) -> None:
    """Maps, residuals and convergence of one simulated survey with two wrong readings."""
    adjustment = solution.adjustment
    names = solution.world.names
    place = dict(zip(adjustment.network.points, adjustment.parameters.points, strict=True))
    points = Places(
        names,
        np.array([place[name] for name in names]),
        diagonal_blocks(adjustment, adjustment.point_rows(names), 2),
    )
    table = solution.pose_table()
    if table is None:
        raise RuntimeError("the simulated survey gave no poses")
    write_figure(IMAGES / "survey_world_points.png", survey_map(drawn_room(room), points))
    frames = Places(table.ids, table.poses, table.covariances)
    write_figure(IMAGES / "survey_poses.png", survey_map(drawn_room(room), points, frames))
    used = solution.used
    labels = [f"{a} to {b}" for a, b in zip(used.start, used.end, strict=True)]
    residuals = residual_figure(used.distance, solution.reliability.w, labels)
    write_figure(IMAGES / "survey_residuals.png", residuals)
    draw_convergence(survey, solution)


def draw_convergence(survey: SimulatedCampaign, solution: SurveySolution) -> None:
    """survey_convergence.png: the pose with the most first guesses that fail."""
    rng = np.random.default_rng(1)
    unknowns = unknowns_of(solution, survey.readings, survey.robot_frame)
    explored = {
        unknown.name: explore_convergence(unknown.problem, unknown.solution, rng)
        for unknown in unknowns
        if unknown.kind == "pose"
    }
    name = min(explored, key=lambda pose: explored[pose].counts[0])
    figure = convergence_map(explored[name], f"pose {name}")
    write_figure(IMAGES / "survey_convergence.png", figure)


def draw_instrument() -> None:
    """survey_instrument.png: a laser whose origin is 2 mm off."""
    rng = np.random.default_rng(2)
    length = np.repeat(np.array([1.0, 2.0, 4.0, 6.0, 8.0, 10.0]), 2)
    reading = np.round(length + 0.002 + rng.normal(0, 0.0006, length.size), 3)
    check = check_instrument(length, reading, Instrument())
    figure = instrument_figure(length, reading, check, Instrument())
    write_figure(IMAGES / "survey_instrument.png", figure)


def main() -> None:
    """Write docs/images/survey_*.png and print the table of plans."""
    rng = np.random.default_rng(20080731)
    room = make_room(RoomSettings(stops=10), rng)
    survey = simulate_survey(room, SimulationSettings(blunders=2), rng)
    solution = solve_survey(room.vframe, survey.robot_frame, survey.readings, room.world_names)
    draw_planning()
    draw_mirror(room, solution)
    draw_survey(room, survey, solution)
    draw_instrument()
    print_plans()


if __name__ == "__main__":
    main()
