"""Usual mistakes in tracked motions beyond those of poses: device and controller do not keep the same time.

What is compared needs no frames: the speed of the target as measured, and that of the flange by the joint angles.
"""

from __future__ import annotations

import numpy as np

from exactarm import _core
from exactarm.dataset import Dataset
from exactarm.identify.clock_drift import lags
from exactarm.identify.planned import controller_angles
from exactarm.identify.suspicion import Suspicion
from exactarm.robot import Robot

MUCH_LAG_S = 0.3  # an effect of the library fits what is shorter


def tracked_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    if not robot.has_geometry or data.time is None:
        return []
    found = []
    for run in np.unique(data.run):
        rows = np.flatnonzero(data.run == run)
        rows = rows[np.argsort(data.time[rows], kind="stable")]
        if rows.size < 60:
            continue
        time = data.time[rows]
        flange = _core.forward_kinematics(
            robot.core, np.ascontiguousarray(controller_angles(robot, data.select(rows)))
        )[0]
        speed = lambda points: np.linalg.norm(np.gradient(points, time, axis=0), axis=1)
        found += clock_suspicions(
            lags(time, speed(flange), speed(data.position[rows])), f"run {run}", "the tracker"
        )
    return found[:1]


def clock_suspicions(found, run: str, device: str) -> list[Suspicion]:
    """What the lags of one run tell of the device's clock."""
    if found is None:
        return []
    if found.drifts:
        share = 1e2 * (found.last - found.first) / found.span
        return [
            Suspicion(
                f"{run}: {device} lags by {1e3 * found.first:.3g} ms at the beginning and by {1e3 * found.last:.3g} ms in the end: does its "
                f"clock run {abs(share):.2g} % {'slower' if share > 0 else 'faster'}?",
                sentence=True,
            )
        ]
    if abs(found.first) > MUCH_LAG_S:
        return [
            Suspicion(
                f"{run}: {device} lags by {found.first:.3g} s throughout: do its samples begin at another instant?",
                sentence=True,
            )
        ]
    return []
