"""Every finding has a subject, a code, and its size as a field where anything was measured."""

import ast

from blocks import REPOSITORY
from finding_codes import CODE_POSITION, PACKAGES, _argument, _calls, _values

from validation.results import Finding, Size, sentences

SUBJECT_POSITION, SIZES_POSITION = 2, 4
NOTHING_MEASURED = {
    # Files, names, entries and settings.
    *("no_provenance", "out_of_date", "unknown_system", "unexpected", "input_missing"),
    *("inputs_unknown", "no_validation", "without_survey", "not_comparable", "not_explained"),
    *("no_time_reference", "without_delay", "assumed_sigmas", "assumed_mount", "unit", "left_out"),
    *("published-poses", "set-aside", "recognised_not_used", "no_poses", "not_checked"),
    *("check_not_found", "heights_stated", "tolerated", "record", "motion_open", "plan"),
    *("extra_readings", "mount_unchecked", "drive_frame", "drive_no_loops", "steady"),
    *("one_clock", "unknown_camera", "errors_not_stated", "heading_open", "almanac"),
    *("part_missing", "odometry_not_laid", "day_unreadable", "day_without_results"),
    # That something cannot be known.
    *("nees_unavailable", "no_three_cornered_hat", "positions_only", "not_observable", "rivals"),
    *("clock_not_determinable", "compared_in_part", "scatter_only", "steadiness_unknown"),
    *("common_errors_open", "base_noise_open"),
    *("no_uncertainty", "no_correlation", "pose-open", "world-point-open", "m0"),
    *("no_angle_seen", "one_position", "ambiguous", "plan_ambiguous", "trajectory"),
    # A convention, an exchange or a state: there is one, or there is none.
    *("convention", "perhaps_degrees", "mirror", "camera_moved", "frame_fitted"),
}
"""Codes of findings in which no number is at stake, wherever they are made without a size."""


def made():
    """Of each place that makes a finding: file and line, subject, codes, sizes."""
    for package in PACKAGES:
        for path in sorted((REPOSITORY / package).rglob("*.py")):
            tree = ast.parse(path.read_text())
            place = path.relative_to(REPOSITORY).as_posix()
            for scope, call in _calls(tree, "Finding"):
                code = _argument(call, CODE_POSITION, "code")
                codes = set() if code is None else set(_values(code, scope, tree, place))
                subject = _argument(call, SUBJECT_POSITION, "subject")
                sizes = _argument(call, SIZES_POSITION, "sizes")
                yield f"{place}:{call.lineno}", subject, codes, sizes


def test_every_finding_has_a_subject_a_code_and_a_size_where_there_is_one():
    places = list(made())
    assert len(places) > 200
    assert [place for place, subject, codes, _ in places if subject is None or not codes] == []
    without = {code for _, _, codes, sizes in places if sizes is None for code in codes}
    assert without - NOTHING_MEASURED == set()
    # Nothing stands in the list that has its size everywhere by now.
    assert NOTHING_MEASURED - without == set()


def test_the_sentence_is_the_first_of_the_text():
    one = Finding("note", "Off by 3 mm. Turn it.", "rig", "odd", (Size("off", 0.003, "m"),))
    assert one.sentence == "Off by 3 mm."
    assert sentences(one.text) == ("Off by 3 mm.", "Turn it.")
