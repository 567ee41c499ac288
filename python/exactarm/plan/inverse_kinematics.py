"""Inverse kinematics along a reference, on the accurate model (thesis (4.5)); the work is done in the core.

A pose that cannot be reached is reported with its time and the reason. Without a start the branch
nearest to the middle of the joint limits that follows the whole reference is taken. Arms of fewer than six
axes take the nearest orientation where axes that lean leave none (few_axes.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm import _core
from exactarm.errors import ComputationError, InputError
from exactarm.plan.few_axes import attainable
from exactarm.plan.reference import Reference

NEAR_SINGULAR = 0.01  # conditioning below which the result carries a warning


@dataclass(frozen=True)
class JointPath:
    """Joint angles (N, n) in rad, the smallest conditioning on the way, warnings."""

    q: np.ndarray
    conditioning: float
    warnings: tuple[str, ...]


def inverse_kinematics(core: _core.Robot, reference: Reference, start: np.ndarray | None = None) -> JointPath:
    """Joint angles along the reference; raises ComputationError with time and reason where there are none."""
    n = core.axes
    if start is not None and np.shape(start) != (n,):
        raise InputError(f"start: found {np.size(start)} joint angles, expected {n}")
    try:
        return _followed(core, reference, start)
    except ComputationError:
        nearest = attainable(core, reference, start) if n < 6 else None
        if nearest is None:
            raise
        reached, start, off = nearest
        found = _followed(core, reached, start)
        told = (f"the flange is turned up to {1e3 * off:.2g} mrad from the orientation asked for: the axes "
                f"of this arm lean, and {n} of them cannot make up for it",)
        return JointPath(found.q, found.conditioning, found.warnings + told)


def _followed(core: _core.Robot, reference: Reference, start: np.ndarray | None) -> JointPath:
    starts = [np.asarray(start, float)] if start is not None else branches(core, reference)
    rotations = reference.rotation.reshape(-1, 9)
    failures = []
    for q0 in starts:
        q, report = _core.inverse_kinematics_path(core, reference.position, rotations, q0)
        if report.status == _core.InverseKinematicsStatus.solved:
            time = float(reference.time[report.conditioning_index])
            near = report.conditioning < NEAR_SINGULAR
            warning = (f"the path passes near a singular pose at {time:.3f} s (conditioning "
                       f"{report.conditioning:.1e})",)
            return JointPath(q, report.conditioning, warning if near else ())
        failures.append((report.index, describe(report, reference)))
    # The branch that came furthest says most.
    raise ComputationError(max(failures)[1])


def branches(core: _core.Robot, reference: Reference) -> list[np.ndarray]:
    """All starts within the joint limits; raises ComputationError where the first pose has none."""
    target = _core.Pose(reference.rotation[0], reference.position[0])
    found = _core.inverse_kinematics_branches(core, target)
    if found:
        return found
    options = _core.InverseKinematicsOptions()
    options.check_limits = False
    if _core.inverse_kinematics_branches(core, target, options):
        raise ComputationError("the path starts at a pose that is reached only beyond the joint limits")
    position = ", ".join(f"{x:.3f}" for x in reference.position[0])
    raise ComputationError(f"the path starts at a pose out of reach: ({position}) m at 0 s")


def describe(report: _core.InverseKinematicsReport, reference: Reference) -> str:
    """One line: what stopped the inverse kinematics, and when."""
    status, time = report.status, reference.time[report.index]
    position = ", ".join(f"{x:.3f}" for x in reference.position[report.index])
    where = f"at {time:.3f} s, ({position}) m"
    if status == _core.InverseKinematicsStatus.joint_limit:
        beyond = np.degrees(abs(report.value - report.limit))
        return (f"joint {report.joint + 1} leaves its limit of {np.degrees(report.limit):.1f} deg "
                f"by {beyond:.2g} deg {where}")
    if status == _core.InverseKinematicsStatus.singular:
        return f"the arm comes to a singular pose {where}"
    if status == _core.InverseKinematicsStatus.not_finite:
        return f"the pose is not finite {where}"
    return f"the pose is out of reach {where}"
