"""A gyroscope that feels gravity: all nine terms that the runs show, none of the others."""

import numpy as np
import pytest

from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects import effect_from_table
from exactarm.effects.gyro_g_sensitivity import GyroGSensitivity, shown_components
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs

MATRIX = np.array([[2e-3, -1e-3, 0.0], [1e-3, 2e-3, 0.0], [-3e-3, 1.5e-3, 0.0]])


def test_components_that_are_constant_or_follow_others_are_not_shown():
    angle = np.linspace(0.0, 3.0, 400)
    turning = np.stack([np.cos(angle), np.sin(angle), np.full(400, 0.7)], axis=1)
    assert shown_components(turning) == (0, 1)
    assert shown_components(np.tile([0.0, 0.0, 1.0], (400, 1))) == ()
    assert shown_components(turning[:, [0, 1, 0]]) in ((0, 1), (1, 2))
    assert shown_components(np.concatenate([turning, turning @ np.diag([1.0, 1.0, -1.0])])) == (0, 1, 2)
    assert shown_components(np.zeros((0, 3))) == ()


@pytest.mark.slow
def test_every_term_that_a_run_shows_is_found_and_the_others_stay_zero():
    robot = load_robot("racer-7-1.4")
    true = GyroGSensitivity(None, tuple(MATRIX.ravel()))
    data = measure_gear_runs(VirtualRobot.of(robot, [true]), [1], [0.6, 1.2], 3, Sensors(),
                             np.random.default_rng(3))
    found = diagnose(robot, data)
    assert found.verdict == EXPLAINED and [f.effect.label for f in found.findings] == ["gyro_g_sensitivity"]
    effect = found.findings[0].effect
    estimated = np.reshape(effect.values, (3, 3))
    assert effect.columns == (0, 1) and not np.any(estimated[:, 2])
    assert "forces along the sensor's z: held at zero" in found.findings[0].evidence
    assert np.max(np.abs(estimated - MATRIX)) < 2e-4
    assert found.after["validation"].rms == pytest.approx(Sensors().gyro_rad_s, rel=0.05)


def test_files_of_three_terms_are_those_of_the_moving_axis():
    old = effect_from_table({"effect": "gyro_g_sensitivity", "x_rad_s_per_g": 1e-3, "y_rad_s_per_g": 2e-3,
                             "z_rad_s_per_g": 3e-3})
    assert old.values == (0.0,) * 6 + (1e-3, 2e-3, 3e-3)
    assert effect_from_table(old.to_table()) == old
