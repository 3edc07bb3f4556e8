"""What the façade gives: frozen, short at a prompt, a table in a notebook."""

import dataclasses
import inspect
import re
from html.parser import HTMLParser

import numpy as np
import pytest

import gtval
import gtval.testing as samples


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """One result of every kind, by the name of its type."""
    drive, scans, images = (
        samples.make_drive(tmp_path_factory.mktemp("drive")),
        samples.make_scans(),
        samples.make_images(),
    )
    offsets = gtval.find_offsets(drive.records)
    room = samples.make_room(tmp_path_factory.mktemp("room"), seed=2, bias=(0.1, 0.0, 0.0))
    done = gtval.run_campaign(room.folder)
    survey, rig = done.tables
    errors = gtval.compare(survey, rig)
    made = [
        *(survey, drive, scans, images, offsets, room, errors, done),
        *(samples.make_motion(minutes=0.5), samples.make_survey(), samples.make_fixes(loops=1)),
        gtval.load_campaign(room.folder),
        gtval.explain(survey, rig),
        gtval.findings(errors)[0],
        gtval.solve_survey(**room.survey),
        gtval.match_scans(scans.scans[0], scans.scans[1], scans.guesses[0]),
        gtval.locate_markers(images.images[0], images.camera, images.sides, images.family)[0],
        gtval.find_path(drive.records, offsets, drive.heights),
        *(scans.scans[0], images.camera, drive.records[0]),
    ]
    motion = samples.make_motion(minutes=2)
    camera = motion.cameras["camera_2"]
    clocks = gtval.sync(motion.reference, camera)
    made += [motion.reference, clocks, clocks["camera_2"], gtval.fuse([camera])]
    made += [
        gtval.compare_in_time(motion.reference, camera),
        gtval.find_standstills(motion.reference)[0],
    ]
    made.append(gtval.explain_in_time(motion.reference, camera))
    gtval.write_run(done)
    made += [gtval.summarise([room.folder]), gtval.control_chart(np.zeros(6) + np.arange(6) % 2)]
    return {type(one).__name__: one for one in made}


def test_there_is_a_result_of_every_type_of_the_facade(results):
    types = {name for name in gtval.__all__ if inspect.isclass(getattr(gtval, name))}
    types |= {name for name in dir(samples) if name.startswith("Sample")}
    assert types - set(results) == {"GtvalError", "InputError"}


def test_results_are_frozen(results):
    for name, one in results.items():
        first = dataclasses.fields(one)[0].name
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(one, first, None)
        assert dataclasses.is_dataclass(one), name


def test_arrays_of_a_pose_table_cannot_be_changed_and_are_its_own():
    poses = np.zeros((2, 3))
    table = gtval.pose_table("rig", poses)
    poses[0, 0] = 5.0
    assert table.poses[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        table.poses[0, 0] = 5.0


def test_reprs_are_one_line_without_arrays(results):
    # A line of fields, not the thousands of numbers of a dataclass's own repr; camera and finding
    # have a handful of numbers or a sentence.
    for name, one in results.items():
        text = repr(one)
        assert text.startswith(f"{name}("), text
        if name not in {"Camera", "Finding"}:
            assert "\n" not in text
            assert len(text) < 500, text


def test_the_repr_tells_shapes_and_few_names():
    table = gtval.pose_table("rig", [[0.0, 0.0, 0.1]] * 5, sigmas=[0.1] * 3)
    assert repr(table).startswith("PoseTable(system='rig', ids=5 items, poses=(5, 3) array,")


class Cells(HTMLParser):
    """The tables of a page: their captions and cells; raises for what is not closed."""

    def __init__(self, page):
        super().__init__()
        self.open, self.captions, self.cells = [], [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, _attributes):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "caption":
            self.captions.append(data)
        if self.open and self.open[-1] in {"td", "th"}:
            self.cells.append(data)


@pytest.mark.parametrize(
    ("name", "captions"),
    [
        ("PoseTable", ["Poses of survey"]),
        ("Evaluation", ["Statistics of the errors of example_gt", "Poses of example_gt"]),
        ("RunResult", ["Errors of all systems (validation minus GT)"]),
        (
            "TimeComparison",
            [
                "Errors in time (reference minus source)",
                "Statistics of the errors of camera_2 in time",
            ],
        ),
        ("TimeExplanation", ["Findings", "Where the errors come from"]),
        ("Clocks", ["Clocks of the sources"]),
        ("ClockEstimate", ["Clocks of the sources"]),
        ("Explanation", ["Findings", "example_gt: parameters of 'frame'"]),
    ],
)
def test_a_notebook_shows_tables(results, name, captions):
    page = Cells(results[name]._repr_html_())
    assert page.captions[: len(captions)] == captions
    assert len(page.cells) > 10


def test_html_of_poses_has_every_number():
    table = gtval.pose_table("rig", [[0.1234, -2.0, 0.5]], ids=["<7>"], sigmas=[0.002, 0.003, 0.1])
    cells = Cells(table._repr_html_()).cells
    assert cells[7:] == ["<7>", "0.1234", "-2.0000", "0.5000", "0.0020", "0.0030", "0.1000"]


def test_a_long_table_tells_how_many_poses_are_not_shown():
    page = gtval.pose_table("rig", np.zeros((130, 3)))._repr_html_()
    assert len(re.findall("<tr>", page)) == 101
    assert "30 more poses are not shown." in page


def test_a_result_without_a_form_shows_its_line(results):
    assert results["Match"]._repr_html_() is None
