"""Poses that part two effects: where, after everything else is fitted anew, their predictions differ most.

Candidates are random poses inside the joint limits (or the measured range) with the target inside the measured
space, each approached from both directions. Of these a small set is chosen by the exchange of the design of
experiments, so that the two effects stand as many standard deviations apart as possible once the declared
parameters and the rival have absorbed what they can over old and new poses together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import View, predict_poses
from exactarm.dataset import Dataset
from exactarm.diagnose.problem import Fitted
from exactarm.diagnose.scan import free_mask
from exactarm.effects.base import Effect
from exactarm.identify.criterion import information_of
from exactarm.identify.pose_space import Box, PoseSpace
from exactarm.identify.separation import separating_set, separation_of
from exactarm.robot import Robot

_CANDIDATES = 400
_POSES = 4
_APART = 4.0  # standard deviations between two effects that nobody confuses any more
_MOST_REPEATS = 25


@dataclass(frozen=True)
class SeparatingPoses:
    """q (K, n) in rad, each to be approached from both directions and measured `repeats` times; standard deviations
    between the two effects before and after."""

    q: np.ndarray
    repeats: int
    before: float
    after: float


def separating_poses(robot: Robot, fitted: Fitted, one: Effect, other: Effect, seed: int) -> str:
    """One sentence with the poses to measure and what they would tell."""
    plan = plan_separation(robot, fitted, one, other, seed)
    names = f"{one.title} and {other.title}"
    if plan.after < _APART:
        return (f"No unloaded poses inside the limits part {names} ({len(plan.q)} poses measured {plan.repeats} times from "
                f"both directions: {plan.after:.1f} standard deviations): repeat the poses with another known payload, "
                "speed or direction of approach.")
    degrees = "; ".join("(" + ", ".join(str(round(float(angle))) for angle in np.rad2deg(q)) + ")" for q in plan.q)
    times = "" if plan.repeats == 1 else f", {plan.repeats} times each"
    return (f"Measure q = {degrees} degrees, approached from both directions{times}: then {names} stand {plan.after:.1f} "
            f"standard deviations apart instead of {plan.before:.1f}.")


def plan_separation(robot: Robot, fitted: Fitted, one: Effect, other: Effect, seed: int) -> SeparatingPoses:
    """The poses that part `one` (at its values) from `other` (at any values), on top of the fitted data."""
    q = _candidate_poses(robot, fitted, seed)
    both_ways = np.repeat(q, 2, axis=0)
    approach = np.tile([[-1.0], [1.0]], (len(q), robot.axes))
    data = fitted.view.data
    new = Dataset.of_arrays(
        "poses",
        {"q": both_ways, "approach": approach},
        session=np.full(len(both_ways), data.session[0]),
        position=np.zeros((len(both_ways), 3)),
        covariates={name: np.full(len(both_ways), values.mean()) for name, values in data.covariates.items()},
    )
    keep = _others(fitted, one, other)
    view = predict_poses(robot, fitted.layout, new).view
    pool = _columns(view, one, other, keep) / fitted.sigma[:3, None]
    pool = pool.reshape(len(q), 6, -1)
    old = _columns(fitted.view, one, other, keep) * fitted.scale[:, :3, None]
    known = information_of(old) + _prior(fitted, keep, pool.shape[-1])
    found = separating_set(pool, known, _POSES, np.random.default_rng(seed))
    gained = information_of(pool[found.chosen])
    for repeats in range(1, _MOST_REPEATS + 1):
        after = separation_of(known + repeats * gained)
        if after >= _APART:
            break
    return SeparatingPoses(q[found.chosen], repeats, found.before, after)


def _candidate_poses(robot: Robot, fitted: Fitted, seed: int) -> np.ndarray:
    """(C, n) poses; an axis without limits stays in its measured range, the target in the measured space."""
    measured = fitted.view.q
    joints = tuple(
        replace(
            joint,
            q_min=measured[:, i].min() if joint.q_min is None else joint.q_min,
            q_max=measured[:, i].max() if joint.q_max is None else joint.q_max,
        )
        for i, joint in enumerate(robot.joints)
    )
    open_space = PoseSpace.of(replace(robot, joints=joints), Box(np.full(3, -np.inf), np.full(3, np.inf)))
    seen = open_space.target(measured)
    box = Box(seen.min(axis=0), seen.max(axis=0))
    return replace(open_space, box=box).draw(_CANDIDATES, np.random.default_rng(seed))


def _others(fitted: Fitted, one: Effect, other: Effect) -> np.ndarray:
    """(P,) the free parameters that belong to neither effect."""
    keep = np.ones(fitted.layout.size, bool)
    for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
        if effect.label in (one.label, other.label):
            keep[where] = False
    return keep


def _columns(view: View, one: Effect, other: Effect, keep: np.ndarray) -> np.ndarray:
    """(N, 3, m) declared parameters, the rival's parameters, and the signal of `one` last."""
    signal = view.response(one)[:, :3, free_mask(one)] @ np.array(one.values)[free_mask(one)]
    rival = view.response(other)[:, :3, free_mask(other)]
    return np.concatenate([view.tangents["measured"][:, :, keep], rival, signal[:, :, None]], axis=2)


def _prior(fitted: Fitted, keep: np.ndarray, size: int) -> np.ndarray:
    """(m, m) information of the priors of regularised parameters."""
    rows = np.zeros((len(fitted.prior_rows), size))
    rows[:, : int(keep.sum())] = fitted.prior_rows[:, keep]
    return rows.T @ rows
