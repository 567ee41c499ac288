"""An axis that stands at a few places again and again: what its readings scatter by there is no angle of its
gear."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import exactarm as ea
from exactarm.diagnose.signal import turn_of
from exactarm.numerics.places import at_places, places_of
from exactarm.robot.robot import Placement, Robot
from exactarm.simulate import deviated
from test_robot_types import scara

_READINGS = np.array([3e-5, 7e-5, 2e-5, 1e-4])  # rad, m of the quill: some 20 um each at the tip
_FIXTURE = '[[distances]]\ncontact = "socket"\nbetween = [0, 1]\nlength_mm = 100.0\n'


def test_places_are_their_means_and_what_is_spread_stays():
    random = np.random.default_rng(0)  # seeds 0 to 7 give the same
    stood = np.repeat([0.1, 0.15, 0.3], 20)
    read = stood + 1e-5 * random.normal(size=60)
    means = [read[stood == each].mean() for each in (0.1, 0.15, 0.3)]
    assert np.allclose(at_places(read), np.repeat(means, 20), rtol=1e-12) and places_of(read) == 3
    spread = random.uniform(0.0, 1.0, 500)
    assert np.array_equal(at_places(spread), spread) and places_of(spread) == 500
    assert places_of(np.full(10, 0.2)) == 1 and places_of(np.linspace(0.0, 1.0, 7)) == 7


def test_a_sliding_axis_travels():
    assert str(turn_of(3)) == "a turn of axis 3" and turn_of(3).unit_beside("m") == "rad"
    assert str(turn_of(3, sliding=True)) == "a travel of axis 3"
    assert turn_of(3, sliding=True).unit_beside("rad") == "m"


def touched_plates(nominal: Robot, seed: int) -> dict[str, np.ndarray]:
    """Four seats of each of two plates, 50 mm apart, touched ten times each; angles are read with noise."""
    random = np.random.default_rng(seed)  # arm, touches and noise
    true = replace(deviated(nominal, 1.0, random, frames=False), base=Placement(),
                   tool=Placement(position=(0.03, 0.01, 0.05)))
    place = lambda q: np.array(true.fk(q).position)
    rows = []
    for plate in (0, 1):
        height = place(np.array([0.3, 0.5, 0.1 + 0.05 * plate, 0.0]))[2]
        for seat in range(4):
            at = np.array([0.35 + 0.1 * (seat % 2), -0.1 + 0.3 * plate + 0.1 * (seat // 2), height])
            touches = 0
            while touches < 10:
                turned = random.uniform(-2.5, 2.5)
                start = [random.uniform(-2.0, 2.0), 1.2 * random.choice([-1.0, 1.0]), 0.1]
                found = least_squares(lambda x: place(np.array([*x, turned])) - at, start, xtol=1e-14,
                                      ftol=1e-14)
                if found.cost < 1e-16 and np.abs(found.x[:2]).max() < 2.5:
                    rows.append([plate + 1, seat, *(np.array([*found.x, turned])
                                                    + _READINGS * random.normal(size=4))])
                    touches += 1
    names = ("session", "socket", "q_1_rad", "q_2_rad", "q_3_m", "q_4_rad")
    return dict(zip(names, np.array(rows).T))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_a_quill_above_plates_is_accused_of_nothing(seed, tmp_path):
    """Its readings miss the height of a plate by their own noise, which they follow without a rest: with bins
    and waves of single readings six of seeds 0 to 7, the first eight and all that were tried, were
    `unexplained` (0, 1, 2, 3, 5, 7); none is since."""
    nominal = scara()
    (tmp_path / "fixture.toml").write_text(_FIXTURE)
    found = ea.diagnose(nominal, touched_plates(nominal, seed), fixture=tmp_path / "fixture.toml")
    assert found.json["verdict"] == "no_undeclared_effect"
