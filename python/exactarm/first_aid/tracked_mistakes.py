"""Usual mistakes in tracked motions beyond those of poses: device and controller do not keep the same time.

What is compared needs no frames: the speed of the target as measured, and that of the target by the joint
angles.
"""

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import runs_in_time
from exactarm.first_aid.clock_drift import LEAST_DRIFT_STEPS, SURE, Lags, lags
from exactarm.first_aid.linear_frames import linear_tool
from exactarm.first_aid.suspicion import Suspicion
from exactarm.identify.planned import controller_angles
from exactarm.robot.robot import Placement, Robot

TOOL_ROWS = 300  # from which the tool point is found
OTHER_LAG_S = 0.02  # between runs: what starts a device delays it alike, within its step
MUCH_LAG_S = 0.3  # an effect of the library fits what is shorter


def tracked_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    if not robot.has_geometry or data.time is None:
        return []
    found, bare = [], replace(robot, base=Placement(), tool=Placement()).core
    late: dict[int, Lags | None] = {}
    for rows in runs_in_time(data):
        if rows.size < 60:
            continue
        time, measured = data.time[rows], data.position[rows]
        angles = np.ascontiguousarray(controller_angles(robot, data.select(rows)))
        flange, rotation = _core.forward_kinematics(bare, angles)
        rotation = rotation.reshape(-1, 3, 3)
        some = np.unique(np.linspace(0, rows.size - 1, TOOL_ROWS).astype(int))
        target = flange + rotation @ linear_tool(flange[some], rotation[some], measured[some])
        speed = [np.linalg.norm(np.gradient(points, time, axis=0), axis=1) for points in (target, measured)]
        run = int(data.run[rows[0]])
        late[run] = lags(time, *speed)
        found += clock_suspicions(late[run], f"run {run}", "the tracker")
    return found[:1] or _other_starts({run: each for run, each in late.items() if each is not None})


def _other_starts(late: dict[int, Lags]) -> list[Suspicion]:
    """A run whose device lags otherwise than in all others; those of one lag have it in common."""
    for run, own in late.items():
        others = [each.first for other, each in late.items() if other != run]
        if not others:
            continue
        apart = own.first - np.median(others)
        least = max(OTHER_LAG_S, 2.0 * LEAST_DRIFT_STEPS * own.step, SURE * own.deviation)
        if abs(apart) > least and np.ptp(others) < 0.5 * abs(apart):
            way = "later" if apart > 0.0 else "earlier"
            return [Suspicion(f"run {run}: the tracker logs {abs(apart):.3g} s {way} than in the other runs: "
                              "do its samples begin at another instant there?")]
    return []


def clock_suspicions(found: Lags | None, run: str, device: str, much: float = MUCH_LAG_S) -> list[Suspicion]:
    """What the lags of one run tell of the device's clock; from `much` seconds on a lag is said."""
    if found is None:
        return []
    if found.drifts:
        share = 1e2 * (found.last - found.first) / found.span
        return [Suspicion(f"{run}: {device} lags by {1e3 * found.first:.3g} ms at the beginning and by "
                          f"{1e3 * found.last:.3g} ms in the end: does its clock run {abs(share):.2g} % "
                          f"{'slower' if share > 0 else 'faster'}?")]
    if abs(found.first) > much:
        return [Suspicion(f"{run}: {device} lags by {found.first:.3g} s throughout: do its samples begin at "
                          "another instant?")]
    return []
