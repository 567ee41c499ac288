"""Static poses as a diagnosis problem: residual = position (and orientation) of the target, all sessions at
once."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.diagnose.decisions import LOADED
from exactarm.diagnose.fitted import Fitted, rows_judged
from exactarm.diagnose.in_space import InSpace, errors_in_space
from exactarm.diagnose.next_poses import next_poses, sentence_of
from exactarm.diagnose.pose_fitted import PoseFitted
from exactarm.diagnose.problem_at_rest import ProblemAtRest
from exactarm.diagnose.quantisation import rounding_of_angles
from exactarm.diagnose.signal import Direction, Quantity, Signal, axis_of, movement_of, tilt_of
from exactarm.effects.base import Station
from exactarm.effects.moving_frames import MovingFrames, turned_about
from exactarm.errors import ComputationError
from exactarm.identify.calibrate import (
    CalibrationOptions,
    calibrated_robot,
    fit_identifiable,
    identifiable_layout,
    require_sessions,
)
from exactarm.identify.declared import carried_layout, frames_layout, geometry_layout, reestimated_layout
from exactarm.identify.match import require_match
from exactarm.identify.pose_fit import PoseFit, fit_poses
from exactarm.identify.springs_left import mounted_otherwise
from exactarm.robot.robot import Robot

_SLOW = 2.0  # cycles per turn of what a crank does to the load of its axis, and its first overtone


class PoseProblem(ProblemAtRest):
    """`orientation` residuals are used where every row has them."""

    kind = POSES.name
    by_posterior = drafts = True

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, data, held_out, threads, seed)
        self.orientation = data.rotation is not None
        if len(held_out):
            require_sessions(data, held_out)

    @cached_property
    def calibrated(self) -> PoseFit:
        frames, found = frames_layout(self.robot, self.data, orientation=self.orientation, seed=self.seed)
        require_match(self.robot, self.data, found, carried_layout(self.robot, self.data), self.seed)
        options = CalibrationOptions(threads=self.threads, seed=self.seed)
        return fit_identifiable(self.robot, self._whole(frames), self.data, self.orientation, options)[0]

    def declared(self) -> Layout:
        return self.calibrated.layout

    @cached_property
    def misdeclared(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(mounted_otherwise(self.calibrated))

    def doubts(self, fitted: Fitted) -> tuple[str, ...]:
        return *self.misdeclared, *self._like_balancers(fitted)

    def _like_balancers(self, fitted: Fitted) -> Iterator[str]:
        """Slow curves of axes that bear weight and give way: a spring that carries some of it, and so bends
        the drive less, makes the same curve of its axis."""
        found = fitted.layout.effects[len(self.calibrated.layout.effects) :]
        springs = {effect.joint for effect in fitted.layout.effects if effect.gives_way}
        turning = np.array([joint.type == "revolute" for joint in self.robot.joints])
        loads = turning * np.sqrt(np.mean(fitted.view.torque**2, axis=0))
        for effect in found:
            orders = [order for order, _ in effect.orders()]
            if not orders or max(orders) > _SLOW or loads[effect.index] <= LOADED * loads.max():
                continue
            if effect.joint in springs or self.robot.joints[effect.index].spring_linear:
                yield (f"a balancer (a spring that carries weight of axis {effect.joint}) does the same in "
                       f"poses as {effect.title}: a log of drive torques tells which of them it is")

    @cached_property
    def _rounding(self) -> np.ndarray | None:
        size = 6 if self.orientation else 3
        return rounding_of_angles(self.data, self.robot, self.calibrated.prediction.view, size)

    def rounding(self) -> np.ndarray | None:
        return self._rounding

    def _whole(self, frames: Layout) -> Layout:
        """The declared model beside these frames, whether the poses can tell its parameters or not."""
        return frames.joined(geometry_layout(self.robot)).joined(reestimated_layout(self.robot, self.data))

    def declared_under(self, declared: Layout, sigma: np.ndarray) -> Layout:
        frames = Layout.of(tuple(e for e in declared.effects if e.frames_of is not None))
        whole = Layout(declared.effects, self._whole(frames).free)
        sigma = np.sqrt(np.mean(sigma.reshape(-1, 3) ** 2, axis=1))
        told, _ = identifiable_layout(self.robot, whole, self.data, self.orientation, sigma, self.threads)
        return Layout(declared.effects, tuple(a | b for a, b in zip(declared.free, told.free)))

    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        weight = np.ones(len(self.data)) if weight is None else weight
        result = fit_poses(
            self.robot, layout, self.data, orientation=self.orientation, weights=weight, threads=self.threads,
            sigma=None if sigma is None else sigma[::3], tolerance=self.tolerance,
            drawn=self.calibrated.drawn)
        prediction = result.prediction
        residual = prediction.residual(self.orientation)
        view = prediction.view
        view.signals["residual"] = residual
        jacobian = prediction.jacobian[:, : residual.shape[1]]
        fitted = PoseFitted(self.robot, result.layout, result.fit, residual, jacobian, result.sigma,
                            weight, view, drawing=self.calibrated.drawn.to)
        view.signals["scale"] = fitted.scale
        return fitted

    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        prediction = predict_poses(self.robot, fitted.layout, data, tangents=False, threads=self.threads)
        error = np.linalg.norm(prediction.residual(), axis=1)
        return np.where(rows_judged(fitted.layout, prediction.view, self.data), error, np.nan)

    def in_space(self, first: Fitted, last: Fitted) -> InSpace:
        which = "validation" if len(self.held_out) else "identification"
        used = np.isfinite(self.errors(last, self.judged))
        return errors_in_space(self.robot, first.layout, last.layout, self.judged, which, used, self.threads)

    def held_out_picture(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray] | None:
        prediction = predict_poses(self.robot, fitted.layout, self.judged, threads=self.threads)
        residual = prediction.residual(self.orientation)
        kept = rows_judged(fitted.layout, prediction.view, self.data)
        return residual[kept], prediction.jacobian[kept, : residual.shape[1]]

    def spread_by_row(self, fitted: Fitted) -> np.ndarray:
        if not len(self.held_out):
            return np.zeros(0)
        prediction = predict_poses(self.robot, fitted.layout, self.held_out, threads=self.threads)
        return fitted.variance_of(prediction.jacobian[:, :3]).sum(axis=1)

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        position = fitted.view.signals["target"]
        return super().signals(fitted) | {
            Signal(Quantity.POSITION, part=axis): position[:, k] for k, axis in enumerate("xyz")}

    def space(self, fitted: Fitted) -> tuple[Signal, np.ndarray]:
        """Where the target is; set-ups stand far apart."""
        target, session = fitted.view.signals["target"], self.data.session
        spread = np.sqrt(np.mean(np.var(target, axis=0)))
        return Signal(Quantity.PLACE), np.column_stack([target / spread, 100.0 * session])

    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        view, m = fitted.view, fitted.residual.shape[1]
        unit = np.ones((view.rows, 1, 1))
        turn = {movement_of(self.robot, i + 1): view.transfers[Station.GEAR]((i,), unit)[:, :m, 0]
                for i in range(view.axes)}
        axes = np.eye(m)[:3]
        return turn | {axis_of("device", name): np.tile(axes[k], (view.rows, 1))
                       for k, name in enumerate("xyz")}

    def tilts(self, fitted: Fitted) -> dict[Direction, list[np.ndarray]]:
        view, m = fitted.view, fitted.residual.shape[1]
        frames, still, found = MovingFrames.of(view), np.zeros((view.rows, 3, view.axes)), {}
        for k in range(view.axes):
            along = frames.rotations[:, k + 1, :, 0]
            twists = [turned_about(view, across, still, frames.origins[:, k], still)[0][:, :, None]
                      for across in (along, np.cross(frames.axes[:, k], along))]
            found[tilt_of(k + 1)] = [view.transfers[Station.GEOMETRY](tuple(range(6)), twist)[:, :m, 0]
                                     for twist in twists]
        return found

    def error_of_unit_noise(self, fitted: Fitted) -> float:
        return float(np.sqrt(np.sum(fitted.sigma[:3] ** 2)))

    def repeat_noise(self, fitted: Fitted) -> float | None:
        """Pure error of rows measured at the same commanded pose in the same session, those left out
        excepted."""
        return self.repeats(fitted.residual[:, :3] / fitted.sigma[:3], fitted.weight > 0)

    def updated_robot(self, fitted: Fitted) -> Robot:
        return calibrated_robot(self.robot, self.data, fitted.layout, fitted.fit)

    def next_experiments(self, fitted: Fitted, places: tuple) -> tuple[str, tuple]:
        try:
            found = next_poses(self.robot, fitted, places, self.seed)
        except ComputationError as error:
            return f"No poses that part the causes could be planned: {error}.", ()
        return sentence_of(found), found
