"""Partner: another arm whose ball the target touches, in poses of both arms.

    |x - (b + R_b x_B(q_B, z))| - g         x (3,) m: target; x_B (3,): ball of the partner in its own base

Unknown: where the partner's base stands (b, R_b), its ball on its flange (3), both those of its controller,
the distance g of the two centres about what the fixture file says, and the partner's own deviations z (r,):
its parameters are those of its robot file plus F z, z standard normal before any data. So F F' is what the
file leaves open of the partner, and what of that goes into the arm stands in the arm's intervals. r = 0: the
partner is as its file says (judging). Neither base moves: one contact for all sessions. Effects in the
partner's file act, and the springs that it declares. Limits: the partner's axes turn (none slides), and its
own play is not known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.chain import Layout, PosePrediction, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import Fixture
from exactarm.data.fixture import Partner as Declared
from exactarm.data.kinds import POSES
from exactarm.effects.base import Parameter, Station
from exactarm.errors import InputError
from exactarm.measurement.contact import Contact
from exactarm.numerics.factors import lstsq
from exactarm.numerics.rotation import exp, left_jacobian, nearest, skew
from exactarm.robot.controller_frames import at_flange, target_on_flange, with_target
from exactarm.robot.robot import Robot

NAME = "partner"
_ROUNDS = 20  # of a start: the base by the ball, the ball by the base
FRAMES = 10  # so many numbers before those of the arm
_BASE, _TURN, _BALL, _GAP, _ARM = slice(0, 3), slice(3, 6), slice(6, 9), 9, slice(FRAMES, None)
_UNSEEN_M = 1e-9  # centres nearer than this have no direction
_Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Partner(Contact):
    """arm: the partner's free parameters at their declared values; factor (P, r): F; reference (3, 3): the
    orientation of its base that the rotation vector counts from."""

    declared_as: Declared | None = None
    arm: Layout = Layout.of(())
    factor: _Rows = ()
    reference: _Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    contact: ClassVar[str] = NAME

    @property
    def title(self) -> str:
        return "partner"

    def parameter_label(self, parameter: Parameter) -> str:
        return f"{NAME}_{parameter.name}"

    def parameters(self) -> tuple[Parameter, ...]:
        sigma = np.inf if self.declared_as is None else self.declared_as.sigma
        count = len(self.factor[0]) if self.factor else 0
        return (
            *(Parameter(f"base_{axis}_m", 10.0) for axis in "xyz"),
            *(Parameter(f"base_r{axis}_rad", np.pi) for axis in "xyz"),
            *(Parameter(f"ball_{axis}_m", 10.0) for axis in "xyz"),
            Parameter("gap_m", 1.0, prior=sigma),
            *(Parameter(f"arm_{k}", 1.0, prior=1.0) for k in range(1, count + 1)),
        )

    def rows(self, data) -> np.ndarray:
        return data.contacts[NAME] >= 0

    def open_to(self, arm: Layout, factor: np.ndarray) -> Partner:
        """The same with the partner's deviations free as its file leaves them open."""
        rows = tuple(tuple(map(float, row)) for row in factor)
        values = (*self.values[: FRAMES], *np.zeros(factor.shape[1]))
        return replace(self, arm=arm, factor=rows, values=values)

    @property
    def deviations(self) -> np.ndarray:
        """(r,) z."""
        return np.asarray(self.values[_ARM])

    @property
    def arm_now(self) -> Layout:
        """`arm` at its present values."""
        return self.arm.at(self.arm.values + np.asarray(self.factor) @ self.deviations) if self.factor \
            else self.arm

    def started(self, view, at):
        declared = partner_of(view.data.fixture, view.data)
        self = replace(self, declared_as=declared)
        bare = self.flange(view, at)
        points = view.signals["target"][at] + view.signals["displacement"][at, :3]
        start = target_on_flange(declared.robot.tool, declared.robot.controller).position
        turn, base, ball = placed_by(points, bare.position, bare.rotation, start)
        rows = tuple(tuple(map(float, row)) for row in turn)
        return replace(self.with_values([*base, 0.0, 0.0, 0.0, *ball, 0.0]), reference=rows)

    def numbers_at(self, view, at):
        values = np.asarray(self.values)
        found = self._held(view, at, values[_BALL], tangents=bool(self.factor))
        turn = exp(values[_TURN]) @ np.asarray(self.reference)
        there = found.position @ turn.T
        points = view.signals["target"][at] + view.signals["displacement"][at, :3]
        between = points - values[_BASE] - there
        distance = np.maximum(np.linalg.norm(between, axis=1), _UNSEEN_M)
        towards = (between / distance[:, None])[:, None, :]
        parts = [-towards, towards @ skew(there) @ left_jacobian(values[_TURN]),
                 -towards @ turn @ found.rotation, np.full((len(at), 1, 1), -1.0)]
        if self.factor:
            parts.append(-towards @ turn @ found.jacobian[:, :3] @ np.asarray(self.factor))
        numbers = distance - self.declared_as.distance - values[_GAP]
        by_target = np.concatenate([towards, np.zeros_like(towards)], axis=2)
        return numbers[:, None], by_target, np.concatenate(parts, axis=2)

    def flange(self, view, at: np.ndarray) -> PosePrediction:
        """The partner's flange in its own base, in the rows `at`."""
        return self._held(view, at, np.zeros(3), tangents=False)

    def _held(self, view, at: np.ndarray, ball: np.ndarray, tangents: bool) -> PosePrediction:
        """The partner's ball in its own base, with derivatives by its free parameters."""
        robot = self.declared_as.robot
        own = tuple(effect for effect in robot.effects if POSES.name in effect.kinds and not effect.record
                    and effect.station != Station.DEVICE)
        layout = self.arm_now.joined(Layout.of(own, estimate=False))
        placed = with_target(at_flange(robot), ball)
        rows = Dataset.of_arrays(POSES.name, {"q": robot.controller.joints(view.data.partner[at])})
        return predict_poses(placed, layout, rows, tangents=tangents, threads=view.threads)


def partner_of(fixture: Fixture, data: Dataset) -> Declared:
    """The partner that the fixture file declares, with its robot. Raises InputError where it cannot be used
    with these rows."""
    declared = fixture.partner
    if declared is None or declared.robot is None:
        raise InputError("angles of another arm, and no [partner] in the fixture file; expected --fixture "
                         "with its robot and distance_mm", file=data.first_file, column="partner_q_1_rad")
    robot = declared.robot
    if not robot.has_geometry or any(joint.type == "prismatic" for joint in robot.joints):
        raise InputError("declares no geometry, or an axis that slides; expected a partner whose axes turn",
                         file=declared.file)
    if data.partner is None or data.partner.shape[1] != robot.axes:
        found = 0 if data.partner is None else data.partner.shape[1]
        column = f"partner_q_{min(found, robot.axes) + 1}_rad"
        raise InputError(f"angles of {found} axes of the partner; its robot file {declared.file} has "
                         f"{robot.axes}", file=data.first_file, column=column)
    return declared


def placed_by(points: np.ndarray, flange: np.ndarray, turned: np.ndarray,
              ball: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R_b, b, ball with points = b + R_b (flange + turned ball) by least squares in turns, from `ball`;
    points, flange (K, 3), turned (K, 3, 3)."""
    for _ in range(_ROUNDS):
        there = flange + turned @ ball
        centres = points.mean(axis=0), there.mean(axis=0)
        turn = nearest((points - centres[0]).T @ (there - centres[1]))
        columns = np.concatenate([np.tile(np.eye(3), (len(points), 1, 1)), turn @ turned], axis=2)
        right = points - flange @ turn.T
        solution = lstsq(columns.reshape(-1, 6), right.ravel(), rcond=1e-6)[0]
        base, ball = solution[:3], solution[3:]
    return turn, base, ball


def partner_robot(contact: Partner) -> Robot:
    """The partner's robot with its parameters as estimated beside the arm's."""
    robot = contact.arm_now.baked(contact.declared_as.robot)
    return with_target(robot, np.asarray(contact.values[_BALL]))
