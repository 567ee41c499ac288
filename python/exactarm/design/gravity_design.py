"""Design of readings of a gravity sensor on the flange: the poses that tell most about the arm's angles.

Of random poses of the work space (of an inclinometer those within its range), `count` by the mean variance of
the target's position over the work space that the angles leave which readings can tell
(exactarm.design.closure_design), with mounting, base tilt, gain, zero and sensitivity across the axes unknown
and the drawing as prior. The sensor's axes are taken for those of the flange; a reading is taken to be good
to SIGMA_RAD.
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.fixture import Fixture
from exactarm.design.closure_design import (
    ClosureDesignOptions,
    expected_error,
    least_variance,
    work_space_weight,
)
from exactarm.design.criterion import information_of
from exactarm.design.design import short_way
from exactarm.design.pose_space import PoseSpace
from exactarm.effects.parameter_id import ParameterId
from exactarm.errors import InputError
from exactarm.identify.closure_fit import Pulls
from exactarm.identify.closures import identifiable_closures
from exactarm.identify.declared import geometry_layout, require_geometry
from exactarm.identify.identifiability import Identifiability
from exactarm.measurement.closures import predict_closures
from exactarm.measurement.contacts import SENSORS
from exactarm.measurement.touching import rows_at
from exactarm.robot.controller_frames import at_base
from exactarm.robot.robot import Robot

SIGMA_RAD = 1e-4  # of an averaged reading: an ordinary inclinometer, an accelerometer of 100 micro-g
RANGE_RAD = 1.0  # of an inclinometer
_POOL = 12  # random poses for each that is asked for


@dataclass(frozen=True)
class GravityDesign:
    """q (K, n) of the controller; deviation: expected error of the target over the work space by those of the
    arm's angles that readings can tell, m, with the drawing alone, with random poses, and with these.
    hidden: angles that gravity shows only together with others (zeros of parallel axes): they turn the sensor
    alike and move the target differently; with_hidden: the error with these poses, these angles included."""

    q: np.ndarray
    deviation: tuple[float, float, float]
    identifiability: Identifiability
    hidden: frozenset[ParameterId]
    with_hidden: float


def hidden_angles(found: Identifiability, geometry: Layout) -> set[ParameterId]:
    """Angles that are held because others of the arm, and no contact, turn the sensor alike."""
    return {entry.name for entry in found.dropped if entry.name.unit == "rad" and entry.collides_with
            and set(entry.collides_with) <= set(geometry.names)}


def design_gravity(robot: Robot, sensor: str, options: ClosureDesignOptions) -> GravityDesign:
    """The poses. Raises InputError where too few are within the sensor's range."""
    require_geometry(robot)
    random = np.random.default_rng(options.seed)
    robot = replace(at_base(robot), effects=())
    space = PoseSpace.of(robot, options.box, options.clearance)
    cls = SENSORS[sensor]
    device = cls(None, (0.0,) * cls.size())
    q = space.draw(_POOL * options.count, random)
    setup, geometry = Layout.of((device,)), geometry_layout(robot)
    read = lambda q: rows_at(q, device, **{sensor: np.zeros((len(q), cls.numbers))})
    if sensor == "tilt":
        tilts = predict_closures(robot, setup.held, read(q), tangents=False).residual[:, : cls.numbers]
        q = q[np.abs(tilts).max(axis=1) < RANGE_RAD]
    if len(q) <= options.count:
        raise InputError(f"--count {options.count}: expected fewer than the {len(q)} random poses within the "
                         "sensor's range")
    kept, found = identifiable_closures(robot, setup, geometry, read(q), options.threads)
    hidden = hidden_angles(found, geometry)
    gone = set(geometry.names) - set(kept.names) - hidden

    def picture(layout: Layout) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information of each pose, known before any, and weight, in units of the drawing's prior."""
        plausible = np.array([parameter.plausible for parameter in layout.parameters])
        jacobian = predict_closures(robot, layout, read(q), threads=options.threads).jacobian
        pull, _ = Pulls.of(geometry, Fixture()).rows(layout)
        loose = np.array([name not in set(geometry.names) for name in layout.names])
        known = information_of(pull[:, None, :] * plausible) + np.diag(loose.astype(float))
        return (jacobian[:, : cls.numbers] / SIGMA_RAD * plausible, known,
                work_space_weight(robot, layout, options, plausible))

    chosen, _, deviations = least_variance(*picture(kept), options.count, random)
    pool, known, weight = picture(setup.joined(geometry.without(gone)))
    with_hidden = expected_error(known + information_of(pool[chosen]), weight)
    return GravityDesign(short_way(space, q[chosen]), deviations, found, frozenset(hidden), with_hidden)
