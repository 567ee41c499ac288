"""One drawn case of a tracked motion: arm, set-up, runs of smooth excitation, hidden cause scaled to a wanted
error, noise.

The cause is sized on a few hundred rows, by the fit that static poses are sized by; loads are those of the
moving arm. A held-out run may leave the angles of the others: a cause that they hardly show may be large
there. So it is sized, and called clear, by the smaller of its two traces, on the rows that are fitted and on
those that are held out. The best possible and the declared model's error count what the noise does to the
fit: each row stands for a block of samples and carries the mean of their noise.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import posture, read_arm
from blind.conditions import (
    TODAY,
    Conditions,
    declare,
    draw_conditions,
    held_still,
    still_axes,
    without_springs,
)
from blind.hidden import Hidden, Rows, Setting
from blind.motion import excitation
from blind.noise import component_noise, draw_noise, with_memory
from blind.passage import passed
from blind.pose_scenario import LARGEST_SHIFT_M, Case, draw_set_up, pose_robot_file
from blind.poses import Fit, Truth, fit_left, load, measure
from blind.tracked_effects import SHAKING, TRACKED_EFFECTS, TRACKED_FOREIGN

TRIES = 60
SIZING_ROWS = 300


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None,
              conditions: str = TODAY) -> Case:
    """Writes robot.toml, tracked.csv and truth.json. theme and conditions as in `pose_scenario.draw_case`."""
    random, drawn = np.random.default_rng(seed), draw_conditions(conditions, "tracked_motion", seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or drawn.theme(random, ("single", "clean", "foreign", "pair"), (0.68, 0.12, 0.1, 0.1))
    for _ in range(TRIES):
        robot = _robot_file(folder, random, robots, seed, drawn)
        declared = declare(robot, read_arm(robot), drawn)
        if declared is None or (drawn.passage_s and not any(declared.tables)):
            continue
        rows = _rows(declared, random, drawn)
        truth = draw_set_up(declared, random, 1, drawn)
        causes = _draw_causes(theme, random, truth, rows)
        case = None if causes is None else _write(folder, robot, truth, rows, causes, random, seed, drawn)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def _robot_file(folder: Path, random, robots: Path, seed: int, drawn: Conditions) -> Path:
    """A shipped or a drawn arm without gear tables: at a reversal they leave the motion undefined.

    With them, and then without springs that they would shake, where the conditions define the passage at a
    reversal.
    """
    path = pose_robot_file(folder, random, robots, seed)
    if drawn.passage_s:
        path.write_text(without_springs(path.read_text()))
        return path
    path.write_text(re.sub(r"\[joints\.gear_c?cw\][^\n]*\n(?:[a-z_]+ = [^\n]*\n)+", "", path.read_text()))
    return path


def _rows(arm, random, drawn: Conditions) -> Rows:
    middle = 0.5 * (arm.lower + arm.upper) + random.uniform(-0.2, 0.2, arm.axes)
    rate, runs = float(random.choice((100.0, 200.0, 333.0))), int(random.integers(1, 5))
    seconds = float(random.uniform(8.0, 14.0))
    drive = excitation(arm, middle, seconds, 1.0 / rate, runs, random)
    if drawn.still:
        drive = held_still(drive, middle, still_axes(arm.axes, random))
    direction = np.sign(drive.rate) * np.sign(arm.motor_per_output)
    if drawn.passage_s:
        direction = passed(direction, drive.run, 1.0 / rate, drawn.passage_s)
    clock = drive.time + (drive.run - 1) * (seconds + 5.0)
    held = drive.run == runs if runs > 1 else drive.time > 0.7 * seconds
    has = {name for name, chance in (("time", 1.0), ("temperature", 0.4)) if random.random() < chance}
    command = (drive.q - arm.offset) * arm.motor_per_output
    return Rows(
        command, direction, np.ones(len(clock), int), np.arange(len(clock), dtype=float),
        clock, drive.temperature - 5.0, drive.run, ~held, frozenset(has), drive.rate, drive.acceleration,
    )


def _draw_causes(theme: str, random, truth: Truth, rows: Rows) -> tuple[Hidden, ...] | None:
    if theme == "clean":
        return ()
    pool = TRACKED_FOREIGN if theme == "foreign" else TRACKED_EFFECTS
    if theme not in ("single", "foreign", "pair"):
        pool = tuple(c for c in TRACKED_EFFECTS + TRACKED_FOREIGN if theme in (c.name, c.__name__))
    kinds = [pool[i] for i in random.permutation(len(pool))[: 2 if theme == "pair" else 1]]
    arm = truth.arm
    if np.any(arm.linear) and any(kind.__name__ in SHAKING for kind in kinds):
        return None
    q = rows.command / arm.motor_per_output + arm.offset
    setting = Setting(arm, rows, load(arm, q, rows), posture(arm, q))
    causes = tuple(kind.draw(random, setting) for kind in kinds)
    return None if any(cause is None for cause in causes) else causes


def _write(folder, robot, truth, rows, causes, random, seed, drawn: Conditions) -> Case | None:
    sigma = float(random.uniform(2e-5, 1e-4))
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(5.0))))
    chosen, block = _blocks(rows)
    some = rows.part(chosen)
    clean = measure(truth, some)
    sized = [_to_size(cause, truth, some, raised, sigma) for cause in causes]
    if any(cause is None for cause in sized):
        return None
    share = lambda: np.sqrt(random.uniform(0.4, 1.0)) if len(causes) > 1 else 1.0
    truth = replace(truth, hidden=tuple(cause.scaled(cause.size * share()) for cause in sized))
    exact = measure(truth, some)
    if causes and np.linalg.norm(exact[0] - clean[0], axis=1).max() > LARGEST_SHIFT_M:
        return None
    noise = _noise(rows, random, drawn) * sigma
    best = _left(truth, some, exact, noise, block, rows.identification, sigma)
    declared = (
        _left(replace(truth, hidden=()), some, exact, noise, block, rows.identification, sigma)
        if causes else best
    )
    record = {
        "kind": "tracked_motion", "seed": seed, "effects": [cause.truth() for cause in truth.hidden],
        "noise": float(np.sqrt(np.mean(np.sum(noise**2, axis=1)))), "best": best.validation,
        "declared": declared.validation,
        "raised": min(declared.validation / best.validation, declared.identification / best.identification),
        "arm": truth.declared.name, "rows": len(rows), "has": sorted(rows.has) + [f"{rows.visit.max()} runs"],
        "conditions": drawn.truth(),
    }
    data = folder / "tracked.csv"
    _table(truth.declared, rows,
           measure(truth, rows)[0] + noise).to_csv(data, index=False, float_format="%.10g")
    (folder / "truth.json").write_text(json.dumps(record, indent=1))
    return Case(robot, data, record)


def _to_size(cause: Hidden, truth: Truth, some: Rows, raised: float, sigma: float) -> Hidden | None:
    """The cause at the size that makes the declared model's error `raised` times the noise, as if there were
    none."""
    for _ in range(2):
        left = fit_left(truth, some, *measure(replace(truth, hidden=(cause,)), some), sigma, None, steps=1)
        shown = min(left.identification, left.validation)
        if shown < 1e-9:
            return None
        cause = cause.scaled(cause.size * np.sqrt(raised**2 - 1.0) * np.sqrt(3.0) * sigma / shown)
    return cause


def _blocks(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Indices (M,) of rows evenly spread, and (N,) which of them each row belongs to."""
    every = max(1, len(rows) // SIZING_ROWS)
    piece = np.arange(len(rows)) // every
    # A block lies within one run and one set.
    _, block = np.unique(np.stack([rows.visit, rows.identification, piece]), axis=1, return_inverse=True)
    block = block.ravel()
    middle = np.array([np.median(np.flatnonzero(block == k)) for k in range(block.max() + 1)]).astype(int)
    order = np.argsort(middle)
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    return middle[order], place[block]


def _left(model: Truth, some: Rows, exact, noise, block, identification, sigma) -> Fit:
    """RMS of what `model`, fitted to all samples, leaves of their noise and of what it cannot follow."""
    count = np.bincount(block)
    mean = np.stack([np.bincount(block, noise[:, k]) / count for k in range(3)], axis=1)
    fit = fit_left(model, some, exact[0] + mean, exact[1], sigma, None)
    square = lambda values, rows: float(np.mean(np.sum(values[rows] ** 2, axis=1)))
    level = lambda left, of_blocks, rows: np.sqrt(max(left**2 - square(mean, of_blocks), 0.0)
                                                  + square(noise, rows))
    return Fit(level(fit.identification, some.identification, identification),
               level(fit.validation, ~some.identification, ~identification))


def _noise(rows: Rows, random, drawn: Conditions) -> np.ndarray:
    """(N, 3) of unit variance: white, or in half of the cases of a memory of some milliseconds to tenths of a
    second."""
    per_second = 1.0 / np.median(np.diff(rows.time))
    noise = draw_noise(drawn, (len(rows), 3), random, rows.visit, per_second)
    if random.random() < 0.5:
        noise = with_memory(noise, np.exp(random.uniform(np.log(3e-3), np.log(0.1))) * per_second)
    return noise * component_noise(drawn, 3, random)


def _table(arm, rows: Rows, position) -> pd.DataFrame:
    columns = {"time_s": rows.time, "run": rows.visit,
               "set": np.where(rows.identification, "identification", "validation")}
    reports_joint = not arm.has_gear.any()
    for i in range(arm.axes):
        values = rows.command[:, i] + (arm.offset[i] if reports_joint else 0.0)
        columns[f"{'q' if reports_joint else 'theta'}_{i + 1}_rad"] = values
    columns |= {f"{axis}_m": position[:, k] for k, axis in enumerate("xyz")}
    if "temperature" in rows.has:
        columns["temperature_degC"] = rows.temperature
    return pd.DataFrame(columns)
