"""Known causes planted in measured data: what a diagnosis makes of them beside an arm's own structure.

    python bench/planted.py ur10 [--rows 150] [--times 3] [--seed 1] [--out marks.json]
    python bench/planted.py kr300 | tx40

`ur10`: so many poses of series B, and as many of C, chosen at random and left in their order, each a set of
its own; `kr300`: both runs between the encoders; `tx40`: the torques. Each set is diagnosed as it is, and
once with each cause: a function of angles, rows or speeds, written here, is added to what was measured, so
large that its root mean square (of position, angle or torque; less its mean) is `--times` the error that the
diagnosis of the set as it is leaves on held-out rows. A cause counts as named where its effect, or another
form of it, stands with its axis. The last figures of a line are the held-out error before and after, over the
error after of the set as it is. `PYTHONPATH` says which checkout diagnoses.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from exactarm import load_robot
from exactarm.files.examples import example

TURN = 2 * np.pi
FILES = {"ur10": ("ur10/series_B", "ur10/series_C"), "kr300": ("kr300/run_A", "kr300/run_B"),
         "tx40": ("tx40/motion",)}
LATE_S = 0.003  # by which the KR300's output encoders lag (docs/measured.md)
DIRECTION = ("hysteresis", "backlash", "direction_dependence", "load_dependence")  # the last by friction
AT_REST = 0.02  # of the fastest: friction of an axis that is slower is anything between its two values
STEP_RAD = 1e-5  # of the difference that says how far an axis moves the flange


class Planted(NamedTuple):
    """A cause in the data: its effect and other forms of it, its axis, the table with it."""

    label: str
    forms: tuple[str, ...]
    axis: int | None
    table: pd.DataFrame


def spread(values: np.ndarray) -> float:
    """Root mean square of (rows,) or (rows, axes) less its mean."""
    return float(np.sqrt(np.mean(np.sum((values - values.mean(0)).reshape(len(values), -1) ** 2, axis=1))))


def directions(q: np.ndarray) -> np.ndarray:
    """Signs of the way from the row before; the first row came as the second."""
    signs = np.sign(np.diff(q, axis=0))
    return np.vstack([signs[:1], signs])


def turning(speed: np.ndarray) -> np.ndarray:
    """Direction of (rows, axes), and nothing where an axis hardly turns."""
    return np.tanh(speed / (AT_REST * np.abs(speed).max(0)))


def in_poses(
    table: pd.DataFrame, robot: str, size_m: float, random: np.random.Generator,
) -> Iterator[Planted]:
    """Errors of joint angles (what the flange felt, the log does not say) and of the tracker."""
    columns, places = [f"q_{axis}_rad" for axis in range(1, 7)], [f"{axis}_mm" for axis in "xyz"]
    q, rows, arm = table[columns].to_numpy(), len(table), load_robot(robot)
    order, cut = np.arange(rows) / rows, int(rows * random.uniform(0.3, 0.7))
    a, b = random.permutation([1, 2, 3])[:2]
    wrist = int(random.choice([4, 5]))
    curves = {
        "eccentricity": (("gear_eccentricity", "gear_harmonics"), a,
                         np.cos(q[:, a - 1] - random.uniform(0, TURN))),
        "wave of order 100": (("gear_harmonics",), b, np.cos(100 * q[:, b - 1] - random.uniform(0, TURN))),
        "approach": (("hysteresis", "backlash", "settling", "direction_dependence"), a,
                     directions(q)[:, a - 1]),
        "mastered anew": (("zero_shift",), b, (np.arange(rows) < cut) * 1.0),
        "wrist coupling": (("joint_coupling",), wrist, q[:, wrist - 2]),
        "ratio": (("gear_ratio",), b, q[:, b - 1]),
        "drift of an axis": (("thermal_drift",), a, order),
    }
    for label, (forms, axis, curve) in curves.items():
        turn = np.zeros(6)
        turn[axis - 1] = STEP_RAD
        lever = np.array([arm.fk(row + turn).position - arm.fk(row - turn).position for row in q])
        lever /= 2 * STEP_RAD
        curve = curve - curve.mean()
        factor = size_m / np.sqrt(np.mean(np.sum((lever * curve[:, None]) ** 2, axis=1)))
        log = {columns[axis - 1]: q[:, axis - 1] - factor * curve}
        yield Planted(label, forms, int(axis), table.assign(**log))
    way = random.normal(size=3)
    way /= np.linalg.norm(way)
    gross = np.isin(np.arange(rows), random.choice(rows, 3, replace=False))
    position = table[places].to_numpy()
    shifts = {
        "pushed tracker": (("tracker_step", "tool_shift"), (np.arange(rows) >= cut)[:, None] * way),
        "drifting tracker": (("tracker_drift",), order[:, None] * way),
        "three wrong rows": (("outliers",), gross[:, None] * way),
    }
    for label, (forms, shift) in shifts.items():
        yield Planted(label, forms, None, table.assign(
            **dict(zip(places, (position + 1e3 * size_m * shift / spread(shift)).T))))


def in_gear(
    table: pd.DataFrame, robot: str, size_rad: float, random: np.random.Generator,
) -> Iterator[Planted]:
    """Errors between the encoders of one axis of three, the same in both runs."""
    joints, axes = load_robot(robot).joints, (1, 2, 3)
    late = {}
    for run, rows in table.groupby("run"):
        elapsed = rows["time_s"].to_numpy()
        late[run] = rows.apply(lambda column, t=elapsed: np.interp(t - LATE_S, t, column))
    seen = pd.concat(late.values())
    torque, q, theta = (seen[[f"{name}_{axis}_{unit}" for axis in axes]].to_numpy() for name, unit in
                        (("tau_motor", "Nm"), ("q", "rad"), ("theta", "rad")))
    steps = pd.DataFrame(theta).groupby(table["run"].to_numpy()).diff().fillna(0.0)
    sign = turning(steps.rolling(9, center=True, min_periods=1).mean().to_numpy())
    a, b, c = random.permutation([1, 2, 3])
    order = float(random.choice([2.0, 3.0, 5.0, 11.0]))
    curves = {
        f"order {order:g} of the motor": (("gear_harmonics",), a, np.cos(order * theta[:, a - 1] + 1.0)),
        "twice an output turn": (("gear_harmonics", "gear_eccentricity"), b, np.cos(2 * q[:, b - 1] + 2.0)),
        "direction": (DIRECTION, c, sign[:, c - 1]),
        "ratio": (("gear_ratio",), a, q[:, a - 1]),
        "coupling": (("joint_coupling",), b, theta[:, a - 1] / joints[a - 1].ratio),
        "load": (("load_dependence", "joint_compliance"), c, torque[:, c - 1]),
    }
    for label, (forms, axis, curve) in curves.items():
        column = f"q_{axis}_rad"
        yield Planted(label, forms, int(axis), table.assign(
            **{column: table[column] + size_rad * (curve - curve.mean()) / spread(curve)}))


def in_motion(
    table: pd.DataFrame, robot: str, size_Nm: float, random: np.random.Generator,
) -> Iterator[Planted]:
    """Torques of one axis of three at its motor; the size is at the output."""
    joints = load_robot(robot).joints
    theta = table[[f"theta_{axis}_rad" for axis in (1, 2, 3)]].to_numpy()
    speed = pd.DataFrame(np.gradient(theta, table["time_s"].to_numpy(), axis=0))
    speed = speed.rolling(101, center=True, min_periods=1).mean().to_numpy()
    slow = 0.1 * np.abs(speed).max(0)
    a, b, c = random.permutation([1, 2, 3])
    q = theta[:, c - 1] / joints[c - 1].ratio
    curves = {
        "ripple once a turn": (("torque_ripple",), a, np.cos(theta[:, a - 1] + 1.0)),
        "stribeck": (("stribeck_friction", "coulomb_friction"), a,
                     turning(speed)[:, a - 1] * np.exp(-(speed[:, a - 1] / slow[a - 1]) ** 2)),
        "counterbalance": (("gravity_compensator", "link_masses"), c, np.sin(q + 0.7)),
        "other way round": (("asymmetric_friction", "coulomb_friction"), b,
                            np.maximum(turning(speed)[:, b - 1], 0)),
    }
    for label, (forms, axis, curve) in curves.items():
        column, size = f"tau_motor_{axis}_Nm", size_Nm / abs(joints[axis - 1].ratio)
        yield Planted(label, forms, int(axis), table.assign(
            **{column: table[column] + size * curve / spread(curve)}))


def sets_of(robot: str, rows: int, random: np.random.Generator) -> Iterator[tuple[str, pd.DataFrame]]:
    """The measured sets of an arm, as tables."""
    tables = []
    for name in FILES[robot]:
        path = example(name)
        tables.append(pd.read_csv(path) if path.suffix == ".csv" else pd.read_parquet(path).astype(float))
    if robot == "ur10":
        for name, table in zip("BC", tables):
            chosen = np.sort(random.choice(len(table), rows, replace=False))
            yield name, table.iloc[chosen].reset_index(drop=True)
    else:
        for run, table in enumerate(tables, start=1):
            table["run"] = run
        yield robot, pd.concat(tables, ignore_index=True)


PLANTED = {"ur10": in_poses, "kr300": in_gear, "tx40": in_motion}
KIND = {"ur10": "poses", "kr300": "gear_run", "tx40": "motion"}


def diagnosed(robot: str, table: pd.DataFrame, folder: Path) -> dict:
    """The result of a diagnosis by the command line."""
    folder.mkdir(parents=True)
    table.to_parquet(folder / "data.parquet")
    subprocess.run(
        [sys.executable, "-m", "exactarm", "diagnose", robot, folder / "data.parquet", "--kind", KIND[robot],
         "--out", folder / "out"], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "out" / "result.json").read_text())


def error_of(result: dict, model: str) -> float:
    """On held-out rows."""
    return result[model]["validation"]["rms"]


def main() -> None:
    """Mark every cause in every set of an arm."""
    words = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    words.add_argument("robot", choices=sorted(PLANTED))
    words.add_argument("--rows", type=int, default=150)
    words.add_argument("--times", type=float, default=3.0)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--out", type=Path)
    asked = words.parse_args()
    random, marks = np.random.default_rng(asked.seed), []
    with tempfile.TemporaryDirectory() as scratch:
        for name, table in sets_of(asked.robot, asked.rows, random):
            plain = diagnosed(asked.robot, table, Path(scratch) / name)
            left, own = error_of(plain, "after"), [(e["effect"], e.get("joint")) for e in plain["effects"]]
            print(f"{name} as it is: {plain['verdict']}, {error_of(plain, 'before'):.3g} to {left:.3g}, "
                  f"{own}", flush=True)
            planted = PLANTED[asked.robot](table, asked.robot, asked.times * left, random)
            for number, cause in enumerate(planted):
                result = diagnosed(asked.robot, cause.table, Path(scratch) / f"{name}_{number}")
                found = [(e["effect"], e.get("joint")) for e in result["effects"]]
                named = any(effect in cause.forms and axis == cause.axis for effect, axis in found)
                marks.append({
                    "set": name, "cause": cause.label, "axis": cause.axis, "named": named, "found": found,
                    "verdict": result["verdict"], "before": error_of(result, "before") / left,
                    "after": error_of(result, "after") / left})
                mark = marks[-1]
                print(f"  {'named ' if named else 'MISSED'} {cause.label}, axis {cause.axis}: "
                      f"{mark['verdict']}, {mark['before']:.2f} to {mark['after']:.2f}, {found}", flush=True)
    after = [mark["after"] for mark in marks]
    print(f"named: {sum(mark['named'] for mark in marks)} of {len(marks)}; error over that of the set as it "
          f"is: median {np.median(after):.2f}, at most {max(after):.2f}")
    if asked.out:
        options = {"robot": asked.robot, "rows": asked.rows, "times": asked.times, "seed": asked.seed}
        asked.out.write_text(json.dumps({"options": options, "marks": marks}, indent=1))


if __name__ == "__main__":
    main()
