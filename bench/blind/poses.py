"""Poses of a true arm with hidden causes, at rest or on the move: what the device reads, and what a fit of
the true model leaves.

    theta -> phi -> q <- gravity -> flange, tool, base -> device,   fixed point of q and its own gravity
    torque

`fit_left`: Gauss-Newton on the identification rows from the true values, with forward differences and a wide
prior around the truth for what the data cannot tell; the RMS on the validation rows. With the hidden causes
in the model that is the best that anybody can reach, without them it is the error that the declared model is
left with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from blind.arm import Arm, gravity_torque, output_angle, posture, spring_deflection, turn
from blind.hidden import Hidden, Rows
from blind.motion import inverse_dynamics

_FIELDS = ("a", "alpha", "offset")
_STEP = 1e-6  # m or rad
_PRIOR = 0.02  # m or rad: standard deviation of the wide prior
_PASSES, _SETTLED_RAD = 12, 1e-12


@dataclass(frozen=True)
class Setup:
    """Where the arm stands and what it carries, per session: base (S, 6) and tool (S, 6), metres and rotation
    vectors."""

    base: np.ndarray
    tool: np.ndarray


@dataclass(frozen=True)
class Truth:
    """Everything that makes the data, but for the noise."""

    arm: Arm
    setup: Setup
    hidden: tuple[Hidden, ...]
    declared: Arm


def measure(truth: Truth, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Position (N, 3) and rotation (N, 3, 3) of the target in the device's frame, without noise."""
    arm = truth.arm
    for cause in truth.hidden:
        arm = cause.links(arm)
    phi = output_angle(arm, rows.command, rows.direction)
    phi = phi + sum(cause.gear(arm, phi, rows) for cause in truth.hidden)
    q = phi + arm.offset
    moves_under_load = (
        arm.mass is not None
        and (np.any(arm.linear) or any(type(c).spring is not Hidden.spring for c in truth.hidden))
    )
    for _ in range(_PASSES if moves_under_load else 1):
        before = q
        torque = load(arm, q, rows)
        rest = phi + arm.offset - spring_deflection(arm, torque)
        q = rest + sum(cause.spring(arm, q, torque, rows) for cause in truth.hidden)
        if np.max(np.abs(q - before)) < _SETTLED_RAD:
            break
    stretch = np.prod([np.broadcast_to(cause.stretch(rows), len(rows)) for cause in truth.hidden]
                      + [np.ones(len(rows))], axis=0)
    at = posture(arm, q, stretch)
    which = np.unique(rows.session, return_inverse=True)[1]
    base, tool = truth.setup.base[which], truth.setup.tool[which]
    target = at.flange + np.einsum("nij,nj->ni", at.rotation[:, -1], tool[:, :3])
    rotation = at.rotation[:, -1] @ turn(tool[:, 3:])
    moved = [cause.structure(arm, at, target, rows) for cause in truth.hidden]
    for shift, turned in (pair for pair in moved if pair is not None):
        target, rotation = target + shift, turn(turned) @ rotation
    frame = turn(base[:, 3:])
    position = base[:, :3] + np.einsum("nij,nj->ni", frame, target)
    position = position + sum(cause.device(position, rows) for cause in truth.hidden)
    return position, frame @ rotation


def load(arm: Arm, q: np.ndarray, rows: Rows) -> np.ndarray:
    """(N, n) torque at the joints: gravity at rest, and what the acceleration adds in motion."""
    if rows.rate is None or arm.mass is None:
        return gravity_torque(arm, posture(arm, q))
    return inverse_dynamics(arm, q, rows.rate, rows.acceleration)


def spoiled(truth: Truth, rows: Rows) -> np.ndarray:
    """(N,) rows that are wrong by themselves."""
    out = np.zeros(len(rows), bool)
    for cause in truth.hidden:
        wrong = cause.spoiled(rows)
        if wrong is not None:
            out |= wrong
    return out


def _free_numbers(truth: Truth) -> list[tuple[str, tuple]]:
    """What the declared model re-identifies, as (field, index)."""
    arm, tables = truth.arm, truth.arm.tables or ({},) * truth.arm.axes
    numbers = [(name, (i,)) for name in _FIELDS for i in range(arm.axes)]
    numbers += [("beta" if arm.hayati[i] else "d", (i,)) for i in range(arm.axes)]
    numbers += [("ratio", (i,)) for i in range(arm.axes) if arm.has_gear[i] and not tables[i]]
    for frame in ("base", "tool"):
        numbers += [(frame, (s, k)) for s in range(len(truth.setup.base)) for k in range(6)]
    return numbers


def _moved(truth: Truth, field: str, index: tuple, by: float) -> Truth:
    if field in ("base", "tool"):
        values = getattr(truth.setup, field).copy()
        values[index] += by
        return replace(truth, setup=replace(truth.setup, **{field: values}))
    values = getattr(truth.arm, field).copy()
    values[index] += by * (values[index] if field == "ratio" else 1.0)
    return replace(truth, arm=truth.arm.with_values(**{field: values}))


@dataclass(frozen=True)
class Fit:
    """RMS (m) of the Euclidean position error after the fit, spoiled rows left out when the model knows of
    them."""

    identification: float
    validation: float


def fit_left(truth: Truth, rows: Rows, position, rotation, sigma: float, sigma_turn: float | None,
             steps: int = 2) -> Fit:
    """Fits what the declared model re-identifies, and the size of every cause in `truth`, from the true
    values."""
    use = rows.identification & ~spoiled(truth, rows)
    numbers = _free_numbers(truth)

    def residual(model: Truth) -> np.ndarray:
        p, r = measure(model, rows)
        parts = [(position - p) / sigma]
        if sigma_turn is not None:
            parts.append(_rotation_vector(rotation @ np.swapaxes(r, 1, 2)) / sigma_turn)
        return np.concatenate(parts, axis=1)

    for _ in range(steps):
        now, columns = residual(truth), []
        for field, index in numbers:
            columns.append((residual(_moved(truth, field, index, _STEP)) - now)[use].ravel() / _STEP)
        sizes = [1e-3 * cause.size for cause in truth.hidden]
        for k, (cause, step) in enumerate(zip(truth.hidden, sizes)):
            columns.append((residual(_resized(truth, k, cause.size + step)) - now)[use].ravel() / step)
        prior = np.concatenate([np.full(len(numbers), 1.0 / _PRIOR),
                                np.array([1e-3 / abs(s) for s in sizes])])
        stacked = np.concatenate([np.stack(columns, axis=1), np.diag(prior)])
        scale = np.linalg.norm(stacked, axis=0)
        right = np.concatenate([now[use].ravel(), np.zeros(len(prior))])
        step = -np.linalg.lstsq(stacked / scale, right, rcond=None)[0] / scale
        for (field, index), value in zip(numbers, step):
            truth = _moved(truth, field, index, value)
        for k, value in enumerate(step[len(numbers) :]):
            truth = _resized(truth, k, truth.hidden[k].size + value)
    norm = np.linalg.norm(position - measure(truth, rows)[0], axis=1)
    good = ~spoiled(truth, rows)
    rms = lambda mask: float(np.sqrt(np.mean(norm[mask] ** 2)))
    return Fit(rms(rows.identification & good), rms(~rows.identification & good))


def _resized(truth: Truth, index: int, size: float) -> Truth:
    hidden = list(truth.hidden)
    hidden[index] = hidden[index].scaled(size)
    return replace(truth, hidden=tuple(hidden))


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """(N, 3) of small turns: the antisymmetric part."""
    return 0.5 * np.stack(
        [rotation[:, 2, 1] - rotation[:, 1, 2], rotation[:, 0, 2] - rotation[:, 2, 0],
         rotation[:, 1, 0] - rotation[:, 0, 1]], axis=1
    )
