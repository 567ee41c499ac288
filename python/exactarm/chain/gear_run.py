"""The chain for gear runs: motor angles in, what the sensor behind the gear reads out.

    theta --gear of the direction of motion--> phi --spring under gravity--> q
    gyroscope:      reading (N, 3) = DEVICE(sum_k w_k dq_k/dt),
                    rad/s in the sensor's axes, z along the moving axis
    link encoders:  reading (N, E) = q of the axes that have one, rad (an offset per run and axis is a
                    parameter)

d/dt is one linear operator, of values and tangents alike (chain/gear_record.py, signals.py). w_k are the axes
upstream of the sensor, seen from its link; without a declared geometry only the moving axis counts. The load
is gravity's; where no masses are declared, a measured torque is taken. The angle and its load form a fixed
point as in static poses (chain/poses.py).
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy  # scipy.ndimage is imported at its first use

from exactarm import _core
from exactarm.chain.gear import declared_output_angle
from exactarm.chain.gear_record import GearRecord, gear_record
from exactarm.chain.layout import Layout
from exactarm.chain.propagate import pass_station
from exactarm.chain.run_tangents import Recorded, device_map, joint_tangents, moved
from exactarm.chain.sensor_link import force_in_sensor, sensor_rates
from exactarm.chain.spring import declared_deflection
from exactarm.chain.wave_rates import TangentsBeyond, beyond_values, prepare
from exactarm.data.dataset import Dataset
from exactarm.effects.base import Station
from exactarm.effects.drive import smooth_sign
from exactarm.numerics.signals import gaussian_filter
from exactarm.numerics.stamps import typical_step
from exactarm.rest_load import declared_constants
from exactarm.robot.robot import Robot
from exactarm.view import View, on_axes

_FIXED_POINT_TOLERANCE_RAD = 1e-13
_FIXED_POINT_PASSES = 30
_TORQUE_CUTOFF_HZ = 10.0  # arms swing near 10 Hz: above it the drive's torque does not reach the link
_SPIKE_S = 0.02


@dataclass(frozen=True)
class GearRunPrediction:
    """measured (N, m) rad/s or rad; jacobian (N, m, P) or None; observed (N, m) what the sensor said.

    keep (N,) rows on which the model is defined; along (N, m): the moving axis in the sensor's axes
    (gyroscope).
    """

    measured: np.ndarray
    observed: np.ndarray
    jacobian: np.ndarray | None
    along: np.ndarray | None
    view: View

    @property
    def keep(self) -> np.ndarray:
        return self.view.keep

    def residual(self) -> np.ndarray:
        """(N, m) observed minus predicted."""
        return self.observed - self.measured


def predict_gear_run(robot: Robot, layout: Layout, data: Dataset, *, record: GearRecord | None = None,
                     tangents: bool = True, threads: int = 1) -> GearRunPrediction:
    """Prediction of every row with the effects of `layout`; `record`: of the same data, where prepared."""
    record = gear_record(robot, data) if record is None else record
    robot = layout.baked(robot)
    view = record.view(robot, data, threads)
    nominal = record.theta / robot.ratios + robot.offsets
    passed, declared = _joint_angles(view, layout, tangents, None if record.encoder_axes else record)
    view.signals["q_dot"] = record.rate(view.q)
    if not record.encoder_axes:
        view.signals["q_dot"] += beyond_values(view, declared, passed, record.rate)
    if record.encoder_axes:
        weights = np.zeros((view.rows, len(record.encoder_axes), view.axes))
        weights[:, np.arange(len(record.encoder_axes)), record.encoder_axes] = 1.0
        view.signals["measured"] = view.q[:, record.encoder_axes]
        observed = data.joints["q"][:, record.encoder_axes]
    else:
        weights, force = sensor_rates(view, nominal)
        shown = {(e.session, e.index): e.axis_in_sensor for e in layout.effects
                 if e.axis_in_sensor is not None}
        view.signals["specific_force"] = force_in_sensor(view, nominal, force, shown)
        view.signals["measured"] = np.einsum("imk,ik->im", weights, view.signals["q_dot"])
        observed = data.gyro
    _pass(view, layout, Station.DEVICE, "measured", passed)
    device = device_map(view, passed)
    along = None if record.encoder_axes else _along(device)
    view.by_axis = (partial(on_axes, record.encoder_axes, view.axes) if along is None
                    else partial(_on_moving_axis, view.sensor_axis, along, view.axes))
    view = view.leaving(observed - view.measured)
    jacobian = _jacobian(view, layout, record, passed, weights) if tangents else None
    onto = device @ weights
    view.transfers = _transfers(view, record, onto)
    view.from_rate = lambda columns, rates: onto[:, :, list(columns)] @ rates
    return GearRunPrediction(view.measured, observed, jacobian, along, view)


def _pass(view: View, layout: Layout, station: Station, signal: str, passed: list[Recorded],
          derivatives: bool = True) -> None:
    """Adds the changes at a station to the signal's values and records them for the tangents."""
    passed.extend(Recorded(index, station, change, layout)
                  for index, change in pass_station(view, layout, station, signal, derivatives))


def _joint_angles(view: View, layout: Layout, derivatives: bool,
                  rated: GearRecord | None) -> tuple[list[Recorded], np.ndarray]:
    """Fills theta, phi, torque, q; returns the changes of the last pass and the angles (N, n) behind the
    declared gears. rated: the record, where rates are read."""
    first: list[Recorded] = []
    _pass(view, layout, Station.MOTOR, "theta", first)
    declared, slope = declared_output_angle(view)
    view.signals["gear_slope"] = slope
    view.signals["q"] = declared + view.robot.offsets
    if rated is not None:
        view.signals["phi"] = declared
        steps = [typical_step(rated.time[rows]) for rows in rated.runs if rows.size > 1]
        prepare(view, rated.rate, max(steps, default=0.0), bool(first))
    load = None if view.has_masses else _measured_load(view)
    settled = False
    for _ in range(_FIXED_POINT_PASSES):
        before, passed = view.q, list(first)
        if view.has_masses:
            load = _core.gravity_torque(view.robot.core, view.q, view.threads)
        view.signals["torque"] = load
        _pass(view, layout, Station.LOAD, "torque", passed, settled and derivatives)
        view.signals["phi"] = declared
        _pass(view, layout, Station.GEAR, "phi", passed, settled and derivatives)
        deflection, view.signals["spring_slope"] = declared_deflection(view.robot, view.torque)
        view.signals["q"] = view.phi + view.robot.offsets + deflection
        _pass(view, layout, Station.SPRING, "q", passed, settled and derivatives)
        if settled:
            break
        # One more pass at the fixed point records the derivatives of what lives in the robot's tables.
        settled = np.max(np.abs(view.q - before), initial=0.0) < _FIXED_POINT_TOLERANCE_RAD
        if settled and not derivatives:
            break
    return passed, declared


def _measured_load(view: View) -> np.ndarray:
    """(N, n) measured torque on the output side, 0 where none was measured: spikes out, low-passed.

    A gear gives way to what the arm demands, not to the ripple and noise of the drive's current. Nor to what
    the drive's dry friction takes of it: view.signals["friction_sign"] (N, n) is the shape of that part
    behind the same low-pass.
    """
    torque, ratios = np.zeros((view.rows, view.axes)), view.robot.ratios
    constants = declared_constants(view.robot)
    for name, factor in (("current", ratios * constants), ("tau_motor", ratios), ("tau", 1.0)):
        if name in view.data.joints:
            measured = view.data.joints[name] * factor
            torque = np.where(np.isnan(measured), torque, measured)
    if not np.any(torque):
        return torque
    view.signals["friction_sign"] = np.zeros_like(torque)
    for rows in view.runs:
        time = view.data.time[rows]
        width = 1 + 2 * int(round(_SPIKE_S / typical_step(time)))
        plain = scipy.ndimage.median_filter(torque[rows], size=(width, 1), mode="nearest")
        torque[rows] = gaussian_filter(plain, time, _TORQUE_CUTOFF_HZ)
        sign = smooth_sign(view.signals["theta_dot"][rows] / view.robot.ratios)
        view.signals["friction_sign"][rows] = gaussian_filter(sign, time, _TORQUE_CUTOFF_HZ)
    return torque


def _along(device: np.ndarray) -> np.ndarray:
    """(N, 3) direction of the moving axis in the sensor's axes."""
    along = device[:, :, 2]
    return along / np.linalg.norm(along, axis=1)[:, None]


def _on_moving_axis(sensor_axis: np.ndarray, along: np.ndarray, axes: int,
                    residual: np.ndarray) -> np.ndarray:
    """(N, n) of a gyroscope's residual (N, 3), along the axis that moves."""
    left = np.zeros((len(residual), axes))
    left[np.arange(len(residual)), sensor_axis] = np.einsum("ij,ij->i", residual, along)
    return left


def _jacobian(view: View, layout: Layout, record: GearRecord, passed: list[Recorded],
              weights: np.ndarray) -> np.ndarray:
    """(N, m, P), run by run, so that the tangents of the joints never stand in memory all at once."""
    size, components = layout.size, weights.shape[1]
    jacobian = np.zeros((view.rows, components, size))
    for number, rows in enumerate(record.runs):
        reading: dict[int, np.ndarray] = {}
        rate_of = partial(record.run_rate, number)
        beyond = None if record.encoder_axes else TangentsBeyond(view, rows, rate_of)
        for axis, tangent in joint_tangents(view, layout, passed, rows, beyond).items():
            rate = tangent if beyond is None else rate_of(tangent)
            rate = rate + beyond.by_axis[axis] if beyond is not None and axis in beyond.by_axis else rate
            for component in np.flatnonzero(np.any(weights[rows, :, axis] != 0.0, axis=0)):
                part = weights[rows, component, axis, None] * rate
                reading[component] = reading[component] + part if component in reading else part
        tangents = {"measured": reading}
        for recorded in passed:
            if recorded.station == Station.DEVICE:
                moved(tangents, "measured", recorded, rows, size)
        for component, tangent in tangents["measured"].items():
            jacobian[rows, component] = tangent
    return jacobian


def _transfers(view: View, record: GearRecord, weights: np.ndarray) -> dict:
    """First-order effect of a change at each station on the reading."""
    by_torque = view.signals["spring_slope"]

    def joint(columns, derivative):
        moved = derivative if record.encoder_axes else record.rate(derivative)
        return weights[:, :, list(columns)] @ moved

    def motor(columns, derivative):
        slope = view.signals["gear_slope"][:, list(columns), None]
        if record.encoder_axes:
            return joint(columns, derivative * slope)
        bends = view.signals["gear_slope_dot"][:, list(columns), None]
        return weights[:, :, list(columns)] @ (slope * record.rate(derivative) + bends * derivative)

    def load(columns, derivative):
        return joint(columns, derivative * by_torque[:, list(columns), None])

    def geometry(columns, derivative):
        return np.zeros((view.rows, weights.shape[1], derivative.shape[2]))

    def device(columns, derivative):
        out = geometry(columns, derivative)
        out[:, list(columns)] = derivative
        return out

    return {Station.MOTOR: motor, Station.GEAR: joint, Station.LOAD: load, Station.SPRING: joint,
            Station.GEOMETRY: geometry, Station.DEVICE: device}

