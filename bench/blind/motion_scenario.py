"""One drawn case of a motion: arm with declared links and friction, excitation, hidden cause, torque noise,
files.

Of the declared model only friction is re-identified; a linear fit of our own (sign and rate of every axis)
takes out what it can absorb, and the inertial parameters of all links where the file declares none. Gear
tables are declared only where the conditions say in what time a gear passes from one to the other: at a
reversal they leave the motion undefined.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import Arm, read_arm
from blind.conditions import (
    TODAY,
    Conditions,
    declare,
    draw_conditions,
    held_still,
    still_axes,
    without_springs,
)
from blind.motion import SMOOTH_RAD_S, Drive, excitation, inverse_dynamics, play
from blind.motion_effects import MOTION_EFFECTS, MOTION_FOREIGN
from blind.noise import component_noise, draw_noise
from blind.passage import passed
from blind.pose_scenario import Case
from blind.random_arms import write_random_arm

TRIES = 60
FINE_HZ = 1000.0  # a passage between gear tables is computed at this rate, at least
SIZING_ROWS = 1500  # that inertial parameters are taken out on
LARGEST_SHARE = 0.6  # of the largest torque that a cause of plausible size makes


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None,
              conditions: str = TODAY) -> Case:
    """Writes robot.toml, motion.csv and truth.json. theme and conditions as in `pose_scenario.draw_case`."""
    random, drawn = np.random.default_rng(seed), draw_conditions(conditions, "motion", seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or drawn.theme(random, ("single", "pair", "clean", "foreign"), (0.65, 0.1, 0.15, 0.1))
    for _ in range(TRIES):
        robot = _robot_file(folder, random, robots, seed, drawn)
        arm = declare(robot, read_arm(robot), drawn)
        if arm is None or arm.mass is None or not arm.has_gear.all() or (
            drawn.passage_s and not any(arm.tables)
        ):
            continue
        middle = 0.5 * (arm.lower + arm.upper) + random.uniform(-0.2, 0.2, arm.axes)
        rate = float(random.choice((100.0, 250.0, 500.0, 1000.0)))
        every = int(np.ceil(FINE_HZ / rate)) if drawn.passage_s else 1
        drive = excitation(arm, middle, random.uniform(8.0, 14.0), 1.0 / (rate * every),
                           int(random.integers(2, 5)), random)
        drive = _conditioned(arm, drive, middle, random, drawn)
        cause = _draw_cause(theme, random, arm, drive)
        case = None if cause is None else _write(folder, robot, arm, drive, cause, random, seed, drawn, every)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def _robot_file(folder: Path, random, robots: Path, seed: int, drawn: Conditions) -> Path:
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
                ("coulomb_Nm", "viscous_Nm_s_rad", "rotor_inertia_kg_m2")[: 3 if rotors else 2],
                (next(friction), 8.0, 2e-4)
            )
        )
        text = re.sub(r"\[\[joints\]\]\n", more, text)
    # An axis that stands still holds its motor still; a spring behind it would have the motor follow the
    # load.
    text = without_springs(text) if drawn.still else text
    tables = "" if drawn.passage_s else r"\[joints\.gear_c?cw\][^\n]*\n(?:[a-z_]+ = [^\n]*\n)+"
    path.write_text(re.sub(tables, "", text) if tables else text)
    return path


def _conditioned(arm: Arm, drive: Drive, middle, random, drawn: Conditions) -> Drive:
    """The motion with axes that stand still, and with a direction where gear tables are declared."""
    if drawn.still:
        drive = held_still(drive, middle, still_axes(arm.axes, random))
    if not drawn.passage_s:
        return drive
    direction = np.sign(drive.rate) * np.sign(arm.motor_per_output)
    return replace(drive,
                   direction=passed(direction, drive.run, drive.time[1] - drive.time[0], drawn.passage_s))


def _draw_cause(theme: str, random, arm: Arm, drive: Drive):
    if theme == "clean":
        return ()
    pool = MOTION_FOREIGN if theme == "foreign" else MOTION_EFFECTS
    if theme not in ("single", "pair", "foreign"):
        pool = tuple(c for c in MOTION_EFFECTS + MOTION_FOREIGN if theme in (c.name, c.__name__))
    chosen = random.permutation(len(pool))[: 2 if theme == "pair" else 1]
    causes = tuple(pool[k].draw(random, arm, drive, play(arm, drive, ())) for k in chosen)
    return None if any(cause is None for cause in causes) else causes


def _inertial(arm: Arm, drive: Drive, rows: np.ndarray) -> np.ndarray:
    """(len(rows), n, 10 n) torque of every inertial parameter of the links, by differences of masses,
    centres, inertias."""
    n = arm.axes

    def torque(link: int, mass: float, centre=np.zeros(3), inertia=np.zeros((3, 3))) -> np.ndarray:
        masses, centres, inertias = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
        masses[link], centres[link], inertias[link] = mass, centre, inertia
        body = arm.with_values(mass=masses, centre=centres, inertia=inertias)
        return inverse_dynamics(body, drive.q[rows], drive.rate[rows], drive.acceleration[rows])

    columns = []
    for link in range(n):
        columns += [torque(link, 1.0)] + [torque(link, 1.0, e) - torque(link, 1.0, -e) for e in np.eye(3)]
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            inertia = np.zeros((3, 3))
            inertia[i, j] = inertia[j, i] = 1.0
            columns.append(torque(link, 0.0, inertia=inertia))
    return np.stack(columns, axis=2)


def _left_by_links(drive: Drive, error: np.ndarray, inertial: np.ndarray, rows: np.ndarray) -> float:
    """RMS over all axes of what friction and the inertial parameters of all links together cannot absorb."""
    n = error.shape[1]
    friction = np.zeros((len(rows), n, 2 * n))
    for i in range(n):
        friction[:, i, 2 * i], friction[:, i,
                                        2 * i + 1] = np.tanh(drive.rate[rows, i] / SMOOTH_RAD_S), drive.rate[
                                            rows, i
                                        ]
    design = np.concatenate([inertial, friction], axis=2).reshape(len(rows) * n, -1)
    design = design / np.maximum(np.linalg.norm(design, axis=0), 1e-9)
    values = error[rows].ravel()
    return float(np.sqrt(np.mean((values - design @ np.linalg.lstsq(design, values, rcond=1e-9)[0]) ** 2)))


def _left(drive: Drive, error: np.ndarray) -> float:
    """RMS over all axes of what Coulomb and viscous friction cannot absorb."""
    out = np.empty_like(error)
    for i in range(error.shape[1]):
        v = drive.rate[:, i]
        design = np.stack([np.tanh(v / SMOOTH_RAD_S), v], axis=1)
        out[:, i] = error[:, i] - design @ np.linalg.lstsq(design, error[:, i], rcond=None)[0]
    return float(np.sqrt(np.mean(out**2)))


def _write(folder, robot, arm, drive, causes, random, seed, drawn: Conditions, every: int) -> Case | None:
    clean = play(arm, drive, ())
    left = lambda error: _left(drive, error)
    if not drawn.masses:
        rows = np.linspace(0, len(drive.time) - 1, min(SIZING_ROWS, len(drive.time))).astype(int)
        inertial = _inertial(arm, drive, rows)
        left = lambda error: _left_by_links(drive, error, inertial, rows)
    sigma = random.uniform(0.005, 0.02) * np.abs(clean.tau).max(axis=0)
    sigma = sigma * component_noise(drawn, arm.axes, random)
    level = float(np.sqrt(np.mean(sigma**2)))
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(3.0))))
    if len(causes) == 2:
        raised = max(raised, 1.5)
    for _ in range(2):
        sized = []
        for cause in causes:
            size = left(play(arm, drive, (cause,)).tau - clean.tau)
            if size < 1e-9:
                return None
            sized.append(cause.scaled(cause.size * np.sqrt(raised**2 - 1.0) * level / size))
        causes = tuple(sized)
    if any(abs(cause.size) > cause.largest for cause in causes):
        return None
    played = play(arm, drive, causes)
    if np.any(np.abs(played.tau - clean.tau).max(axis=0) > LARGEST_SHARE * np.abs(clean.tau).max(axis=0)):
        return None
    noise = draw_noise(drawn, played.tau.shape, random, drive.run, 1.0 / (drive.time[1] - drive.time[0]))
    tau = played.tau + noise * sigma
    numbers = np.unique(drive.run)
    record = {
        "kind": "motion", "seed": seed, "effects": [cause.truth() for cause in causes], "noise": level,
        "best": level,
        "declared": left(tau - clean.tau), "arm": arm.name, "rows": len(tau), "has": [f"{len(numbers)} runs"],
        "conditions": drawn.truth(),
    }
    record["raised"] = record["declared"] / level
    if every > 1:
        logged = np.concatenate([np.flatnonzero(drive.run == number)[::every] for number in numbers])
        drive, tau, played = drive.part(logged), tau[logged], replace(played, theta=played.theta[logged])
        record["rows"] = len(logged)
    columns = {"time_s": drive.time, "run": drive.run}
    columns["set"] = np.where(drive.run == numbers[-1], "validation", "identification")
    step = 2.0 * np.pi / 2**17
    theta = np.round(played.theta / step) * step
    reported = random.integers(3)  # motor angles, or the controller's joint angles in either unit
    reported = 0 if drawn.passage_s else reported
    for i in range(arm.axes):
        q = theta[:, i] / arm.motor_per_output[i] + arm.offset[i]
        columns |= (({f"theta_{i + 1}_rad": theta[:, i]}, {f"q_{i + 1}_rad": q},
                     {f"q_{i + 1}_deg": np.rad2deg(q)})[reported])
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
