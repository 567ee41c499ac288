"""The law of compensation: the command reaches its target, and `actual_of` is its inverse."""

from dataclasses import replace

import numpy as np
import pytest

from compensation_cell import Cell, identified, reachable
from exactarm.compensate.flange_poses import Poses, pose_error
from exactarm.compensate.law import CompensationModel, actual_of, command_of
from exactarm.errors import InputError
from exactarm.robot.robot import Controller
from exactarm.robot_file import load_robot


def test_a_robot_may_be_given_by_its_name_as_to_every_command():
    q = reachable(load_robot("ur10"), 3)
    np.testing.assert_array_equal(command_of("ur10", q), command_of(load_robot("ur10"), q))
    np.testing.assert_array_equal(actual_of("ur10", q), actual_of(load_robot("ur10"), q))


def test_the_real_arm_stands_where_the_planner_meant_it():
    robot = identified()
    q = reachable(robot, 50)
    cell, model = Cell(robot), CompensationModel.of(robot)
    commands = command_of(robot, q)
    error = pose_error(model.controller.poses(q), model.reached(commands))
    assert np.abs(error).max() < 1e-9
    # the uncorrected arm is off by what the deviations of an arm as delivered do
    missed = np.linalg.norm(cell.true_tip(q, 0 * q) - [tip.position for tip in cell.tip(q)], axis=1)
    assert 5e-4 < missed.mean() < 5e-3


def test_approaching_from_the_other_side_asks_for_another_command():
    robot = identified()
    q = reachable(robot, 20)
    up, down = command_of(robot, q, approach=np.ones_like(q)), command_of(robot, q, approach=-np.ones_like(q))
    assert 1e-5 < np.abs(up - down).max() < 1e-2


def test_joint_states_come_back_to_what_was_planned():
    robot = identified()
    q = reachable(robot, 50)
    approach = np.random.default_rng(3).choice([-1.0, 0.0, 1.0], q.shape)
    assert np.abs(actual_of(robot, command_of(robot, q, approach=approach), approach) - q).max() < 1e-9


def test_poses_are_reached_on_the_branch_that_is_near():
    robot = identified()
    q = reachable(robot, 20)
    model = CompensationModel.of(robot)
    targets = model.controller.poses(q)
    commands = command_of(robot, Poses(targets.position, targets.rotation), near=q)
    assert np.abs(commands - q).max() < 0.05
    assert np.abs(pose_error(targets, model.reached(commands))).max() < 1e-9


def test_a_load_at_the_flange_is_held_up():
    robot = identified()
    q = reachable(robot, 20)
    model = CompensationModel.of(robot)
    loaded = model.with_load(8.0, np.array([0.0, 0.0, 0.1]))
    targets = model.controller.poses(q)
    commands = loaded.commands(targets, q)
    assert np.abs(pose_error(targets, loaded.reached(commands.q))).max() < 1e-9
    assert np.abs(model.commands(targets, q).q - commands.q).max() > 1e-5


def test_a_redundant_direction_is_left_alone_and_a_singular_pose_is_called_so():
    robot = identified(effects=False)
    q = reachable(robot, 1)
    q[:, 4] = 0.0  # the axes 4 and 6 are in line
    commands = CompensationModel.of(robot).commands(CompensationModel.of(robot).controller.poses(q), q)
    assert commands.amplification[0] > 100.0


def test_effects_that_no_program_can_compensate_are_named():
    from exactarm.effects.thermal_drift import ThermalDrift

    effect = ThermalDrift.from_table({"growth_1_per_degC": 1e-5, "form": "growth",
                                      "driver": "temperature_degC"})
    for where, middle in ((effect, 20), (replace(effect, between=(45.0, 54.0)), 49.5)):
        robot = replace(identified(effects=False), effects=(where,))
        said = f"thermal_drift_growth (taken as at {middle} degC)"
        (left,) = CompensationModel.of(robot).left_out
        assert left is where and left.where_unknown == said


def test_a_calibrated_file_without_the_controllers_frames_is_refused_and_a_declared_one_stands_for_them():
    bare = replace(identified(), controller=Controller())
    with pytest.raises(InputError, match="--nominal"):
        command_of(replace(bare, record={"command": "diagnose"}), np.zeros((1, 6)))
    with pytest.raises(InputError, match="--nominal"):
        command_of(replace(bare, record={"command": "gear", "previous": {"command": "calibrate"}}),
                   np.zeros((1, 6)))
    q = reachable(identified(), 5)
    declared = CompensationModel.of(bare)
    there = declared.reached(command_of(bare, q))
    assert np.abs(pose_error(declared.controller.poses(q), there)).max() < 1e-9


def test_sides_without_motions_and_behind_an_unknown_place():
    """An axis that rests keeps its side; behind a place that nobody knows, nothing is kept."""
    from exactarm.compensate.approach import Approaches
    from exactarm.compensate.program import Motion

    robot = identified(effects=False)
    model = CompensationModel.of(robot)
    sense = np.sign(model.actual.ratios)
    assert Approaches(model, []).of(np.zeros((0, 6))).shape == (0, 6)
    steps = np.array([[0.0], [0.1], [0.1], [0.3]]) * np.array([1.0, -1.0, 1.0, 0.0, 1.0, 1.0])
    q = reachable(robot, 1) + steps
    motions = [Motion("joint", k, k) for k in (0, 1, 2)] + [Motion("joint", None, 4), Motion("joint", 3, 5)]
    found = Approaches(model, motions).of(q) * sense
    np.testing.assert_array_equal(found[1], [1.0, -1.0, 1.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(found[2], found[1])
    np.testing.assert_array_equal(found[[0, 3, 4]], 0.0)
    started = Approaches(model, motions[:1], q[0] - 0.2).of(q) * sense
    np.testing.assert_array_equal(started[0], 1.0)
    told = [Motion("joint", 0, 1), Motion("joint", 1, 2, approach=(0.0, 1.0, 1.0, -1.0, 1.0, 1.0))]
    np.testing.assert_array_equal(Approaches(model, told).of(q)[1], told[1].approach)


@pytest.mark.parametrize("values", [np.full((2, 6), np.nan), np.zeros((2, 5)), np.zeros(6), "abc"])
def test_what_is_no_row_of_angles_is_refused(values):
    """An angle that is not a number came back as finite angles."""
    for function in (command_of, actual_of):
        with pytest.raises(InputError, match=r"expected an array \(N, 6\) of finite numbers"):
            function("ur10", values)


def test_rows_that_no_command_reaches_are_no_numbers():
    """At a singular pose they came back as they were."""
    robot = identified()
    q = np.vstack([reachable(robot, 2), reachable(robot, 1)])
    q[1, 4] = 0.0  # axes 4 and 6 are one
    found = command_of(robot, q)
    assert np.isnan(found[1]).all() and np.isfinite(found[[0, 2]]).all()
    poses = CompensationModel.of(robot).controller.poses(q)
    places = np.vstack([poses.position, [[9.0, 0.0, 0.0]]])
    far = Poses(places, np.concatenate([poses.rotation, np.eye(3)[None]]))
    found = command_of(robot, far, near=np.vstack([q, q[:1]]))
    assert np.isnan(found[3]).all() and np.isfinite(found[0]).all()


def test_an_arm_at_a_singular_pose_is_seen_nowhere():
    """Axis 4 came back turned by 24 turns."""
    robot = identified(effects=False)
    q = np.vstack([reachable(robot, 1), np.radians([[0.0, 90.0, 0.0, 0.0, 0.0, 0.0]]), reachable(robot, 1)])
    q[1, 4] = 0.0  # axes 4 and 6 are one, and the axes of the real arm are not
    found = actual_of(robot, q)
    assert np.isnan(found[1]).all() and np.abs(found[[0, 2]] - q[[0, 2]]).max() < 0.05


def test_a_command_beyond_the_limits_of_the_axes_is_none():
    """It came back, and no controller takes it."""
    robot = identified(effects=False)
    q = reachable(robot, 2)
    q[1, 0] = CompensationModel.of(robot).controller.limits[1, 0] + 0.05
    found = command_of(robot, q)
    assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()
