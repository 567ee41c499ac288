"""The daily check names a change of any size: it fits each candidate as it is, not as its derivative.

Seeds: the first tried, none exchanged.
"""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement
from exactarm.verify.change import day_weights, detect
from exactarm.verify.explanation import explain
from test_check import NOISE_M, NUMBERS, an_arm_for, before_of, days_of, fresh, moved, some_hypotheses

ZEROS = [(f"q{i}", 0.05, f"zero of axis {i}") for i in range(1, 7)]
LARGE = [ZEROS[0], *(pytest.param(*zero, marks=pytest.mark.slow) for zero in ZEROS[1:5]), ZEROS[5],
         ("tool", 0.02, "tool"), ("base", 1.0, "base")]


@pytest.mark.slow
@pytest.mark.parametrize("what, size, name", LARGE)
def test_a_large_change_is_named_as_surely_as_a_small_one(what, size, name):
    """The arm is not calibrated: its lengths and angles are off by millimetres and milliradians."""
    arm, truth, q, random = an_arm_for(21)
    new = [*days_of(truth, q, random, 3, arm), *days_of(moved(truth, what, size), q, random, 4, arm)]
    result = ea.check(arm, before_of(truth, q, random, arm), new)
    assert result["verdict"] == "moved" and result["since"]["day"] == "day 4"
    names = {cause["cause"] for cause in result["causes"]}
    assert names == {name} | {"q1": {"base"}, "q6": {"tool"}}.get(what, set())
    if what.startswith("q"):
        (cause,) = [cause for cause in result["causes"] if cause["cause"] == name]
        (found,) = cause["parameters"].values()
        assert found["ci95"][0] < size < found["ci95"][1]
        assert found["ci95"][1] - found["ci95"][0] < 0.2 * size


@pytest.mark.slow
def test_a_large_change_is_named_where_every_day_is_another_set_up():
    arm, truth, q, random = an_arm_for(22)
    turned = moved(truth, "q3", 0.05)
    new = []
    for number, robot in enumerate([truth, truth, turned, turned, turned], start=2):
        place = Placement(exp(random.normal(size=3)), random.normal(size=3))
        (day,) = days_of(replace(robot, base=place), q, random, 1, arm)
        new.append(replace(day, session=np.full(5, number)))
    result = ea.check(arm, before_of(truth, q, random, arm), new)
    assert [cause["cause"] for cause in result["causes"]] == ["zero of axis 3"]
    assert result["verdict"] == "moved" and result["since"]["day"] == "day 3"


def test_two_large_changes_at_once_are_not_called_one():
    arm, truth, q, random = an_arm_for(23)
    both = moved(moved(truth, "q2", 0.02), "tool", 0.002)
    result = ea.check(arm, before_of(truth, q, random, arm), days_of(both, q, random, 4, arm))
    assert result["verdict"] == "moved_unexplained"


@pytest.mark.slow
def test_the_move_of_the_base_is_counted_in_its_old_axes():
    arm, truth, q, random = an_arm_for(24)
    by, shift = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.2, -0.3])
    base = truth.base
    bent = replace(truth, base=Placement(base.rotation @ exp(by), base.position + base.rotation @ shift))
    result = ea.check(arm, before_of(truth, q, random, arm), days_of(bent, q, random, 4, arm))
    found = result["causes"][0]["parameters"]
    told = [found[f"base_{axis}"]["value"] for axis in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")]
    # the base frame itself is known to the error of this arm's model, some mm and mrad
    np.testing.assert_allclose(told, [*shift, *by], atol=6e-3)


# -- a day of larger noise -----------------------------------------------------------------------------
def noisy(data, random):
    return replace(data, position=data.position + random.normal(0.0, 6 * NOISE_M, data.position.shape))


@pytest.mark.slow
def test_one_noisy_day_is_no_change_and_hides_none():
    arm, truth, q, random = an_arm_for(25)
    quiet = days_of(truth, q, random, 6, arm)
    quiet[3] = noisy(quiet[3], random)
    before = before_of(truth, q, random, arm)
    result = ea.check(arm, before, quiet)
    assert not result["moved"]
    (told,) = [warning for warning in result.warnings if "every other day" in warning]
    assert told.startswith("day 4")
    loud = [*days_of(truth, q, random, 2, arm), *days_of(moved(truth, "q2", 1e-3), q, random, 4, arm)]
    loud[4] = noisy(loud[4], random)
    result = ea.check(arm, before, loud)
    assert result["verdict"] == "moved" and result["causes"][0]["cause"] == "zero of axis 2"
    assert result["since"]["day"] == "day 3"


@pytest.mark.slow
def test_an_alarm_of_the_last_day_alone_asks_for_another_measurement():
    arm, truth, q, random = an_arm_for(26)
    new = [*days_of(truth, q, random, 3, arm), *days_of(moved(truth, "q2", 1e-3), q, random, 2, arm)]
    before = before_of(truth, q, random, arm)
    assert "One day alone" in str(ea.check(arm, before, new[:4]).report)
    assert "One day alone" not in str(ea.check(arm, before, new).report)


def test_days_are_weighed_by_their_distance_to_the_nearest_other_one():
    random = np.random.default_rng(5)
    detector, level = fresh(random, some_hypotheses(random), 10)
    shift = np.zeros(NUMBERS)
    shift[:4] = 40.0
    y = [level + random.normal(size=NUMBERS) for _ in range(6)]
    y[2], y[4], y[5] = y[2] + 8.0 * random.normal(size=NUMBERS), y[4] + shift, y[5] + shift
    weights = day_weights(detector.before, [(row, np.eye(NUMBERS)) for row in y])
    assert list(weights < 1.0) == [False, False, True, False, False, False] and weights[2] < 0.1


@pytest.mark.slow
def test_the_first_day_is_told_however_long_ago():
    """More days since than the test looks back (WINDOW)."""
    random = np.random.default_rng(6)
    hypotheses = some_hypotheses(random)
    detector, level = fresh(random, hypotheses, 10)
    size = 10.0 * hypotheses[1].columns[:, 0]
    days = [(level + size * (d >= 4) + random.normal(size=NUMBERS), np.eye(NUMBERS)) for d in range(150)]
    alarms = detect(detector.before, days, hypotheses, 250.0)
    (best, *_) = explain(detector.before, days, hypotheses, alarms).causes
    assert alarms.alarm == 4 and best.name == "q1" and best.days == (4, 4)
    assert best.estimate[0] == pytest.approx(10.0, rel=0.05)
