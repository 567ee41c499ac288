"""How dry friction turns over at a reversal, axis by axis (chain/dry_friction.py): by the rate with a width,
or by the way with a reach, and then what it held at the start of each run.

No robot file declares it. A wrong one leaves a peak at every reversal that looks like breakaway torque, or
all of the friction wherever an axis stands between two motions. Each axis takes the law at which its own
torque leaves least, with friction, all free parameters and smooth curves of angle, rate, acceleration and
load fitted (a cause that is not declared must not hide the peaks), and a constant for each run until the axis
has moved in it; the law of the record unless another is clearly better. Other laws of friction of the axis
(breakaway torque) turn over with it. What the law leaves open is in the intervals (`by_turnover`).
"""

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout, MotionRecord, predict_motion
from exactarm.chain.dry_friction import DryFriction, unsettled_rows
from exactarm.effects.base import Station
from exactarm.effects.drive import over_samples
from exactarm.numerics.factors import lstsq
from exactarm.numerics.orthonormal import shown
from exactarm.robot.robot import Robot
from exactarm.view import SIGN_WIDTH_RAD_S

Law = tuple[float, float]  # width rad/s and reach rad

_WIDTHS_RAD_S = (1.2e-3, 2.5e-3, 5e-3, 1e-2, SIGN_WIDTH_RAD_S, 4e-2, 8e-2, 0.16)
# before a gear slides: some tenths of a mrad (Al-Bender, Lampaert and Swevers 2005)
_REACHES_RAD = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3)
# A law by the way also says what is held at rest: where an axis did not rest so long, it has to leave a tenth
# less. Of axes 1 and 2 of the TX40 (tests/python/test_identify_dynamics.py) 0.2 and 4 % less were no ground
# (3.66 Nm held out for 2.26 on axis 1); friction by the way leaves up to 95 % less.
_REST_RAD_S, _LEAST_REST_S, _UNSEEN = 1e-3, 0.2, 0.9
_FINER = (2.0**0.5, 2.0**0.25, 2.0**0.125, 2.0**0.0625)  # steps between the laws above, about twice another
_CLEARLY = 0.998  # of the square sum: 1.4 nats of 40 s behind the usual low-pass
_DEPENDENT = 1e-9  # of a column: what is left of it is rounding
_SAME_START = 0.05  # of the dry friction


def dry_friction(robot: Robot, layout: Layout, record: MotionRecord, threads: int = 1) -> DryFriction:
    """`layout`: what is identified. The one of the record itself where nothing has changed."""
    known = record.dry
    rubbed = [effect.index for effect in layout.effects if effect.reverses]
    if not rubbed:
        return known
    prediction = predict_motion(robot, layout, record, threads=threads)
    width, reach = known.width.copy(), known.reach.copy()
    start = np.zeros((len(record.runs), robot.axes))
    for axis in rubbed:
        own = _Axis(prediction, layout, axis)
        width[axis], reach[axis] = own.law((width[axis], reach[axis]))
        if reach[axis]:
            start[:, axis] = own.start((width[axis], reach[axis]))
    found = DryFriction(width, reach, start if reach.any() else None)
    return known if _same(found, known) else found


def by_turnover(prediction, layout: Layout) -> np.ndarray:
    """(N, n, k) derivative of the predicted torque by the logarithm of the width or reach of each axis that
    rubs: they are estimated too."""
    view, found, step = prediction.view, [], _FINER[0]
    dry = view.evaluated[2].dry
    for axis in (effect.index for effect in layout.effects if effect.reverses):
        rubbing, law = _Rubbing(view, layout, axis), (dry.width[axis], dry.reach[axis])
        high, low = (rubbing.at(_by_law(view, axis, _times(law, factor), dry.start))[0]
                     for factor in (step, 1.0 / step))
        column = np.zeros_like(prediction.torque)
        column[:, axis] = (high - low) / (2.0 * np.log(step))
        found.append(column)
    return np.stack(found, axis=2) if found else np.zeros((*prediction.torque.shape, 0))


def _same(one: DryFriction, other: DryFriction) -> bool:
    if not (np.array_equal(one.width, other.width) and np.array_equal(one.reach, other.reach)):
        return False
    if one.start is None or other.start is None:
        return one.start is other.start
    return bool(np.max(np.abs(one.start - other.start)) < _SAME_START)


def _times(law: Law, factor: float) -> Law:
    return law[0] * factor, law[1] * factor


class _Axis:
    """What the measured torque of one axis leaves by each law, all else that is free fitted anew."""

    def __init__(self, prediction, layout: Layout, axis: int):
        view = prediction.view
        record, keep = view.evaluated[2], prediction.record.keep
        self.view, self.axis, self.keep = view, axis, keep
        rate = view.signals["theta_dot"][:, axis] / view.robot.controller_ratios[axis]
        self.rests = np.sum(np.abs(rate[keep]) < _REST_RAD_S) * record.step > _LEAST_REST_S
        self.rubbing = _Rubbing(view, layout, axis)
        at_start = _at_start(record, axis)[:, keep].T
        self.begun = at_start.any(axis=0)  # runs that show it
        self.at_start = at_start[:, self.begun]
        curves = record.smooth(_smooth_curves(view, rate, axis))[keep]
        columns = _on_axis(prediction.jacobian, axis)[keep]
        self.others = np.column_stack([columns[:, ~self.rubbing.free], curves])
        self.basis = shown(np.column_stack([self.others, self.at_start]), _DEPENDENT)
        # without all that rubs
        self.target = (prediction.residual()[:, axis] + self.rubbing.at(view)[0])[keep]

    def law(self, known: Law) -> Law:
        """The best one, or the known one unless that is clearly better."""
        sampled = self.view.evaluated[2].samples is not None
        laws = [(width, 0.0) for width in _WIDTHS_RAD_S]
        least, best = min((self.left(law), law) for law in laws)
        if sampled:
            by_way = min((self.left((SIGN_WIDTH_RAD_S, reach)), (SIGN_WIDTH_RAD_S, reach))
                         for reach in _REACHES_RAD)
            if by_way[0] < least * (1.0 if self.rests else _UNSEEN):
                least, best = by_way
        for factor in _FINER:
            nearer = [_times(best, factor), _times(best, 1.0 / factor)]
            least, best = min((least, best), *((self.left(law), law) for law in nearer))
        return best if least < _CLEARLY * self.left(known) else known

    def left(self, law: Law) -> float:
        """Square sum."""
        torque, columns = (part[self.keep] for part in self.rubbing.at(_by_law(self.view, self.axis, law)))
        clear = lambda values: values - self.basis @ (self.basis.T @ values)
        target, left = clear(self.target - torque), clear(columns)
        # What is left of a column that the others explain is rounding: it explains nothing more.
        left = left[:, np.sum(left**2, axis=0) > _DEPENDENT**2 * np.sum(columns**2, axis=0)]
        added = shown(left, _DEPENDENT)
        return float(target @ target - np.sum((added.T @ target) ** 2))

    def start(self, law: Law) -> np.ndarray:
        """(runs,) what dry friction held at the start of each run, in parts of itself."""
        columns = self.rubbing.at(_by_law(self.view, self.axis, law))[1][self.keep]
        found = lstsq(np.column_stack([columns, self.at_start, self.others]), self.target,
                                rcond=_DEPENDENT)[0]
        held, first = np.zeros(self.begun.size), columns.shape[1]
        levels = found[first : first + self.at_start.shape[1]]
        rubs = max(found[0], _DEPENDENT * np.max(np.abs(levels), initial=_DEPENDENT))
        held[self.begun] = np.clip(levels / rubs, -1.0, 1.0)
        return held


class _Rubbing:
    """What of a layout turns over with the dry friction of one axis: the table's Coulomb friction, effects of
    its drive or of all drives, and of its sensor what follows the drive torque; free (P,): their
    parameters."""

    def __init__(self, view, layout: Layout, axis: int):
        self.axis, self.effects, self.sensor = axis, [], []
        self.free = np.zeros(layout.size, bool)
        for effect, mask, where in zip(layout.effects, layout.free, layout.slices):
            of_drive = effect.station is Station.DRIVE
            turns = effect.joint in (axis + 1, None) if of_drive else (
                effect.joint == axis + 1 and effect.station is Station.DEVICE)
            if not turns:
                continue
            own = mask & (np.arange(mask.size) > 0) if effect.reverses else mask  # its sign comes first
            (self.effects if of_drive else self.sensor).append((effect, own))
            self.free[where] = True
        # what the drive needs beside, and what a sensor that follows it reads
        self.beside = view.signals["drive"][:, axis] - self._drive(view)[0] if self.sensor else None

    def at(self, view) -> tuple[np.ndarray, np.ndarray]:
        """(N,) Nm and its columns (N, k), of which the first is the sign, behind the low-pass."""
        record = view.evaluated[2]
        asked = (self.axis, record.dry.width[self.axis], record.dry.reach[self.axis])
        plain = record.samples is not None and record.dry.start is None and len(self.effects) == 1
        plain = plain and not self.sensor and not np.any((view.theta - record.theta)[:, self.axis])
        known = record.samples.known if plain else {}
        coulomb = view.robot.joints[self.axis].coulomb or 0.0
        if asked not in known:
            torque, columns = self._drive(view)
            if plain:
                torque = torque - coulomb * columns[0]
            for effect, mask in self.sensor:
                drive = view.signals["drive"].copy()
                drive[:, self.axis] = self.beside + torque
                change = effect.change(replace(view, signals=view.signals | {"measured": drive}))
                torque = torque + change.value[:, 0]
                columns += [*change.by_parameters[:, 0, mask].T]
            known[asked] = record.smooth(np.column_stack([torque, *columns]))
        torque, columns = known[asked][:, 0], known[asked][:, 1:]
        return torque + coulomb * columns[:, 0] if plain else torque, columns

    def _drive(self, view) -> tuple[np.ndarray, list[np.ndarray]]:
        sign = over_samples(view, self.axis)
        torque, columns = (view.robot.joints[self.axis].coulomb or 0.0) * sign, [sign]
        for effect, mask in self.effects:
            change = effect.change(view)
            place = list(change.columns).index(self.axis)
            torque = torque + change.value[:, place]
            columns += [*change.by_parameters[:, place, mask].T]
        return torque, columns


def _by_law(view, axis: int, law: Law, start: np.ndarray | None = None):
    """The view with another law for one axis."""
    record = view.evaluated[2]
    width, reach = record.dry.width.copy(), record.dry.reach.copy()
    width[axis], reach[axis] = law
    return replace(view, evaluated=(*view.evaluated[:2],
                                    replace(record, dry=DryFriction(width, reach, start))))


def _at_start(record: MotionRecord, axis: int) -> np.ndarray:
    """(runs, N) until the axis has moved in the run."""
    if record.samples is None:
        return np.zeros((0, len(record.inside)))
    return unsettled_rows(record, axis, max(_REACHES_RAD)).astype(float)


def _smooth_curves(view, rate: np.ndarray, axis: int) -> np.ndarray:
    """(N, c) what a torque may follow without jumping at a reversal."""
    v, q, load = np.abs(rate), view.q[:, axis], _on_axis(view.torque[:, :, None], axis)[:, 0]
    return np.column_stack([np.ones_like(v), v, v * rate, view.signals["q_ddot"][:, axis], np.cos(q),
                            np.sin(q), load])


def _on_axis(columns: np.ndarray, axis: int) -> np.ndarray:
    """(N, k) of columns (N, n, k) on one axis; zero where what they have there is rounding."""
    own = columns[:, axis]
    seen = np.linalg.norm(own, axis=0) > _DEPENDENT * np.sqrt(np.einsum("nak,nak->k", columns, columns))
    return np.where(seen, own, 0.0)
