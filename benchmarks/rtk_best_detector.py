"""How small a jump the best detector would see, whoever wrote it.

Nothing of the program is used but the simulated drives. The true motion of each drive is fitted by
a vector autoregression of its speeds, turns, lift, pitch and roll; with it, the three antennas of a
rigid body, and the known noise (white, and Gauss-Markov of each receiver) the information on a step
in the middle of 32 seconds follows by least squares, and with that the share of jumps whose
generalised likelihood ratio is above 46 (the program's least). Constant errors of each antenna are
free. Numbers on the command line: first seed and how many drives.
"""

import sys
from itertools import product

import numpy as np
from scipy.stats import ncx2
from trials.lasting_errors import ETA, Errors
from trials.rough_drives import KINDS, rough_motion

from validation.poses.angles import Array

ORDER, EPOCHS, EVERY = 6, 160, 0.2
QUIET = 0.9
"""Share of the epochs, the quieter ones, whose innovations count: jolts are rare."""
GAIN = 46.0
NOISE = {
    "white 4 mm": Errors(0.004),
    "slow 10 mm, 30 s": Errors(0.003, 0.010, 30.0),
    "slow 5 mm, 60 s": Errors(0.003, 0.005, 60.0),
    "slow 7 mm, 120 s": Errors(0.004, 0.007, 120.0),
}
RATES = {"5 Hz": (0.2, 0.2, 0.2), "1 + 5 Hz": (1.0, 0.2, 0.2)}
CAUSES = {
    "restart": [(0,), (1, 2), (0, 1), (2,)],
    "all": [(0, 1, 2)],
    "false": [(0,), (1,), (2,)],
}


def motion_information(poses: Array) -> Array:
    """(6 n, 6 n) information on n intervals' speeds, lift and angles, of poses (m, 6) at 5 Hz."""
    yaw = np.unwrap(poses[:, 3])
    middle, moves = (yaw[1:] + yaw[:-1]) / 2, np.diff(poses[:, :3], axis=0)
    c, s = np.cos(middle), np.sin(middle)
    ahead, aside = c * moves[:, 0] + s * moves[:, 1], c * moves[:, 1] - s * moves[:, 0]
    states = np.column_stack([ahead, aside, np.diff(yaw), moves[:, 2], poses[:-1, 4:]])
    states = states - states.mean(0)
    past = np.hstack([states[ORDER - k - 1 : -k - 1] for k in range(ORDER)])
    guess = np.linalg.lstsq(past, states[ORDER:], rcond=None)[0]
    left = states[ORDER:] - past @ guess
    squares = np.einsum("ni,ij,nj->n", left, np.linalg.pinv(np.cov(left.T)), left)
    quiet = left[squares < np.quantile(squares, QUIET)]
    weight = np.linalg.inv(quiet.T @ quiet / len(quiet) + 1e-10 * np.eye(6))
    n = EPOCHS + 1
    rows = np.zeros((6 * (n - ORDER), 6 * n))
    for t in range(ORDER, n):
        here = slice(6 * (t - ORDER), 6 * (t - ORDER) + 6)
        rows[here, 6 * t : 6 * t + 6] = np.eye(6)
        for k in range(ORDER):
            rows[here, 6 * (t - k - 1) : 6 * (t - k)] -= guess[6 * k : 6 * k + 6].T
    return np.asarray(rows.T @ np.kron(np.eye(n - ORDER), weight) @ rows)


def observed(antennas: Array) -> Array:
    """(n, 3, 3, k) positions seen from the vehicle, by the states and nine constants."""
    n = EPOCHS + 1
    found = np.zeros((n, 3, 3, 6 * n + 9))
    for (k, (x, y, _)), t in product(enumerate(antennas), range(n)):
        for axis, state, arm in ((0, 0, 1.0), (0, 2, -y), (1, 1, 1.0), (1, 2, x), (2, 3, 1.0)):
            found[t, k, axis, state : 6 * t : 6] = arm
        found[t, k, 2, 6 * t + 4 : 6 * t + 6] += [-x, y]
        found[t, k, range(3), 6 * n + 3 * k + np.arange(3)] = 1.0
    return found


def step_information(
    design: Array, motion: Array, noise: Errors, rates: tuple[float, ...]
) -> dict[tuple[int, ...], Array]:
    """(3, 3) information on a step of each cause, along, across and up."""
    times, middle = np.arange(EPOCHS + 1) * EVERY, EPOCHS // 2
    whole = 1e-9 * np.eye(design.shape[-1])
    whole[: len(motion), : len(motion)] += motion
    shown = [np.zeros((len(whole), 3)) for _ in range(3)]
    known = np.zeros((3, 3))
    for k, every in enumerate(rates):
        stride = round(every / EVERY)
        rows = np.arange((middle + 1 + stride // 2) % stride, EPOCHS + 1, stride)
        lags = np.abs(times[rows][:, None] - times[rows])
        spread = noise.white**2 * np.eye(len(rows)) + noise.slow**2 * np.exp(-lags / noise.memory)
        step = (rows > middle).astype(float)
        for axis, scale in enumerate((1.0, 1.0, ETA)):
            weight = np.linalg.inv(spread) / scale**2
            by = design[rows, k, axis]
            whole += by.T @ weight @ by
            shown[k][:, axis] = by.T @ weight @ step
            known[k, axis] = step @ weight @ step
    found = {}
    for cause in {one for some in CAUSES.values() for one in some}:
        by = sum(shown[k] for k in cause)
        alone = np.diag(known[list(cause)].sum(0))
        found[cause] = np.asarray(alone - by.T @ np.linalg.solve(whole, by))
    return found


def main() -> None:
    first, drives = (int(n) for n in sys.argv[1:3]) if len(sys.argv) > 2 else (100, 4)
    shares: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for seed in range(first, first + drives):
        antennas, poses = rough_motion(seed, 600.0)
        design, motion = observed(antennas), motion_information(poses[::4])
        for (name, noise), (rate, rates) in product(NOISE.items(), RATES.items()):
            told = step_information(design, motion, noise, rates)
            for kind, (least, more) in KINDS.items():
                angles = np.arange(0, np.pi, np.pi / 6)
                level = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
                ways = np.array([[0.0, 0.0, 1.0]]) if kind.endswith("up") else level
                # A false fix has two ends.
                ends = 2 if kind.startswith("false") else 1
                some = shares.setdefault((kind, name, rate), [])
                for cause, size in product(
                    CAUSES[kind.split()[0]], least * np.linspace(1, more, 5)
                ):
                    for way in ways:
                        squares = ends * float(way @ told[cause] @ way)
                        share = float(ncx2.sf(GAIN, 3, size**2 * squares))
                        some.append((share, squares**-0.5))
    print(f"Jumps whose ratio is above {GAIN:.0f}, and the sigma of a size: median, worst of ten")
    for (kind, name, rate), some in sorted(shares.items()):
        share, sigmas = np.array(some).T
        usual, worst = 1000 * np.quantile(sigmas, [0.5, 0.9])
        print(f"  {kind:14} {name:18} {rate:9} {share.mean():5.2f}, {usual:5.1f} {worst:5.1f} mm")


if __name__ == "__main__":
    main()
