"""Small campaigns for the page."""

import numpy as np

HOSTILE = "<script>alert(1)</script>"
TOML = f"""
name = "A room {HOSTILE}"

[[published]]
system = "rig"
file = "rig.csv"
"""


def written(folder, seed=1, stops=6):
    """A campaign of published poses, whose run takes a second."""
    rng = np.random.default_rng([20261129, seed])
    poses = np.column_stack([rng.uniform(-4, 4, (stops, 2)), rng.uniform(-3, 3, stops)])
    for name, table in (
        ("survey/published_poses.csv", poses),
        ("rig.csv", poses + rng.normal(size=poses.shape) * 0.01),
    ):
        rows = [f"{at},{x:.4f},{y:.4f},{t:.4f}" for at, (x, y, t) in enumerate(table, 1)]
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("\n".join(["pose,x,y,theta", *rows, ""]))
    (folder / "campaign.toml").write_text(TOML)
    return folder
