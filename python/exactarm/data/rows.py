"""Rows of measured data in memory, in SI units: values without rules of their own.

N rows, n axes of the robot; angles in rad, lengths in m, time in s, torque in Nm.
`exactarm.data.dataset.Dataset` adds how rows are divided, `exactarm.data.kinds` what they can show.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from exactarm.data.columns import PAYLOAD, PAYLOAD_CENTRE
from exactarm.data.fixture import Fixture
from exactarm.data.row_marks import RowMarks
from exactarm.errors import row_name
from exactarm.robot.robot import Placement
from exactarm.value import Value


@dataclass(frozen=True)
class Source:
    """One file that was read: as named by the user, SHA-256 of its bytes, data rows (None: not a table), the
    marks of its measured positions."""

    path: str
    sha256: str
    rows: int | None = None
    marks: RowMarks = RowMarks()

    @property
    def entry(self) -> dict[str, str]:
        """What a robot file keeps of it."""
        return {"file": self.path, "sha256": self.sha256, **self.marks.entry()}

    def is_file(self, entry: Mapping[str, Any]) -> bool:
        """Whether it is a file on record, to the byte or row by row."""
        return entry.get("sha256") == self.sha256 or self.marks.same_rows(entry)

    def shares(self, entry: Mapping[str, Any]) -> bool:
        """Whether it is, or has rows in common with, a file on record."""
        return self.is_file(entry) or self.marks.some_rows(entry)


def by_name(path: object) -> list[tuple[int, str]]:
    """A sort key for files, however they are given: day2 before day10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", str(path))]


NO_CONTACT = -1  # the mark of a row without one
LEAST_TURN_RAD = 1e-4  # 20 arc seconds: less is within the wind-up of a gear


@dataclass(frozen=True, eq=False, repr=False)
class Rows(Value):
    """Measurements in SI units.

    kind, kinds     the kind of data (exactarm.data.kinds): the first to analyse, and all in order
    joints          "theta", "q", "theta_dot", "q_dot", "tau", "tau_motor", "current", "approach": (N, n),
                    NaN in axes the files do not have; no key where no axis has the quantity
                    "tau_error" beside "tau" of poses: what the noise leaves open of a load's size, Nm
    position (N, 3), rotation (N, 3, 3), gyro (N, 3), time (N,), visit (N,) int, identification (N,) bool: or
    None;
                    beside contacts NaN in rows without a tracker
    rotation_vector (N, 3) rad, rx, ry, rz as the files have them, and turns (N, 3) rad, roll, pitch, yaw, for
                    the first aid alone; None without
    session, run    (N,) int
    contacts        "socket", "plane", "sphere", "bar", "pair": (N,) int, NO_CONTACT where the row has none;
                    "tilt", "accel", "camera", "partner": 0 where the sensor was read, a corner seen, the
                    other arm touched
    tilt (N, 2)     rad, accel (N, 3) m/s^2: its readings at rest, NaN where there is none; None without
    pixel (N, 2)    where a corner of a board was seen, NaN where none was; picture, corner (N,) int,
                    NO_CONTACT where there is none; None without
    partner (N, m)  rad, joint angles of another arm that the target touches, as its controller reports them,
                    NaN where it does not; None without
    length (N,)     read off a bar or wire, m, NaN where none was; None without
    fixture         what is known of the contacts
    covariates      name as in the header -> (N,)
    flange          the controller's flange in DH frame n, in which centres of payloads are given
    unweighed       sessions whose payload is not known: zero in `payload`, to be estimated
    notes           what reading decided that a user should know, a sentence each
    way (N, n)      -1, 0, +1: how each angle would last have moved had every pose been reached straight from
                    the row before; 0 in the first row of a set-up
    step (N, n)     how far each angle has come since the row before, as measured; 0 in the first row
    file_index, row (N,) where each row came from: index into `sources`, row from 1
    """

    kind: str
    kinds: tuple[str, ...]
    axes: int
    joints: dict[str, np.ndarray]
    session: np.ndarray
    run: np.ndarray
    file_index: np.ndarray
    row: np.ndarray
    time: np.ndarray | None = None
    position: np.ndarray | None = None
    rotation: np.ndarray | None = None
    rotation_vector: np.ndarray | None = None
    turns: np.ndarray | None = None
    gyro: np.ndarray | None = None
    visit: np.ndarray | None = None
    identification: np.ndarray | None = None
    contacts: dict[str, np.ndarray] = field(default_factory=dict)
    length: np.ndarray | None = None
    tilt: np.ndarray | None = None
    accel: np.ndarray | None = None
    pixel: np.ndarray | None = None
    picture: np.ndarray | None = None
    corner: np.ndarray | None = None
    partner: np.ndarray | None = None
    fixture: Fixture = Fixture()
    covariates: dict[str, np.ndarray] = field(default_factory=dict)
    flange: Placement = Placement()
    sources: tuple[Source, ...] = ()
    unweighed: tuple[int, ...] = ()
    way: np.ndarray | None = None
    step: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def of_arrays(cls, kind: str, joints: Mapping[str, np.ndarray], **arrays: Any) -> Self:
        """A data set from arrays alone (a simulation): one session, one run and no file where not given."""
        joints = {name: np.asarray(values, dtype=float) for name, values in joints.items()}
        rows, axes = next(iter(joints.values())).shape
        ones = np.ones(rows, dtype=int)
        defaults = {"session": ones, "run": ones, "file_index": np.zeros(rows, dtype=int),
                    "row": 1 + np.arange(rows)}
        return cls(kind, (kind,), axes, joints, **(defaults | arrays)).with_way()

    def with_way(self) -> Self:
        """With `way` and `step` by the order of the rows as they are now: before any are taken out."""
        angle = self.joints.get("q", self.joints.get("theta"))
        if angle is None or not len(self):
            return self
        place = np.arange(len(self))
        first = np.ones(len(self), bool)
        first[1:] = (np.diff(self.session) != 0) | (np.diff(self.file_index) != 0)
        begin = np.maximum.accumulate(np.where(first, place, 0))
        step = np.diff(angle, axis=0, prepend=angle[:1])
        moved = (np.abs(step) > LEAST_TURN_RAD) & ~first[:, None]
        last = np.maximum.accumulate(np.where(moved, place[:, None], -1), axis=0)
        known = last >= begin[:, None]
        sign = np.sign(np.take_along_axis(step, np.maximum(last, 0), axis=0))
        return replace(self, way=np.where(known, sign, 0.0), step=np.where(first[:, None], 0.0, step))

    def __len__(self) -> int:
        return len(self.row)

    @property
    def load_on_flange(self) -> tuple[np.ndarray, np.ndarray] | None:
        """What the flange carries in each row beside the declared links: mass (N,) kg and centre (N, 3) m in
        the flange's frame; None where no column payload_kg says so. Without centre it hangs at the flange's
        origin."""
        mass = self.covariates.get(PAYLOAD)
        if mass is None:
            return None
        zero = np.zeros(len(self))
        return mass, np.stack([self.covariates.get(name, zero) for name in PAYLOAD_CENTRE], axis=1)

    @property
    def payload(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The same with the centre in DH frame n."""
        load = self.load_on_flange
        if load is None:
            return None
        mass, centre = load
        return mass, self.flange.position + centre @ self.flange.rotation.T

    @property
    def first_file(self) -> str | None:
        """The file that the first row came from, for messages; None where no file was read."""
        return self.sources[self.file_index[0]].path if self.sources and len(self) else None

    def place_of(self, index: int) -> str:
        """The row at `index`, as a message names it: its number in its file, and the file's name."""
        if not self.sources:
            return row_name(None, self.row[index])
        path, names = self.sources[self.file_index[index]].path, [Path(s.path).name for s in self.sources]
        alike = names.count(Path(path).name) > 1
        return f"{row_name(path, self.row[index])} of {path if alike else Path(path).name}"

    @property
    def fingerprint(self) -> tuple[str, ...]:
        """SHA-256 of the files that it was read from, in their order; empty where no file was read."""
        return tuple(source.sha256 for source in self.sources)

    def is_of(self, entries: Sequence[Mapping[str, Any]]) -> bool:
        """Whether it was read from the files on record, all of them in their order."""
        return 0 < len(entries) == len(self.sources) and all(
            source.is_file(entry) for source, entry in zip(self.sources, entries))

    def shared_files(self, entries: Sequence[Mapping[str, Any]]) -> np.ndarray:
        """(F,) bool: its files that are, or have rows in common with, one on record."""
        return np.array([any(map(source.shares, entries)) for source in self.sources], bool)

    def select(self, rows: np.ndarray) -> Self:
        """The rows of a mask (N,) bool or of an index array."""
        changes = {}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                changes[item.name] = value[rows]
            elif isinstance(value, dict):
                changes[item.name] = {name: array[rows] for name, array in value.items()}
        return replace(self, **changes)

    @property
    def sample_times(self) -> np.ndarray:
        """(N,) s: the time of each row of a series, which has one (kinds/base.py looks)."""
        if self.time is None:
            raise ValueError("rows without a time; expected a series")
        return self.time
