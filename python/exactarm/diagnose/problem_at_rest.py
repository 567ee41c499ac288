"""Problems whose rows are poses at rest, which may come again: positions in m, each row by itself."""

from __future__ import annotations

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.split import pose_groups, pose_split
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.noise import repeat_scatter
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import APPROACH, LOAD, ORDER, TIME, TWO_ANGLES, Signal, place_of_axis
from exactarm.diagnose.smoothness import second_order
from exactarm.identify.declared import require_geometry
from exactarm.noise.wandering import SESSIONS_APART
from exactarm.robot.robot import Robot

_SEARCH_POSES = 600  # enough to find every large cause in good time; the smallest may need more poses
_LEAST_REPEATS = 10


class ProblemAtRest(Problem):
    unit = "m"
    numbers_of_error = 3
    groups_independent = True
    # relative fall of the square sum that ends a fit: a thousandth of what evidence can notice
    tolerance = 1e-7

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, data, held_out, threads, seed)
        require_geometry(robot)

    def search_rows(self) -> np.ndarray | None:
        if len(self.data) <= _SEARCH_POSES:
            return None
        return pose_split(self.data, np.random.default_rng(self.seed), _SEARCH_POSES / len(self.data))

    def groups(self) -> np.ndarray:
        return pose_groups(self.data)

    def order(self) -> np.ndarray:
        time = self.data.time if self.data.time is not None else np.arange(len(self.data), dtype=float)
        session = np.unique(self.data.session, return_inverse=True)[1]
        step = np.diff(time[np.lexsort((time, session))])
        typical = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 1.0
        return (time - time.min()) / typical + session * (np.ptp(time) / typical + SESSIONS_APART)

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        view, data = fitted.view, self.data
        signals = {place_of_axis(self.robot, i + 1): view.q[:, i] for i in range(view.axes)}
        signals |= {Signal(LOAD, i + 1): view.torque[:, i] for i in range(view.axes)
                    if np.ptp(view.torque[:, i]) > 0}
        directions = view.direction
        signals |= {Signal(APPROACH, i + 1): directions[:, i] for i in range(view.axes)
                    if np.ptp(directions[:, i]) > 0}
        order = data.time if data.time is not None else np.arange(len(data), dtype=float)
        signals[Signal(TIME if data.time is not None else ORDER)] = order
        return signals | {Signal(name): values for name, values in data.covariates.items()
                          if np.ptp(values) > 0}

    def surfaces(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        q = fitted.view.q
        return {Signal(TWO_ANGLES): second_order(q[:, np.ptp(q, axis=0) > 0.0])}

    def repeats(self, residual: np.ndarray, used: np.ndarray) -> float | None:
        """Pure error of those rows (N,) bool that were measured at the same commanded pose in the same
        session, by their residual (N, 3); None where there are few."""
        groups = (self.groups() * (1 + self.data.session.max()) + self.data.session)[used]
        if len(groups) - len(np.unique(groups)) < _LEAST_REPEATS:
            return None
        return repeat_scatter(residual[used], groups)
