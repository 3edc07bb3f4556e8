"""`gtval explain` at the command line: files, campaigns, bad input."""

import json
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from explain_campaigns import simulate, table

from validation.cli import main
from validation.poses.pose_table import from_csv, to_csv


@pytest.fixture
def files(tmp_path):
    survey, rig = simulate("frame", 1)
    (tmp_path / "truth.csv").write_text(to_csv(survey))
    (tmp_path / "rig.csv").write_text(to_csv(rig))
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(main, ["explain", *(str(one) for one in arguments)])


def test_the_cause_is_printed_in_words(files):
    result = run(files / "truth.csv", files / "rig.csv")
    assert result.exit_code == 0, result.output
    assert "Explained by a wrong frame" in result.output


def test_json_holds_the_numbers(files):
    result = run(files / "truth.csv", files / "rig.csv", "--json")
    told = json.loads(result.output)
    one = told["systems"]["rig"]
    assert one["explanation"] == "frame"
    assert {p["name"] for p in one["parameters"]} == {"frame_x", "frame_y", "frame_theta"}
    assert one["candidates"][0]["name"] == "none"
    assert set(one["statistics"]) == {"before_all", "after_all", "before", "after"}


def test_corrected_poses_are_written_apart_with_their_provenance(files):
    before = (files / "rig.csv").read_bytes()
    result = run(files / "truth.csv", files / "rig.csv", "--output", files / "out")
    assert result.exit_code == 0, result.output
    assert (files / "rig.csv").read_bytes() == before
    corrected = from_csv(files / "out/explain/corrected_rig.csv", "rig")
    truth = from_csv(files / "truth.csv", "survey")
    assert np.abs(corrected.poses[:, :2] - truth.poses[:, :2]).mean() < 0.012
    assert all("corrected: frame (frame_x=" in source for source in corrected.sources)
    assert corrected.has_covariance.all()
    assert (files / "out/explain/flagged.csv").read_text().startswith("pose,cell,source")


def test_figures_are_drawn_on_demand(files):
    result = run(files / "truth.csv", files / "rig.csv", "--output", files / "out", "--figures")
    assert result.exit_code == 0, result.output
    drawn = {path.name for path in (files / "out/explain").glob("*.svg")}
    assert drawn == {
        "explain_sources.svg",
        "explain_ellipses.svg",
        "explain_heading_rig.svg",
        "explain_arrows_rig.svg",
    }


def test_a_campaign_is_explained_with_its_own_table(ad23_folder, tmp_path):
    import shutil

    folder = tmp_path / "campaign"
    shutil.copytree(ad23_folder, folder)
    result = run(folder, "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.output)
    assert told["systems"]["laser_genetic"]["reference"] == "6"
    assert told["sensors"]["laser"]["same"] is True
    assert "hand" in told["noise"]
    assert (folder / "results/explain/corrected_laser_genetic.csv").is_file()
    # Corrected tables are not taken for a system in the next run.
    again = json.loads(run(folder, "--json").output)
    assert set(again["systems"]) == {"vision", "laser_genetic", "laser_scanmatch"}


def test_a_time_column_lets_a_time_offset_show(tmp_path):
    rng = np.random.default_rng(2)
    t = np.linspace(0, 20, 50)

    def path(at):
        return np.column_stack([2 * np.cos(0.3 * at), 2 * np.sin(0.6 * at), 0.4 * at])

    noise = rng.normal(size=(2, 50, 3)) * 0.003
    (tmp_path / "truth.csv").write_text(to_csv(table("survey", path(t) + noise[0])))
    lines = ["pose,x,y,theta,time"]
    for row, (values, at) in enumerate(zip(path(t - 0.08) + noise[1], t, strict=True), 1):
        lines.append(f"{row},{','.join(map(str, values.tolist()))},{at}")
    (tmp_path / "rig.csv").write_text("\n".join(lines))
    result = run(tmp_path / "truth.csv", tmp_path / "rig.csv", "--json")
    told = json.loads(result.output)["systems"]["rig"]
    assert told["explanation"] == "time"
    [offset] = told["parameters"]
    assert offset["low"] < 0.08 < offset["high"]


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda text: text.replace("pose", "stop", 1), "column is missing"),
        (lambda _: "pose,x,y,theta\n" + "a,0,0,0\nb,1,1,1\n", "no pose id in common"),
        (
            lambda _: "pose,x,y,theta,xx,xy,xt,yy,yt,tt\n1,0,0,0,1,0,0,0,0,1\n",
            "a variance that is not positive",
        ),
        (
            lambda _: "pose,x,y,theta,xx,xy,xt,yy,yt,tt\n1,0,0,0,1,1,0,1,0,1\n",
            "not positive definite",
        ),
        (
            lambda _: "pose,x,y,theta\n1,0,0,90\n2,1,1,180\n3,1,2,-45\n",
            "looks like degrees; write radians: degrees times 0.0174533",
        ),
    ],
)
def test_bad_tables_end_in_a_plain_error(files, edit, said):
    path = files / "rig.csv"
    path.write_text(edit(path.read_text()))
    result = run(files / "truth.csv", path, "--output", files / "out")
    assert result.exit_code == 2
    assert said in result.output
    assert "Traceback" not in result.output
    assert not (files / "out").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--reference", "rig=99"), "reference pose 99 has no validation pose"),
        (("--reference", "other=1"), "system 'other', which is not there"),
        (("--reference", "rig"), "not of the form"),
        (("--shared-sensor", "laser=rig,other"), "shared by other"),
        (("--independent", "rig,other"), "other is not there"),
        (("--figures",), "--figures needs --output"),
    ],
)
def test_bad_options_end_in_a_plain_error(files, options, said):
    result = run(files / "truth.csv", files / "rig.csv", *options)
    assert result.exit_code == 2
    assert said in result.output


def test_copies_count_as_witnesses_of_their_own_only_where_that_is_stated(tmp_path):
    rng = np.random.default_rng(2)
    truth = np.column_stack([rng.uniform(-3, 3, (12, 2)), rng.uniform(-3, 3, 12)])
    rig = truth + rng.normal(0, 0.02, (12, 3))
    for name, poses in (("survey", truth), ("rig", rig), ("again", rig + 1e-6)):
        rows = "".join(f"{k},{x},{y},{t}\n" for k, (x, y, t) in enumerate(poses))
        (tmp_path / f"{name}.csv").write_text("pose,x,y,theta\n" + rows)
    paths = [tmp_path / f"{name}.csv" for name in ("survey", "rig", "again")]
    codes = [
        {one["code"] for one in json.loads(run(*paths, *more, "--json").stdout)["findings"]}
        for more in ((), ("--independent", "rig,again"))
    ]
    assert ["copies" in some for some in codes] == [True, False]


def test_an_unknown_key_of_the_table_is_an_error(ad23_folder, tmp_path):
    import shutil

    folder = tmp_path / "campaign"
    shutil.copytree(ad23_folder, folder)
    path = folder / "campaign.toml"
    path.write_text(path.read_text() + "\n[explain.refrences]\nlaser_genetic = '6'\n")
    result = run(folder)
    assert result.exit_code == 2
    assert "explain.refrences" in result.output


def test_the_command_loads_nothing_heavy():
    code = (
        "import sys; from validation.commands.explain import explain; "
        "heavy = {'numpy', 'scipy', 'matplotlib', 'pydantic', 'rich'} & set(sys.modules); "
        "sys.exit(f'loaded: {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_analysis_does_without_the_slow_parts_of_scipy():
    code = (
        "import sys; import validation.explain.telling.section; "
        "heavy = {'scipy.stats', 'scipy.optimize', 'matplotlib'} & set(sys.modules); "
        "sys.exit(f'loaded: {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_system_that_is_not_there_is_not_called_independent(files):
    (files / "results").mkdir()
    for name, source in (("survey", "truth"), ("rig", "rig")):
        (files / f"results/poses_{name}.csv").write_text((files / f"{source}.csv").read_text())
    stated = '[explain]\nindependent = [["rig", "survey"], ["rig", "rigg"]]\n'
    (files / "campaign.toml").write_text(f'name = "room"\n\n{stated}')
    result = run(files)
    assert result.exit_code == 2
    place = "campaign.toml, line 4, field 'explain.independent': 'rigg'"
    for part in (place, "write one of survey, rig, or take it out"):
        assert part in result.output
