"""The survey's part of the report: tables and figures."""

from collections.abc import Iterator

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.campaign.result_files import adjusted_points
from survey.estimation.network import Network
from survey.estimation.robot_frames import RobotFrameFit
from survey.estimation.solve import SurveySolution
from survey.readings.levels import CRITICAL
from validation.poses.angles import wrap
from validation.results import APPENDIX, Section, Table, Text

MM = 1e3


def survey_sections(outcome: SurveyOutcome) -> list[Section]:
    """All sections; figures are added where the survey has something to draw."""
    from survey.campaign.figures import hand_pose_figure, solution_figures  # noqa: PLC0415

    sections = []
    solution = outcome.solution
    if solution is not None:
        figures = solution_figures(outcome)
        sections += [
            Section("Vframe", [*_frame_tables(solution)]),
            Section(
                "World points",
                [*_world_tables(outcome, solution), *figures["world points"]],
            ),
        ]
        if solution.poses:
            sections.append(
                Section("Robot frames", [pose_table(solution), *figures["robot frames"]])
            )
        sections.append(Section("Readings", [*_reading_tables(solution), *figures["readings"]]))
    appendix = readings_tables(solution, outcome) if solution is not None else []
    listings = listing_tables(outcome)
    if listings:
        sections.append(Section("The document's filters, as printed", listings))
    if outcome.poses is not None and outcome.inputs.evidence.guesses:
        sections.append(
            Section(
                "Hand against validation poses",
                [hand_table(outcome), *hand_pose_figure(outcome)],
            )
        )
    if appendix:
        sections.append(Section(f"{APPENDIX}: all readings", appendix))
    return sections


def _frame_tables(solution: SurveySolution) -> Iterator[Table]:
    positions, covariances = adjusted_points(solution, solution.vframe.names)
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    yield Table(
        "Vframe points after the joint adjustment",
        ("point", "x [m]", "y [m]", "sigma x [mm]", "sigma y [mm]"),
        [
            (name, *p, *(MM * s))
            for name, p, s in zip(solution.vframe.names, positions, sigma, strict=True)
        ],
        ("", ".4f", ".4f", ".1f", ".1f"),
    )
    if solution.vframe.checks:
        yield Table(
            "Is the frame what it should be?",
            ("test", "measured", "expected", "difference", "sigma", "p", "rests on"),
            [
                (
                    f"{check.name} [{check.unit}]",
                    check.measured,
                    check.expected,
                    check.measured - check.expected,
                    check.sigma,
                    check.p_value,
                    ", ".join(sorted(check.rests_on)),
                )
                for check in solution.vframe.checks
            ],
            ("", ".4f", ".4f", "+.4f", ".4f", ".2f", ""),
            note="Sigma of the difference if marks and readings are as good as stated. Rows that "
            f"rest on the same readings are one test: {len(solution.vframe.tests)} in all.",
        )


def world_table(solution: SurveySolution) -> Table:
    """World points with their standard deviations and the solution that was rejected."""
    rows = []
    adjusted, covariances = adjusted_points(solution, solution.world.names)
    for point, place, covariance in zip(solution.world.points, adjusted, covariances, strict=True):
        other = point.rejected
        rows.append(
            (
                point.name,
                *point.position,
                *(MM * np.sqrt(np.diagonal(point.covariance))),
                point.cost,
                point.redundancy,
                *(MM * (place - point.position)),
                *(MM * np.sqrt(np.diagonal(covariance))),
                None if other is None else f"({other.position[0]:.3f}, {other.position[1]:.3f})",
                None if other is None else other.cost,
            )
        )
    rows += [(p.name, *(None,) * 12) for p in solution.world.missing]
    return Table(
        "World points",
        (
            *("world point", "x [m]", "y [m]", "sigma x [mm]", "sigma y [mm]", "chi²"),
            *("redundancy", "joint dx [mm]", "joint dy [mm]", "joint sigma x [mm]"),
            *("joint sigma y [mm]", "rejected solution [m]", "its chi²"),
        ),
        rows,
        ("", ".6f", ".6f", ".1f", ".1f", ".1f", "", "+.1f", "+.1f", ".1f", ".1f", "", ".3g"),
        note=(
            "x, y by trilateration from the nominal Vframe, chi² of the point's own readings; "
            "'joint' is what the joint adjustment of all readings adds. The rejected solution is "
            "the best of the others that two circles offer."
            + (" Without x, y: see the findings." if solution.world.missing else "")
        ),
    )


def _table_from_marks(solution: SurveySolution) -> Table:
    """World points that only the joint adjustment has."""
    names = tuple(solution.from_marks)
    places, covariances = adjusted_points(solution, names)
    return Table(
        "World points located from the robot's marks as well",
        ("world point", "x [m]", "y [m]", "sigma x [mm]", "sigma y [mm]"),
        [
            (name, *place, *(MM * np.sqrt(np.diagonal(covariance))))
            for name, place, covariance in zip(names, places, covariances, strict=True)
        ],
        ("", ".6f", ".6f", ".1f", ".1f"),
        note="x, y of the joint adjustment: the Vframe alone does not give these points.",
    )


def _world_tables(outcome: SurveyOutcome, solution: SurveySolution) -> Iterator[Table | Text]:
    if solution.labelling.status == "unconfirmed":
        yield Text(
            "Not confirmed: these coordinates may be the mirror image of the truth. See the "
            "findings for what to measure."
        )
    yield world_table(solution)
    if solution.from_marks:
        yield _table_from_marks(solution)
    comparison = outcome.published
    if comparison is not None:
        where = dict(zip(solution.world.names, solution.world.positions, strict=True))
        yield Table(
            "Published against computed world points",
            ("world point", "x [m]", "y [m]", "dx [mm]", "dy [mm]", "verdict"),
            [
                (
                    name,
                    *(where[name] + d),
                    *(MM * d),
                    "does not follow from its readings" if bad else "follows",
                )
                for name, d, bad in zip(
                    comparison.names, comparison.difference, comparison.inconsistent, strict=True
                )
            ],
            ("", ".6f", ".6f", "+.3f", "+.3f", ""),
            note="x, y as published; dx, dy published minus computed from the readings.",
        )


def pose_table(solution: SurveySolution) -> Table:
    """Validation poses of the joint adjustment beside the single-pose ones."""
    table = solution.pose_table()
    single = {frame.pose: frame for frame in solution.frames}
    rows = []
    if table is not None:
        sigma = np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2))
        for name, pose, s in zip(table.ids, table.poses, sigma, strict=True):
            alone: RobotFrameFit | None = single.get(name)
            if alone is None:
                rows.append((name, *pose, *(MM * s), *(None,) * 5))
                continue
            off = np.append(MM * (alone.state[:2] - pose[:2]), MM * wrap(alone.state[2] - pose[2]))
            rows.append((name, *pose, *(MM * s), *off, alone.cost, alone.redundancy))
    return Table(
        "Validation poses",
        (
            *("pose", "x [m]", "y [m]", "theta [rad]"),
            *("sigma x [mm]", "sigma y [mm]", "sigma theta [mrad]"),
            *("alone dx [mm]", "alone dy [mm]", "alone dtheta [mrad]", "chi²", "redundancy"),
        ),
        rows,
        ("", ".4f", ".4f", ".4f", ".1f", ".1f", ".1f", "+.1f", "+.1f", "+.1f", ".1f", ""),
        note=(
            "Joint adjustment; 'alone' is the pose from its own readings and fixed world points "
            "minus the joint one."
        ),
    )


def hand_table(outcome: SurveyOutcome) -> Table:
    """Initial guesses by hand beside the validation poses, as the document prints them."""
    poses, guesses = outcome.poses, outcome.inputs.evidence.guesses
    rows = []
    if poses is not None:
        for name, pose in zip(poses.ids, poses.poses, strict=True):
            if name in guesses:
                hand = guesses[name]
                rows.append(
                    (name, *hand, *pose, *(pose[:2] - hand[:2]), float(wrap(pose[2] - hand[2])))
                )
    return Table(
        "Hand-measured and validation robot frames",
        (
            *("pose", "hand x [m]", "hand y [m]", "hand theta [rad]"),
            *("x [m]", "y [m]", "theta [rad]", "dx [m]", "dy [m]", "dtheta [rad]"),
        ),
        rows,
        ("", *(".4f",) * 6, *("+.4f",) * 3),
        note="d: validation minus hand.",
    )


def _reading_tables(solution: SurveySolution) -> Iterator[Table]:
    adjustment = solution.adjustment
    used, n = solution.used, len(solution.used)
    residual = MM * adjustment.residual[:n] * used.sigma
    yield Table(
        "Joint adjustment",
        ("quantity", "value"),
        [
            ("readings", n),
            ("observations in all", len(adjustment.residual)),
            ("unknowns", adjustment.jacobian.shape[1]),
            ("degrees of freedom", adjustment.degrees_of_freedom),
            ("m0", f"{adjustment.m0:.3f}"),
            ("rms residual of the readings [mm]", f"{np.sqrt(np.mean(residual**2)):.2f}"),
            *_weights(adjustment.network),
        ],
        note="m0 is that of all observations, each weighted by its standard deviation: the "
        "readings by theirs, which the file of checked readings holds, the others by those above.",
    )
    worst = np.argsort(-np.nan_to_num(np.abs(solution.reliability.w)))[:15]
    yield Table(
        "Readings with the largest test values",
        (
            *("reading", "line", "distance [m]", "residual [mm]", "redundancy"),
            *("w", "smallest blunder found [mm]"),
        ),
        [
            (
                f"{used.start[i]}–{used.end[i]}",
                used.line[i],
                used.distance[i],
                residual[i],
                adjustment.redundancy[i],
                solution.reliability.w[i],
                MM * solution.reliability.minimal_detectable[i]
                if np.isfinite(solution.reliability.minimal_detectable[i])
                else None,
            )
            for i in worst
        ],
        ("", "", ".3f", "+.1f", ".2f", "+.2f", ".1f"),
        note=f"|w| above {CRITICAL} happens by chance once in a thousand readings.",
    )


def _weights(network: Network) -> Iterator[tuple[str, str]]:
    """How many observations there are besides the readings, and their standard deviations."""
    for what, count, sigma in (
        ("coordinates of Vframe points", 2 * len(network.fixed), network.nominal_sigma),
        ("coordinates of marks in the robot frame", 2 * len(network.mark), network.marking_sigma),
        ("coordinates of rig points", 2 * len(network.rig_names), network.rig_sigma),
        ("sides of the rig", len(network.side_length), network.side_sigma),
    ):
        if count:
            yield f"{what}: number, sigma [mm]", f"{count}, {MM * sigma:.3g}"


def readings_tables(solution: SurveySolution, outcome: SurveyOutcome) -> list[Table]:
    """All readings used, as they stand in the room: world points by Vframe point, and by mark.

    AD2.3, "Table with the measures of each world-point from the 4 Vframe points".
    """
    used, labels = solution.used, outcome.inputs.settings.labels
    cells: dict[tuple[str, str], list[str]] = {}
    for a, b, distance in zip(used.start, used.end, used.distance, strict=True):
        for pair in ((a, b), (b, a)):
            cells.setdefault(pair, []).append(f"{distance:.3f}")
    world = [name for name in outcome.inputs.settings.world_points if any(name in c for c in cells)]
    typed = {name: labels.get(name, name) for name in solution.vframe.names}
    other = ", ".join(f"{a} stands for {b}" for a, b in typed.items() if a != b)
    tables = [
        Table(
            "Distances from the world points to the Vframe points [m]",
            ("world point", *typed),
            [(w, *(" ".join(cells.get((w, v), [])) for v in typed.values())) for w in world],
            note=f"Columns as written in the file; {other}." if other else "",
        )
    ]
    marks = [name for name in dict.fromkeys(used.start + used.end) if "/" in name]
    if marks:
        rows = [(m, *(" ".join(cells.get((m, w), [])) for w in world)) for m in marks]
        head = ("mark", *world)
        tables.append(Table("Distances from the marks to the world points [m]", head, rows))
    return tables


def listing_tables(outcome: SurveyOutcome) -> list[Table]:
    """World points and robot frames by the document's filters; none where not asked for."""
    solution, literal = outcome.solution, outcome.as_published
    if solution is None or literal is None:
        return []
    points, starts = [], []
    for point in solution.world.points:
        starts.append(
            (
                point.name,
                literal.lost_from_origin[point.name],
                literal.own_from_origin[point.name],
            )
        )
        listed = literal.world[point.name]
        off, sigma = listed.x - point.position, np.sqrt(np.diagonal(listed.P))
        points.append((point.name, *listed.x, *(MM * off), *(MM * sigma)))
    frames = []
    for frame in solution.frames:
        listed = literal.frames[frame.pose]
        off, sigma = listed.x - frame.state, np.sqrt(np.diagonal(listed.P))
        off[2] = wrap(off[2])
        frames.append((frame.pose, *listed.x, *(MM * off), *(MM * sigma)))
    origin = Table(
        "Started at the Vframe's origin: how far from the world point the filters end",
        ("world point", "the document's [m]", "this program's [m]"),
        starts,
        ("", ".2g", ".2g"),
        note="The document gave up this start, as its filter did not always converge from there.",
    )
    listed_tables = [
        Table(
            "World points by the document's listing",
            (
                *("world point", "x [m]", "y [m]"),
                *("dx [mm]", "dy [mm]", "its sigma x [mm]", "its sigma y [mm]"),
            ),
            points,
            ("", ".6f", ".6f", "+.3f", "+.3f", ".1f", ".1f"),
            note="d: listing minus this program's world point, before the joint adjustment.",
        ),
        Table(
            "Robot frames by the document's listing",
            (
                *("pose", "x [m]", "y [m]", "theta [rad]"),
                *("dx [mm]", "dy [mm]", "dtheta [mrad]"),
                *("its sigma x [mm]", "its sigma y [mm]", "its sigma theta [mrad]"),
            ),
            frames,
            ("", ".4f", ".4f", ".4f", "+.2f", "+.2f", "+.2f", ".1f", ".1f", ".1f"),
            note=(
                "R as printed: not squared, so its standard deviations are far too large. "
                "d: listing minus this program's single-pose filter."
            ),
        ),
    ]
    return [*listed_tables[: 2 if frames else 1], origin]


def overview_tables(outcome: SurveyOutcome) -> list[Table]:
    """What a terminal shows of a survey: world points, validation poses, and the listings."""
    solution = outcome.solution
    if solution is None:
        return []
    poses = [pose_table(solution)] if solution.poses else []
    return [world_table(solution), *poses, *listing_tables(outcome)]
