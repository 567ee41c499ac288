"""Rounded angles are noise that repeats hide: it is seen in the columns, and belongs to the noise floor."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.quantisation import step_of

RANDOM = np.random.default_rng(4)


@pytest.mark.parametrize("step", [1e-4, 2.0 * np.pi / 2**16, 3e-7])
def test_the_step_of_a_rounded_column_is_found(step):
    assert step_of(np.round(RANDOM.uniform(-2, 2, 200) / step) * step) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("rows, step, decimals", [
    (100, 2.0 * np.pi / 2**12, 6), (100, 2.0 * np.pi / 2**12, 8), (200, 2.0 * np.pi / 2**14, 6),
    (60, 2e-3, 6)])
def test_the_digits_that_a_rounded_column_was_written_with_do_not_hide_its_step(rows, step, decimals):
    """The last digit was taken for the step, and the true rounding for a cause."""
    random = np.random.default_rng(rows)
    rounded = [np.round(random.uniform(-2, 2, rows) / step) * step for _ in range(20)]
    found = [step_of(np.round(values, decimals)) for values in rounded]
    assert found == pytest.approx([step] * 20, rel=1e-3)
    # as a file in degrees is read
    written = [np.radians(np.round(np.degrees(values), decimals - 1)) for values in rounded]
    assert [step_of(values) for values in written] == pytest.approx([step] * 20, rel=1e-3)


def test_digits_alone_are_their_own_step():
    random = np.random.default_rng(6)
    for unit in (1.0, np.pi / 180.0):
        for decimals in (3, 4, 5):
            written = unit * np.round(random.uniform(-2, 2, 60) / unit, decimals)
            assert step_of(written) == pytest.approx(unit * 10.0**-decimals, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 6))
def test_one_coarse_encoder_written_with_six_decimals_is_no_cause(seed):
    """Axis 2 of a UR10 on 4,096 counts at its output; where the grid was not seen, the rounding of one axis
    passed for waves, or for a structure that nothing explains (seeds 1, 4 and 5 of these, the first five)."""
    made = ea.simulate("ur10", count=100, seed=seed).data
    step, q = 2.0 * np.pi / 4096, made.joints["theta"].copy()  # of an arm without gears
    q[:, 1] = np.round(q[:, 1] / step) * step
    result = diagnose(ea.load_robot("ur10"), replace(made, joints={"theta": np.round(q, 6)}))
    assert result.verdict == "no_undeclared_effect" and not result.findings


def test_an_exact_column_and_few_chosen_values_are_not_rounded():
    assert step_of(RANDOM.uniform(-2, 2, 200)) == 0.0
    assert step_of(np.tile([0.0, 0.5, 1.0], 20)) == 0.0


def rounded_poses(seed):
    """65,536 counts at the output of a UR10, each pose visited twice: 96 urad that repeats do not show."""
    return ea.simulate("ur10", count=60, visits=2, noise=5e-6, counts=65536, seed=seed).data


@pytest.mark.slow
def test_the_noise_floor_knows_of_rounding_that_repeats_hide():
    result = diagnose(ea.load_robot("ur10"), rounded_poses(3))
    assert result.noise.source.endswith("and the rounding of the reported angles")
    assert result.noise.value > 4.0 * np.sqrt(3.0) * 5e-6  # the tracker's noise alone, that repeats do show
    assert 0.8 < result.after["validation"].rms / result.noise.value < 1.25


@pytest.mark.slow
def test_rounded_poses_are_given_causes_as_rarely_as_stated():
    """One clean set in twenty may be: of these ten seed 3 is (a zero that shifted behind the first pose,
    probability 0.60). Two or more of ten are given one by chance in 9 of 100 such tests."""
    named = [seed for seed in range(3, 13) if diagnose(ea.load_robot("ur10"), rounded_poses(seed)).findings]
    assert len(named) <= 1, named


@pytest.mark.slow
def test_clean_data_of_a_robot_without_gears_lack_nothing():
    made = ea.simulate("ur10", count=60, visits=2, noise=5e-6, seed=3)
    result = diagnose(ea.load_robot("ur10"), made.data)
    assert (
        result.verdict == "no_undeclared_effect" and result.noise.source == "repeated visits of the same pose"
    )
