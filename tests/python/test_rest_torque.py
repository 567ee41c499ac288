"""What a spring carries of torques that were read at rest: weights, no friction or noise of the drives."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.identify.rest_torque import as_springs_carry
from exactarm.rest_load import RestLoad
from exactarm.robot.robot import Joint, Robot
from three_arms import puma

ROWS = 90
BARE = replace(puma(), links=None)
# A tenth of noise in 90 readings leaves of some 15 numbers that an axis' readings decide 0.1 sqrt(15 / 90)
AMONG_NOISE = 0.1 * np.sqrt(15 / ROWS)
FRICTION_NM = np.array([9.0, 8.0, 5.0, 0.2, 0.2, 0.1])
SAG, TRUE = "joint_compliance joint=2 linear_rad_per_Nm=1.2e-5 cubic_rad_per_Nm3=0", 1.2e-5


def readings(noise=0.0, friction=0.0, more=None, rows=ROWS, seed=3):
    """Poses of the bare arm, its gravity (N, 6), and readings; more(q): torques of something else."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.0, 2.0, (rows, 6))
    gravity = _core.gravity_torque(puma().core, q, 1) + (0.0 if more is None else more(q))
    approach = rng.choice([-1.0, 1.0], q.shape)
    tau = gravity + noise * rng.standard_normal(q.shape) * gravity.std(axis=0) + friction * approach
    joints = {"q": q, "tau": tau, "approach": approach}
    return Dataset.of_arrays("poses", joints, position=np.zeros((rows, 3))), gravity


def off(found, gravity):
    """Standard deviation of the error of loads, over that of the gravity, of the two axes that weights load
    most; without any offset."""
    return (found - gravity).std(axis=0)[1:3] / gravity.std(axis=0)[1:3]


def test_readings_without_noise_stay_as_they_are():
    data, gravity = readings()
    found = as_springs_carry(BARE, data)
    np.testing.assert_allclose(found.joints["tau"], gravity, atol=1e-6)
    assert found.notes == data.notes


def test_noise_and_friction_are_no_load():
    data, gravity = readings(0.1, FRICTION_NM)
    assert np.all(off(data.joints["tau"], gravity) > 0.15)
    found = as_springs_carry(BARE, data)
    assert np.all(off(found.joints["tau"], gravity) < AMONG_NOISE)
    doubt = [RestLoad.of(BARE, found).doubt(axis) for axis in (1, 2)]
    assert doubt == pytest.approx([0.1 / np.sqrt(ROWS)] * 2, rel=0.2)  # of 90: 8 % by itself
    (note,) = found.notes
    assert "dry friction of up to 9" in note and "are left out" in note
    # what is told in another column stays to be said
    current = replace(data, joints=dict(data.joints) | {"current": np.ones_like(gravity)})
    assert "current" in as_springs_carry(BARE, current).joints


@pytest.mark.parametrize("seed", [3, 4, 5])
@pytest.mark.parametrize("wrong", [1.0, 1.1, 1.3])
def test_declared_masses_are_the_load_as_far_as_the_readings_allow(wrong, seed):
    """Weights that are estimated alone leave `AMONG_NOISE` of the load; a right file leaves nothing. Seeds 0
    to 23 all do."""
    data, gravity = readings(0.1, FRICTION_NM, seed=seed)
    declared = replace(puma(), links=tuple(replace(link, mass=wrong * link.mass) for link in puma().links))
    found = as_springs_carry(declared, data).joints["tau"]
    assert np.all(off(found, gravity) < (1e-9 if wrong == 1.0 else AMONG_NOISE))


def test_torques_of_axes_without_lengths_have_no_declared_masses():
    """A turntable has neither links nor lengths that could stand for them."""
    table = Robot("turntable", (Joint(),))
    random = np.random.default_rng(0)  # any seed: nothing is compared
    data = Dataset.of_arrays("poses", {name: random.normal(0.0, 1.0, (60, 1)) for name in ("q", "tau")},
                             position=np.zeros((60, 3)))
    assert np.isfinite(as_springs_carry(table, data).joints["tau"]).all()


def test_a_further_payload_and_a_counterbalance_are_load():
    spring = lambda q: np.outer(np.cos(2.0 * q[:, 1] + 0.4), 60.0 * np.eye(6)[1])
    data, gravity = readings(0.1, 0.0, spring)
    assert np.all(off(as_springs_carry(BARE, data).joints["tau"], gravity) < AMONG_NOISE)
    session = np.repeat([1, 2], ROWS // 2)
    flange = _core.dynamics_regressor(puma().core, data.joints["q"], *2 * [np.zeros((ROWS, 6))])[:, :, -10]
    carried = 8.0 * flange * (session == 2)[:, None]
    both = replace(data, session=session, joints=dict(data.joints) | {"tau": data.joints["tau"] + carried})
    assert np.all(off(as_springs_carry(BARE, both).joints["tau"], gravity + carried) < AMONG_NOISE)


def test_torques_that_are_no_weight_are_the_load_as_they_were_read():
    data, gravity = readings()
    other = np.random.default_rng(4).normal(0.0, 50.0, ROWS)
    tau = gravity.copy()
    tau[:, 1] += other
    found = as_springs_carry(BARE, replace(data, joints=dict(data.joints) | {"tau": tau})).joints["tau"]
    error = found[:, 1] - tau[:, 1]
    assert error.std() < 0.3 * other.std()  # less what looks like friction
    few, _ = readings(0.1, rows=5)
    assert as_springs_carry(BARE, few) is few


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_spring_is_named_and_sized_under_readings_with_noise_and_friction(seed):
    """Failed before in all three, the first seeds tried: the base gave way instead (3, 5), or beside a spring
    of two thirds (4). Of 5 the interval missed by 4e-10 until it knew of the noise of the torques."""
    robot, rng = ea.load_robot("ur10"), np.random.default_rng(seed)
    data = ea.simulate(robot, effects=[SAG], count=100, deviation=1, seed=seed, noise=3e-5, torques=0.0).data
    result = ea.diagnose(replace(robot, links=None), _as_read(data, rng), seed=3, threads=1)
    (effect,) = result["effects"]
    assert (effect["effect"], effect["joint"]) == ("joint_compliance", 2) and result["verdict"] == "explained"
    low, high = effect["parameters"]["linear_rad_per_Nm"]["ci95"]
    assert low < TRUE < high


@pytest.mark.slow
def test_the_spring_of_a_calibration_lies_in_its_interval_under_such_readings():
    """95 % of twenty seeds, the first tried: fewer than 16 hold by chance in 3 of 1000 cases (binomial). 13
    held until the interval knew of the noise of the torques, 18 do since."""
    held = 0
    for seed in range(40, 60):
        robot, rng = ea.load_robot("ur10"), np.random.default_rng(seed)
        data = ea.simulate(robot, effects=[SAG], count=100, deviation=1, seed=seed, noise=3e-5,
                           torques=0.0).data
        result = ea.calibrate(replace(robot, links=None), _as_read(data, rng), seed=3, threads=1)
        low, high = result["parameters"]["joint_compliance_2.linear_rad_per_Nm"]["ci95"]
        held += low < TRUE < high
    assert held >= 16


def _as_read(data, rng):
    """With a tenth of noise, and of the drives' friction, in the torques."""
    tau = data.joints["tau"]
    size = tau.std(axis=0)
    wrong = 0.1 * size * rng.standard_normal(tau.shape) + 0.1 * size * data.joints["approach"]
    return replace(data, joints=dict(data.joints) | {"tau": tau + wrong})
