"""The examples of a lab's own system and tests, installed beside the built wheel."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "my_system"
LAB = ROOT / "examples" / "my_lab"


@pytest.mark.full  # `make test` does the same in .ci/check-wheel
def test_the_examples_pass_their_own_tests_beside_the_wheel(tmp_path):
    build = [ROOT / ".ci" / "fresh-environment", sys.executable, tmp_path, ROOT, EXAMPLE, LAB]
    subprocess.run(build, check=True, capture_output=True, cwd=ROOT)
    python = tmp_path / "venv" / "bin" / "python"
    for path in [*EXAMPLE.glob("tests/test_*.py"), *LAB.glob("tests/test_*.py")]:
        (tmp_path / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", tmp_path]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "12 passed" in done.stdout


def run_of_the_lab(folder, sources, *chosen):
    """What pytest prints of tests of the lab, with its package from somewhere."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    return subprocess.run(
        [*command, "-c", LAB / "pyproject.toml", *chosen],
        check=False,
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(sources)},
    ).stdout


@pytest.mark.parametrize("seed", [1, 5])
def test_the_tests_of_a_lab_pass_whatever_the_room(tmp_path, seed):
    chosen = [LAB / "tests", f"--gtval-seed={seed}", "-k", "not whole"]
    told = run_of_the_lab(tmp_path, LAB / "src", *chosen)
    assert "6 passed" in told, told


def test_a_lab_whose_solver_is_wrong_is_told_so(tmp_path):
    """The tests of the example can fail: a solver that is off by 3 cm does not pass."""
    solver = (LAB / "src" / "my_lab" / "solver.py").read_text(encoding="utf-8")
    wrong = solver.replace("return point, covariance,", "return point + 0.03, covariance,")
    assert wrong != solver
    (tmp_path / "my_lab").mkdir()
    (tmp_path / "my_lab" / "__init__.py").write_text("", encoding="utf-8")
    (tmp_path / "my_lab" / "solver.py").write_text(wrong, encoding="utf-8")
    told = run_of_the_lab(tmp_path, tmp_path, LAB / "tests" / "test_solver.py")
    assert "1 failed, 1 passed" in told, told


def test_the_examples_import_nothing_of_ours_but_the_facade():
    # What it imports beyond these names could change under a lab's feet.
    for path in [*EXAMPLE.rglob("*.py"), *LAB.rglob("*.py")]:
        for line in path.read_text(encoding="utf-8").splitlines():
            words = line.split()
            if words[:1] in (["import"], ["from"]):
                package = words[1].partition(".")[0]
                assert package not in {"validation", "survey", "vision_gt", "laser_gt", "rtk_gt"}
