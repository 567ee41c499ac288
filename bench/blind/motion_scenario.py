"""One drawn case of a motion: arm with declared links and friction, excitation, hidden cause, torque noise, files.

Of the declared model only friction is re-identified; a linear fit of our own (sign and rate of every axis) takes out
what it can absorb. Gear tables are not declared here: at a reversal they leave the motion undefined.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import Arm, read_arm
from blind.motion import SMOOTH_RAD_S, Drive, excitation, play
from blind.motion_effects import MOTION_EFFECTS, MOTION_FOREIGN
from blind.pose_scenario import Case
from blind.random_arms import write_random_arm

TRIES = 60
LARGEST_SHARE = 0.6  # of the largest torque that a cause of plausible size makes


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None) -> Case:
    """Writes robot.toml, motion.csv and truth.json. theme as in `pose_scenario.draw_case`."""
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or random.choice(("single", "pair", "clean", "foreign"), p=(0.65, 0.1, 0.15, 0.1))
    for _ in range(TRIES):
        robot = _robot_file(folder, random, robots, seed)
        arm = read_arm(robot)
        if arm.mass is None or not arm.has_gear.all():
            continue
        middle = 0.5 * (arm.lower + arm.upper) + random.uniform(-0.2, 0.2, arm.axes)
        rate = float(random.choice((100.0, 250.0, 500.0, 1000.0)))
        drive = excitation(arm, middle, random.uniform(8.0, 14.0), 1.0 / rate, int(random.integers(2, 5)), random)
        cause = _draw_cause(theme, random, arm, drive)
        case = None if cause is None else _write(folder, robot, arm, drive, cause, random, seed)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def _robot_file(folder: Path, random, robots: Path, seed: int) -> Path:
    path = folder / "robot.toml"
    if random.random() < 0.4:
        text = (robots / "racer-7-1.4.toml").read_text()
    else:
        write_random_arm(path, random, f"arm-{seed}")
        text = path.read_text()
        friction = iter(np.exp(random.uniform(np.log(2.0), np.log(30.0), 8)))
        rotors = random.random() < 0.5
        more = lambda match: match[0] + "".join(
            f"{key} = {float(value)!r}\n" for key, value in zip(
                ("coulomb_Nm", "viscous_Nm_s_rad", "rotor_inertia_kg_m2")[: 3 if rotors else 2], (next(friction), 8.0, 2e-4)
            )
        )
        text = re.sub(r"\[\[joints\]\]\n", more, text)
    path.write_text(re.sub(r"\[joints\.gear_c?cw\][^\n]*\n(?:[a-z_]+ = [^\n]*\n)+", "", text))
    return path


def _draw_cause(theme: str, random, arm: Arm, drive: Drive):
    if theme == "clean":
        return ()
    pool = MOTION_FOREIGN if theme == "foreign" else MOTION_EFFECTS
    if theme not in ("single", "pair", "foreign"):
        pool = tuple(c for c in MOTION_EFFECTS + MOTION_FOREIGN if theme in (c.name, c.__name__))
    chosen = random.permutation(len(pool))[: 2 if theme == "pair" else 1]
    causes = tuple(pool[k].draw(random, arm, drive, play(arm, drive, ())) for k in chosen)
    return None if any(cause is None for cause in causes) else causes


def _left(drive: Drive, error: np.ndarray) -> float:
    """RMS over all axes of what Coulomb and viscous friction cannot absorb."""
    out = np.empty_like(error)
    for i in range(error.shape[1]):
        v = drive.rate[:, i]
        design = np.stack([np.tanh(v / SMOOTH_RAD_S), v], axis=1)
        out[:, i] = error[:, i] - design @ np.linalg.lstsq(design, error[:, i], rcond=None)[0]
    return float(np.sqrt(np.mean(out**2)))


def _write(folder, robot, arm, drive, causes, random, seed) -> Case | None:
    clean = play(arm, drive, ())
    sigma = random.uniform(0.005, 0.02) * np.abs(clean.tau).max(axis=0)
    level = float(np.sqrt(np.mean(sigma**2)))
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(3.0))))
    if len(causes) == 2:
        raised = max(raised, 1.5)
    for _ in range(2):
        sized = []
        for cause in causes:
            size = _left(drive, play(arm, drive, (cause,)).tau - clean.tau)
            if size < 1e-9:
                return None
            sized.append(cause.scaled(cause.size * np.sqrt(raised**2 - 1.0) * level / size))
        causes = tuple(sized)
    if any(abs(cause.size) > cause.largest for cause in causes):
        return None
    played = play(arm, drive, causes)
    if np.any(np.abs(played.tau - clean.tau).max(axis=0) > LARGEST_SHARE * np.abs(clean.tau).max(axis=0)):
        return None
    tau = played.tau + random.normal(size=played.tau.shape) * sigma
    numbers = np.unique(drive.run)
    record = {
        "kind": "motion", "seed": seed, "effects": [cause.truth() for cause in causes], "noise": level, "best": level,
        "declared": _left(drive, tau - clean.tau), "arm": arm.name, "rows": len(tau), "has": [f"{len(numbers)} runs"],
    }
    record["raised"] = record["declared"] / level
    columns = {"time_s": drive.time, "run": drive.run}
    columns["set"] = np.where(drive.run == numbers[-1], "validation", "identification")
    step = 2.0 * np.pi / 2**17
    theta = np.round(played.theta / step) * step
    reported = random.integers(3)  # motor angles, or the controller's joint angles in either unit
    for i in range(arm.axes):
        q = theta[:, i] / arm.motor_per_output[i] + arm.offset[i]
        columns |= (({f"theta_{i + 1}_rad": theta[:, i]}, {f"q_{i + 1}_rad": q}, {f"q_{i + 1}_deg": np.rad2deg(q)})[reported])
    if any(cause.name == "thermal_drift" for cause in causes) or random.random() < 0.2:
        columns["temperature_degC"] = drive.temperature
    motor_side = random.random() < 0.5
    for i in range(arm.axes):
        name = f"tau_motor_{i + 1}_Nm" if motor_side else f"tau_{i + 1}_Nm"
        columns[name] = tau[:, i] / (arm.motor_per_output[i] if motor_side else 1.0)
    data = folder / "motion.csv"
    pd.DataFrame(columns).to_csv(data, index=False, float_format="%.12g")
    (folder / "truth.json").write_text(json.dumps(record, indent=1))
    return Case(robot, data, record)
