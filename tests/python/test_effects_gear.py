"""Effects of gears and gyroscopes: derivatives against central differences, signs, limits, robot file
entries."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import Device
from exactarm.effects import effect_from_table, library
from exactarm.effects.backlash import Backlash
from exactarm.effects.direction_dependence import DirectionDependence
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.harmonic_family import searched_orders
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.numerics.harmonics import delivered_angle
from exactarm.robot.robot import GearTable
from exactarm.robot_file import load_robot

POSE_EFFECTS = (
    Backlash(2, (4e-4, 3.0)),
    GearHarmonics(1, (84.9, 1e-3, 3e-3, -5e-4, 2e-4)),
    DirectionDependence(3, (70.2, 2e-3, -1e-3)),
    GearEccentricity(2, (1e-4, -2e-4, 5e-5, 1e-4)),
    Hysteresis(3, (3e-4,)),
    JointCoupling(6, (5.0, 0.03)),
)


@pytest.fixture(scope="module")
def racer():
    return load_robot("racer-7-1.4")


def poses(robot, rows=24, seed=3):
    random = np.random.default_rng(seed)
    low = np.array([joint.q_min for joint in robot.joints])
    high = np.array([joint.q_max for joint in robot.joints])
    q = low + (high - low) * random.uniform(0.1, 0.9, (rows, robot.axes))
    theta = (q - robot.offsets) * robot.ratios
    approach = random.choice([-1.0, 1.0], (rows, robot.axes))
    return Dataset.of_arrays("poses", {"theta": theta, "approach": approach}, position=np.zeros((rows, 3)))


@pytest.mark.parametrize("effect", POSE_EFFECTS, ids=lambda effect: effect.name)
def test_derivatives_in_poses(racer, effect):
    data, layout = poses(racer), Layout.of((effect,))
    predict = lambda x: predict_poses(racer, layout.at(x), data, tangents=False).position
    jacobian = predict_poses(racer, layout, data).jacobian[:, :3]
    step = np.maximum(1e-3 * np.abs(layout.values), 1e-7)
    assert_derivative(predict, layout.values, jacobian, step, relative=2e-6)


@pytest.mark.parametrize("effect", POSE_EFFECTS, ids=lambda effect: effect.name)
def test_zero_size_changes_nothing_in_poses(racer, effect):
    free = [0.0 if not p.fixed and "order" not in p.name else v
            for p, v in zip(effect.parameters(), effect.values)]
    data = poses(racer)
    with_effect = predict_poses(racer, Layout.of((effect.with_values(free),)), data, tangents=False)
    without = predict_poses(racer, Layout.of(()), data, tangents=False)
    assert_allclose(with_effect.position, without.position, atol=1e-15)


@pytest.mark.parametrize("effect", POSE_EFFECTS, ids=lambda effect: effect.name)
def test_table_gives_the_effect_back(effect):
    assert effect_from_table(effect.to_table()) == effect


@pytest.mark.parametrize("name", sorted(library()))
@pytest.mark.slow
def test_candidates_have_zero_size(racer, name):
    view = predict_poses(racer, Layout.of(()), poses(racer)).view
    if "poses" not in library()[name].kinds:
        pytest.skip("not for poses")
    for effect in library()[name].candidates(racer, view):
        change = effect.change(view)
        assert not np.any(change.value)
        assert change.by_parameters.shape == (view.rows, len(change.columns), len(effect.values))
        assert len(effect.parameters()) == len(effect.values)


def test_harmonics_are_those_of_the_declared_table(racer):
    """The effect on a plain gear and the same numbers in the robot's table predict the same angle."""
    table = GearTable(np.array([70.0, 140.0]), np.array([2e-2, 1e-3]), np.array([-1e-2, 3e-3]))
    plain = racer.with_joint(2, cw=None, ccw=None)
    data = poses(racer)
    effect = GearHarmonics(3, (70.0, 2e-2, -1e-2, 1e-3, 3e-3))
    by_effect = predict_poses(plain, Layout.of((effect,)), data, tangents=False).view.q
    by_table = predict_poses(plain.with_joint(2, cw=table, ccw=table), Layout.of(()), data,
                             tangents=False).view.q
    assert_allclose(by_effect, by_table, atol=1e-12)


def test_delivered_angle_solves_its_equation():
    phi, orders = np.linspace(-3.0, 3.0, 501), np.array([85.0, 303.0])
    a, b = np.array([0.02, 1e-3]), np.array([-0.01, 2e-3])
    x = delivered_angle(phi, orders, a, b)
    assert_allclose(x + _core.transmission(x, orders, a, b)[0], phi, atol=1e-13)


def test_backlash_rests_on_the_loaded_flank(racer):
    data = poses(racer)
    view = predict_poses(racer, Layout.of((Backlash(2, (1e-3, 1e-3)),)), data, tangents=False).view
    shift = view.q - predict_poses(racer, Layout.of(()), data, tangents=False).view.q
    assert_allclose(shift[:, 1], -0.5e-3 * np.sign(view.torque[:, 1]), atol=1e-6)


def test_backlash_without_load_follows_the_approach(racer):
    data = poses(racer)
    view = predict_poses(racer, Layout.of((Backlash(1, (1e-3, 5.0)),)), data, tangents=False).view
    shift = view.q - predict_poses(racer, Layout.of(()), data, tangents=False).view.q
    assert_allclose(shift[:, 0], -0.5e-3 * data.joints["approach"][:, 0], rtol=1e-3)


def test_stop_operator_remembers():
    reach = 0.1
    motion = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0.95, 11)[1:],
                             np.linspace(0.95, 0, 96)[1:]])
    memory, _ = _core.stop_operator(motion, reach)
    assert_allclose(memory[5], 0.5, atol=1e-12)
    assert_allclose(memory[100], 1.0)
    assert_allclose(memory[110], 0.5, atol=1e-12)  # came back by half the reach
    assert_allclose(memory[-1], -1.0)


def test_stop_operator_derivative():
    random = np.random.default_rng(5)
    motion = np.cumsum(random.normal(0.0, 0.02, 400))
    value = lambda reach: _core.stop_operator(motion, float(reach[0]))[0]
    analytic = _core.stop_operator(motion, 0.07)[1][:, None]
    assert_derivative(value, np.array([0.07]), analytic, 1e-6)


def test_an_order_that_changes_sign_with_the_direction_is_found_in_a_run_to_and_fro():
    time = np.linspace(0.0, 20.0, 6000)
    phi, rate = np.sin(time)[:, None], np.cos(time)[:, None]
    wave = 1e-4 * np.sign(rate) * np.sin(90.0 * phi)
    view = SimpleNamespace(
        signals={"axis_residual": wave}, moving=np.array([True]), moving_runs=((np.arange(6000), 0),),
        data=SimpleNamespace(gyro=None), keep=np.ones(6000, bool), phi=phi, direction=np.sign(rate),
        device=Device.GEAR,
        robot=SimpleNamespace(ratios=np.array([100.0]), joints=(SimpleNamespace(cw=None, ccw=None),)),
    )
    assert abs(searched_orders(view.robot, view, 0)[0] - 90.0) < 1.0


def test_curve_keeps_its_end_where_nothing_was_measured():
    """Beyond the measured angles the value of the nearer end, over whole turns too; the robot file remembers
    them."""
    curve = GearHarmonics(1, (1.0, 1e-3, 2e-3, -1e-3, 5e-4), seen=(-0.5, 1.0))
    free = replace(curve, seen=None)
    angles = np.array([0.3, 0.3 + 2.0 * np.pi, 1.0, 2.0, -0.5, -1.2, 5.0])
    at = lambda effect, phi: effect.change(SimpleNamespace(
        phi=phi[:, None], rows=phi.size, axes=1, is_fast=lambda *wave: False))
    value, slope = at(curve, angles).value[:, 0], at(curve, angles).by_signal["phi"][:, 0, 0]
    expected = at(free, np.array([0.3, 0.3, 1.0, 1.0, -0.5, -0.5, -0.5])).value[:, 0]
    np.testing.assert_allclose(value, expected, atol=1e-12)
    assert np.all(slope[[3, 5, 6]] == 0.0) and slope[0] != 0.0
    assert effect_from_table(curve.to_table()) == curve


def test_a_run_out_beyond_real_gears_is_drawn_as_wide_as_it_came_out():
    usual = GearEccentricity(1, (4e-4, 3e-4, 0.0, 0.0))
    assert usual.redrawn(np.zeros((4, 4))) is usual
    large = GearEccentricity(1, (4e-3, 3e-3, 0.0, 0.0))
    redrawn = large.redrawn(np.diag([0.0, 0.0, 5e-6, 6e-6]))
    assert [p.prior for p in redrawn.parameters()] == pytest.approx([3e-3] * 4)  # sqrt(36 / 4) mrad
    assert redrawn.values == large.values and redrawn.redrawn(np.diag([0.0, 0.0, 5e-6, 6e-6])) is redrawn
