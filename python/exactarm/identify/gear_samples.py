"""Samples of one gear: what its output did beside what its motor did, with everything else taken out.

Gyroscope: the reading along the aligned axis (3.3), less what gravity bends (the chain without this gear's
harmonics, on a record of fewer samples: it is smooth), against the motor's rate at the ratio u0.
Encoders on both sides: the output angle less offset and bending against the motor angle over u0.
Kinematic error (E6): motor over ratio minus output. What the robot file carries (a delay, found effects of
this and other axes) comes from the effects of the chain.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exactarm.chain import GearRecord, Layout, gear_record, predict_gear_run
from exactarm.chain.propagate import acts, pass_station
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.data.kinds.base import rows_by_number
from exactarm.identify.declared import carried_layout
from exactarm.identify.gear_declared import sensor_layout
from exactarm.numerics.stamps import typical_step
from exactarm.robot.robot import Robot
from exactarm.station import Station

LEAST_SPEED_SHARE = 0.3  # slower samples carry little and may stick
_MOST_ROWS = 10000
_LONGEST_STEP_S = 0.02


@dataclass(frozen=True)
class GearSamples:
    """Rows of one axis (index from 0), all arrays (N,) over them.

    rows: in the data; angle, rate: motor over u0 (the declared ratio), rad and rad/s; output: rad/s or rad;
    direction -1, +1; keep; run; identification; disturbances (N, k): what may stand in the output beside the
    gear (unit columns), known by name. `rated`: the output is a rate.
    """

    axis: int
    ratio: float
    rows: np.ndarray
    time: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    output: np.ndarray
    direction: np.ndarray
    keep: np.ndarray
    run: np.ndarray
    identification: np.ndarray
    disturbances: np.ndarray
    disturbance_names: tuple[str, ...]
    rated: bool

    @property
    def motor(self) -> np.ndarray:
        """What the output would be with a constant ratio u0."""
        return self.rate if self.rated else self.angle

    @property
    def unit(self) -> str:
        return "rad/s" if self.rated else "rad"

    @cached_property
    def runs(self) -> list[np.ndarray]:
        """Index arrays of the runs, in the order of their numbers."""
        return rows_by_number(self.run)

    def side(self, way: float) -> np.ndarray:
        """(N,) the rows that count in one direction."""
        return self.keep & (self.direction == way)

    def speed(self, rows: np.ndarray | slice = slice(None)) -> float:
        """Typical speed at the output, rad/s, where the axis moves at all in those of the rows that count: a
        short motion may rest for most of its run."""
        speeds = np.abs(self.rate[rows][self.keep[rows]])
        moving = speeds > LEAST_SPEED_SHARE * np.max(speeds, initial=0.0)
        return float(np.median(speeds[moving])) if moving.any() else 0.0


def gear_samples(robot: Robot, data: Dataset, record: GearRecord, axis: int, identification: np.ndarray,
                 threads: int = 1) -> tuple[GearSamples, Layout]:
    """Samples of one axis, and the set-up (alignment or offsets) as found on the identification rows."""
    here = np.ones(len(data), bool) if record.encoder_axes else record.sensor_axis == axis
    rows = np.flatnonzero(here)
    plain = robot.with_joint(axis, cw=None, ccw=None)  # of a constant ratio
    fitted = here if record.encoder_axes else _setup_rows(data, here, identification)
    setup = sensor_layout(plain, data, record, chosen=fitted)
    carried = carried_layout(plain, data, GEAR_RUN.name)
    theta, theta_dot = _at_the_gear(plain, data, record, carried, threads)
    angle, rate = theta[rows, axis] / robot.ratios[axis], theta_dot[rows, axis] / robot.ratios[axis]
    beside = _beside(plain, data, rows, axis, setup, carried, threads)
    rated = not record.encoder_axes
    if rated:
        along = _axis_in_sensor(setup, data.session[rows])
        output = np.einsum("ij,ij->i", data.gyro[rows], along) - beside
        disturbances, names = np.ones((rows.size, 1)), ("bias",)
    else:
        output = data.joints["q"][rows, axis] - robot.offsets[axis] - beside
        disturbances, names = _encoder_disturbances(data, record, rows, axis, rate)
    samples = GearSamples(axis, float(robot.ratios[axis]), rows, data.time[rows], angle, rate, output,
                          record.direction[rows, axis],
                          record.keep[rows], data.run[rows], identification[rows], disturbances, names, rated)
    return samples, setup


def _setup_rows(data: Dataset, here: np.ndarray, identification: np.ndarray) -> np.ndarray:
    """(N,) the identification rows of every set-up that has any, all rows of the others."""
    fitted = here & identification
    known = np.isin(data.session, np.unique(data.session[fitted]))
    return here & (identification | ~known)


def _axis_in_sensor(setup: Layout, sessions: np.ndarray) -> np.ndarray:
    """(N, 3) the moving axis in the sensor's axes, by session."""
    along = np.zeros((sessions.size, 3))
    for effect in setup.effects:
        along[sessions == effect.session] = effect.axis_in_sensor
    return along


def _at_the_gear(plain: Robot, data: Dataset, record: GearRecord, carried: Layout,
                 threads: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, n) motor angles and rates as the gears receive them: with what the robot file knows of the motors'
    side (a delay), by the effects of the chain."""
    view = record.view(plain, data, threads)
    before = [effect for effect in carried.effects if acts(effect, view, Station.MOTOR)]
    if not before:
        return record.theta, record.theta_dot
    pass_station(view, Layout.of(tuple(before), estimate=False), Station.MOTOR, "theta", tangents=False)
    return view.theta, record.rate(view.theta)


def _beside(plain, data, rows, axis, setup, carried: Layout, threads: int) -> np.ndarray:
    """(N,) what the chain puts into the output beside this gear, on fewer rows, interpolated in time."""
    stride, runs = 1, rows_by_number(data.run[rows])
    if rows.size > _MOST_ROWS:
        step = typical_step(data.time[rows[runs[0]]])
        stride = max(1, min(int(np.ceil(rows.size / _MOST_ROWS)), int(_LONGEST_STEP_S / step)))
    picked = [of[::stride] for of in runs]  # even steps, which derivatives ask for
    few = rows[np.concatenate(picked)]
    part = data.select(few)
    record = gear_record(plain, part)
    layout = carried if record.encoder_axes else setup.joined(carried)
    prediction = predict_gear_run(plain, layout, part, record=record, tangents=False, threads=threads)
    theta, theta_dot = (motor[:, axis] / plain.ratios[axis]
                        for motor in _at_the_gear(plain, part, record, carried, threads))
    if record.encoder_axes:
        column = record.encoder_axes.index(axis)
        beside = prediction.measured[:, column] - theta - plain.offsets[axis]
    else:
        beside = np.einsum("ij,ij->i", prediction.measured, prediction.along) - theta_dot
    out = np.empty(rows.size)
    ends = np.cumsum([0] + [of.size for of in picked])
    for of, start, end in zip(runs, ends[:-1], ends[1:]):
        out[of] = np.interp(data.time[rows[of]], part.time[start:end], beside[start:end])
    return out


def _encoder_disturbances(data, record, rows, axis, rate):
    """Offsets of the runs, delay, wind-up under the measured torque, and the friction by which the output
    stays behind."""
    columns = {f"offset of run {run}": (data.run[rows] == run).astype(float)
               for run in np.unique(data.run[rows])}
    columns["delay"] = -rate
    for name in ("tau", "tau_motor"):
        torque = data.joints.get(name)
        if torque is not None and np.all(np.isfinite(torque[rows, axis])):
            columns["wind-up"] = -torque[rows, axis]
            break
    columns["friction"] = -record.direction[rows, axis]
    return np.stack([*columns.values()], axis=1), tuple(columns)
