"""Fits of a diagnosis depend on what they are given, not on what was fitted before; weights and priors
count."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout, predict_tracked_motion
from exactarm.data.dataset import Dataset
from exactarm.diagnose.problems import problem_for
from exactarm.effects import effect_from_table, library
from exactarm.robot_file import load_robot
from gear_simulation import DEGREE, GearRuns, joined, simulate
from motions import fourier_motion, motion_data
from rigid_arm import LINKS_ALONE, rigid
from set_ups import at_random_place


def motion_case():
    """A hidden rotor: the residual falls far below half when it is found."""
    robot = rigid(**LINKS_ALONE)
    time, angle, rate, acceleration = fourier_motion(robot, 6.0, 100.0, seed=5)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate,
                                    acceleration) + 5.0 * np.tanh(rate / 0.005)
    torque = torque + np.where(np.arange(6) == 2, 3.0, 0.0) * acceleration
    data = motion_data(robot, time, angle, torque + np.random.default_rng(2).normal(0.0, 0.5, torque.shape))
    return robot, data, {"effect": "rotor_inertia", "joint": 3, "inertia_kg_m2": 0.0}


def gear_case():
    robot = rigid()
    shape = lambda time, phi, direction: 2e-3 * phi
    parts = [simulate(robot,
                      GearRuns(2, speed * DEGREE, 4, 200.0, 0.05 * DEGREE, seed=3 + k, first_run=1 + 4 * k),
                      rest=np.zeros(6), extra=shape) for k, speed in enumerate((40.0, 80.0))]
    return robot, joined(*parts), {"effect": "gear_ratio", "joint": 2, "scale": 0.0}


def tracked_case():
    robot, rng = load_robot("ur10"), np.random.default_rng(3)
    parts = [fourier_motion(robot, 6.0, 50.0, 7 + run, base_hz=0.1, amplitude=0.8) for run in range(2)]
    time, angle = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
    data = Dataset.of_arrays(
        "tracked_motion", {"q": angle + [0.3, -1.2, 1.2, -0.8, 0.9, 0.2]}, time=time,
        position=np.zeros((time.size, 3)),
        run=np.repeat([1, 2], len(parts[0][0])), identification=np.ones(time.size, bool),
    )
    hidden = effect_from_table({"effect": "time_delay", "delay_s": 4e-3})
    path = predict_tracked_motion(at_random_place(robot, rng, 0.3), Layout.of((hidden,), False), data,
                                  tangents=False)
    data = replace(data, position=path.position + rng.normal(0.0, 3e-5, path.position.shape))
    return robot, data, {"effect": "time_delay", "delay_s": 0.0}


CASES = {"motion": motion_case, "gear_run": gear_case, "tracked_motion": tracked_case}


@pytest.fixture(scope="module", params=CASES)
def problem_and_effect(request):
    robot, data, table = CASES[request.param]()
    every = np.ones(len(data), bool)
    return problem_for(robot, data.select(every), data.select(~every), 1, 0), effect_from_table(table)


def bits(fitted):
    return [fitted.fit.x.tobytes(), fitted.fit.covariance.tobytes(), fitted.sigma.tobytes(),
            fitted.residual.tobytes()]


@pytest.mark.slow
def test_two_orders_of_calls_give_identical_bits(problem_and_effect):
    problem, effect = problem_and_effect
    declared = problem.declared()
    richer = declared.joined(Layout.of((effect,)))
    plain = problem.fit(declared)
    better = problem.fit(richer)
    # what made it estimate the noise anew
    assert np.sum(better.residual**2) < 0.5 * np.sum(plain.residual**2)
    assert bits(problem.fit(declared)) == bits(plain)
    assert bits(problem.fit(richer)) == bits(better)


@pytest.mark.slow
def test_rows_without_weight_have_no_say(problem_and_effect):
    problem, _ = problem_and_effect
    declared = problem.declared()
    rows = len(problem.fit(declared).weight)
    weight = (np.arange(rows) < 0.8 * rows).astype(float)
    fitted = problem.fit(declared, weight)
    whole = problem.fit(declared)
    assert not fitted.weight[weight == 0.0].any() and fitted.weight.any()
    assert not np.array_equal(fitted.fit.x, whole.fit.x)


@pytest.mark.slow
def test_priors_count_in_motions():
    """Noise of 500 Nm tells nothing of eccentric gears: they stay within what their prior calls plausible."""
    robot, data, _ = motion_case()
    torque = data.joints["tau"] + np.random.default_rng(8).normal(0.0, 500.0, data.joints["tau"].shape)
    data = replace(data, joints=data.joints | {"tau": torque})
    every = np.ones(len(data), bool)
    problem = problem_for(robot, data.select(every), data.select(~every), 1, 0)
    declared = problem.declared()
    curves = library()["gear_eccentricity"].candidates(robot, problem.fit(declared).view)
    layout = declared.joined(Layout.of(tuple(curves)[:3]))
    prior, again = layout.prior, problem.fit(layout)
    drawn = np.isfinite(prior)
    assert drawn.sum() >= 6 and again.fit.converged
    assert np.all(np.abs(again.fit.x[drawn]) < 3.0 * prior[drawn])
    assert np.all(np.sqrt(np.diag(again.fit.covariance))[drawn] < 1.2 * prior[drawn])
