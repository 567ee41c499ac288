"""A day of the check in another unit, mirrored or in another order is told; a base that was pushed or a zero
that was lost is not taken for it."""

import numpy as np
import pytest

import exactarm as ea
from exactarm.chain.controller import forward
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp
from exactarm.robot_file import load_robot
from exactarm.verify.day_mistakes import day_mistake

MOST_M = 0.05


@pytest.fixture
def points():
    return np.random.default_rng(4).uniform(-0.8, 0.8, (6, 3))


@pytest.mark.parametrize("scale, words", [(1e3, "1000 times"), (1e-3, "0.001 times"), (1 / 25.4, "0.03937")])
def test_another_unit_is_named_by_its_factor(points, scale, words):
    assert words in day_mistake("Monday", points, scale * points + 3.0, MOST_M)


@pytest.mark.parametrize("columns, signs", [([0, 1, 2], [-1, 1, 1]), ([1, 0, 2], [1, 1, 1])])
def test_a_mirror_image_is_named(points, columns, signs):
    assert "mirror" in day_mistake("Monday", points, points[:, columns] * signs, MOST_M)


def test_rows_in_another_order_are_named(points):
    words = lambda order: day_mistake("Monday", points, points[order], MOST_M)
    assert "1 row too late, beside the angles" in words([5, 0, 1, 2, 3, 4])
    assert "2 rows too early, beside the angles" in words([2, 3, 4, 5, 0, 1])
    assert "in another order than the angles" in words([1, 0, 2, 3, 4, 5])
    assert words([0, 1, 2, 3, 4, 5]) == ""


@pytest.mark.slow
def test_what_may_have_happened_to_the_arm_is_none():
    """Base pushed, tool exchanged, a zero lost by 5 to 120 degrees: 1,400 days of 5 arms' poses, no word."""
    random, words = np.random.default_rng(7), []
    for name in ("ur10", "tx40", "gen3lite", "panda", "racer-7-1.4"):
        robot = load_robot(name)
        for _ in range(280):
            q = random.uniform(-2.0, 2.0, (random.integers(3, 10), robot.axes))
            lost = np.eye(robot.axes)[random.integers(robot.axes)] * random.uniform(0.1, 2.0)
            position, rotation = forward(robot, np.concatenate([q, q + lost]))
            expected = position[: len(q)]
            seen = position[len(q) :] + rotation[len(q) :] @ random.normal(0.0, 0.2, 3)
            seen = seen @ exp(random.normal(size=(1, 3)))[0].T + random.normal(size=3)
            words.append(day_mistake("Monday", expected, seen, MOST_M))
    assert [word for word in words if word] == []


@pytest.mark.slow
def test_days_may_be_rows_of_one_file_but_each_row_is_taken_once():
    """Chosen in Python; they were refused as the same file."""
    data = ea.read("ur10", "ur10/series_B")
    before, day = data.select(np.arange(60)), data.select(np.arange(60, 120))
    assert ea.check("ur10", before, day)["days"][0]["day"] == "day 1"
    with pytest.raises(InputError, match="the same content as .*; expected each file once"):
        ea.check("ur10", before, data.select(np.arange(59, 120)))
