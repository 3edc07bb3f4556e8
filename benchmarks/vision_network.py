"""The camera network: errors of the double pattern, and of chains against their covariances.

Boards at 2.6 to 3.3 m, 0.5 m apart on the bar, camera centres 4 m apart, corner noise 0.1 px.
Printed for each: the worst error over the seeds, what was asked, and for chains the mean of the
normalised estimation error squared over its six degrees of freedom for the last camera, which is
1 where the predicted covariance is right.

    python benchmarks/vision_network.py [seeds]
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "vision_gt"))

from scipy.stats import chi2
from vision_scenes import CameraRow

from validation.poses.angles import Array
from vision_gt.network.adjustment import Bar, KnownBody, Network
from vision_gt.network.solution import NetworkInput, solve_network
from vision_gt.optics.transforms import angle_between, change_between, perturbed

EXACT = np.zeros(6)
UNSURE = np.array([0.003] * 3 + [np.deg2rad(0.3)] * 3)
REFERENCE = np.diag(np.square([5e-4] * 3 + [3e-4] * 3))


def solved(row: CameraRow, sigmas: Array, rng: np.random.Generator) -> Network:
    """The network of a row of cameras; the reference is laid as badly as is stated."""
    off = np.linalg.cholesky(REFERENCE) @ rng.standard_normal(6)
    given = NetworkInput(
        cameras=tuple(row.cameras),
        snapshots=tuple(row.snapshots),
        both=tuple(row.both),
        reference=(row.reference,),
        calibration=(),
        bar=Bar(row.nominal_bar, sigmas),
        known_reference=KnownBody(perturbed(row.T_gtv_reference, off), REFERENCE),
        origin_near=row.reference.pixels[0],
    )
    return solve_network(given).network


def pair_errors(seeds: range, bar_error: tuple[float, float]) -> Array:
    """(n, 2) errors of the second camera relative to the first: metres, radians."""
    errors = []
    for seed in seeds:
        known = not any(bar_error)
        row = CameraRow(seed, bar_error=bar_error, both=0 if known else 15)
        rng = np.random.default_rng(1000 + seed)
        found = solved(row, EXACT if known else UNSURE, rng).T_gtv_camera
        relative, true = (T[0].inv() * T[1] for T in (found, row.T_gtv_camera))
        length = np.linalg.norm(relative.translation - true.translation)
        errors.append((length, float(angle_between(relative, true))))
    return np.array(errors)


def chain(cameras: int, seeds: range) -> tuple[Array, Array, Array]:
    """Of the last camera: errors of its place (n,), predicted sigmas (n,), NEES / 6 (n,)."""
    lengths, sigmas, nees = [], [], []
    for seed in seeds:
        row = CameraRow(seed, cameras=cameras, snapshots=20)
        network = solved(row, EXACT, np.random.default_rng(2000 + seed))
        off = change_between(network.T_gtv_camera[cameras - 1], row.T_gtv_camera[cameras - 1])
        P = network.pose_covariance(str(cameras))
        lengths.append(np.linalg.norm(off[:3]))
        sigmas.append(np.sqrt(np.trace(P[:3, :3])))
        nees.append(off @ np.linalg.solve(P, off) / 6)
    return np.array(lengths), np.array(sigmas), np.array(nees)


def main(count: int) -> None:
    seeds = range(500, 500 + count)
    known = pair_errors(seeds, (0.0, 0.0))
    print(
        f"known bar, {count} seeds: {1e3 * known[:, 0].max():.2f} mm (below 1 asked), "
        f"{np.rad2deg(known[:, 1].max()):.4f} degrees (below 0.015 asked)",
        flush=True,
    )
    wrong = pair_errors(seeds, (0.002, float(np.deg2rad(0.2))))
    print(
        f"bar 2 mm and 0.2 degrees wrong, calibrated by 15 images of both boards: "
        f"{1e3 * wrong[:, 0].max():.2f} mm (below 1.5 asked)",
        flush=True,
    )
    low, high = chi2.ppf([0.025, 0.975], 6 * count) / (6 * count)
    for cameras in (4, 10):
        lengths, sigmas, nees = chain(cameras, seeds)
        print(
            f"chain of {cameras}: last camera {1e3 * np.sqrt((lengths**2).mean()):.1f} mm rms, "
            f"predicted {1e3 * np.sqrt((sigmas**2).mean()):.1f} mm; NEES / 6 {nees.mean():.2f} "
            f"(95 % of such runs: {low:.2f} to {high:.2f})",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
