"""Other people's tools take the exported files and find the same numbers."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from validation.poses.tum_text import to_tum
from validation.statistics.comparison import compare

EVO = shutil.which("evo_ape") or shutil.which("evo_ape", path=str(Path(sys.executable).parent))


@pytest.mark.skipif(EVO is None, reason="evo is not installed")
@pytest.mark.parametrize("system", ["vision", "laser_genetic"])
def test_evo_finds_the_same_position_errors(tmp_path, ad23_poses, system):
    validation, gt = ad23_poses["survey"], ad23_poses[system]
    (tmp_path / "validation.tum").write_text(to_tum(validation))
    (tmp_path / "gt.tum").write_text(to_tum(gt))
    # evo keeps settings in the home folder; this one is thrown away.
    environment = {**os.environ, "HOME": str(tmp_path), "MPLBACKEND": "agg"}
    subprocess.run(
        [EVO, "tum", "validation.tum", "gt.tum", "--save_results", "ape.zip"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        check=True,
        timeout=120,
    )
    with zipfile.ZipFile(tmp_path / "ape.zip") as results:
        theirs = json.loads(results.read("stats.json"))
    distances = compare(validation, gt).distances
    assert theirs["rmse"] == pytest.approx(np.sqrt(np.square(distances).mean()), rel=1e-9)
    assert theirs["mean"] == pytest.approx(distances.mean(), rel=1e-9)
    assert theirs["max"] == pytest.approx(distances.max(), rel=1e-9)
