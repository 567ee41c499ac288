"""Backlash: its flank follows what the joint really carries, and how much friction holds it is found with the
width."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_gear_run, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.joint_fit import candidates_for
from exactarm.diagnose.motion_problem import MotionProblem
from exactarm.diagnose.posterior import _could_be_right
from exactarm.diagnose.scan import scan
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects import effect_from_table
from exactarm.effects.backlash import Backlash
from exactarm.effects.load_dependence import LoadDependence
from exactarm.noise.estimate import normal_noise
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs, measure_poses, parse_effect
from motions import fourier_motion, motion_data
from rigid_arm import LINKS_ALONE
from rigid_arm import rigid as rigid_arm
from set_ups import joints_in_limits
from test_closures import virtual
from test_diagnose_poses import HIDDEN, data_with, ur10
from test_selection import fitted_problem, poses

FRICTION_NM, ROTOR_KG_M2, NOISE_NM = 10.0, 2e-4, 0.3


@pytest.fixture(scope="module")
def rigid():
    return rigid_arm(**LINKS_ALONE | {"rotor_inertia": ROTOR_KG_M2, "coulomb": FRICTION_NM})


def motion_through_a_gap(robot, joint, width):
    """The links move smoothly, the motor of one axis crosses its gap: the angles that are logged have the gap
    in them."""
    time, angle, rate, acceleration = fourier_motion(robot, 12.0, 500.0, seed=5)
    load = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    k, gap = joint - 1, np.zeros_like(angle)
    pressed = load[:, k] + FRICTION_NM * np.tanh(rate[:, k] / 0.02)
    gap[:, k] = 0.5 * width * np.tanh(pressed / (0.2 * FRICTION_NM))
    crossing = np.gradient(gap, time, axis=0)
    motor = acceleration + np.gradient(crossing, time, axis=0)
    torque = load + ROTOR_KG_M2 * robot.ratios**2 * motor + FRICTION_NM * np.tanh((rate + crossing) / 0.02)
    torque += np.random.default_rng(2).normal(0.0, NOISE_NM, torque.shape)
    return motion_data(robot, time, angle + gap, torque)


@pytest.mark.slow
@pytest.mark.parametrize("joint, width", [(2, 1e-3)])
def test_a_drive_torque_tells_the_gap_with_its_sign_and_size(rigid, joint, width):
    found = diagnose(rigid, motion_through_a_gap(rigid, joint, width))
    first = found.findings[0].effect
    assert first.label == f"backlash_{joint}"
    assert first.values == pytest.approx((width, FRICTION_NM), rel=0.05)
    assert found.after["validation"].rms < 0.15 * found.before["validation"].rms


@pytest.mark.slow
@pytest.mark.parametrize("noise_Nm", [0.3, 3.0])
def test_noise_of_the_measured_torque_does_not_pass_for_a_gap(rigid, noise_Nm):
    """The flank follows the torque in which the residual's own noise is; it follows its slow part only."""
    data = motion_through_a_gap(rigid, 2, 0.0)
    torque = data.joints["tau"] + np.random.default_rng(7).normal(0.0, noise_Nm, data.joints["tau"].shape)
    data = replace(data, joints=data.joints | {"tau": torque})
    problem = MotionProblem(rigid, data, data.select(np.zeros(0, int)))
    fitted = problem.fit(problem.declared())
    gaps = [effect for effect in candidates_for(problem, fitted) if effect.name == "backlash"]
    assert len({effect.joint for effect in gaps}) == 6
    assert max(c.evidence for c in scan(fitted, gaps, 0.5 * fitted.data_numbers)) < 0.0


@pytest.mark.slow
def test_friction_of_the_flank_is_estimated_in_a_gear_run():
    robot = load_robot("racer-7-1.4")
    virtual = VirtualRobot.of(robot, [parse_effect("backlash joint=2 width_rad=6e-4 friction_Nm=12", 6)])
    found = diagnose(robot,
                     measure_gear_runs(virtual, [1], [0.8, 1.2], 3, Sensors(), np.random.default_rng(1)))
    assert found.verdict == EXPLAINED and [f.effect.label for f in found.findings] == ["backlash_2"]
    for value, (low, high), true in zip(found.findings[0].effect.values, found.findings[0].intervals,
                                        (6e-4, 12.0)):
        assert high - low < 0.05 * true and abs(value - true) < high - low


def test_derivative_by_the_friction():
    robot = load_robot("racer-7-1.4")
    data = measure_gear_runs(VirtualRobot.of(robot), [1], [1.0], 1, Sensors(gyro_rad_s=0.0, counts=0),
                             np.random.default_rng(1), 250.0)
    layout = Layout.of((Backlash(2, (4e-4, 60.0), least_Nm=0.1),))
    assert layout.names == ("backlash_2.width_rad", "backlash_2.friction_Nm")
    predict = lambda x: predict_gear_run(robot, layout.at(x), data, tangents=False).measured
    assert_derivative(predict, layout.values, predict_gear_run(robot, layout, data).jacobian,
                      1e-4 * layout.values, relative=1e-5)


@pytest.mark.slow
def test_friction_of_a_fifth_of_the_load_is_found_in_poses():
    clearance = effect_from_table(HIDDEN["backlash"] | {"width_rad": 5e-4, "friction_Nm": 20.0})
    found = diagnose(ur10(), data_with((clearance,), 201)[0])
    assert found.verdict == EXPLAINED and [f.effect.label for f in found.findings] == ["backlash_2"]
    assert found.findings[0].effect.values == pytest.approx((5e-4, 20.0), rel=0.2)


def test_wind_up_gives_way_and_never_the_other_way_unless_a_declared_spring_is_too_soft():
    assert LoadDependence(2, (0.0,), beside_spring=False).parameters()[0].lower == 0.0
    assert LoadDependence(2, (0.0,)).parameters()[0].lower == -np.inf


def test_a_generic_load_may_change_its_sign_elsewhere():
    """Only there a bias is tried; the flank's derivatives hold with it, and the robot file keeps it."""
    data, _ = data_with((), 3)
    bare = with_generic_masses(replace(ur10(), links=None))
    offered = {}
    for name, robot in {"declared": ur10(), "generic": bare}.items():
        view = predict_poses(robot, Layout.of(()), data).view
        offered[name] = [effect for effect in Backlash.candidates(robot, view) if effect.joint == 2]
    assert [len(effect.values) for effect in offered["declared"]] == [2]
    (biased,) = offered["generic"]
    assert len(biased.values) == 3 and min(biased.biases) < 0.0 < max(biased.biases)
    effect = biased.with_values((5e-4, 20.0, -8.0))
    assert effect_from_table(effect.to_table()).values == effect.values
    layout = Layout.of((effect,))
    predict = lambda x: predict_poses(bare, layout.at(x), data, tangents=False).position
    assert_derivative(predict, layout.values, predict_poses(bare, layout, data).jacobian[:, :3],
                      np.full(layout.size, 1e-5))


@pytest.mark.slow
def test_rows_on_the_flank_that_a_guessed_load_does_not_give_are_not_wrong_by_themselves():
    """Where masses are guessed, nobody knows on which side of the play an arm rests near the change of its
    load: rows of the other flank are no broken beams, a row half a millimetre aside is one."""
    table = {"effect": "backlash", "joint": 2, "width_rad": 6e-4, "friction_Nm": 10.0, "bias_Nm": 5.0}
    effect, (robot, data) = effect_from_table(table), poses(table, count=80)
    problem, declared = fitted_problem(robot, data)
    layout = declared.joined(Layout.of((effect,)))
    fitted = problem.fit(layout)
    side = effect.flank(fitted.view)[0]
    near = np.argsort(np.abs(side))[-40:-38]
    moved = fitted.view.transfers[effect.station]((effect.index,), np.ones((len(data), 1, 1)))[:, :3, 0]
    for beside, right in ((0.0, True), (5e-4, False)):
        position = data.position.copy()
        position[near] += (effect.values[0] * side[near])[:, None] * moved[near]
        position[near[0], 2] += beside
        problem, declared = fitted_problem(robot, replace(data, position=position))
        weight = np.ones(len(data))
        weight[near] = 0.0
        trial = problem.fit(layout, weight)
        noise = replace(normal_noise(trial.residual[weight > 0.0]), weight=weight)
        assert _could_be_right(trial, len(declared.effects), noise) == right
        known = replace(trial, layout=declared.joined(Layout.of((Backlash(2, (6e-4, 10.0)),))))
        assert not _could_be_right(known, len(declared.effects), noise)


@pytest.mark.slow
@pytest.mark.parametrize("axis", [2, 3])
@pytest.mark.parametrize("seed", [1, 2])
def test_play_of_an_arm_without_masses_is_the_only_cause(seed, axis):
    """Where the guessed load changes its sign was tried at every fifteenth row: with seed 2, rows on the
    wrong flank left axis 2 unexplained and gave axis 3 a payload at 0.996 beside the play; seed 1 was right
    before, too. Seeds: the first two, none was left out. With seed 2 and axis 2 rows on the wrong flank made
    the width 12 % too small, by 2.7 standard deviations, and what was left followed two angles. Since unknown
    functions of two axes are waves of a turn, too, three rows are left out there, the interval holds. A
    base that gives way by no more than its interval stood beside the play with 0.70 as long as it had the
    prior of six springs."""
    robot, random = virtual("ur10", seed, f"backlash joint={axis} width_rad=8e-4")
    q = joints_in_limits(robot.nominal, 120, random)
    data = measure_poses(robot, q, Sensors(position_m=5e-5, orientation_rad=5e-5, counts=0), random)
    found = diagnose(replace(robot.nominal, links=None), data)
    assert found.verdict == EXPLAINED and not found.dossier_after.of_posture
    (named,) = found.findings
    low, high = named.intervals[0]
    assert named.effect.label == f"backlash_{axis}" and low < 8e-4 < high
