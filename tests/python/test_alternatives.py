"""Rivals of what was found: rows that were not fitted may speak for one of them."""


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


def test_they_leave_the_effect_found_what_chance_makes_of_such_a_density():
    """Two rivals, 16.5 nats for one of them: 2 exp(-16.5) = 1.4e-7."""
    rivals = [rival(16.5), rival(-2.0)]
    spoken = preferred_elsewhere(rivals)
    assert left_by(spoken, FOUND.label, 0.9999, rivals) == pytest.approx(1.365e-7, rel=0.01)
    assert left_by(spoken, "another", 0.9999, rivals) == left_by(None, FOUND.label, 0.9999, rivals) == 0.9999
