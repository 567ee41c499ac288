"""A virtual partner: a second arm of the same type beside the first, whose ball the target touches in poses
of both arms.

It deviates from its drawing as any new arm does, and its robot file is one that a calibration has written:
the truth up to `CALIBRATED_M` and `CALIBRATED_RAD` (standard deviations), with intervals that say so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import Partner
from exactarm.errors import ComputationError
from exactarm.measurement.partner import NAME
from exactarm.measurement.touching import TOUCHES_M, rows_at, target_at, touching
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Joint, Placement, Robot
from exactarm.simulate.profiles import limit
from exactarm.simulate.sensors import Sensors
from exactarm.simulate.virtual_robot import VirtualRobot, deviated

CALIBRATED_M, CALIBRATED_RAD = 2e-5, 2e-5  # of each length, of each angle
DISTANCE_M = 0.0254  # of the balls' centres
FILE = "partner.toml"
_SLIP_M = 5e-3  # standard deviation of a touch that has slipped
_APART = 0.95  # of the greatest reach: how far the two bases are from each other
_LEANS_RAD, _TURNED_RAD, _HIGHER_M, _BALL_M = 0.02, 0.3, 0.05, 0.12
_TWO_SIGMA = 1.959964  # half a 95 % interval
_POOL = 40  # random poses for each touch
_IN_VAIN = 5


def touched_partner(robot: VirtualRobot, count: int, sensors: Sensors,
                    random: np.random.Generator) -> tuple[Dataset, Partner]:
    """`count` touches of the target and a partner's ball, and what the fixture file says of the partner."""
    true, declared = _pair_of(robot, random)
    reached = target_at(robot.true, robot.layout, _drawn(robot.nominal, 400, random))
    far = np.linalg.norm(reached, axis=1).max()
    about = np.pi + random.normal(0.0, _TURNED_RAD)
    turn = exp(random.normal(0.0, _LEANS_RAD, 3)) @ exp(np.array([0.0, 0.0, about]))
    base = np.array([_APART * far, 0.0, random.normal(0.0, _HIGHER_M)])
    parts: list[Dataset] = []
    for attempt in range(_POOL):
        if attempt >= _IN_VAIN and not parts:
            break
        q, other = _drawn(robot.nominal, _POOL * count, random), _drawn(robot.nominal, _POOL * count, random)
        aside = random.choice([-1.0, 1.0], q.shape)
        points = target_at(robot.true, robot.layout, q)
        gap = random.normal(size=points.shape)
        gap *= DISTANCE_M / np.linalg.norm(gap, axis=1, keepdims=True)
        slips = (random.random(len(q)) < sensors.wrong_rows)[:, None]
        gap += random.normal(0.0, sensors.position_m, gap.shape) + slips * random.normal(0.0, _SLIP_M,
                                                                                         gap.shape)
        goal = (points + gap - base) @ turn
        near = np.flatnonzero(np.linalg.norm(goal, axis=1) < far)[: 4 * count]
        found, left = touching(true, Layout.of(true.effects, estimate=False), other[near], None,
                               position=goal[near])
        good = (left < TOUCHES_M) & _within(robot.nominal, found)
        if good.any():
            rows = rows_at(q[near][good], None, aside[near][good])
            parts.append(replace(rows, contacts=rows.contacts | {NAME: np.zeros(good.sum(), int)},
                                 partner=true.controller.reported(found[good])))
        if sum(map(len, parts)) >= count:
            stack = lambda pick: np.concatenate([pick(part) for part in parts])[:count]
            rows = rows_at(stack(lambda part: part.joints["q"]), None,
                           stack(lambda part: part.joints["approach"]))
            rows = replace(rows, contacts=rows.contacts | {NAME: np.zeros(count, int)},
                           partner=stack(lambda part: part.partner))
            return rows, Partner(FILE, DISTANCE_M, robot=declared)
    raise ComputationError("two such arms beside each other do not touch within their joint limits")


def _pair_of(robot: VirtualRobot, random: np.random.Generator) -> tuple[Robot, Robot]:
    """The partner as it is, and as its robot file has it."""
    bare = replace(robot.nominal, base=Placement(), tool=Placement())
    true = deviated(bare, 1.0, random, frames=False)
    true = replace(true, tool=Placement(np.eye(3), random.uniform(-_BALL_M, _BALL_M, 3)))
    joints, intervals = [], {}
    for axis, joint in enumerate(true.joints, 1):
        found, known = _calibrated(joint, axis, random)
        joints.append(found)
        intervals |= known
    return true, replace(true, tool=Placement(), joints=tuple(joints), intervals=intervals, file=FILE)


def _calibrated(joint: Joint, axis: int, random: np.random.Generator) -> tuple[Joint, dict]:
    """The joint as a calibration has found it, with the intervals of its parameters."""
    keys = {"a": f"a_{axis}_m", "alpha": f"alpha_{axis}_rad", "q_offset": f"q_offset_{axis}_rad"}
    keys |= {"d": f"d_{axis}_m"} if joint.beta is None else {"beta": f"beta_{axis}_rad"}
    changes, intervals = {}, {}
    for key, name in keys.items():
        sigma = CALIBRATED_M if name.endswith("_m") else CALIBRATED_RAD
        value = getattr(joint, key) + random.normal(0.0, sigma)
        changes[key] = value
        intervals[name] = (value - _TWO_SIGMA * sigma, value + _TWO_SIGMA * sigma)
    return replace(joint, **changes), intervals


def _drawn(robot: Robot, count: int, random: np.random.Generator) -> np.ndarray:
    return random.uniform(limit(robot, "q_min"), limit(robot, "q_max"), (count, robot.axes))


def _within(robot: Robot, q: np.ndarray) -> np.ndarray:
    return np.all((q > limit(robot, "q_min")) & (q < limit(robot, "q_max")), axis=1)
