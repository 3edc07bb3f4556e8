"""The example of a lab's own system, installed beside the built wheel."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "my_system"


@pytest.mark.full  # `make test` does the same in .ci/check-wheel
def test_a_run_has_the_poses_findings_section_and_command_of_the_plug_in(tmp_path):
    build = [ROOT / ".ci" / "fresh-environment", sys.executable, tmp_path, ROOT, EXAMPLE]
    subprocess.run(build, check=True, capture_output=True, cwd=ROOT)
    python = tmp_path / "venv" / "bin" / "python"
    tests = (EXAMPLE / "tests" / "test_my_system.py").read_text(encoding="utf-8")
    (tmp_path / "test_my_system.py").write_text(tests, encoding="utf-8")
    command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", tmp_path]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout


def test_the_example_imports_nothing_of_ours_but_the_facade():
    # What it imports beyond these names could change under a lab's feet.
    for path in EXAMPLE.rglob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines():
            words = line.split()
            if words[:1] in (["import"], ["from"]):
                package = words[1].partition(".")[0]
                assert package not in {"validation", "survey", "vision_gt", "laser_gt", "rtk_gt"}
