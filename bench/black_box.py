"""The UR10's shipped poses: black boxes on what the calibrated geometry leaves, beside the diagnosed model.

    python bench/black_box.py [--series B C] [--splits random other blocked] [--out FILE.json] [--threads 1]

Every method sees the same rows and is judged on the same others:

    random     three rows in ten are held out
    other      fitted to one series, judged on the other: same arm, tracker and probe at other places
    blocked    axes 2 and 3 in four quadrants (split at their medians): one is held out, the next, ...

calibrated is `exactarm calibrate` (with the compliance that it finds), diagnosed `exactarm diagnose`, both on
the fitted rows. A black box learns what the calibrated model leaves, in the robot's base frame, as a function
of the six joint angles, and its prediction is added to the model:

    kriging    Gaussian process, Matern 5/2 with a length for each axis, and noise; marginal likelihood
    RBF        thin-plate spline, its smoothing chosen by five-fold cross-validation on the fitted rows
    trees      gradient boosting, 200 rounds at a rate of 0.1, leaves per tree chosen in the same way

On another series the frames of base and tool are fitted to its own rows for every method, with what the
method adds in place. Printed: the mean and the 95th percentile of the Euclidean error on held-out rows.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind.arm import Arm, posture, read_arm, turn  # noqa: E402

DATA = TOP / "python" / "exactarm" / "data" / "examples" / "ur10"
JOINTS = [f"q_{i}_rad" for i in range(1, 7)]
METHODS = ("calibrated", "kriging", "RBF", "trees", "diagnosed")
LENGTH_ROWS = 300  # that the lengths of the kriging kernel are estimated on
SMOOTHINGS = (1e-3, 1e-2, 1e-1, 1.0, 10.0)
LEAVES, ROUNDS, LEARNING_RATE = (4, 8, 16), 200, 0.1
BLOCKED_AXES = (1, 2)  # from 0


def exactarm(command: str, robot, files: list[Path], out: Path, threads: int) -> Path:
    """The folder of one run of the program that this Python finds."""
    words = [command, str(robot), *map(str, files), "--out", str(out), "--threads", str(threads), "--quiet"]
    subprocess.run([sys.executable, "-m", "exactarm", *words], check=True)
    return out


@dataclass(frozen=True)
class Frames:
    """Base (position, rotation vector) in the device's frame, and the tool's position on the flange."""

    base: np.ndarray
    turned: np.ndarray
    tool: np.ndarray


def fitted_frames(arm: Arm, q: np.ndarray, measured: np.ndarray) -> Frames:
    """Base and tool by least squares: a start from rotations tried about the vertical, then Gauss-Newton."""
    return min((_gauss_newton(arm, q, measured, start) for start in _starts()), key=lambda pair: pair[1])[0]


def _starts():
    for angle in np.arange(0.0, 2.0 * np.pi, np.pi / 4.0):
        yield np.array([0.0, 0.0, angle])
        yield np.pi * np.array([np.cos(angle), np.sin(angle), 0.0])  # upside down


def _gauss_newton(arm, q, measured, turned, steps: int = 30) -> tuple[Frames, float]:
    at = posture(arm, q)
    flange, rotation = at.flange, at.rotation[:, -1]
    frame, tool = turn(turned), np.zeros(3)
    base = (measured - flange @ frame.T).mean(axis=0)
    for _ in range(steps):
        target = flange + rotation @ tool
        residual = measured - base - target @ frame.T
        jacobian = _by_frames(rotation, target, frame)
        step = np.linalg.lstsq(jacobian.reshape(-1, 9), residual.ravel(), rcond=None)[0]
        base, frame, tool = base + step[:3], turn(step[3:6]) @ frame, tool + step[6:]
        if np.abs(step).max() < 1e-12:
            break
    residual = measured - base - (flange + rotation @ tool) @ frame.T
    return Frames(base, _rotation_vector(frame), tool), float(np.sum(residual**2))


def _by_frames(rotation: np.ndarray, target: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(N, 3, 9) how the measured target moves with the base, its turn and the tool."""
    cross = np.stack([np.cross(unit, target @ frame.T) for unit in np.eye(3)], axis=2)
    return np.concatenate(
        [np.broadcast_to(np.eye(3), (len(target), 3, 3)), cross, frame @ rotation], axis=2
    )


def frame_jacobian(arm: Arm, q: np.ndarray, frames: Frames) -> np.ndarray:
    at = posture(arm, q)
    rotation = at.rotation[:, -1]
    return _by_frames(rotation, at.flange + rotation @ frames.tool, turn(frames.turned))


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_rotvec()


def kriging(x: np.ndarray, y: np.ndarray, random):
    """A Gaussian process; the lengths from some of the rows, the posterior from all of them."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern(np.ones(6), (5e-2, 1e2), nu=2.5) + WhiteKernel(
        0.1, (1e-4, 2.0)
    )
    some = random.permutation(len(x))[:LENGTH_ROWS]
    scale = y.std(axis=0)
    start = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=0).fit(
        x[some], y[some] / scale
    )
    model = GaussianProcessRegressor(start.kernel_, optimizer=None).fit(x, y / scale)
    return lambda new: model.predict(new) * scale


def thin_plate(x: np.ndarray, y: np.ndarray, random):
    from scipy.interpolate import RBFInterpolator

    fit = lambda x, y, smoothing: RBFInterpolator(x, y, smoothing=smoothing * len(x))
    smoothing = _chosen(fit, x, y, SMOOTHINGS, random)
    return fit(x, y, smoothing)


def trees(x: np.ndarray, y: np.ndarray, random):
    from sklearn.ensemble import HistGradientBoostingRegressor

    def fit(x, y, leaves):
        models = [
            HistGradientBoostingRegressor(
                learning_rate=LEARNING_RATE,
                max_iter=ROUNDS,
                max_leaf_nodes=leaves,
                early_stopping=False,
                random_state=0,
            ).fit(x, column)
            for column in y.T
        ]
        return lambda new: np.stack([model.predict(new) for model in models], axis=1)

    return fit(x, y, _chosen(fit, x, y, LEAVES, random))


def _chosen(fit, x, y, options, random):
    """The option of the least error on five folds of the fitted rows."""
    fold = random.permutation(len(x)) % 5
    error = [
        sum(
            np.sum((fit(x[fold != k], y[fold != k], option)(x[fold == k]) - y[fold == k]) ** 2)
            for k in range(5)
        )
        for option in options
    ]
    return options[int(np.argmin(error))]


BOXES = {"kriging": kriging, "RBF": thin_plate, "trees": trees}


def learned(q: np.ndarray, left: np.ndarray) -> dict:
    """What each black box adds at joint angles (N, 6), learned from what is left (N, 3), both of the fitted
    rows."""
    centre, spread = q.mean(axis=0), np.maximum(q.std(axis=0), 1e-9)
    models = {
        name: learn((q - centre) / spread, left, np.random.default_rng(1)) for name, learn in BOXES.items()
    }
    return {
        name: (lambda new, model=model: model((new - centre) / spread)) for name, model in models.items()
    }


def residuals(folder: Path) -> np.ndarray:
    """(N, 3) measured less model of every row of the one file of a run, m, in the device's frame."""
    table = pd.read_csv(folder / "residuals.csv").sort_values("row")
    return table[["dx_m", "dy_m", "dz_m"]].to_numpy()


def without_frames(arm: Arm, q: np.ndarray, frames: Frames, left: np.ndarray) -> np.ndarray:
    """(N, 3) what is left once base and tool may move a little more."""
    jacobian = frame_jacobian(arm, q, frames).reshape(-1, 9)
    return left - (jacobian @ np.linalg.lstsq(jacobian, left.ravel(), rcond=None)[0]).reshape(-1, 3)


def within(table: pd.DataFrame, fitted: np.ndarray, folder: Path, threads: int) -> dict[str, np.ndarray]:
    """Errors (N_held,) of every method on the rows of one series that are not `fitted`."""
    data = folder / "data.csv"
    folder.mkdir(parents=True, exist_ok=True)
    table.assign(set=np.where(fitted, "identification", "validation")).to_csv(data, index=False)
    left = residuals(exactarm("calibrate", "ur10", [data], folder / "calibrated", threads))
    diagnosed = exactarm("diagnose", "ur10", [data], folder / "diagnosed", threads)
    q = table[JOINTS].to_numpy()
    errors = {
        name: np.linalg.norm(left[~fitted] - add(q[~fitted]), axis=1)
        for name, add in learned(q[fitted], left[fitted]).items()
    }
    found = pd.read_csv(diagnosed / "residuals.csv")
    errors["diagnosed"] = found["error_after"][found["set"] == "validation"].to_numpy()
    return {"calibrated": np.linalg.norm(left[~fitted], axis=1)} | errors


def across(table: pd.DataFrame, other: pd.DataFrame, folder: Path, threads: int) -> dict[str, np.ndarray]:
    """The same on all rows of another series, whose frames are fitted."""
    folder.mkdir(parents=True, exist_ok=True)
    data, judged = folder / "data.csv", folder / "judged.csv"
    table.assign(set="identification").to_csv(data, index=False)
    other.to_csv(judged, index=False)
    calibrated = exactarm("calibrate", "ur10", [data], folder / "calibrated", threads)
    diagnosed = exactarm("diagnose", "ur10", [data], folder / "diagnosed", threads)
    evaluated = [
        exactarm("evaluate", run / "robot.toml", [judged], folder / f"of_{run.name}", threads)
        for run in (calibrated, diagnosed)
    ]
    arm, q, new = read_arm(calibrated / "robot.toml"), table[JOINTS].to_numpy(), other[JOINTS].to_numpy()
    here, there = fitted_frames(arm, q, _positions(table)), fitted_frames(arm, new, _positions(other))
    left = residuals(evaluated[0])
    errors = {
        name: np.linalg.norm(
            without_frames(arm, new, there, left - add(new) @ turn(there.turned).T), axis=1
        )
        for name, add in learned(q, residuals(calibrated) @ turn(here.turned)).items()
    }
    errors["diagnosed"] = np.linalg.norm(residuals(evaluated[1]), axis=1)
    return {"calibrated": np.linalg.norm(left, axis=1)} | errors


def _positions(table: pd.DataFrame) -> np.ndarray:
    return table[["x_mm", "y_mm", "z_mm"]].to_numpy() * 1e-3


def quadrants(table: pd.DataFrame) -> np.ndarray:
    """(N,) 0 to 3: above or below the median of axes 2 and 3."""
    high = [table[JOINTS[axis]] > table[JOINTS[axis]].median() for axis in BLOCKED_AXES]
    return (2 * high[0] + high[1]).to_numpy()


def measured_rows(series: list[str], splits: list[str], threads: int):
    """Yields (series, split, errors by method)."""
    tables = {"B": pd.read_csv(DATA / "series_B.csv"), "C": pd.read_parquet(DATA / "series_C.parquet")}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in series:
            table = tables[name]
            if "random" in splits:
                fitted = np.random.default_rng(1).random(len(table)) < 0.7
                yield name, "random", within(table, fitted, folder / f"{name}_random", threads)
            if "other" in splits:
                other = "C" if name == "B" else "B"
                yield (
                    name,
                    f"other ({other})",
                    across(table, tables[other], folder / f"{name}_other", threads),
                )
            block = quadrants(table)
            for k in range(4) if "blocked" in splits else ():
                yield name, f"blocked {k + 1}", within(table, block != k, folder / f"{name}_{k}", threads)


def summary(error: np.ndarray) -> dict:
    error = error[np.isfinite(error)]
    return {
        "rows": len(error),
        "mean_mm": 1e3 * float(error.mean()),
        "rms_mm": 1e3 * float(np.sqrt(np.mean(error**2))),
        "p95_mm": 1e3 * float(np.quantile(error, 0.95)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--series", nargs="+", choices=("B", "C"), default=["B", "C"])
    parser.add_argument(
        "--splits",
        nargs="+",
        choices=("random", "other", "blocked"),
        default=["random", "other", "blocked"],
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    # Lengths at their bounds belong to axes without effect.
    warnings.filterwarnings("ignore", category=UserWarning, module="sklearn")
    print("| fitted to | judged on | rows | " + " | ".join(METHODS) + " |")
    print("| --- " * (3 + len(METHODS)) + "|", flush=True)
    results = []
    for name, split, errors in measured_rows(arguments.series, arguments.splits, arguments.threads):
        found = {method: summary(errors[method]) for method in METHODS}
        results.append({"series": name, "split": split} | found)
        cells = " | ".join(f"{one['mean_mm']:.3f} ({one['p95_mm']:.2f})" for one in found.values())
        print(f"| {name} | {split} | {found['calibrated']['rows']} | {cells} |", flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
