"""A plan as a table: the columns of trajectory.csv. Units in the names."""

from __future__ import annotations

import numpy as np

from exactarm.plan.optimal import Plan


def trajectory_table(plan: Plan) -> dict[str, np.ndarray]:
    """Columns of the trajectory: time, motor angles with rates and accelerations, link angles, flange."""
    columns: dict[str, np.ndarray] = {"time_s": plan.time}
    for name, unit, values in (
        ("theta", "rad", plan.theta), ("theta_dot", "rad_s", plan.theta_dot),
        ("theta_ddot", "rad_s2", plan.theta_ddot),
        ("q", "rad", plan.q), ("q_desired", "rad", plan.q_desired),
    ):
        columns |= {f"{name}_{i + 1}_{unit}": values[:, i] for i in range(values.shape[1])}
    return columns | {f"{axis}_m": plan.position[:, k] for k, axis in enumerate("xyz")}
