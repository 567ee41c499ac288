"""Forms of a gear's error: one order, a run-out or a whole curve, as the held-out error says."""

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

COUNT = 320
JOINT = 3
_random = np.random.default_rng(21)
CURVE = GearHarmonics(JOINT,
                      (1.0, *(4e-4 * np.repeat(np.arange(1.0, 13.0) ** 0.5, 2) * _random.normal(size=24))))
TRUTHS = {
    "run-out": (GearEccentricity(JOINT, (3e-4, -2e-4, 1e-4, 2e-4)), "gear_eccentricity", (2, 4)),
    "one order": (GearHarmonics(JOINT, (7.0, 2e-3, -1e-3)), "gear_harmonics", (3, 5)),
    "curve": (CURVE, "gear_harmonics", (20, 200)),
}


@pytest.mark.slow
@pytest.mark.parametrize("truth", TRUTHS)
def test_form_is_that_of_the_truth(truth):
    hidden, name, (fewest, most) = TRUTHS[truth]
    rng = np.random.default_rng(22)
    robot = load_robot("ur10")
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.5, 2.5)
    data = measured(robot, [true_robot(robot, rng, 0.5)], [q], 4e-5, rng,
                    layout=Layout.of((hidden,), estimate=False),
                    identification=np.arange(COUNT) % 10 < 7)
    result = diagnose(robot, data)
    assert [finding.effect.label for finding in result.findings] == [f"{name}_{JOINT}"], result.sentence
    assert fewest <= len(result.findings[0].effect.values) <= most
    assert result.after["validation"].rms < 0.5 * result.before["validation"].rms
