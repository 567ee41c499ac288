"""One drawn case of a gear run: arm, runs, hidden cause scaled to a wanted error, sensor noise, files.

What the declared model can still absorb is taken out by a linear fit of our own: harmonics of the declared
orders per direction, the constant tilt of the gyroscope, an offset per run of a link encoder.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import read_arm
from blind.conditions import TODAY, Conditions, declare, draw_conditions
from blind.gear_effects import GEAR_EFFECTS, GEAR_FOREIGN
from blind.gear_runs import OVERSAMPLING, Reading, Runs, ramped, sense, to_and_fro
from blind.noise import component_noise, draw_noise
from blind.passage import passed
from blind.pose_scenario import Case
from blind.random_arms import write_random_arm

TRIES = 60
RAMP_S, REST_S = 0.25, 0.1
CUT_FURTHER = 0.15  # share of a run that is cut off beyond its ramp, at most
LARGEST_RATE_SHARE, LARGEST_ANGLE_RAD = 0.3, 5e-3  # that a cause of plausible size changes


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None,
              conditions: str = TODAY) -> Case:
    """Writes robot.toml, gear.csv and truth.json. theme and conditions as in `pose_scenario.draw_case`."""
    random, drawn = np.random.default_rng(seed), draw_conditions(conditions, "gear_run", seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or drawn.theme(random, ("single", "pair", "clean", "foreign"), (0.65, 0.1, 0.15, 0.1))
    for _ in range(TRIES):
        robot = _robot_file(folder, random, robots, seed)
        declared = declare(robot, read_arm(robot), drawn)
        if declared is None or not declared.has_gear.all():
            continue
        if drawn.passage_s and not any(declared.tables):
            continue
        arm = declared.with_values(offset=declared.offset + random.normal(0.0, 1e-3, declared.axes))
        encoders = declared.name == "kr300" or random.random() < 0.4
        runs = (_encoder_runs if encoders else _gyroscope_runs)(arm, random, drawn)
        tilt = _small_turn(random.normal(0.0, 0.015, 2))
        if declared.name == "kr300" and theme == "foreign":
            continue
        cause = _draw_cause(theme, random, sense(arm, runs, (), tilt))
        if cause is None:
            continue
        case = _write(folder, robot, arm, runs, tilt, cause, random, seed, drawn)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def _robot_file(folder: Path, random, robots: Path, seed: int) -> Path:
    path = folder / "robot.toml"
    choice = random.integers(5)
    if choice < 3:
        shutil.copy(robots / f"{('racer-7-1.4', 'tx40', 'kr300')[choice]}.toml", path)
    else:
        write_random_arm(path, random, f"arm-{seed}")
    return path


def _small_turn(angles) -> np.ndarray:
    a, b = angles
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return about_x @ about_y


def _rest(arm, random) -> np.ndarray:
    middle, half = 0.5 * (arm.lower + arm.upper), 0.5 * np.minimum(arm.upper - arm.lower, np.pi)
    return middle + 0.5 * half * random.uniform(-1.0, 1.0, arm.axes)


def _gyroscope_runs(arm, random, drawn: Conditions) -> Runs:
    """One or two axes, one after the other, to one side and back, at one or two speeds, two or three times
    each.

    There and back are two runs; where a passage between the tables is to be seen, one.
    """
    rate = float(random.choice((400.0, 400.0, 1000.0)))
    step = 1.0 / (rate * OVERSAMPLING)
    rest = _rest(arm, random) - arm.offset
    axes = random.permutation(min(arm.axes, 5))[: 1 + int(random.random() < 0.3)]
    speeds = random.uniform(0.7, 1.8) * np.array((1.0, 0.5) if random.random() < 0.6 else (1.0,))
    parts = []
    for axis in map(int, axes):
        low, high = arm.lower[axis] - arm.offset[axis] + 0.1, arm.upper[axis] - arm.offset[axis] - 0.1
        if high - low > 4.0:
            low, high = 0.5 * (low + high) - 2.0, 0.5 * (low + high) + 2.0
        for repeat in range(3 if len(speeds) == 1 else 2):
            for speed in speeds:
                path = ramped(high - low, speed, RAMP_S, step, REST_S)
                logged = _logged(len(path), step, RAMP_S + REST_S, random, drawn)
                for sign in (1.0, -1.0):
                    phi = np.tile(rest, (len(path), 1))
                    phi[:, axis] = low + path if sign > 0 else high - path
                    direction = np.zeros_like(phi)
                    direction[:, axis] = sign * np.sign(arm.motor_per_output[axis])
                    parts.append((phi, direction, axis, logged))
                if drawn.passage_s:
                    parts[-2:] = [_there_and_back(*parts[-2:])]
    return _joined(arm, parts, step, random, drawn)


def _there_and_back(one, other):
    """Two parts as one; it is cut at its own begin and end alone."""
    phi, direction = (np.concatenate([a, b]) for a, b in zip(one[:2], other[:2]))
    middle = len(one[0]) // 2
    first, last = one[3].copy(), other[3].copy()
    first[middle:] = last[:middle] = True
    return phi, direction, one[2], np.concatenate([first, last])


def _logged(count: int, step: float, ramp_s: float, random, drawn: Conditions) -> np.ndarray:
    """(count,) which samples are recorded: all, or none before (after) the ramp is over (begins) and a little
    more."""
    at, logged = np.arange(count) * step, np.ones(count, bool)
    for cut, elapsed in zip(drawn.cut, (at, at[::-1])):
        if cut:
            logged &= elapsed > ramp_s + random.uniform(0.0, CUT_FURTHER) * (count * step - 2.0 * ramp_s)
    return logged


def _encoder_runs(arm, random, drawn: Conditions) -> Runs:
    """Several axes wander at once; encoders on one to three of the first axes."""
    rate = 250.0
    step = 1.0 / (rate * OVERSAMPLING)
    count = int(random.integers(1, min(4, arm.axes)))
    parts = []
    for _ in range(2 + int(random.random() < 0.5)):
        phi = np.tile(_rest(arm, random) - arm.offset, (int(10.0 / step), 1))
        for axis in range(max(count, 2)):
            half = 0.35 * min(arm.upper[axis] - arm.lower[axis], np.pi)
            phi[:, axis] += to_and_fro(half, 10.0, step, random)[: len(phi)]
        speed = np.gradient(phi, step, axis=0)
        direction = np.where(np.abs(speed) > 1e-9, np.sign(speed), 0.0) * np.sign(arm.motor_per_output)
        parts.append((phi, direction, 0, _logged(len(phi), step, 0.5, random, drawn)))
    return replace(_joined(arm, parts, step, random, drawn), encoder_axes=tuple(range(count)))


def _joined(arm, parts, step: float, random, drawn: Conditions) -> Runs:
    time, run, temperature, clock = [], [], [], 0.0
    for number, (phi, *_) in enumerate(parts):
        t = np.arange(len(phi)) * step
        time.append(t)
        run.append(np.full(len(phi), number + 1))
        temperature.append(25.0 + 8.0 * (1.0 - np.exp(-(clock + t) / 40.0)))
        clock += t[-1] + 5.0
    phi, direction, axes, logged = zip(*parts)
    direction, run = np.concatenate(direction), np.concatenate(run)
    if drawn.passage_s:
        direction = passed(direction, run, step, drawn.passage_s)
    return Runs(
        np.concatenate(time), np.concatenate(phi) * arm.motor_per_output, direction, run,
        np.concatenate([np.full(len(p), axis) for p, axis in zip(phi, axes)]), np.concatenate(temperature),
        logged=np.concatenate(logged) if any(drawn.cut) else None,
    )


def _draw_cause(theme: str, random, clean: Reading):
    if theme == "clean":
        return ()
    pool = GEAR_FOREIGN if theme == "foreign" else GEAR_EFFECTS
    if theme not in ("single", "pair", "foreign"):
        pool = tuple(c for c in GEAR_EFFECTS + GEAR_FOREIGN if theme in (c.name, c.__name__))
    chosen = random.permutation(len(pool))[: 2 if theme == "pair" else 1]
    causes = tuple(pool[k].draw(random, clean.state) for k in chosen)
    return None if any(cause is None for cause in causes) else causes


def _absorbed(arm, reading: Reading, error: np.ndarray) -> np.ndarray:
    """(M, c) what is left of `error` after what the declared model re-identifies."""
    state, picked = reading.state, reading.picked
    run = state.runs.run[picked]
    left = np.empty_like(error)
    encoders = state.runs.encoder_axes
    moved = state.runs.moved[picked]
    for column, axis in enumerate(encoders or tuple(int(a) for a in np.unique(moved))):
        rows = np.ones(len(picked), bool) if encoders else moved == axis
        phi, rate, direction = (v[picked, axis][rows] for v in (state.phi, state.rate, state.runs.direction))
        columns = [np.ones(len(phi)) * (run[rows] == number) for number in np.unique(run)] if encoders else []
        tables = arm.tables[axis] if arm.tables else {}
        orders = np.unique(np.concatenate([t.order for t in tables.values()])) if tables else ()
        speed = 1.0 if encoders else rate
        for order in orders:
            columns += [f(order * phi) * (direction * side > 0) * speed for f in (np.cos, np.sin)
                        for side in (-1, 1)]
        if not encoders:
            # A constant tilt turns the reading across the axis into nothing that shows along it.
            across = error[rows, 0:2]
            left[rows, 0:2] = across - rate[:, None] * (rate @ across / (rate @ rate))
            column = 2
        left[rows, column] = error[rows, column]
        if columns:
            design = np.stack(columns, axis=1)
            left[rows, column] -= design @ np.linalg.lstsq(design, error[rows, column], rcond=1e-10)[0]
    return left


def _judged(left: np.ndarray, encoders: bool) -> float:
    return float(np.sqrt(np.mean(left**2 if encoders else left[:, 2] ** 2)))


def _write(folder, robot, arm, runs, tilt, causes, random, seed, drawn: Conditions) -> Case | None:
    encoders = bool(runs.encoder_axes)
    sigma = random.uniform(5e-6, 3e-5) if encoders else random.uniform(3e-4, 2e-3)
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(5.0))))
    clean = sense(arm, runs, (), tilt)
    share = component_noise(drawn, clean.sensor.shape[1], random)
    if not encoders:  # `sigma` is that of the moving axis
        share = share / share[2]
    if len(causes) == 2:
        raised = max(raised, 1.5)
    for _ in range(2):
        sized = []
        for cause in causes:
            error = _absorbed(arm, clean, sense(arm, runs, (cause,), tilt).sensor - clean.sensor)
            size = _judged(error, encoders)
            if not encoders:  # what shows only across the axis is found there
                size = max(size, float(np.sqrt(np.mean((error / share)[:, :2] ** 2))))
            if size < 1e-12:
                return None
            sized.append(cause.scaled(cause.size * np.sqrt(raised**2 - 1.0) * sigma / size))
        causes = tuple(sized)
    reading = sense(arm, runs, causes, tilt)
    change = np.abs(reading.sensor - clean.sensor).max()
    limit = LARGEST_ANGLE_RAD if encoders else LARGEST_RATE_SHARE * np.abs(clean.sensor).max()
    if causes and change > limit:
        return None
    noise = draw_noise(drawn, reading.sensor.shape, random, runs.run[reading.picked],
                       1.0 / (OVERSAMPLING * runs.step))
    sensor = reading.sensor + sigma * share * noise
    left = _judged(_absorbed(arm, clean, sensor - clean.sensor), encoders)
    picked = reading.picked
    numbers = np.unique(runs.run)
    record = {
        "kind": "gear_run", "seed": seed, "effects": [cause.truth() for cause in causes], "noise": sigma,
        "best": sigma,
        "declared": left, "raised": left / sigma, "arm": arm.name, "rows": len(picked), "encoders": encoders,
        "has": ["encoders" if encoders else "gyroscope", f"axis {runs.moved[0] + 1}"],
        "conditions": drawn.truth(),
    }
    columns: dict[str, np.ndarray] = {"time_s": runs.time[picked], "run": runs.run[picked]}
    if random.random() < 0.5 and len(numbers) >= 3:
        each = [numbers[[runs.moved[runs.run == number][0] == axis for number in numbers]]
                for axis in np.unique(runs.moved)]
        held = numbers[-1:] if encoders else np.concatenate([own[-2:] for own in each])
        columns["set"] = np.where(np.isin(runs.run[picked], held), "validation", "identification")
    step = 2.0 * np.pi / 2**16
    unit, scale = (("rad", 1.0), ("deg", 180.0 / np.pi))[int(random.random() < 0.3)]
    for i in range(arm.axes):
        columns[f"theta_{i + 1}_{unit}"] = np.round(runs.theta[picked, i] / step) * step * scale
    if encoders:
        columns |= {f"q_{axis + 1}_{unit}": sensor[:, k] * scale for k, axis in enumerate(runs.encoder_axes)}
    else:
        columns |= {f"gyro_{axis}_{unit}_s": sensor[:, k] * scale for k, axis in enumerate("xyz")}
    if random.random() < 0.5 or any(cause.name == "thermal_drift" for cause in causes):
        columns["temperature_degC"] = runs.temperature[picked]
    data = folder / "gear.csv"
    pd.DataFrame(columns).to_csv(data, index=False, float_format="%.12g")
    (folder / "truth.json").write_text(json.dumps(record, indent=1))
    return Case(robot, data, record)
