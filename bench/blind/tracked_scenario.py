"""One drawn case of a tracked motion: arm, set-up, runs of smooth excitation, hidden cause scaled to a wanted error, noise.

The cause is sized on a few hundred rows, by the fit that static poses are sized by; loads are those of the moving arm.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import posture, read_arm
from blind.hidden import Hidden, Rows, Setting
from blind.motion import excitation
from blind.pose_scenario import LARGEST_SHIFT_M, Case, draw_set_up, pose_robot_file
from blind.poses import Truth, fit_left, load, measure
from blind.tracked_effects import SHAKING, TRACKED_EFFECTS, TRACKED_FOREIGN

TRIES = 60
SIZING_ROWS = 300


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None) -> Case:
    """Writes robot.toml, tracked.csv and truth.json. theme as in `pose_scenario.draw_case` (no pairs)."""
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or random.choice(("single", "clean", "foreign"), p=(0.75, 0.15, 0.1))
    for _ in range(TRIES):
        robot = _robot_file(folder, random, robots, seed)
        declared = read_arm(robot)
        rows = _rows(declared, random)
        truth = draw_set_up(declared, random, 1)
        cause = _draw_cause(theme, random, truth, rows)
        case = None if cause is None else _write(folder, robot, truth, rows, cause, random, seed)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def _robot_file(folder: Path, random, robots: Path, seed: int) -> Path:
    """A shipped or a drawn arm without gear tables: at a reversal they leave the motion undefined."""
    path = pose_robot_file(folder, random, robots, seed)
    path.write_text(re.sub(r"\[joints\.gear_c?cw\][^\n]*\n(?:[a-z_]+ = [^\n]*\n)+", "", path.read_text()))
    return path


def _rows(arm, random) -> Rows:
    middle = 0.5 * (arm.lower + arm.upper) + random.uniform(-0.2, 0.2, arm.axes)
    rate, runs = float(random.choice((100.0, 200.0, 333.0))), int(random.integers(1, 5))
    seconds = float(random.uniform(8.0, 14.0))
    drive = excitation(arm, middle, seconds, 1.0 / rate, runs, random)
    clock = drive.time + (drive.run - 1) * (seconds + 5.0)
    held = drive.run == runs if runs > 1 else drive.time > 0.7 * seconds
    has = {name for name, chance in (("time", 1.0), ("temperature", 0.4)) if random.random() < chance}
    command = (drive.q - arm.offset) * arm.motor_per_output
    return Rows(
        command, np.sign(drive.rate) * np.sign(arm.motor_per_output), np.ones(len(clock), int), np.arange(len(clock), dtype=float),
        clock, drive.temperature - 5.0, drive.run, ~held, frozenset(has), drive.rate, drive.acceleration,
    )


def _draw_cause(theme: str, random, truth: Truth, rows: Rows) -> tuple[Hidden, ...] | None:
    if theme == "clean":
        return ()
    pool = TRACKED_FOREIGN if theme == "foreign" else TRACKED_EFFECTS
    if theme not in ("single", "foreign"):
        pool = tuple(c for c in TRACKED_EFFECTS + TRACKED_FOREIGN if theme in (c.name, c.__name__))
    kind = pool[random.integers(len(pool))]
    arm = truth.arm
    if kind.__name__ in SHAKING and np.any(arm.linear):
        return None
    q = rows.command / arm.motor_per_output + arm.offset
    cause = kind.draw(random, Setting(arm, rows, load(arm, q, rows), posture(arm, q)))
    return None if cause is None else (cause,)


def _write(folder, robot, truth, rows, causes, random, seed) -> Case | None:
    sigma = float(random.uniform(2e-5, 1e-4))
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(5.0))))
    some = rows.part(np.sort(random.permutation(len(rows))[:SIZING_ROWS]))
    clean = measure(truth, some)
    for _ in range(3 if causes else 0):
        position, rotation = measure(replace(truth, hidden=causes), some)
        left = fit_left(truth, some, position, rotation, sigma, None).validation
        if left < 1e-9:
            return None
        causes = (causes[0].scaled(causes[0].size * np.sqrt(raised**2 - 1.0) * np.sqrt(3.0) * sigma / left),)
    truth = replace(truth, hidden=causes)
    if causes and np.linalg.norm(measure(truth, some)[0] - clean[0], axis=1).max() > LARGEST_SHIFT_M:
        return None
    position, rotation = measure(truth, rows)
    noise = _noise(rows, random) * sigma
    level = float(np.sqrt(np.mean(np.sum(noise[~rows.identification] ** 2, axis=1))))
    # Thousands of rows for some forty numbers: the best fit leaves the noise.
    declared = level
    if causes:
        position_some = measure(truth, some)[0] + sigma * random.normal(size=(len(some), 3))
        declared = fit_left(replace(truth, hidden=()), some, position_some, measure(truth, some)[1], sigma, None, steps=3).validation
    record = {
        "kind": "tracked_motion", "seed": seed, "effects": [cause.truth() for cause in causes], "noise": level, "best": level,
        "declared": declared, "raised": declared / (np.sqrt(3.0) * sigma) if causes else 1.0, "arm": truth.declared.name,
        "rows": len(rows), "has": sorted(rows.has) + [f"{rows.visit.max()} runs"],
    }
    data = folder / "tracked.csv"
    _table(truth.declared, rows, position + noise).to_csv(data, index=False, float_format="%.10g")
    (folder / "truth.json").write_text(json.dumps(record, indent=1))
    return Case(robot, data, record)


def _noise(rows: Rows, random) -> np.ndarray:
    """(N, 3) of unit variance: white, or in half of the cases of a memory of some milliseconds to tenths of a second."""
    noise = random.normal(size=(len(rows), 3))
    if random.random() < 0.5:
        keep = np.exp(-np.median(np.diff(rows.time)) / np.exp(random.uniform(np.log(3e-3), np.log(0.1))))
        for k in range(1, len(noise)):
            noise[k] = keep * noise[k - 1] + np.sqrt(1.0 - keep**2) * noise[k]
    return noise


def _table(arm, rows: Rows, position) -> pd.DataFrame:
    columns = {"time_s": rows.time, "run": rows.visit, "set": np.where(rows.identification, "identification", "validation")}
    reports_joint = not arm.has_gear.any()
    for i in range(arm.axes):
        values = rows.command[:, i] + (arm.offset[i] if reports_joint else 0.0)
        columns[f"{'q' if reports_joint else 'theta'}_{i + 1}_rad"] = values
    columns |= {f"{axis}_m": position[:, k] for k, axis in enumerate("xyz")}
    if "temperature" in rows.has:
        columns["temperature_degC"] = rows.temperature
    return pd.DataFrame(columns)
