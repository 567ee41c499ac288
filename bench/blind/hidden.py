"""What a hidden cause is: a name of docs/effects.md, an axis, a size, and where it enters the measurement.

    gear       adds to the output angle of a gear            (N, n) rad
    links      changes masses: returns another arm
    spring     adds to the joint angle, knows the load       (N, n) rad
    stretch    scales all lengths of the arm                 (N,)
    structure  moves what the tool carries, base frame       (N, 3) m and (N, 3) rad
    device     changes what the device reads                 (N, 3) m
    spoiled    rows that are wrong by themselves             (N,) bool

`size` is the one number that a scenario scales; everything else about the cause is drawn once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from blind.arm import Arm, Posture


@dataclass(frozen=True)
class Rows:
    """What a controller and a clock report, row by row: commands (N, n), approach directions, session, time,
    temperature.

    `order`: a number per row, in the order of measurement; rate, acceleration (N, n) of the joints: where the
    arm moves.
    """

    command: np.ndarray
    direction: np.ndarray
    session: np.ndarray
    order: np.ndarray
    time: np.ndarray
    temperature: np.ndarray
    visit: np.ndarray
    identification: np.ndarray
    has: frozenset[str] = frozenset()
    rate: np.ndarray | None = None
    acceleration: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.session)

    def part(self, chosen: np.ndarray) -> Rows:
        """The rows of an index array."""
        arrays = {item.name: getattr(self, item.name) for item in fields(self)}
        return replace(self,
                       **{name: value[chosen] for name, value in arrays.items()
                          if isinstance(value, np.ndarray)})


@dataclass(frozen=True)
class Hidden:
    """A cause. `joint` from 1 or None; `detail` goes to the truth file as it is."""

    name: str = ""
    joint: int | None = None
    size: float = 1.0
    detail: dict = field(default_factory=dict)

    foreign = False
    measures = ""  # the parameter of docs/effects.md that `size` is

    @property
    def index(self) -> int:
        return self.joint - 1

    def scaled(self, size: float) -> Hidden:
        return replace(self, size=size)

    def at_joint(self, shape: np.ndarray, axes: int) -> np.ndarray:
        """(N, n) with size * shape (N,) on this cause's axis."""
        out = np.zeros((len(shape), axes))
        out[:, self.index] = self.size * shape
        return out

    def links(self, arm: Arm) -> Arm:
        return arm

    def gear(self, arm: Arm, phi: np.ndarray, rows: Rows) -> np.ndarray | float:
        return 0.0

    def spring(self, arm: Arm, q: np.ndarray, torque: np.ndarray, rows: Rows) -> np.ndarray | float:
        return 0.0

    def stretch(self, rows: Rows) -> np.ndarray | float:
        return 1.0

    def structure(self, arm: Arm, at: Posture, target: np.ndarray,
                  rows: Rows) -> tuple[np.ndarray, np.ndarray] | None:
        return None

    def device(self, measured: np.ndarray, rows: Rows) -> np.ndarray | float:
        return 0.0

    def spoiled(self, rows: Rows) -> np.ndarray | None:
        return None

    def parameters(self) -> dict[str, float]:
        """Numbers of docs/effects.md that this cause has exactly; none where it is another form of it."""
        return {self.measures: self.size} if self.measures else {}

    def truth(self) -> dict:
        own = {"effect": self.name, "joint": self.joint, "size": self.size, "foreign": self.foreign}
        return own | {"parameters": self.parameters()} | self.detail


@dataclass(frozen=True)
class Setting:
    """What a draw may look at: the true arm, its rows, load torques of the declared arm (N, n)."""

    arm: Arm
    rows: Rows
    torque: np.ndarray
    at: Posture

    def loaded_axes(self) -> np.ndarray:
        """Axes from 0 that carry a load that varies."""
        spread = np.ptp(self.torque, axis=0)
        return (
            np.flatnonzero(spread > 0.02 * max(spread.max(), 1e-9)) if self.arm.mass is not None
            else np.zeros(0, int)
        )
