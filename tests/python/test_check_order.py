"""The daily check where rows, or files, stand in another order than they were measured in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import exactarm as ea
from exactarm.data.dataset import write_dataset
from test_check import an_arm_for, before_of, days_of


def exchanged(data, order):
    return replace(data, position=data.position[order])


@pytest.mark.parametrize("days", [1, 2])
@pytest.mark.parametrize("late", [1, 2, 4])
@pytest.mark.slow
def test_points_that_stand_rows_late_are_no_rest(late, days):
    """Neither zero, base nor tool can do it: "nothing has moved" stood beside a move of 1.7 m."""
    arm, truth, q, random = an_arm_for(14)
    order = np.roll(np.arange(len(q)), late)
    wrong = [exchanged(data, order) for data in days_of(truth, q, random, days, arm)]
    found = ea.check(arm, before_of(truth, q, random, arm), wrong)
    assert found["verdict"] == "moved_unexplained" and found["alarm"] == "day 1"
    rows = {1: "1 row too late", 2: "2 rows too late", 4: "1 row too early"}[late]
    assert f"day 1: are x, y, z {rows}, beside the angles?" in " ".join(found["warnings"])


@pytest.mark.slow
def test_days_of_a_shells_order_are_taken_by_their_numbers(tmp_path):
    """day_10 stood before day_2, and an alarm before its cause; another order is the user's."""
    arm, truth, q, random = an_arm_for(14)
    days = days_of(truth, q, random, 3, arm)
    paths = [str(tmp_path / f"day_{n}.csv") for n in (1, 10, 2)]
    for path, data in zip(paths, days):
        write_dataset(Path(path), data, arm)
    before = before_of(truth, q, random, arm)
    order = lambda given: [day["day"] for day in ea.check(arm, before, given)["days"]]
    assert order(paths) == ["day_1", "day_2", "day_10"]
    assert order(paths[::-1]) == ["day_2", "day_10", "day_1"]
