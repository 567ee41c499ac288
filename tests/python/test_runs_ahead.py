"""Lost motion of the wrong sign: the angles were read too early, or the order of the rows is another one."""

import numpy as np
import pytest

import exactarm as ea
from exactarm.effects.hysteresis import Hysteresis
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis


@pytest.mark.parametrize("by_rows", [False, True])
def test_an_angle_that_runs_ahead_is_no_lost_motion_and_not_compensated(by_rows):
    lags, leads = (Hysteresis(1, (size,), by_rows=by_rows) for size in (1e-4, -1e-4))
    assert lags.compensable and "lost motion" in lags.in_plain_words and not lags.caveat(np.eye(1))
    assert not leads.compensable and "runs ahead" in leads.in_plain_words
    assert ("order of measurement" if by_rows else "approach") in leads.caveat(np.eye(1))


@pytest.mark.slow
def test_angles_that_were_logged_too_early_are_told_and_not_compensated():
    """Every axis 1 still moves on by 1 mrad after its angle was read."""
    random, arm = np.random.default_rng(1), six_axis(placed=False)
    q = joints_in_limits(arm, 90, random)
    data = measured(arm, [true_robot(arm, random)], [q], 3e-5, random)
    data.joints["theta"][1:, 0] -= 1e-3 * arm.joints[0].ratio * np.sign(np.diff(q[:, 0]))
    made = ea.diagnose(arm, data)
    (found,) = made["effects"]
    assert (found["effect"], found["joint"], found["compensable"]) == ("hysteresis", 1, False)
    assert found["parameters"]["size_rad"]["value"] == pytest.approx(-1e-3, rel=0.1)
    assert "logged before the arm stood still" in found["evidence"]
