"""The chain for motions: motor angles over time in, drive torque out (N, n), Nm on the output side.

    q      = Xi^{-1}(theta) + offset + gear effects - kappa^{-1}(torque)
    torque = D(q) q_ddot + C q_dot + g + effects of the load                       carried by the springs
    drive  = ratio (dphi/dtheta)' torque + J ratio theta_ddot + friction(theta_dot) + effects of the drive

The middle line of the drive is the principle of virtual work (E4): whatever turns a joint is loaded by it, so
a wrist whose motors turn several axes, or a gear ratio that is not constant, transposes. Declared springs
answer as the arm swings on them (chain/spring_response.py); what effects add to them follows the load of the
unbent motion. Rates are those of the motor over its ratio, plus the derivative of what the arm deviates from
it, low-passed as the measured angles are.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from exactarm import _core
from exactarm.chain.gear import declared_output_angle
from exactarm.chain.layout import Layout
from exactarm.chain.loaded_arms import Arm, loaded_arms
from exactarm.chain.motion_record import SLOW_HZ, MotionRecord
from exactarm.chain.propagate import pass_station, pass_tangents
from exactarm.chain.spring_response import SpringResponse, rates
from exactarm.data.kinds import MOTION, Device
from exactarm.effects.base import Effect, Station
from exactarm.effects.drive import over_samples, sign_slopes
from exactarm.robot.robot import Robot
from exactarm.view import View

_RELATIVE_STEP = 1e-4  # of a plausible value, for the slope of dphi/dtheta (exact for effects linear in it)


@dataclass
class MotionView(View):
    """A view that remembers how it came about, and so tells the response to an effect not in the layout."""

    evaluated: tuple = field(default=(), repr=False)  # robot, layout, record
    # (robot, layout, record, threads, bent) -> prediction
    predict: Callable | None = field(default=None, repr=False)
    # stretch of the springs, torque left, tangent stiffness
    bent: tuple | None = field(default=None, repr=False)

    @property
    def arms(self) -> tuple[Arm, ...]:
        """Rows, and the arm with its payload that moves in them."""
        return loaded_arms(self.robot, self.data, self.evaluated[1].effects)

    @property
    def sign_width(self) -> np.ndarray:
        return self.evaluated[2].dry.width

    def dry_friction(self, index: int, law: Callable | None = None) -> np.ndarray | None:
        record = self.evaluated[2]
        samples = record.samples
        if samples is None:
            return None
        if not self._moved(index):
            if law is None:
                return record.mean_dry_sign(index)
            return samples.gathered(law(record.dry_sign(index), samples.rate[:, index]))
        angle, rate = self._moved_samples(index)
        sign = record.dry.sign(index, rate, angle, samples.runs)
        return samples.gathered(sign if law is None else law(sign, rate))

    def _moved(self, index: int) -> bool:
        """Whether an effect moves one motor (from 0) from where the record has it."""
        return bool(np.any(self.theta[:, index] - self.evaluated[2].theta[:, index]))

    def _moved_samples(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """(S,) angle and rate of one motor as it was logged, moved as the record's rows are."""
        record, ratio = self.evaluated[2], self.robot.controller_ratios[index]
        samples = record.samples
        moved = self.theta[:, index] - record.theta[:, index]
        faster = self.signals["theta_dot"][:, index] - record.theta_dot[:, index]
        angle, rate = (own[:, index] + samples.spread(change, record.runs) / ratio
                       for own, change in ((samples.angle, moved), (samples.rate, faster)))
        return angle, rate

    def shown_of_wave(self, index: int, order: float) -> tuple[np.ndarray, np.ndarray] | None:
        record = self.evaluated[2]
        if record.samples is None:
            return None
        return record.samples.shown_of_wave(np.abs(record.theta_dot[:, index]) / (2.0 * np.pi), order)

    def sign_by_rate(self, index: int) -> np.ndarray | None:
        record = self.evaluated[2]
        if record.samples is None or record.dry.reach[index]:
            return None
        if not self._moved(index):
            return record.mean_dry_slope(index)
        return record.samples.gathered(record.dry.slope_by_rate(index, self._moved_samples(index)[1]))

    def sign_by_angle(self, index: int) -> np.ndarray | None:
        samples, dry = self.evaluated[2].samples, self.evaluated[2].dry
        if samples is None or not dry.reach[index]:
            return None
        return samples.gathered(dry.slope(index, samples.angle[:, index], samples.runs))

    @cached_property
    def folded(self) -> np.ndarray:
        return self.evaluated[2].folded(self.robot)

    @property
    def swing(self) -> np.ndarray:
        # A row stands for all samples of the log around it, none of which has seen more than its own instant.
        step = self.evaluated[2].step - self.evaluated[2].logged_step
        return 0.5 * max(step, 0.0) * np.abs(self.signals["theta_ddot"] / self.robot.controller_ratios)

    def response(self, effect: Effect) -> np.ndarray:
        """(N, m, k) derivative of the prediction by all parameters of the effect, at its values."""
        return self._responses([effect], [np.ones(len(effect.values), bool)], None)[0]

    def responses(self, effects: list[Effect]) -> list[np.ndarray]:
        """The same of several effects of zero size, by what is neither fixed nor searched (the rest is zero):
        one run through the arm serves all of them."""
        free = [np.array([not p.fixed and not p.search for p in effect.parameters()], bool)
                for effect in effects]
        return self._responses(effects, free, self.bent)

    def _responses(self, effects: list[Effect], free: list[np.ndarray], bent) -> list[np.ndarray]:
        robot, layout, record = self.evaluated
        asked = Layout(tuple(effects), tuple(free))
        jacobian = self.predict(robot, layout.held.joined(asked), record, self.threads, bent).jacobian
        found = []
        for mask, where in zip(free, asked.slices):
            found.append(np.zeros((*jacobian.shape[:2], mask.size)))
            found[-1][:, :, mask] = jacobian[:, :, where]
        return found


@dataclass(frozen=True)
class MotionPrediction:
    """What the drives should report on the record's rows: torque (N, n) Nm, jacobian (N, n, P) or None."""

    torque: np.ndarray
    jacobian: np.ndarray | None
    view: MotionView
    record: MotionRecord

    def residual(self) -> np.ndarray:
        """(N, n) measured minus predicted; NaN in axes without a measurement."""
        return self.record.torque - self.torque


def predict_motion(robot: Robot, layout: Layout, record: MotionRecord, *, tangents: bool = True,
                   threads: int = 1, bent=None) -> MotionPrediction:
    """Drive torque on every row of `record` with the effects of `layout` in the chain.

    bent: `MotionView.bent` of the same motion, where that is known.
    """
    view = motion_view(robot, layout, record, tangents=tangents, threads=threads, bent=bent)
    view.predict = lambda *about: predict_motion(*about[:3], threads=about[3], bent=about[4])
    predict_drive(view, robot, layout, tangents and layout.size > 0)
    torque = record.smooth(view.signals["measured"])
    nothing = np.zeros((*torque.shape, 0))
    jacobian = record.smooth(view.tangents.get("measured", nothing)) if tangents else None
    return MotionPrediction(torque, jacobian, view, record)


def motion_view(robot: Robot, layout: Layout, record: MotionRecord, *, tangents: bool = True,
                threads: int = 1, kind: str = MOTION.name, bent=None) -> MotionView:
    """Motor angles, gears, loads, springs and joint angles with their rates: all signals up to the joints."""
    baked = layout.baked(robot)
    view = MotionView(baked, record.data, kind, threads, evaluated=(robot, layout, record), bent=bent)
    tangents = tangents and layout.size > 0
    _motors(view, layout, record, tangents)
    if not np.isnan(record.torque).all():
        view.signals["carried"], view.signals["carried_noise"] = _carried(view, record)
    declared, slope = declared_output_angle(view)
    view.signals["phi"] = declared
    if tangents:
        view.tangents["phi"] = slope[:, :, None] * view.tangents["theta"]
    view.signals["q"] = view.phi + baked.offsets
    if tangents:
        view.tangents["q"] = view.tangents["phi"]
    _load(view, layout, record, tangents)  # of the undeflected motion: what bends gears and springs
    if any(effect.station in (Station.GEAR, Station.SPRING) for effect in layout.effects):
        pass_station(view, layout, Station.GEAR, "phi", tangents)
        _joints(view, layout, tangents)
        _load(view, layout, record, tangents)
    if view.has_masses and any(joint.spring_linear for joint in baked.joints):
        _bend(view, layout, record, tangents)
    return view


def _motors(view: View, layout: Layout, record: MotionRecord, tangents: bool) -> None:
    shape = (view.rows, view.axes, layout.size)
    view.signals |= {"theta": record.theta, "theta_dot": record.theta_dot, "theta_ddot": record.theta_ddot}
    view.signals["direction"] = record.direction
    if tangents:
        view.tangents |= {name: np.zeros(shape) for name in ("theta", "theta_dot", "theta_ddot")}
    if not any(effect.station == Station.MOTOR for effect in layout.effects):
        return
    pass_station(view, layout, Station.MOTOR, "theta", tangents)
    moved = record.derivative(view.theta - record.theta)
    view.signals["theta_dot"] = record.theta_dot + moved
    view.signals["theta_ddot"] = record.theta_ddot + record.derivative(moved)
    if tangents:
        view.tangents["theta_dot"] = record.derivative(view.tangents["theta"])
        view.tangents["theta_ddot"] = record.derivative(view.tangents["theta_dot"])


def _joints(view: View, layout: Layout, tangents: bool) -> None:
    """q from phi and what effects add to the springs."""
    view.signals["q"] = view.phi + view.robot.offsets
    if tangents:
        view.tangents["q"] = view.tangents["phi"]
    pass_station(view, layout, Station.SPRING, "q", tangents)


def _bend(view: View, layout: Layout, record: MotionRecord, tangents: bool) -> None:
    """The declared springs give way under the torque, and relieve it; tangents about the bent motion."""
    if view.bent is None:
        unbent = SpringResponse(view.robot, *_slopes(view), record.runs, record.step, record.inside)
        view.bent = (*unbent.give_way(view.torque), unbent.tangent)
    stretch, torque, tangent = view.bent
    _bent(view.signals, record, stretch, torque)
    if tangents:
        slopes = _slopes(view)
        view.tangents["torque"] = _torque_tangent(view, slopes)
        pass_tangents(view, layout, Station.LOAD, "torque")
        response = SpringResponse(view.robot, *slopes, record.runs, record.step, record.inside)
        response.tangent = tangent
        _bent(view.tangents, record, *response.give_way_tangent(view.tangents["torque"]))


def _slopes(view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, n, n) derivatives of the inverse dynamics by q, q_dot, q_ddot."""
    motion = (view.q, view.signals["q_dot"], view.signals["q_ddot"])
    found = tuple(np.zeros((view.rows, view.axes, view.axes)) for _ in range(3))
    for rows, arm in view.arms:
        slopes = _core.inverse_dynamics_derivatives(arm.core, *(each[rows] for each in motion),
                                                    threads=view.threads)
        for whole, name in zip(found, ("dtau_dq", "dtau_dq_dot", "mass_matrix")):
            whole[rows] = slopes[name]
    return found


def _torque_tangent(view: View, slopes) -> np.ndarray:
    return sum(slope @ view.tangents[name] for slope, name in zip(slopes, ("q", "q_dot", "q_ddot")))


def _bent(signals: dict[str, np.ndarray], record: MotionRecord, stretch: np.ndarray,
          torque: np.ndarray) -> None:
    rate, acceleration = rates(stretch, record.runs, record.step)
    signals["torque"] = torque
    for name, change in (("q", stretch), ("q_dot", rate), ("q_ddot", acceleration)):
        signals[name] = signals[name] - change


def _load(view: View, layout: Layout, record: MotionRecord, tangents: bool) -> None:
    """Rates of q, and the torque at the joints.

    Under a tracker, without declared springs, the rates are those of the motors over their ratios: how a fast
    gear error or a gear's passage at a reversal loads the arm hangs on springs and a passage that nobody
    declares, and at the rows of a fit it would be a spike of any height.
    """
    ratios = view.robot.ratios
    deviation = view.q - view.theta / ratios - view.robot.offsets
    shaken = view.device is not Device.TARGET or any(joint.spring_linear for joint in view.robot.joints)
    rate = record.derivative(record.smooth_angle(deviation)) if shaken else np.zeros_like(deviation)
    view.signals["q_dot"] = view.signals["theta_dot"] / ratios + rate
    view.signals["q_ddot"] = view.signals["theta_ddot"] / ratios + record.derivative(rate)
    if tangents:
        moved = view.tangents["q"] - view.tangents["theta"] / ratios[:, None]
        moved = moved if shaken else np.zeros_like(moved)
        moved = record.derivative(record.smooth_angle(moved)) if np.any(moved) else moved
        view.tangents["q_dot"] = view.tangents["theta_dot"] / ratios[:, None] + moved
        moved = record.derivative(moved) if np.any(moved) else moved
        view.tangents["q_ddot"] = view.tangents["theta_ddot"] / ratios[:, None] + moved
    view.signals["torque"] = np.zeros((view.rows, view.axes))
    if tangents:
        view.tangents["torque"] = np.zeros((view.rows, view.axes, layout.size))
    if view.has_masses:
        motion = (view.q, view.signals["q_dot"], view.signals["q_ddot"])
        for rows, arm in view.arms:
            view.signals["torque"][rows] = _core.inverse_dynamics(arm.core, *(each[rows] for each in motion),
                                                                  view.threads)
        if tangents and np.any(view.tangents["q"]):
            view.tangents["torque"] = _torque_tangent(view, _slopes(view))
    pass_station(view, layout, Station.LOAD, "torque", tangents)


def predict_drive(view: MotionView, robot: Robot, layout: Layout, tangents: bool) -> None:
    """From joint torques to what the drives report: virtual work, rotor, friction, sensor."""
    nominal = view.robot.controller_ratios
    taken, by_angle, by_rate, by_acceleration = _taken_by_drives(view)
    gears = transmission(view, layout)
    drive = nominal * np.einsum("nji,nj->ni", gears, view.torque) + taken
    view.signals["drive"] = drive
    if tangents:
        moved = nominal[:, None] * np.einsum("nji,njp->nip", gears, view.tangents["torque"])
        moved += by_acceleration[:, None] * view.tangents["theta_ddot"]
        moved += by_rate[:, :, None] * view.tangents["theta_dot"]
        if by_angle.any():
            moved += by_angle[:, :, None] * view.tangents["theta"]
        view.tangents["drive"] = moved + nominal[:, None] * _transmission_tangent(view, robot, layout)
    pass_station(view, layout, Station.DRIVE, "drive", tangents)
    view.signals["measured"] = view.signals["drive"]
    if tangents:
        view.tangents["measured"] = view.tangents["drive"]
    pass_station(view, layout, Station.DEVICE, "measured", tangents)


def _taken_by_drives(view: View) -> tuple[np.ndarray, ...]:
    """(N, n) Nm that declared rotors and friction take of the drive torque, its slopes by theta and
    theta_dot (N, n) and theta_ddot (n,)."""
    nominal = view.robot.controller_ratios
    rate = view.signals["theta_dot"] / nominal
    coulomb, viscous, rotor = (np.array([getattr(joint, name) or 0.0 for joint in view.robot.joints])
                               for name in ("coulomb", "viscous", "rotor_inertia"))
    taken = rotor * nominal * view.signals["theta_ddot"] + viscous * rate
    by_rate, by_angle = np.tile(viscous, (view.rows, 1)), np.zeros_like(rate)
    for index in np.flatnonzero(coulomb):
        taken[:, index] += coulomb[index] * over_samples(view, index)
        slopes = sign_slopes(view, index)
        by_rate[:, index] += coulomb[index] * slopes[0]
        by_angle[:, index] = coulomb[index] * slopes[1]
    return taken, by_angle / nominal, by_rate / nominal, rotor * nominal


def _carried(view: MotionView, record: MotionRecord) -> tuple[np.ndarray, np.ndarray]:
    """(N, n) Nm that the joints carry as the drives tell: measured torque less rotors and friction, NaN where
    none was measured; and (n,) its standard deviation of noise, by what the band above holds.

    Unlike the torque of the model it does not hang on angles that a gap has bent. Slow, because its noise is
    that of the residual too: what it decides within the band would explain noise by itself.
    """
    told = record.torque - record.smooth(_taken_by_drives(view)[0])
    slow = record.slow(told)
    above = max((record.bandwidth_hz or 0.0) - SLOW_HZ, SLOW_HZ)
    return slow, np.sqrt(SLOW_HZ / above * np.mean((told - slow) ** 2, axis=0))


def transmission(view: View, layout: Layout,
                 declared: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """dphi/dtheta (N, n, n) of declared gears and gear effects at the angles of `view`; declared: what
    `declared_output_angle` gives there, where it is known."""
    declared, slope = declared_output_angle(view) if declared is None else declared
    n = view.axes
    inside = replace(view, signals=dict(view.signals), tangents={})
    inside.signals["phi"] = declared
    inside.tangents["theta"] = np.broadcast_to(np.eye(n), (view.rows, n, n))
    inside.tangents["phi"] = slope[:, :, None] * np.eye(n)
    pass_station(inside, layout.held, Station.GEAR, "phi", True)
    return inside.tangents["phi"]


def _transmission_tangent(view: MotionView, robot: Robot, layout: Layout) -> np.ndarray:
    """(N, n, P) derivative of (dphi/dtheta)' torque by the parameters of the gears, the torque held."""
    tangent = np.zeros((view.rows, view.axes, layout.size))
    record = view.evaluated[2]
    known = (declared_output_angle(view) if any(effect.station == Station.GEAR for effect in layout.effects)
             else None)
    sized = [index for index, effect in enumerate(layout.effects)
             if effect.only_in_tables or _has_size(effect)]
    for index, effect in enumerate(layout.effects):
        if effect.station not in (Station.MOTOR, Station.GEAR):
            continue
        # Effects without any size leave the transmission as it is.
        around = [layout.effects[k] for k in sized if k != index]
        # What adds to the output angle leaves the motors and the declared gears as they are.
        moves_declared = effect.station == Station.MOTOR or effect.only_in_tables
        parameters = effect.parameters()
        for column, k in zip(range(layout.size)[layout.slices[index]], np.flatnonzero(layout.free[index])):
            step = _RELATIVE_STEP * parameters[k].plausible
            ends = []
            for sign in (1.0, -1.0):
                shifted = np.array(effect.values, float)
                shifted[k] += sign * step
                held = Layout.of((*around, effect.with_values(shifted)), estimate=False)
                ends.append(_shifted_transmission(view, robot, held, record,
                                                  None if moves_declared else known))
            tangent[:, :, column] = np.einsum("nji,nj->ni", (ends[0] - ends[1]) / (2.0 * step), view.torque)
    return tangent


def _has_size(effect: Effect) -> bool:
    """Whether any value differs from zero that is neither fixed nor searched."""
    return any(value != 0.0 for p, value in zip(effect.parameters(), effect.values)
               if not p.fixed and not p.search)


def _shifted_transmission(view: MotionView, robot: Robot, layout: Layout, record: MotionRecord,
                          declared: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
    if declared is not None:
        return transmission(view, layout, declared)
    shifted = replace(view, robot=layout.baked(robot), signals=dict(view.signals), tangents={})
    _motors(shifted, layout, record, False)
    return transmission(shifted, layout)
