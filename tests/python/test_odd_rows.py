"""Mistakes in a part of the rows of poses, of one column, a file given twice; right rows in any order."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.first_aid.first_aid import first_aid
from exactarm.numerics.rotation import exp
from exactarm.robot_file import load_robot
from test_first_aid import column, kr300, order, position, scaled, shifted, tx40, ur10  # noqa: F401

DEGREE = np.pi / 180.0
ROWS = np.arange(1495)
SECOND_HALF, MIDDLE = ROWS > 747, (ROWS > 498) & (ROWS < 996)


def angles_in(rows, change):
    return lambda d: column(d, "q", lambda q: np.where(rows[:, None], change(q.copy()), q))


def device_turned(data, rows, angle):
    turn = exp(np.array([0.0, 0.0, angle]))
    return replace(data, position=np.where(rows[:, None], data.position @ turn.T, data.position),
                   rotation=np.where(rows[:, None, None], turn @ data.rotation, data.rotation))


PARTS = {
    "half in degrees": (angles_in(SECOND_HALF, scaled(slice(None), 1 / DEGREE)),
                        "degrees labelled as radians from about row 751"),
    "half in radians labelled degrees": (angles_in(SECOND_HALF, scaled(slice(None), DEGREE)),
                                         "radians labelled as degrees from about row 751"),
    "a sign that changes": (angles_in(SECOND_HALF, scaled(2, -1)),
                            "opposite sign of axis 3 from about row 751"),
    "columns that change": (angles_in(SECOND_HALF, order(1, 3, 2, 4, 5, 6)),
                            "axes 2 and 3 exchanged from about row 751"),
    "a zero lost by 90 degrees": (angles_in(SECOND_HALF, shifted(3, np.pi / 2)),
                                  "another zero of axis 4 (by -90 degrees) from about row 751"),
    "a zero lost by 3 degrees": (angles_in(SECOND_HALF, shifted(3, 3 * DEGREE)),
                                 "another zero of axis 4 (by about -3"),
    "a lost row": (angles_in(SECOND_HALF, lambda q: np.roll(q, 1, axis=0)), "positions one row earlier"),
    "device turned in the middle": (lambda d: device_turned(d, MIDDLE, DEGREE),
                                    "device frame from about row 501"),
    "a log that stood still": (angles_in((ROWS > 300) & (ROWS < 400), lambda q: q[[300]] + 0.0 * q),
                               "with other angles from about row 307 of series_B.csv to row 395"),
    "rows of another order": (angles_in(SECOND_HALF, lambda q: q[::-1]),
                              "with other angles from about row 751"),
    "one column in inches": (lambda d: position(d, lambda p: p / [25.4, 1, 1]), "column x alone 25.4 times"),
    "one column in feet": (lambda d: position(d, lambda p: p / [0.3048, 1, 1]), "column x alone 0.305 times"),
    "gon": (lambda d: column(d, "q", scaled(slice(None), 1 / 0.9)), "gon labelled as degrees"),
}


# Those that take over half a second.
LONG = {"half in degrees", "half in radians labelled degrees", "columns that change", "rows of another order",
        "a zero lost by 90 degrees"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name
                                  for name in PARTS])
def test_a_mistake_in_a_part_of_the_rows_is_told_with_its_place(ur10, name):  # noqa: F811
    robot, data = ur10
    change, words = PARTS[name]
    found = first_aid(robot, change(data))
    assert found and words in found[0], found


@pytest.mark.parametrize("arm", ["ur10", pytest.param("tx40", marks=pytest.mark.slow), "kr300"])
def test_the_same_file_under_another_name_is_told(request, arm):
    robot, data = request.getfixturevalue(arm)
    rows = np.concatenate([np.arange(len(data))] * 2)
    again = replace(data.select(rows), run=np.concatenate([data.run, data.run + data.run.max()]))
    assert "to the last digit: was a file given twice" in first_aid(robot, again)[0]


def test_rows_that_come_again_by_chance_or_with_other_noise_are_no_second_file(ur10):  # noqa: F811
    robot, data = ur10
    few = data.select(np.concatenate([ROWS, ROWS[100:115]]))
    other = replace(data, position=data.position + np.random.default_rng(1).normal(0.0, 1e-6, (1495, 3)))
    twice = replace(few.select(np.concatenate([ROWS, ROWS])),
                    position=np.concatenate([data.position, other.position]))
    assert first_aid(robot, few) == first_aid(robot, twice) == ()


@pytest.mark.slow
def test_neighbours_in_a_corner_are_not_suspected_for_their_orientations(ur10):  # noqa: F811
    """They hardly show the base's rotation: 0.08 rad were once told as another quaternion."""
    robot, data = ur10
    for start in range(0, 1400, 140):
        assert first_aid(robot, data.select(ROWS[start : start + 30])) == ()


@pytest.mark.parametrize("arm", ["ur10", "panda"])
@pytest.mark.slow
def test_right_rows_are_not_suspected_in_any_order(arm):
    """An arm 1 mm wrong leaves more in one corner than in another; sorted rows put neighbours together."""
    robot = load_robot(arm)
    data = ea.simulate(arm, count=80, noise=3e-5, counts=0, deviation=2, seed=4).data
    angles = data.joints.get("q", data.joints.get("theta"))
    for key in (np.arange(len(data)), angles[:, 0], angles[:, 1], data.position[:, 2]):
        assert first_aid(robot, data.select(np.argsort(key))) == ()


@pytest.mark.parametrize("count, seed", [(120, 0), pytest.param(1000, 1, marks=pytest.mark.slow)])
def test_rows_too_many_for_single_errors_and_too_few_for_frames_of_their_own_are_named(
        ur10, count, seed):  # noqa: F811
    """They have the angles of another row: "is it another robot?" was asked. Of seeds 0 to 7 all name the
    seven of 120; of 51 in 1,000, of which a quarter are looked at first, 1, 3, 4, 5 and 7 count all, the
    others see more than a twentieth and tell other angles in so many per cent of the rows."""
    robot, data = ur10
    random = np.random.default_rng(seed)
    data = data.select(random.choice(len(data), count, replace=False))
    wrong = np.sort(random.choice(np.arange(1, count), 7 if count == 120 else 51, replace=False))
    q = data.joints["q"].copy()
    q[wrong] = data.joints["q"][(wrong + 37) % count]
    told = " ".join(map(str, first_aid(robot, replace(data, joints=data.joints | {"q": q}))))
    assert f"with {len(wrong)} gross errors, the largest of" in told
    named = {data.place_of(row) for row in wrong}
    assert sum(f"{place}," in told or f"{place} " in told for place in named) == 6
    assert f"and {len(wrong) - 6} more" in told
