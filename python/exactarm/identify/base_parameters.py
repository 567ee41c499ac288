"""Base parameters: the combinations of inertial parameters that a motion can show at all (Gautier 1991).

The regressor at random states has dependent columns. Going through the columns in order of preference, one
that is a combination of those before it is dropped (QR, Gram-Schmidt with reorthogonalisation); what it does
is
borne by the kept ones:   base = kept + K dropped.   Inertias and first moments are preferred, then masses,
then rotor inertias, so that the groups read as text books have them.
"""

from dataclasses import dataclass

import numpy as np

from exactarm import _core
from exactarm.effects.link_inertia import LinkInertia, column_name
from exactarm.numerics.factors import lstsq
from exactarm.robot.robot import Robot

_STATES = 150
_DEPENDENT = 1e-7  # of a column's own norm is left: rounding
_SHOWN = 1e-6  # smaller factors of a group are rounding
_DECIMALS = 9  # of a factor that are no rounding


@dataclass(frozen=True)
class BaseParameters:
    """Columns 0 .. 10 n - 1 are the links', 10 n .. 11 n - 1 the rotors'.

    kept (b,), dropped (d,), without_effect (z,) column indices; K (b, d).
    """

    kept: np.ndarray
    dropped: np.ndarray
    without_effect: np.ndarray
    K: np.ndarray
    names: tuple[str, ...]

    def group(self, position: int) -> str:
        """The combination that the kept column stands for, in words: `Izz_1_kg_m2 + 0.02 m_2_kg`."""
        text = self.names[self.kept[position]]
        for factor, column in zip(self.K[position], self.dropped):
            if abs(factor) > _SHOWN:
                # a half of the last figure is rounded alike whatever the rounding of the sum before it
                size = "" if abs(abs(factor) - 1.0) < _SHOWN else f"{round(abs(factor), _DECIMALS):.4g} "
                text += f" {'-' if factor < 0 else '+'} {size}{self.names[column]}"
        return text

    def borne(self, position: int, robot: Robot) -> float:
        """What the other parts of the combination add to the kept column, by the tables of a robot."""
        links = LinkInertia.of(robot, range(self.link_columns)).values
        every = np.array([*links, *(joint.rotor_inertia or 0.0 for joint in robot.joints)])
        return float(self.K[position] @ every[self.dropped])

    def bearers(self, column: int) -> tuple[str, ...]:
        """The kept parameters that bear a dropped one."""
        k = int(np.flatnonzero(self.dropped == column)[0])
        return tuple(self.names[c] for c, factor in zip(self.kept, self.K[:, k]) if abs(factor) > _SHOWN)

    @property
    def links(self) -> tuple[int, ...]:
        """Kept columns of the links."""
        return tuple(int(c) for c in self.kept if c < self.link_columns)

    @property
    def rotors(self) -> tuple[int, ...]:
        """Axes (from 0) whose rotor inertia is kept."""
        return tuple(int(c) - self.link_columns for c in self.kept if c >= self.link_columns)

    @property
    def link_columns(self) -> int:
        return 10 * len(self.names) // 11


def base_parameters(robot: Robot) -> BaseParameters:
    """Of a robot with its gears; masses in its tables are not used."""
    n = robot.axes
    random = np.random.default_rng(0)
    q = random.uniform(-np.pi, np.pi, (_STATES, n))
    q_dot, q_ddot = random.normal(0.0, 2.0, (_STATES, n)), random.normal(0.0, 8.0, (_STATES, n))
    links = _core.dynamics_regressor(robot.core, q, q_dot, q_ddot)
    rotors = np.zeros((_STATES, n, n))
    for i in range(n):
        rotors[:, i, i] = robot.controller_ratios[i] ** 2 * q_ddot[:, i]
    matrix = np.concatenate([links, rotors], axis=2).reshape(_STATES * n, 11 * n)
    kept, dropped, nothing = _independent(matrix, _preference(n))
    K = (lstsq(matrix[:, kept], matrix[:, dropped], rcond=None)[0]
         if len(dropped) else np.zeros((len(kept), 0)))
    names = (*map(column_name, range(10 * n)), *(f"rotor_inertia_{i + 1}_kg_m2" for i in range(n)))
    return BaseParameters(np.array(kept, int), np.array(dropped, int), np.array(nothing, int), K, names)


def _preference(n: int) -> list[int]:
    """From the first link outwards, first moments and inertias; then masses; then rotors."""
    shape = [10 * i + k for i in range(n) for k in (9, 7, 1, 2, 4, 5, 6, 8, 3)]
    return shape + [10 * i for i in range(n)] + list(range(10 * n, 11 * n))


def _independent(matrix: np.ndarray, order: list[int]) -> tuple[list[int], list[int], list[int]]:
    """(kept, dropped, zero) columns, each sorted; dropped: those before it in `order` make it up."""
    size = np.linalg.norm(matrix, axis=0)
    largest = size.max()
    basis = np.zeros((matrix.shape[0], 0))
    kept, dropped, nothing = [], [], []
    for column in order:
        if size[column] <= _DEPENDENT * largest * 1e-3:
            nothing.append(column)
            continue
        rest = matrix[:, column] / size[column]
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        left = np.linalg.norm(rest)
        if left <= _DEPENDENT:
            dropped.append(column)
        else:
            kept.append(column)
            basis = np.column_stack([basis, rest / left])
    return sorted(kept), sorted(dropped), sorted(nothing)
