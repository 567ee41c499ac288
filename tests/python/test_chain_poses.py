"""The chain for static poses: its Jacobian by every parameter, the fixed point of the deflection, gear tables
by direction."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.base_compliance import BaseCompliance
from exactarm.effects.frames import Frames
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.effects.link_compliance import LinkCompliance
from exactarm.effects.payload import Payload
from exactarm.effects.tracker_scale import TrackerScale
from exactarm.identify.declared import geometry_layout
from exactarm.numerics.rotation import exp, log
from exactarm.robot.robot import GearTable, Placement
from exactarm.robot_file import load_robot
from random_robot import random_rotation
from six_axis import six_axis

NOTHING = Layout.of(())
ROWS = 11
LEFT_OUT = 1e-2  # of a column: what geometry does to the gravity torque, and that to the deflection


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def poses(robot, rng, rows=ROWS, sessions=1, approach=True):
    """Random motor angles inside the limits; sessions in turn."""
    q = rng.uniform([j.q_min for j in robot.joints], [j.q_max for j in robot.joints], (rows, robot.axes))
    joints = {"theta": (q - robot.offsets) * robot.ratios}
    if approach:
        joints["approach"] = rng.choice([-1.0, 0.0, 1.0], (rows, robot.axes))
    session = 3 + np.arange(rows) % sessions
    return Dataset.of_arrays("poses", joints, position=np.zeros((rows, 3)), session=session)


def placement(rng):
    return Placement(random_rotation(rng), rng.normal(0.0, 1.0, 3))


def predicted(robot, layout, data, reference):
    """x -> (N, 6): position, and the rotation increment from `reference` (N, 3, 3)."""

    def function(x):
        prediction = predict_poses(robot, layout.at(x), data, tangents=False)
        return np.concatenate([prediction.position,
                               log(prediction.rotation @ np.swapaxes(reference, -1, -2))], axis=1)

    return function


def assert_jacobian(robot, layout, data, relative=1e-6):
    """All columns, but those of the geometry under springs only to what the chain says it leaves out."""
    geometry = {name for name in geometry_layout(robot).names
                if name.split("_")[0] in ("d", "a", "alpha", "beta")}
    bends = robot.links is not None and any(
        effect.name in ("joint_compliance", "payload") for effect in layout.effects
    ) | any(joint.spring_linear for joint in robot.joints)
    of_geometry = np.array([name in geometry for name in layout.names])
    relative = np.where(of_geometry, LEFT_OUT if bends else relative, relative)
    prediction = predict_poses(robot, layout, data)
    assert prediction.jacobian.shape == (len(data), 6, layout.size) and layout.size > 0
    steps = np.array([1e-2 * max(abs(v), p.plausible) if p.plausible < 0.1 else 1e-3
                      for v, p in zip(layout.values, layout.parameters)])
    assert_derivative(
        predicted(robot, layout, data, prediction.rotation), layout.values, prediction.jacobian, steps,
        relative=relative
    )


@pytest.mark.slow
@pytest.mark.parametrize("springs", [False, True])
@pytest.mark.parametrize("orientation", [False, True])
def test_jacobian_of_all_declared_parameters_in_two_sessions(springs, orientation, rng):
    robot = six_axis(springs=springs)
    data = poses(robot, rng, sessions=2)
    frames = tuple(Frames.of(session, placement(rng), placement(rng), orientation) for session in (3, 4))
    compliance = tuple(JointCompliance(axis, (4e-6, 1e-12), cubic_free=True) for axis in (2, 3, 5))
    layout = Layout.of(frames).joined(geometry_layout(robot)).joined(Layout.of(compliance))
    leaning = 1  # beta of the frame whose axis is parallel to the next one, beside its d
    assert layout.size == (24 if orientation else 18) + 18 + leaning + 6 + 6 + 6
    assert_jacobian(robot, layout, data)


@pytest.mark.slow
def test_jacobian_of_found_effects_beside_the_declared_model(rng):
    robot = six_axis(springs=True)
    found = (
        GearHarmonics(2, (4.0, 2e-3, -1e-3)),
        JointCompliance(2, (4e-6, 0.0)),
        Payload(None, (8.0, 0.05, -0.02, 0.1)),
        TrackerScale(None, (1e-4, -2e-4, 3e-4)),
    )
    layout = Layout.of((Frames.of(3, robot.base, robot.tool, False),)).joined(geometry_layout(robot)).joined(
        Layout.of(found)
    )
    assert_jacobian(robot, layout, poses(robot, rng), relative=1e-5)


def test_jacobian_of_a_payload_that_bends_base_and_bearings(rng):
    """Through springs of joints alone a quarter of its derivative was missing; what one bending does to the
    load of another (1.5e-3 here) is left out."""
    robot = six_axis(springs=True)
    layout = Layout.of((Payload(None, (8.0, 0.05, -0.02, 0.1)), BaseCompliance(None, (3e-6,)),
                        LinkCompliance(3, (4e-6,)), JointCompliance(2, (4e-6, 0.0))))
    assert_jacobian(robot, layout, poses(robot, rng), relative=2e-3)


def test_geometry_is_exact_where_nothing_bends(rng):
    robot = replace(six_axis(), links=None)
    assert_jacobian(robot, geometry_layout(robot), poses(robot, rng))


@pytest.mark.parametrize("turn", [0.0, 1e-8, np.pi - 1e-7])
def test_jacobian_of_frames_at_small_and_large_angles(turn, rng):
    robot = six_axis()
    base = Placement(exp(np.array([turn, 0.0, 0.0])), np.array([0.1, 0.2, 0.3]))
    assert_jacobian(robot, Layout.of((Frames.of(3, base, base, True),)), poses(robot, rng))


def test_jacobian_of_a_part_is_that_part_of_the_whole(rng):
    robot = six_axis(springs=True)
    data, layout = poses(robot, rng), geometry_layout(robot)
    gone = {layout.names[2], layout.names[9]}
    kept = np.array([name not in gone for name in layout.names])
    whole, part = predict_poses(robot, layout, data), predict_poses(robot, layout.without(gone), data)
    assert_allclose(part.jacobian, whole.jacobian[:, :, kept], atol=1e-13)
    assert_allclose(part.position, whole.position, atol=0.0)


def test_sessions_differ_by_their_frames_alone(rng):
    robot = six_axis(springs=True)
    data = poses(robot, rng, sessions=2)
    frames = {session: (placement(rng), placement(rng)) for session in (3, 4)}
    layout = Layout.of(tuple(Frames.of(s, base, tool, True) for s, (base, tool) in frames.items()))
    together = predict_poses(robot, layout, data)
    for session, (base, tool) in frames.items():
        rows = data.session == session
        alone = predict_poses(replace(robot, base=base, tool=tool), NOTHING, data.select(rows),
                              tangents=False)
        assert_allclose(together.position[rows], alone.position, atol=1e-13)
        assert_allclose(together.rotation[rows], alone.rotation, atol=1e-13)
    columns = together.jacobian
    assert (
        not np.any(columns[data.session == 3][:, :, 12:])
        and not np.any(columns[data.session == 4][:, :, :12])
    )


@pytest.mark.parametrize("name", ["six axis", "racer-7-1.4"])
def test_springs_balance_gravity_where_the_arm_comes_to_rest(name, rng):
    """q = phi + offset - kappa^-1(g(q)) (E4), the stretch put back into kappa = k1 e + k3 e^3."""
    robot = six_axis(springs=True) if name == "six axis" else load_robot(name)
    data = poses(robot, rng, approach=False)
    view = predict_poses(robot, NOTHING, data, tangents=False).view
    stretch = view.phi + robot.offsets - view.q
    linear = np.array([joint.spring_linear for joint in robot.joints])
    cubic = np.array([joint.spring_cubic for joint in robot.joints])
    gravity = _core.gravity_torque(robot.core, view.q, 1)
    assert np.max(np.abs(stretch)) > 1e-4
    assert_allclose(linear * stretch + cubic * stretch**3, gravity, atol=1e-6 * np.max(np.abs(gravity)))


def test_compliance_beside_a_spring_adds_to_it(rng):
    robot = six_axis(springs=True)
    data = poses(robot, rng, approach=False)
    soft = JointCompliance(2, (4e-6, 1e-12))
    view = predict_poses(robot, Layout.of((soft,)), data, tangents=False).view
    torque = _core.gravity_torque(robot.core, view.q, 1)
    rigid = view.phi + robot.offsets
    assert_allclose(view.q[:, 1],
                    rigid[:, 1] - torque[:, 1] / 2.5e5 - 4e-6 * torque[:, 1] - 1e-12 * torque[:, 1] ** 3,
                    atol=1e-12)
    assert_allclose(view.q[:, 2], rigid[:, 2] - torque[:, 2] / 1.2e5, atol=1e-12)


def test_without_masses_nothing_bends(rng):
    robot = replace(six_axis(springs=True), links=None)
    data = poses(robot, rng)
    view = predict_poses(robot, geometry_layout(robot), data).view
    assert_allclose(view.q, data.joints["theta"] / robot.ratios + robot.offsets, rtol=1e-15)


@pytest.mark.parametrize("direction", [-1.0, 0.0, 1.0])
def test_gear_table_is_that_of_the_approach(direction, rng):
    """Xi_d(phi) = theta with Xi_d(0) = 0; at rest from an unknown side: the mean of both tables."""
    cw = GearTable(np.array([84.0, 2.0]), np.array([1e-3, 2e-3]), np.array([-3e-3, 1e-3]))
    ccw = GearTable(np.array([84.0]), np.array([-2e-3]), np.array([4e-3]))
    robot = six_axis().with_joint(1, cw=cw, ccw=ccw)
    data = poses(robot, rng)
    data = replace(data, joints=data.joints | {"approach": np.full((ROWS, 6), direction)})
    view = predict_poses(robot, NOTHING, data, tangents=False).view
    u0, phi = robot.ratios[1], view.phi[:, 1]
    by_table = [_integral(table, u0, phi) for table in (cw, ccw)]
    weight = {-1.0: (1.0, 0.0), 0.0: (0.5, 0.5), 1.0: (0.0, 1.0)}[direction]
    assert np.max(np.abs(phi - view.theta[:, 1] / u0)) > 1e-5
    assert_allclose(weight[0] * by_table[0] + weight[1] * by_table[1], view.theta[:, 1], rtol=1e-11)
    others = [0, 2, 3, 4, 5]
    assert_allclose(view.phi[:, others], (view.theta / robot.ratios)[:, others], rtol=1e-15)


def _integral(table, u0, phi):
    """theta = integral of u0 (1 + sum a cos(w phi) - b sin(w phi)) from 0 to phi."""
    w, phi = table.order, phi[:, None]
    return u0 * (phi[:, 0] + np.sum(table.a / w * np.sin(w * phi) + table.b / w * (np.cos(w * phi) - 1.0),
                                    axis=1))


def test_unknown_approach_is_the_mean_table(rng):
    racer = load_robot("racer-7-1.4")
    known = poses(racer, rng)
    zero = replace(known, joints=known.joints | {"approach": np.zeros((ROWS, 6))})
    without = replace(known, joints={"theta": known.joints["theta"]})
    at_rest, absent = (predict_poses(racer, NOTHING, data, tangents=False).position
                       for data in (zero, without))
    assert_allclose(at_rest, absent, atol=0.0)
    assert np.max(np.abs(at_rest - predict_poses(racer, NOTHING, known, tangents=False).position)) > 1e-6


@pytest.mark.slow
def test_jacobian_through_gear_tables_and_springs(rng):
    racer = load_robot("racer-7-1.4")
    layout = Layout.of((Frames.of(3, placement(rng), placement(rng), True),)).joined(geometry_layout(racer))
    assert [name for name in layout.names if name.startswith("ratio")] == ["ratio_4", "ratio_5", "ratio_6"]
    assert_jacobian(racer, layout, poses(racer, rng))


def test_controller_keeps_its_own_constants(rng):
    """A reported q goes back to the motor by what the controller uses, not by what is identified."""
    robot = six_axis()
    q = rng.uniform(-1.0, 1.0, (4, 6))
    data = Dataset.of_arrays("poses", {"q": q}, position=np.zeros((4, 3)))
    layout = geometry_layout(robot)
    x = layout.values
    x[layout.names.index("q_offset_2_rad")] += 0.01
    x[layout.names.index("ratio_4")] *= 1.001
    view = predict_poses(robot, layout.at(x), data, tangents=False).view
    assert_allclose(view.q[:, 1], q[:, 1] + 0.01, rtol=1e-13)
    assert_allclose(view.q[:, 3], q[:, 3] / 1.001, rtol=1e-13)


def test_hysteresis_follows_the_approach_whatever_its_reach(rng):
    """A robot file from gear runs declares a reach; between poses at rest nobody knows the way that it would
    run along."""
    robot = six_axis()
    data = poses(robot, rng)
    plain, reaching = (predict_poses(robot, Layout.of((Hysteresis(2, values),)), data)
                       for values in ((2e-4,), (2e-4, 1e-3)))
    assert_allclose(reaching.position, plain.position, rtol=0, atol=1e-15)
    assert_allclose(reaching.jacobian[:, :, 0], plain.jacobian[:, :, 0], rtol=0, atol=1e-12)
    assert not np.any(reaching.jacobian[:, :, 1])


def test_a_change_is_worked_out_anew_only_where_what_it_follows_has_moved(rng, monkeypatch):
    """Gear harmonics follow the angle alone, which no load moves; a compliance follows the load, which
    settles in several passes: the prediction is what it was, bit by bit."""
    robot = load_robot("ur10")
    data = poses(robot, rng)
    gear = GearHarmonics(2, (3.0, 1e-3, -5e-4))
    layout = Layout.of((gear, JointCompliance(2, (2e-5, 0.0))))
    counts = {GearHarmonics: 0, JointCompliance: 0}
    for cls in counts:
        def counted(self, view, cls=cls, change=cls.change):
            counts[cls] += 1
            return change(self, view)

        monkeypatch.setattr(cls, "change", counted)
    found = predict_poses(robot, layout, data)
    assert counts[GearHarmonics] == 1 and counts[JointCompliance] > 3
    monkeypatch.setattr("exactarm.chain.propagate._change", lambda view, effect: effect.change(view))
    again = predict_poses(robot, layout, data)
    assert np.array_equal(found.jacobian, again.jacobian)
    assert np.array_equal(found.position, again.position) and counts[GearHarmonics] > 3
