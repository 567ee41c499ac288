"""One drawn case of static poses: arm, commands, set-up, hidden causes scaled to a wanted error, noise,
files.

The size of a cause is chosen so that the declared model, identified anew, is left with `raised` times the
error that the true model would be left with on the validation rows.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from blind.arm import Arm, gravity_torque, output_angle, posture, read_arm, turn
from blind.conditions import TODAY, Conditions, declare, draw_conditions, still_axes
from blind.foreign_effects import FOREIGN_EFFECTS
from blind.hidden import Hidden, Rows, Setting
from blind.noise import component_noise, draw_noise
from blind.pose_effects import POSE_EFFECTS
from blind.pose_sets import in_a_cube, over_the_range
from blind.poses import Setup, Truth, fit_left, measure, spoiled
from blind.random_arms import write_random_arm

SHIPPED = ("ur10", "racer-7-1.4", "tx40")
LARGEST_SHIFT_M = 0.015  # that a cause of plausible size makes at the target
TRIES = 60
CUBE_POSES, FEW_POSES = 200, 60


@dataclass(frozen=True)
class Case:
    """What was written, and the truth about it."""

    robot: Path
    data: Path
    truth: dict


def draw_case(folder: Path, seed: int, robots: Path, theme: str | None = None,
              conditions: str = TODAY) -> Case:
    """Writes robot.toml, poses.csv and truth.json into `folder`.

    theme: "clean", "foreign", "pair", a name, or drawn; conditions: one of `conditions.NAMES`.
    """
    random, drawn = np.random.default_rng(seed), draw_conditions(conditions, "poses", seed)
    folder.mkdir(parents=True, exist_ok=True)
    theme = theme or drawn.theme(random, ("single", "clean", "foreign", "pair"), (0.68, 0.12, 0.1, 0.1))
    wanted = None if theme in ("single", "clean", "foreign", "pair") else theme
    for _ in range(TRIES):
        robot = pose_robot_file(folder, random, robots, seed)
        arm = declare(robot, read_arm(robot), drawn)
        if arm is None:
            continue
        truth, rows = _true_world(arm, random, drawn)
        causes = _draw_causes(theme, wanted, random, truth, rows)
        if causes is None:
            continue
        case = _write(folder, robot, truth, rows, causes, random, seed, drawn)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}: no case of {theme} after {TRIES} draws")


def pose_robot_file(folder: Path, random, robots: Path, seed: int) -> Path:
    path = folder / "robot.toml"
    choice = random.integers(6)
    if choice < 3:
        shutil.copy(robots / f"{SHIPPED[choice]}.toml", path)
    else:
        write_random_arm(path, random, f"arm-{seed}")
    return path


def _true_world(declared: Arm, random, drawn: Conditions) -> tuple[Truth, Rows]:
    """The true arm beside its drawing, the set-ups and the commands."""
    rows = _rows(declared, random, drawn)
    return draw_set_up(declared, random, len(np.unique(rows.session)), drawn), rows


def draw_set_up(declared: Arm, random, sessions: int, drawn: Conditions = Conditions()) -> Truth:
    """The true arm beside its drawing, and where it stands in each session."""
    n = declared.axes
    shape = lambda sigma: random.normal(0.0, sigma, n)
    off, turned, zero = drawn.geometry_m, 5e-4 * drawn.angles, 1e-3 * drawn.angles
    arm = declared.with_values(
        a=declared.a + shape(off), d=declared.d + shape(off) * ~declared.hayati,
        alpha=declared.alpha + shape(turned),
        beta=declared.beta + shape(turned) * declared.hayati, offset=declared.offset + shape(zero),
    )
    tables = arm.tables or ({},) * n
    plain = np.array([not table for table in tables])
    arm = arm.with_values(ratio=np.where(plain, arm.ratio * (1.0 + shape(1e-4)), arm.ratio))
    base, tool = np.zeros((sessions, 6)), np.zeros((sessions, 6))
    for s in range(sessions):
        base[s, :3] = random.normal(size=3) * (2.0, 2.0, 0.7)
        level = random.random() < 0.6
        base[s, 3:] = (
            (*random.normal(0.0, 0.01, 2), random.uniform(-np.pi, np.pi))
            if level else random.normal(0.0, 1.0, 3)
        )
        tool[s, :3] = random.uniform((-0.15, -0.15, 0.03), (0.15, 0.15, 0.3))
        tool[s, 3:] = random.normal(0.0, 0.8, 3)
    return Truth(arm, Setup(base, tool), (), declared)


def _rows(arm: Arm, random, drawn: Conditions) -> Rows:
    """Commands within the limits and above the floor, in one to three sessions, with or without repeated
    visits."""
    sessions = random.choice((1, 1, 1, 1, 2, 2, 3))
    total = int(random.integers(max(80, 60 * sessions), 301))
    repeats = int(random.choice((1, 1, 2, 3)))
    if drawn.pose_set:
        sessions, repeats, total = 1, 1, CUBE_POSES if drawn.pose_set == "cube" else FEW_POSES
    distinct = max(total // repeats, 50)
    phi = (in_a_cube if drawn.pose_set == "cube" else over_the_range)(arm, distinct, random)
    still = still_axes(arm.axes, random) if drawn.still else np.zeros(arm.axes, bool)
    phi[:, still] = phi[0, still]
    visit = np.concatenate([random.permutation(distinct) for _ in range(repeats)])
    session = 1 + np.arange(len(visit)) * sessions // len(visit)
    command = phi[visit] * arm.motor_per_output
    step = np.diff(command, axis=0, prepend=random.uniform(-1, 1, (1, arm.axes)) * arm.motor_per_output)
    direction = np.sign(step) if random.random() < 0.5 else random.choice((-1.0, 1.0), step.shape)
    if random.random() < 0.3:
        direction *= random.random(step.shape) > 0.1
    direction = direction * ~still
    time = np.cumsum(random.uniform(15.0, 60.0, len(visit)))
    warm = random.uniform(2.0, 12.0) * (1.0 - np.exp(-time / random.uniform(1800.0, 7200.0)))
    swing = random.uniform(0.0, 3.0) * np.sin(time / random.uniform(600.0, 4000.0) + random.uniform(0, 6.28))
    has = {name for name, chance in (("approach", 0.6), ("time", 0.5), ("temperature", 0.4),
                                     ("orientation", 0.3)) if random.random() < chance}
    if repeats > 1 and random.random() < 0.7:
        has.add("visit")
    held = random.permutation(distinct) < int(round(0.3 * distinct))
    direction = direction if "approach" in has else np.zeros_like(direction)
    return Rows(command, direction, session, np.arange(len(visit), dtype=float), time, 20.0 + warm + swing,
                visit + 1, ~held[visit], frozenset(has))


def _setting(truth: Truth, rows: Rows) -> Setting:
    arm = truth.arm
    q = output_angle(arm, rows.command, rows.direction) + arm.offset
    at = posture(arm, q)
    return Setting(arm, rows, gravity_torque(arm, at), at)


def _draw_causes(theme, wanted, random, truth, rows) -> tuple[Hidden, ...] | None:
    setting = _setting(truth, rows)
    if theme == "clean":
        return ()
    pool = FOREIGN_EFFECTS if theme == "foreign" else POSE_EFFECTS
    if wanted:
        pool = tuple(c for c in POSE_EFFECTS + FOREIGN_EFFECTS if wanted in (c.name, c.__name__))
    kinds = [pool[i] for i in random.permutation(len(pool))[: 2 if theme == "pair" else 1]]
    causes = tuple(kind.draw(random, setting) for kind in kinds)
    return None if any(cause is None for cause in causes) else causes


def _write(folder, robot, truth, rows, causes, random, seed, drawn: Conditions) -> Case | None:
    sigma = random.uniform(3e-5, 1.5e-4) / np.sqrt(3.0)
    sigma_turn = sigma / random.uniform(0.15, 0.5) if "orientation" in rows.has else None
    noise = _noise(truth, rows, sigma, random, drawn)
    turned = random.normal(0.0, sigma_turn, (len(rows), 3)) if sigma_turn else np.zeros((len(rows), 3))
    raised = float(np.exp(random.uniform(np.log(1.05), np.log(5.0))))
    clean, _ = measure(truth, rows)
    sized = []
    for cause in causes:
        cause = _to_size(cause, truth, rows, raised, sigma, sigma_turn)
        if cause is None:
            return None
        sized.append(
            cause.scaled(cause.size * (1.0 if len(causes) == 1 else np.sqrt(random.uniform(0.4, 1.0))))
        )
    truth = replace(truth, hidden=tuple(sized))
    position, rotation = measure(truth, rows)
    shift = np.linalg.norm(position - clean, axis=1)
    if causes and shift[~spoiled(truth, rows)].max() > LARGEST_SHIFT_M:
        return None
    position, rotation = position + noise, turn(turned) @ rotation
    best = fit_left(truth, rows, position, rotation, sigma, sigma_turn)
    declared = (
        fit_left(replace(truth, hidden=()), rows, position, rotation, sigma, sigma_turn, steps=4)
        if causes else best
    )
    record = {
        "kind": "poses", "seed": seed, "effects": [cause.truth() for cause in truth.hidden],
        "noise": float(np.sqrt(3.0) * sigma), "best": best.validation, "declared": declared.validation,
        "raised": declared.validation / best.validation, "arm": truth.declared.name, "rows": len(rows),
        "sessions": len(truth.setup.base), "has": sorted(rows.has), "largest_shift": float(shift.max()),
        "conditions": drawn.truth(),
    }
    data = folder / "poses.csv"
    _table(truth.declared, rows, position, rotation, random).to_csv(data, index=False, float_format="%.10g")
    (folder / "truth.json").write_text(json.dumps(record, indent=1))
    return Case(robot, data, record)


def _noise(truth: Truth, rows: Rows, sigma: float, random, drawn: Conditions) -> np.ndarray:
    """(N, 3) of RMS sigma per component: even; or with an axis of its own; or growing with the distance; or
    partly the repeatability of the joints, which does not come back at the next visit."""
    noise = draw_noise(drawn, (len(rows), 3), random, joined=True)
    kind = random.choice(("even", "axes", "distance", "joints"), p=(0.55, 0.15, 0.15, 0.15))
    if kind == "axes":
        noise *= random.uniform(0.5, 1.5, 3)
    elif kind == "distance":
        far = np.linalg.norm(measure(truth, rows)[0], axis=1, keepdims=True)
        noise *= 0.5 + far / far.mean()
    elif kind == "joints":
        slack = random.normal(0.0, 1e-5, rows.command.shape) * truth.arm.motor_per_output
        moved = measure(truth, replace(rows, command=rows.command + slack))[0] - measure(truth, rows)[0]
        noise += moved / np.sqrt(np.mean(moved**2))
    noise = noise * component_noise(drawn, 3, random)
    return sigma * noise / np.sqrt(np.mean(noise**2))


def _to_size(cause: Hidden, truth: Truth, rows: Rows, raised: float, sigma: float,
             sigma_turn) -> Hidden | None:
    """The cause at the size that makes the declared model's error `raised` times the noise, as if there were
    none."""
    if cause.spoiled(rows) is not None:
        return cause.scaled(np.sqrt(3.0) * sigma)
    for _ in range(3):
        world = replace(truth, hidden=(cause,))
        position, rotation = measure(world, rows)
        left = fit_left(truth, rows, position, rotation, sigma, sigma_turn, steps=2).validation
        if left < 1e-9:
            return None
        factor = np.sqrt(raised**2 - 1.0) * np.sqrt(3.0) * sigma / left
        cause = cause.scaled(cause.size * factor)
        if 0.9 < factor < 1.1:
            break
    return cause


def _table(arm: Arm, rows: Rows, position, rotation, random) -> pd.DataFrame:
    """Columns as docs/files.md has them, with the units that the case happened to choose."""
    columns: dict[str, np.ndarray] = {}
    if "time" in rows.has:
        columns["time_s"] = rows.time
    if len(np.unique(rows.session)) > 1 or random.random() < 0.3:
        columns["session"] = rows.session
    if "visit" in rows.has:
        columns["visit"] = rows.visit
    columns["set"] = np.where(rows.identification, "identification", "validation")
    reports_joint = not arm.has_gear.any()
    for i in range(arm.axes):
        values = rows.command[:, i] + (arm.offset[i] if reports_joint else 0.0)
        columns[f"{'q' if reports_joint else 'theta'}_{i + 1}_rad"] = values
    if "approach" in rows.has:
        columns |= {f"approach_{i + 1}": rows.direction[:, i].astype(int) for i in range(arm.axes)}
    millimetres = random.random() < 0.5
    for k, axis in enumerate("xyz"):
        columns[f"{axis}_mm" if millimetres else f"{axis}_m"] = position[:, k] * (1e3 if millimetres else 1.0)
    if "orientation" in rows.has:
        columns |= {f"q{axis}": values for axis, values in zip("wxyz", _quaternion(rotation).T)}
    if "temperature" in rows.has:
        columns["temperature_degC"] = rows.temperature
    if random.random() < 0.2:
        columns["humidity_percent"] = 50.0 + np.cumsum(random.normal(0.0, 0.2, len(rows)))
    return pd.DataFrame(columns)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """(N, 4) w, x, y, z: the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix."""
    r = rotation
    upper = np.zeros((len(r), 4, 4))
    upper[:, 0, 0] = np.trace(r, axis1=1, axis2=2)
    skew = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1)
    upper[:, 0, 1:] = upper[:, 1:, 0] = skew
    upper[:, 1:, 1:] = r + np.swapaxes(r, 1, 2) - np.trace(r, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.linalg.eigh(upper)[1][:, :, -1]
