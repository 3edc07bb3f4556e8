"""``gtval convert`` as a user runs it."""

import gzip
import json

import pytest
from click.testing import CliRunner

from validation.cli import main
from validation.commands.convert import FROM, TO
from validation.trajectories.formats import read_trajectory
from validation.trajectories.formats.reading import READERS
from validation.trajectories.formats.writing import FORMATS

TUM = "1403636579.763555527 1 2 3 0 0 0 1\n1403636579.813555456 1 2 4 0 0.6 0 0.8\n"


def run(*arguments):
    return CliRunner().invoke(main, ["convert", *map(str, arguments)])


def test_the_choices_are_the_formats():
    assert list(READERS) == FROM
    assert list(FORMATS) == TO


@pytest.mark.parametrize("form", TO)
def test_there_and_back(tmp_path, form):
    source, middle, back = tmp_path / "a.txt", tmp_path / "b.out", tmp_path / "c.csv"
    source.write_text(TUM)
    done = run(source, middle, "--to", form)
    assert done.exit_code == 0, done.output
    assert "2 poses (space) over 0.050 s, read as tum" in done.output
    if form == "mcap":
        middle = middle.rename(tmp_path / "b.mcap")
    times = ["--times", tmp_path / "b_times.out"] if form == "kitti" else []
    done = run(middle, back, *times)
    assert done.exit_code == 0, done.output
    before, after = read_trajectory(source), read_trajectory(back)
    assert after.times_since(before.epoch).tolist() == before.times.tolist()
    assert after.poses == pytest.approx(before.poses, abs=1e-12)


def test_scripts_get_all_that_was_told(tmp_path):
    (tmp_path / "a.tum").write_text(TUM)
    done = run(tmp_path / "a.tum", tmp_path / "a.kitti", "--json")
    told = json.loads(done.output)
    assert told["command"] == "convert"
    assert (told["read_as"], told["written_as"], told["poses"]) == ("tum", "kitti", 2)
    assert [name.rpartition("/")[2] for name in told["files"]] == ["a.kitti", "a_times.kitti"]
    assert told["provenance"]["unit_of_stamps"] == "s"


def test_what_is_lost_and_left_out_is_said(tmp_path):
    rows = [f"{k / 10},{k},0,0,1e-4,0,0,1e-4,0,1e-4\n" for k in range(100)]
    rows.insert(50, rows[49])
    header = "time,x,y,theta,xx,xy,xt,yy,yt,tt\n"
    (tmp_path / "a.csv").write_text(header + "".join(rows))
    done = run(tmp_path / "a.csv", tmp_path / "a.tum")
    assert "1 row repeated the stamp of another and was left out: line 52" in done.output
    assert "covariances are not written: tum has none" in done.output
    assert "written with z = 0" in done.output


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        ("time,x,y\n0,1,2\n1,1,2\n2,1,2\n", [], "--unit s, ms, us or ns"),
        ("time,x,y\n0,1,2\n0.1,1,z\n", [], "line 3, field 'y': 'z' — not a number"),
        ("1 0 0 1 0 1 0 2 0 0 1 3\n", [], "--times times.txt"),
        ("1e18,1,2,3,0,0,0,1\n", [], "--from tum or --from euroc"),
        ("hello\n", [], "no format of a trajectory fits"),
        (TUM, ["--from", "kitti"], "8 cells, not 12"),
        ("time,x,y\n0,1,2\n0.1,1,2\n", ["--to", "tum"], "without orientation"),
    ],
)
def test_an_error_leaves_no_file(tmp_path, content, options, said):
    source = tmp_path / "a.dat"
    source.write_text(content)
    done = run(source, tmp_path / "b.csv", *options)
    assert done.exit_code == 2
    assert said in done.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.dat"]


def test_a_rawlog_is_told_as_one_with_the_commands_that_read_it(tmp_path):
    source = tmp_path / "drive.rawlog"
    source.write_bytes(gzip.compress(b"\x93CObservationComment\x00\x88\x02\x00\x00\x00no\x88"))
    done = run(source, tmp_path / "b.csv")
    assert done.exit_code == 2
    said = " ".join(done.output.split())
    assert "this is a rawlog of MRPT" in said
    assert "`gtval laser drive`" in said
    assert "`gtval rtk`" in said
    assert "euroc" not in said


def test_reasons_that_are_alike_are_told_once(tmp_path):
    source = tmp_path / "a.dat"
    source.write_bytes(bytes(range(256)))
    done = run(source, tmp_path / "b.csv")
    assert done.output.count("this is a binary file, not text") == 1


def test_the_input_is_not_written_over(tmp_path):
    source = tmp_path / "a.csv"
    source.write_text("time,x,y\n0,1,2\n0.1,1,2\n")
    done = run(source, source)
    assert done.exit_code == 2
    assert "OUT is IN" in done.output
    assert source.read_text().startswith("time,x,y")
    assert run(source, tmp_path / "a.unknown").exit_code == 2
