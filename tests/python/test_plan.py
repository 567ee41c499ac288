"""Planning: the source's paths, both solvers, effects, reversals, failures, many paths at once."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain.direction import TRANSITION_S
from exactarm.data.dataset import Dataset
from exactarm.effects.backlash import Backlash
from exactarm.effects.direction_dependence import DirectionDependence
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.payload import Payload
from exactarm.errors import ComputationError, InputError
from exactarm.files.table import read_table, write_table
from exactarm.plan import Line, PathFailure, PlannedPath, PlanOptions, Points, load_path, plan_many, plan_path
from exactarm.plan.limits import violations
from exactarm.plan.trajectory import trajectory_table
from exactarm.robot_file import load_robot
from exactarm.simulate.measure import true_path
from exactarm.simulate.virtual_robot import VirtualRobot

ROBOT = load_robot("racer-7-1.4")
LINE = replace(load_path("line"), rate_hz=200.0)
THREADS = PlanOptions(threads=2)


@pytest.mark.parametrize("name, rms", [("line", 5e-8), ("spiral", 2e-6)])
@pytest.mark.slow
def test_the_paths_of_the_source_are_followed_within_a_micrometre(name, rms):
    plan = plan_path(ROBOT, load_path(name), THREADS)
    assert plan.solver.status == "solved" and plan.solver.iterations <= 5
    assert plan.tracking.position_rms < rms and plan.solver.kkt_error < 1e-5
    assert not plan.warnings and not plan.violations
    np.testing.assert_allclose(plan.q[0], np.radians([0, 90, 0, 0, 90, 0])
                               if name == "line" else plan.q_desired[0], atol=0.5)
    assert np.all(plan.theta_ddot[[0, -1]] == 0.0) and np.all(plan.theta_dot[[0, -1]] == 0.0)


def test_motor_angles_return_the_link_angles_through_the_chain():
    """Statics at both ends: theta -> gear -> spring under gravity -> q."""
    plan = plan_path(ROBOT, replace(LINE, gear_direction="cw"), THREADS)
    for end in (0, -1):
        torque = _core.gravity_torque(ROBOT.core, plan.q[[end]], 1)[0]
        for i, joint in enumerate(ROBOT.joints):
            table = ROBOT.core.joints[i].gear.cw
            phi = _core.gear_output_angle(joint.ratio, table, plan.theta[[end], i])[0]
            stretch = phi + joint.q_offset - plan.q[end, i]
            assert joint.spring_linear * stretch + joint.spring_cubic * stretch**3 == pytest.approx(torque[i],
                                                                                                    abs=1e-6)


@pytest.mark.slow
def test_both_solvers_and_any_number_of_threads_give_the_same_motion():
    own = plan_path(ROBOT, LINE, THREADS)
    ipopt = plan_path(ROBOT, replace(LINE, solver="ipopt"), PlanOptions(threads=1))
    assert ipopt.solver.linear_solver == "mumps" and ipopt.solver.name == "ipopt"
    np.testing.assert_allclose(own.q, ipopt.q, atol=1e-9)
    assert own.solver.objective == pytest.approx(ipopt.solver.objective, rel=1e-8)


def test_both_solvers_agree_with_the_jerk_as_the_input_on_a_coarse_grid():
    """The weight is 5e10 on the input there, against 1 in the equations: unscaled factors lose the digits."""
    path = replace(LINE, rate_hz=100.0, input="jerk", nu=1e-10)
    own, ipopt = plan_path(ROBOT, path, THREADS), plan_path(ROBOT, replace(path, solver="ipopt"), THREADS)
    assert own.solver.objective == pytest.approx(ipopt.solver.objective, rel=1e-8)
    assert ipopt.solver.iterations < 20


@pytest.mark.slow
def test_both_solvers_agree_far_from_the_reference():
    """At this weight the flange leaves the spiral by centimetres, and Newton's full steps go round in
    circles."""
    path = replace(load_path("spiral"), rate_hz=250.0, nu=1e-6)
    own, ipopt = plan_path(ROBOT, path, THREADS), plan_path(ROBOT, replace(path, solver="ipopt"), THREADS)
    assert own.tracking.position_rms > 0.01 and own.solver.status == "solved"
    assert own.solver.objective == pytest.approx(ipopt.solver.objective, rel=1e-8)


def test_jerk_as_the_input_tracks_and_is_smoother():
    jerk = plan_path(ROBOT, replace(LINE, input="jerk", nu=1e-18), THREADS)
    acceleration = plan_path(ROBOT, LINE, THREADS)
    assert jerk.solver.status == "solved" and jerk.tracking.position_max < 1e-4
    rough = lambda plan: np.abs(np.diff(plan.theta_ddot, n=2, axis=0)).max()
    assert jerk.theta_dddot is not None and rough(jerk) < rough(acceleration)


def test_gear_table_changes_at_a_reversal_without_a_jump_of_the_motor():
    there_and_back = Points(np.array([[0.834, 0.0, 1.0], [0.834, 0.15, 1.02], [0.834, 0.0, 1.04]]))
    path = PlannedPath(there_and_back, 2.0, 500.0)
    motion = plan_path(ROBOT, path, THREADS)
    sides = {side: plan_path(ROBOT, replace(path, gear_direction=side), THREADS) for side in ("cw", "ccw")}
    # The motor of axis 1 turns one way, then the other; away from the reversal it has the table of its
    # direction.
    turn = int(np.argmax(motion.q_desired[:, 0]))
    away = int(TRANSITION_S * 500)
    rising, falling = slice(away, turn - away), slice(turn + away, -away)
    assert np.abs(motion.theta - sides["ccw"].theta)[rising, 0].max() < 1e-4
    assert np.abs(motion.theta - sides["cw"].theta)[falling, 0].max() < 1e-4
    gap = np.abs(sides["cw"].theta - sides["ccw"].theta)[turn, 0]
    jump = np.abs(np.diff(motion.theta[:, 0], n=2)).max()
    assert gap > 1e-3 and jump < 0.7 * gap  # in one of the 20 samples that the transition takes


@pytest.mark.slow
@pytest.mark.parametrize("effect, rms", [
    (None, 3e-6), (DirectionDependence(2, (3.0, 1e-3, 5e-4)), 3e-6), (Hysteresis(2, (2e-4,)), 3e-6),
    (Hysteresis(2, (2e-4, 1e-3)), 3e-6),
    (Backlash(1, (4e-4, 30.0)), 3e-6),
])  # fmt: skip
def test_plan_and_virtual_robot_pass_reversals_alike(effect, rms):
    """Both gear tables, five reversals, springs without damping: a different passage would let the arm swing
    on."""
    robot = replace(ROBOT, effects=() if effect is None else (effect,))
    plan = plan_path(robot, replace(load_path("spiral"), rate_hz=500.0), THREADS)
    played = Dataset.of_arrays("tracked_motion", {"theta": plan.theta}, time=plan.time)
    flange = true_path(VirtualRobot(robot, robot), played, plan.q_desired)
    error = np.linalg.norm(flange - plan.reference.position, axis=1)
    assert np.sqrt(np.mean(error**2)) < rms and error.max() < 10.0 * rms
    if effect is not None:
        return
    late = np.roll(plan.q_desired, 20, axis=0)  # what the check sees of a passage at another time
    late[:20] = plan.q_desired[0]
    missed = np.linalg.norm(true_path(VirtualRobot(robot, robot), played, late) - plan.reference.position,
                            axis=1)
    assert np.sqrt(np.mean(missed**2)) > 10.0 * rms


def test_a_payload_is_held_by_the_springs():
    loaded = replace(ROBOT, effects=(Payload(None, (5.0, 0.0, 0.0, 0.25)),))
    plan, bare = plan_path(loaded, LINE, THREADS), plan_path(ROBOT, LINE, THREADS)
    assert plan.compensated == ("payload",) and plan.tracking.position_max < 1e-5
    torque = _core.gravity_torque(loaded.effects[0].bake(ROBOT).core, plan.q[[0]],
                                  1) - _core.gravity_torque(ROBOT.core, plan.q[[0]], 1)
    stretched = (plan.theta - bare.theta)[0] / ROBOT.ratios
    assert (
        np.sign(stretched[1]) == np.sign(torque[0, 1]) and abs(stretched[1]) > 0.3 * abs(torque[0, 1]) / 2.5e5
    )


def test_backlash_moves_the_motor_by_its_width():
    width = 4e-4
    robot = replace(ROBOT, effects=(Backlash(2, (width, 10.0)),))
    moved = (plan_path(robot, LINE, THREADS).theta - plan_path(ROBOT, LINE, THREADS).theta) / ROBOT.ratios
    # The load of axis 2 presses one flank all along the line.
    np.testing.assert_allclose(np.abs(moved[:, 1]), width / 2, rtol=0.02)
    assert np.abs(moved[:, [0, 2, 3, 4, 5]]).max() < 1e-6


def test_a_robot_without_springs_and_masses_is_planned_as_a_rigid_one():
    robot = replace(load_robot("ur10"), links=None)
    pose = _core.forward_kinematics(replace(robot, base=type(robot.base)(), tool=type(robot.tool)()).core,
                                    np.array([[0.3, -1.2, 1.4, -0.7, 1.2, 0.2]]))
    position, rotation = pose[0][0], pose[1][0]
    from scipy.spatial.transform import Rotation

    wxyz = np.roll(Rotation.from_matrix(rotation).as_quat(), 1)[None]
    path = PlannedPath(Line(position, position + [0.0, 0.0, 0.1]), 1.0, 200.0, orientation_wxyz=wxyz)
    plan = plan_path(robot, path, PlanOptions(start=np.array([0.3, -1.2, 1.4, -0.7, 1.2, 0.2])))
    assert any("no link masses" in warning for warning in plan.warnings)
    assert plan.tracking.position_max < 1e-5
    np.testing.assert_allclose(plan.theta / robot.ratios + robot.offsets, plan.q, atol=1e-6)


@pytest.mark.parametrize("kind, nu", [("acceleration", 1e-14), ("jerk", 1e-18)])
@pytest.mark.parametrize("rigid", [(3, 4, 5), (0,), (0, 1, 2, 3, 4)])
@pytest.mark.slow
def test_rigid_joints_among_elastic_ones_follow_their_gears(rigid, kind, nu):
    joints = tuple(replace(joint, spring_linear=0.0, spring_cubic=0.0) if i in rigid else joint
                   for i, joint in enumerate(ROBOT.joints))
    mixed = replace(ROBOT, joints=joints)
    plan = plan_path(mixed, replace(LINE, input=kind, nu=nu, gear_direction="cw"), THREADS)
    assert plan.solver.status == "solved" and plan.tracking.position_max < 1e-6
    soft = plan_path(ROBOT, replace(LINE, input=kind, nu=nu, gear_direction="cw"), THREADS)
    for i, joint in enumerate(ROBOT.joints):
        phi = _core.gear_output_angle(joint.ratio, ROBOT.core.joints[i].gear.cw, plan.theta[:, i])
        if i in rigid:
            np.testing.assert_allclose(phi + joint.q_offset, plan.q[:, i], atol=1e-9)
        else:
            np.testing.assert_allclose(plan.theta[:, i], soft.theta[:, i], atol=1e-4 * joint.ratio)


@pytest.mark.parametrize("change, words", [
    ({"curve": Line(np.array([0.834, 0, 1.0]), np.array([3.0, 0, 1.0]))}, ("out of reach", " s")),
    ({"curve": Line(np.array([9.0, 0, 1.0]), np.array([9.5, 0, 1.0]))}, ("starts at a pose out of reach",)),
    ({"duration": 0.25}, ("infeasible", "shortest duration that fits")),
])
def test_a_path_that_cannot_be_followed_says_why(change, words):
    with pytest.raises(ComputationError) as failure:
        plan_path(ROBOT, replace(LINE, rate_hz=400.0, **change), THREADS)
    for word in words:
        assert word in str(failure.value) or (word == "out of reach" and "singular" in str(failure.value))
    assert "\n" not in str(failure.value)


def test_a_reference_beyond_the_limits_names_axis_time_amount_and_a_duration_that_fits():
    plan = plan_path(ROBOT, replace(LINE, duration=0.75, rate_hz=400.0), THREADS)
    violation = plan.violations[0]
    assert (
        violation.quantity == "acceleration" and abs(violation.value) > violation.limit
        and 0 < violation.time < 0.75
    )
    assert plan.shortest_duration > 0.75
    fitting = plan_path(ROBOT, replace(LINE, duration=plan.shortest_duration * 1.001, rate_hz=400.0), THREADS)
    assert not fitting.violations
    tight = plan_path(ROBOT, replace(LINE, duration=plan.shortest_duration * 0.97, rate_hz=400.0), THREADS)
    assert tight.violations
    # The planned motion itself keeps to the limits.
    assert not list(violations(ROBOT, plan.time, plan.theta_dot, plan.theta_ddot))


def test_times_of_via_points_are_stretched_to_the_shortest_duration_that_fits():
    points = np.array([[0.834, 0.0, 1.0], [0.834, 0.15, 1.02], [0.834, 0.0, 1.04]])
    path = PlannedPath(Points(points, np.array([0.0, 0.35, 0.7])), 0.7, 400.0)
    hurried = plan_path(ROBOT, path, THREADS)
    assert hurried.violations and hurried.shortest_duration > 0.75 and hurried.solver.iterations < 30
    plan = plan_path(ROBOT, path.lasting(hurried.shortest_duration * 1.002), THREADS)
    assert (
        not plan.violations and plan.path.curve.times[1] == pytest.approx(0.501 * hurried.shortest_duration)
    )


def test_a_path_of_no_length_stands_still():
    point = np.array([0.834, 0.1, 1.0])
    plan = plan_path(ROBOT, replace(LINE, curve=Line(point, point)), THREADS)
    assert np.ptp(plan.theta, axis=0).max() < 1e-9 and plan.bandwidth == (None,) * 6


def test_too_few_knots_and_not_a_number_are_refused():
    with pytest.raises((InputError, _core.InvalidArgument), match="knots|samples"):
        plan_path(ROBOT, replace(LINE, duration=0.01, rate_hz=100.0))
    with pytest.raises((InputError, ComputationError)):
        plan_path(ROBOT, replace(LINE, curve=Line(np.array([0.834, 0, 1.0]), np.array([np.nan, 0, 1.0]))))


def test_ma27_runs_or_says_why_it_cannot():
    available, reason = _core.ma27_available()
    path = replace(LINE, solver="ipopt", linear_solver="ma27")
    if available:
        assert plan_path(ROBOT, path).solver.linear_solver == "ma27"
    else:
        with pytest.raises(_core.InvalidArgument, match="HSL"):
            plan_path(ROBOT, path)


def test_a_trajectory_survives_csv_and_parquet(tmp_path):
    plan = plan_path(ROBOT, LINE, THREADS)
    table = trajectory_table(plan)
    assert list(table)[:8] == ["time_s"] + [f"theta_{i}_rad" for i in range(1, 7)] + ["theta_dot_1_rad_s"]
    assert list(table)[-3:] == ["x_m", "y_m", "z_m"] and len(table) == 1 + 5 * 6 + 3
    for name in ("t.csv", "t.parquet"):
        write_table(tmp_path / name, table)
        read = read_table(tmp_path / name).columns
        for column, values in table.items():
            np.testing.assert_array_equal(read[column], values)


@pytest.mark.parametrize("pool", [None, "threads", pytest.param("processes", marks=pytest.mark.slow)])
def test_many_paths_run_on_any_executor_and_one_failure_ends_no_other(pool):
    short = replace(LINE, rate_hz=100.0)
    paths = [short, replace(short, curve=Line(np.array([9.0, 0, 1]), np.array([9, 1, 1]))),
             replace(short, duration=3.0)]
    seen = []
    assert ROBOT.core  # what is compiled must not hinder the travel to another process
    make = {None: lambda: None, "threads": lambda: ThreadPoolExecutor(2),
            "processes": lambda: ProcessPoolExecutor(2,
                                                     mp_context=multiprocessing.get_context("spawn"))}[pool]
    executor = make()
    results = plan_many(ROBOT, paths, executor, progress=lambda done, total: seen.append((done, total)))
    if executor is not None:
        executor.shutdown()
    assert [isinstance(result, PathFailure) for result in results] == [False, True, False]
    assert "out of reach" in results[1].reason and seen == [(1, 3), (2, 3), (3, 3)]
    np.testing.assert_allclose(results[0].theta, plan_path(ROBOT, short).theta, atol=1e-12)
