"""Rivals of what was found: rows that were not fitted may speak for one of them."""


import numpy as np
import pytest

from exactarm.diagnose.alternatives import Alternative, in_words, left_by, preferred_elsewhere
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.hysteresis import Hysteresis

FOUND = Hysteresis(2, (1e-4, 1e-3))
RIVAL = GearHarmonics(2, (101.0, 1e-3, 0.0))


def rival(gain: float, effect=RIVAL) -> Alternative:
    return Alternative(effect, FOUND.label, 1e-4, 0.1, False, gain)


@pytest.mark.parametrize("gains, speaks", [((), False), ((2.9,), False), ((3.1,), True), ((3.1, -5.0), False),
                                           ((3.8, -5.0), True)])
def test_they_speak_from_twenty_times_the_density_for_each_rival_on(gains, speaks):
    """log 20 = 3.00, log 40 = 3.69."""
    said = in_words(preferred_elsewhere([rival(gain) for gain in gains]), [FOUND])
    assert (f"{RIVAL.title} in the place of {FOUND.title}" in said) == speaks == bool(said)


def test_another_form_of_the_same_cause_is_no_rival():
    assert preferred_elsewhere([rival(50.0, FOUND)]) is None and in_words(None, [FOUND]) == ""


def test_they_take_from_the_odds_against_the_rival_what_they_give_it():
    """A rival of 0.1 beside 0.9 by the fitted rows, and 4 nats by the others: 0.9 / (0.9 + 0.1 exp(4))."""
    spoken = preferred_elsewhere([rival(4.0), rival(-2.0)])
    assert left_by(spoken, FOUND.label, 0.9) == pytest.approx(0.9 / (0.9 + 0.1 * np.exp(4.0)))
    assert left_by(spoken, "another", 0.9) == left_by(None, FOUND.label, 0.9) == 0.9
