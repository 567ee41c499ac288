"""A base that has moved so far that no derivative tells it, or turned alone, in the daily check.

Seeds: the first tried, none exchanged; with 20 to 25 the first test holds as well.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement
from test_check import an_arm_for, before_of, days_of


@pytest.mark.slow
@pytest.mark.parametrize("seed", [pytest.param(13, marks=pytest.mark.slow), 14])
@pytest.mark.parametrize("turn_rad, shift_m", [(5e-3, 5e-3), (1.5, 2.0)])
def test_a_base_that_has_moved_far_is_the_base(seed, turn_rad, shift_m):
    """A push by millimetres, and an instrument that was set up anew and nobody said so: no linear change."""
    arm, truth, q, random = an_arm_for(seed)
    by = turn_rad * np.array([0.6, 0.0, 0.8])
    base = Placement(exp(by) @ truth.base.rotation, truth.base.position + np.array([shift_m, 0.0, 0.0]))
    new = [*days_of(truth, q, random, 3, arm), *days_of(replace(truth, base=base), q, random, 4, arm)]
    result = ea.check(arm, before_of(truth, q, random, arm), new)
    assert result["verdict"] == "moved" and result["since"]["day"] == "day 4"
    assert result["causes"][0]["cause"] == "base" and result["cannot_be_told_apart"] == []
    found = result["causes"][0]["parameters"]
    size = np.linalg.norm([found[f"base_{axis}_m"]["value"] for axis in "xyz"])
    assert size == pytest.approx(shift_m, rel=0.05)
    assert "set up anew" in str(result.report)


@pytest.mark.slow
def test_days_of_two_poses_and_a_tool_that_has_moved_far_are_as_they_were():
    """Two points show no turn about their line; 5 mm of the tool are no base."""
    arm, truth, q, random = an_arm_for(15)
    before = before_of(truth, q, random, arm)
    still = ea.check(arm, before, days_of(truth, q[:2], random, 10, arm))
    assert not still["moved"]
    bent = replace(truth, tool=replace(truth.tool, position=truth.tool.position + [0.0, 5e-3, 0.0]))
    result = ea.check(arm, before, days_of(bent, q, random, 4, arm))
    assert result["verdict"] == "moved" and result["causes"][0]["cause"] == "tool"


def test_a_base_that_has_turned_is_said_with_its_turn():
    """Its shift alone was said, which is none."""
    arm, truth, q, random = an_arm_for(7)
    rotation = truth.base.rotation @ exp(np.array([0.0, 5e-4, 0.0]))
    turned = replace(truth, base=replace(truth.base, rotation=rotation))
    new = days_of(truth, q, random, 3, arm) + days_of(turned, q, random, 5, arm)
    result = ea.check(arm, before_of(truth, q, random, arm), new)
    words = re.search(r"The base has moved since .* by .*?(\d\.\d+) mrad\. Alarm", result.report.verdict)
    assert words and float(words[1]) == pytest.approx(0.5, rel=0.2)
