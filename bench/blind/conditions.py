"""Conditions of a case beside its hidden cause: noise, cut runs, reversals, still axes, pose sets, the file.

`today` is what every case had before there were conditions, and leaves each of its random draws as it was.
`wide` draws every condition of the kind of data at random; the name of one condition sets that one alone.

    student     Student-t noise of 3 to 10 degrees of freedom, of the variance of the Gaussian one
    unequal     components of the measurement differ in noise by a ratio of 2 to 8
    coloured    half of the variance of the noise has a memory
    cut         gear runs begin, end, or begin and end while the axis moves
    passage     a gear passes from one table to the other in 5 to 200 ms after a reversal
    still       some axes do not move
    cube, few   200 poses in a small cube of the workspace; 60 poses
    massless    the arm has masses, the robot file declares none (and no springs)
    geometry    lengths off by 5 mm (standard deviation), angles by four times the usual
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from blind.arm import Arm

TODAY, WIDE = "today", "wide"
_STREAM = 20  # of the generator of conditions, apart from the one that draws the case
_NOISE = ("student", "unequal", "coloured")
OF_KIND = {
    "poses": (*_NOISE, "still", "cube", "few", "massless", "geometry"),
    "gear_run": (*_NOISE, "cut", "passage", "massless"),
    "motion": (*_NOISE, "still", "passage", "massless"),
    "tracked_motion": (*_NOISE, "still", "passage", "massless", "geometry"),
}
_CHANCE = {
    "student": 0.25,
    "unequal": 0.25,
    "coloured": 0.2,
    "still": 0.2,
    "cube": 0.15,
    "few": 0.15,
    "massless": 0.2,
    "geometry": 0.25,
    "cut": 0.5,
    "passage": 0.4,
}
NAMES = (TODAY, WIDE, *_CHANCE)
THEMES = ("single", "pair", "clean", "foreign")
WIDE_SHARES = (
    0.55,
    0.1,
    0.25,
    0.1,
)  # of the themes: more clean cases than today, for the rate of false alarms

PASSAGE_S, FREEDOM, SPREAD = (5e-3, 0.2), (3.0, 10.0), (2.0, 8.0)
MEMORY_ROWS, MEMORY_S = (2.0, 6.0), (2e-3, 3e-2)  # of coloured noise: poses; time series
GEOMETRY_M, OFF_GEOMETRY_M, OFF_ANGLES = 3e-4, 5e-3, 4.0


@dataclass(frozen=True)
class Conditions:
    """freedom: degrees of freedom of the noise; spread: ratio of components; memory: rows (poses) or s.

    cut: whether runs begin and end in motion; passage_s: 0 where a gear's table changes at once.
    """

    freedom: float = np.inf
    spread: float = 1.0
    memory: float = 0.0
    cut: tuple[bool, bool] = (False, False)
    passage_s: float = 0.0
    still: bool = False
    pose_set: str = ""
    masses: bool = True
    geometry_m: float = GEOMETRY_M
    wide: bool = False

    @property
    def angles(self) -> float:
        """How many times the usual error of the angles of the geometry."""
        return 1.0 if self.geometry_m == GEOMETRY_M else OFF_ANGLES

    def truth(self) -> dict:
        """Name of each condition that holds, with its number where it has one."""
        said = {
            "student": (np.isfinite(self.freedom), self.freedom),
            "unequal": (self.spread > 1.0, self.spread),
            "coloured": (self.memory > 0.0, self.memory),
            "cut": (any(self.cut), list(self.cut)),
            "passage": (self.passage_s > 0.0, self.passage_s),
            "still": (self.still, True),
            "massless": (not self.masses, True),
            "geometry": (self.geometry_m > GEOMETRY_M, self.geometry_m),
            self.pose_set: (bool(self.pose_set), True),
        }
        return {name: value for name, (holds, value) in said.items() if holds}

    def theme(self, random, today: tuple[str, ...], shares: tuple[float, ...]) -> str:
        """A theme by the shares that the kind of data has today, or by those of wide conditions."""
        return random.choice(THEMES, p=WIDE_SHARES) if self.wide else random.choice(today, p=shares)


def draw_conditions(which: str, kind: str, seed: int) -> Conditions:
    """The conditions of a case; `which`: one of `NAMES`."""
    random = np.random.default_rng([seed, _STREAM])
    own = OF_KIND[kind]
    if which not in (TODAY, WIDE, *own):
        raise ValueError(
            f"{kind} has no condition {which!r}, expected one of: {', '.join((TODAY, WIDE, *own))}"
        )
    drawn = {name for name in own if random.random() < _CHANCE[name]} if which == WIDE else {which} & set(own)
    log_uniform = lambda low, high: float(np.exp(random.uniform(np.log(low), np.log(high))))
    freedom, spread, passage = random.uniform(*FREEDOM), random.uniform(*SPREAD), log_uniform(*PASSAGE_S)
    memory = log_uniform(*(MEMORY_ROWS if kind == "poses" else MEMORY_S))
    ends = ((True, False), (False, True), (True, True))[random.integers(3)]
    return Conditions(
        freedom=float(freedom) if "student" in drawn else np.inf,
        spread=float(spread) if "unequal" in drawn else 1.0,
        memory=memory if "coloured" in drawn else 0.0,
        cut=ends if "cut" in drawn else (False, False),
        passage_s=passage if "passage" in drawn else 0.0,
        still="still" in drawn,
        pose_set=next((name for name in ("cube", "few") if name in drawn), ""),
        masses="massless" not in drawn,
        geometry_m=OFF_GEOMETRY_M if "geometry" in drawn else GEOMETRY_M,
        wide=which == WIDE,
    )


def declare(path: Path, arm: Arm, conditions: Conditions) -> Arm | None:
    """The arm that makes the data; its file loses its masses and springs where the conditions say so.

    None where the arm has no masses that its file could lose.
    """
    if conditions.masses:
        return arm
    if arm.mass is None:
        return None
    path.write_text(
        without_springs(re.sub(r"\[\[links\]\][^\n]*\n(?:[^\[\n][^\n]*\n?|\n)*", "", path.read_text()))
    )
    return arm.with_values(linear=np.zeros(arm.axes), cubic=np.zeros(arm.axes))


def without_springs(text: str) -> str:
    """The text of a robot file less its springs."""
    return re.sub(r"(?m)^spring_[a-z]+_Nm_rad3? = .*\n", "", text)


def still_axes(axes: int, random) -> np.ndarray:
    """(axes,) bool: one axis to half of them stand still."""
    still = np.zeros(axes, bool)
    still[random.permutation(axes)[: int(random.integers(1, axes // 2 + 1))]] = True
    return still


def held_still(drive, middle: np.ndarray, still: np.ndarray):
    """A motion (`blind.motion.Drive`) whose axes `still` stay at `middle`."""
    return replace(
        drive,
        q=np.where(still, middle, drive.q),
        rate=np.where(still, 0.0, drive.rate),
        acceleration=np.where(still, 0.0, drive.acceleration),
    )
