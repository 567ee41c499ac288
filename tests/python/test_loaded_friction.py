"""Friction that grows with the load of a joint: lost motion of a pose by its approach and its torque."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects import effect_from_table
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.joint_compliance import JointCompliance
from set_ups import at_random_place, joints_in_limits, measured
from six_axis import six_axis

AXIS, SIZE_RAD, PER_LOAD, COUNT = 2, 2e-5, 4e-7, 120


def poses(seed, size=SIZE_RAD, per_load=PER_LOAD):
    """An arm, and 120 poses of it from either side, noise of 0.03 mm; the lag is worked out here, from the
    moment of gravity, and added to the angles that the arm stands at."""
    random = np.random.default_rng(seed)
    arm = six_axis(placed=False)
    q = joints_in_limits(arm, COUNT, random)
    sides = np.where(random.uniform(size=q.shape) < 0.5, -1.0, 1.0)
    load = np.abs(_core.gravity_torque(arm.core, q, 1)[:, AXIS - 1])
    there = q.copy()
    there[:, AXIS - 1] -= (size + per_load * load) * sides[:, AXIS - 1]
    data = measured(arm, [at_random_place(arm, random)], [there], 3e-5, random)
    theta = (q - arm.controller_offsets) * arm.controller_ratios
    return arm, replace(data, joints=data.joints | {"theta": theta, "approach": sides})


@pytest.mark.parametrize("masses", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_lost_motion_that_grows_with_the_load_is_named_so(masses):
    """It was a wave of 2.3 cycles that depends on the direction, at probability one. Of seeds 0 to 7 all are
    named and explained, the size per Nm of masses that are declared within its interval in each."""
    arm, data = poses(0)
    result = diagnose(arm if masses else replace(arm, links=None), data)
    (finding,) = result.findings
    assert result.verdict == EXPLAINED and finding.effect.label == "hysteresis_2" and finding.effect.loaded
    assert masses or result.robot.links is not None  # the file keeps what the size is per Nm of
    low, high = finding.intervals[1]
    assert low < PER_LOAD < high and (not masses or high - low < 0.5 * PER_LOAD)


def test_lost_motion_of_one_width_keeps_its_form():
    """Any seed: 0 to 7 are alike."""
    result = diagnose(*poses(0, size=2e-4, per_load=0.0))
    (finding,) = result.findings
    assert finding.effect.label == "hysteresis_2" and not finding.effect.loaded


def test_its_derivatives_by_size_and_by_the_load():
    """Any seed."""
    arm, data = poses(1)
    lag = Hysteresis(AXIS, (SIZE_RAD, PER_LOAD), loaded=True)
    layout = Layout.of((lag, JointCompliance(AXIS, (4e-6, 0.0))))
    at = lambda values: predict_poses(arm, layout.at(values), data, tangents=False).position.ravel()
    jacobian = predict_poses(arm, layout, data).jacobian[:, :3].reshape(-1, layout.size)
    assert_derivative(at, layout.values, jacobian, 0.1 * np.abs(layout.values))


def test_it_comes_back_from_a_file():
    effect = Hysteresis(AXIS, (SIZE_RAD, PER_LOAD), loaded=True)
    assert effect_from_table(effect.to_table()) == effect
    assert "more for every Nm of its load" in effect.describe() and not effect.runs_ahead
    ahead = Hysteresis(AXIS, (-SIZE_RAD, PER_LOAD), loaded=True)
    assert ahead.possible(None, np.array([SIZE_RAD, 0.0])) and not ahead.possible(None, np.zeros(2))
