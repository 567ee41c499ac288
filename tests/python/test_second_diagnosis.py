"""A robot file that an earlier command wrote: its estimates are estimated again, what a person declared in it
is not."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.identify.calibrate import calibrate
from exactarm.identify.declared import reestimated_layout
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M = 5e-5
COUNT, FITTED = 140, 100
ECCENTRICITY = effect_from_table({
    "effect": "gear_eccentricity", "joint": 2, "first_cos_rad": 3e-4, "first_sin_rad": 1e-4,
    "second_cos_rad": 1e-4, "second_sin_rad": 1e-4,
})
COMPLIANCE = effect_from_table({"effect": "joint_compliance", "joint": 3, "linear_rad_per_Nm": 1e-5,
                                "cubic_rad_per_Nm3": 0.0})


@pytest.fixture(scope="module")
def data():
    """UR10 with run-out in gear 2, which a calibration lends to the compliances that it looks for."""
    rng, robot = np.random.default_rng(31), load_robot("ur10")
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
    return measured(robot, [true_robot(robot, rng, 0.5)], [q], NOISE_M, rng,
                    identification=np.arange(COUNT) < FITTED,
                    layout=Layout.of((ECCENTRICITY,), estimate=False))


@pytest.fixture(scope="module")
def calibrated(data):
    return calibrate(load_robot("ur10"), data).robot


@pytest.fixture(scope="module")
def first(data, calibrated):
    return diagnose(calibrated, data)


@pytest.mark.slow
def test_what_a_calibration_has_lent_to_springs_is_given_back(calibrated, first):
    assert any(effect.name == "joint_compliance" for effect in calibrated.effects)
    found = first.findings[0]
    assert (found.effect.name, found.effect.joint) == ("gear_eccentricity", 2) and len(first.findings) == 1
    # Not 0.99 as before: a smooth function of the same angle fits as well, and the posterior holds it
    # possible.
    assert found.probability > 0.9 and first.verdict == "explained"
    assert found.credible_set[0][:2] == ("gear_eccentricity", 2)
    assert found.effect.values[0] == pytest.approx(3e-4, abs=6e-5)
    assert first.after["validation"].rms < 1.15 * np.sqrt(3.0) * NOISE_M


@pytest.mark.slow
def test_diagnosed_once_more_nothing_is_added(data, first):
    again = diagnose(first.robot, data)
    assert not again.findings and again.verdict == "no_undeclared_effect"
    assert again.after["validation"].rms == pytest.approx(first.after["validation"].rms, rel=0.02)


def test_only_estimates_are_free():
    poses = Dataset.of_arrays("poses", {"q": np.zeros((1, 6))})
    robot = replace(load_robot("ur10"), effects=(COMPLIANCE, ECCENTRICITY), intervals={
        "joint_compliance_3.linear_rad_per_Nm": (0.9e-5, 1.1e-5),
        "gear_eccentricity_2.first_cos_rad": (0.0, 0.0),  # at a bound
    })
    assert reestimated_layout(robot, poses).names == ("joint_compliance_3.linear_rad_per_Nm",)


def test_a_curve_keeps_its_regularisation_and_says_what_it_is():
    curve = GearHarmonics.curve(2, 40, 1e-4, (-1.0, 2.0)).with_values((1.0, 0.0, 0.0, 2e-4) + (0.0,) * 77)
    read = effect_from_table(curve.to_table())
    assert [p.prior for p in read.parameters()] == [p.prior for p in curve.parameters()]
    assert (
        read.describe() == curve.describe()
        and "curve that repeats with every revolution, 7" in curve.describe()
    )
