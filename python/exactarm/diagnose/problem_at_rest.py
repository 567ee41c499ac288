"""Problems whose rows are poses at rest, which may come again: positions in m, each row by itself."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Self

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import moving_axes
from exactarm.data.split import pose_groups, pose_split
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.noise import repeat_scatter
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Quantity, Signal, place_of_axis
from exactarm.diagnose.smoothness import second_order
from exactarm.identify.declared import require_geometry
from exactarm.identify.repeats import worth_of_rows
from exactarm.noise.wandering import SESSIONS_APART
from exactarm.numerics.places import at_places
from exactarm.robot.robot import Robot

_SEARCH_POSES = 600  # enough to find every large cause in good time; the smallest may need more poses
_LEAST_REPEATS = 10
_ROUGH = 1e-3  # relative fall of the square sum: a two-thousandth of an RMS error


class ProblemAtRest(Problem):
    unit = "m"
    numbers_of_error = 3
    groups_independent = True
    # relative fall of the square sum that ends a fit: a thousandth of what evidence can notice
    tolerance = 1e-7

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, data, held_out, threads, seed)
        require_geometry(robot)

    @property
    def rough(self) -> Self:
        other = copy(self)
        other.tolerance = _ROUGH
        return other

    def search_rows(self) -> np.ndarray | None:
        if self.measured_poses <= _SEARCH_POSES:
            return None
        share = _SEARCH_POSES / self.measured_poses
        return pose_split(self.data, np.random.default_rng(self.seed), share)

    @property
    def measured_poses(self) -> int:
        return len(self.data)

    def left_out(self) -> tuple[str, ...]:
        """Ways whose drive nobody declares: where its waves are to be looked for is not known."""
        ways = [i for i, joint in enumerate(self.robot.joints, start=1)
                if joint.type == "prismatic" and not joint.has_gear]
        return tuple(f"axis {i} slides and its file has no ratio_rad_m: waves of its screw or pinion, "
                     "shorter than its guide's, are not searched for" for i in ways)

    def groups(self) -> np.ndarray:
        return self._groups

    @property
    def poses(self) -> dict[str, np.ndarray]:
        return {"identification": self._groups, "validation": pose_groups(self.held_out)}

    @cached_property
    def _groups(self) -> np.ndarray:
        return pose_groups(self.data)

    def order(self) -> np.ndarray:
        time = self.data.time if self.data.time is not None else np.arange(len(self.data), dtype=float)
        session = np.unique(self.data.session, return_inverse=True)[1]
        step = np.diff(time[np.lexsort((time, session))])
        typical = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 1.0
        return (time - time.min()) / typical + session * (np.ptp(time) / typical + SESSIONS_APART)

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        view, data = fitted.view, self.data
        moves = self._moving(fitted)
        signals = {place_of_axis(self.robot, i + 1): at_places(view.q[:, i]) for i in np.flatnonzero(moves)}
        signals |= {Signal(Quantity.LOAD, i + 1): view.torque[:, i] for i in range(view.axes)
                    if np.ptp(view.torque[:, i]) > 0}
        directions = view.direction
        signals |= {Signal(Quantity.APPROACH, i + 1): directions[:, i] for i in np.flatnonzero(moves)
                    if np.ptp(directions[:, i]) > 0}
        order = data.time if data.time is not None else np.arange(len(data), dtype=float)
        signals[Signal(Quantity.TIME if data.time is not None else Quantity.ORDER)] = order
        return signals | {Signal(name): values for name, values in data.covariates.items()
                          if np.ptp(values) > 0}

    def surfaces(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        return {Signal(Quantity.TWO_ANGLES): second_order(fitted.view.q[:, self._moving(fitted)])}

    def _moving(self, fitted: Fitted) -> np.ndarray:
        """(n,) bool: axes that move. What the angle of one at rest scatters by is no place of its gear."""
        return moving_axes(self.robot, np.ptp(fitted.view.q, axis=0))

    def correlation_factor(self, fitted: Fitted) -> float:
        return float(np.average(self._worth(fitted), weights=fitted.weight > 0.0))

    def independent_rows(self, fitted: Fitted) -> np.ndarray:
        """Numbers of rows in use: of each pose as many readings, the first ones, as all of them are worth."""
        used = np.flatnonzero(fitted.weight > 0.0)
        _, poses, counts = np.unique(self.groups()[used], return_inverse=True, return_counts=True)
        order = np.argsort(poses, kind="stable")
        place = np.empty(len(used))  # of a reading among those of its pose
        place[order] = np.arange(len(used)) - np.repeat(np.cumsum(counts) - counts, counts)
        return used[place < np.maximum(np.rint(counts[poses] * self._worth(fitted)[used]), 1.0)]

    def _worth(self, fitted: Fitted) -> np.ndarray:
        """(N,) independent readings that a row is worth: those of one pose share what the arm misses."""
        used, worth = fitted.weight > 0.0, np.ones(len(self.data))
        _, poses = np.unique(self.groups()[used], return_inverse=True)
        worth[used] = worth_of_rows((fitted.residual / fitted.sigma)[used], poses, fitted.spent)
        return worth

    def repeats(self, residual: np.ndarray, used: np.ndarray) -> float | None:
        """Pure error of those rows (N,) bool that were measured at the same commanded pose in the same
        session, by their residual (N, 3); None where there are few. Readings without a move between them are
        one visit, of which their mean is told: how well the arm comes back they do not show."""
        stop = self._stops(used)
        count = np.bincount(stop)
        means = np.stack([np.bincount(stop, weights=column) for column in residual[used].T], axis=1)
        groups = self._poses_by_session()[used][np.unique(stop, return_index=True)[1]]
        return _scatter(means / count[:, None], groups)

    def reading_noise(self, fitted: Fitted) -> float | None:
        """The same, in units of sigma, of readings without a move between them; None where there are few."""
        return _scatter((fitted.residual / fitted.sigma)[fitted.weight > 0.0, :3],
                        self._stops(fitted.weight > 0.0))

    def _stops(self, used: np.ndarray) -> np.ndarray:
        """Numbers from 0 of the stops of the rows `used` (N,) bool: rows that follow each other in the order
        of measurement and in the file, at one pose, approached one way. A column `visit` says of every row
        that the arm came anew."""
        data = self.data
        if data.visit is not None:
            return np.arange(used.sum())
        order = np.argsort(self.order()[used], kind="stable")
        approach = np.nan_to_num(data.joints.get("approach", np.zeros((len(data), 0))))
        state = np.column_stack([self._poses_by_session(), data.file_index, data.row - np.arange(len(data)),
                                 approach])
        moved = np.any(np.diff(state[used][order], axis=0) != 0.0, axis=1)
        stop = np.empty(len(order), dtype=int)
        stop[order] = np.concatenate([[0], np.cumsum(moved)])
        return stop

    def _poses_by_session(self) -> np.ndarray:
        return self.groups() * (1 + self.data.session.max()) + self.data.session


def _scatter(residual: np.ndarray, groups: np.ndarray) -> float | None:
    enough = len(groups) - len(np.unique(groups)) >= _LEAST_REPEATS
    return repeat_scatter(residual, groups) if enough else None
