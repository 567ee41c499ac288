"""Rivals of what was found: rows that were not fitted may speak for one of them."""


import pytest

from exactarm.diagnose.alternatives import Alternative, preferred_elsewhere
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
    said = preferred_elsewhere([rival(gain) for gain in gains], [FOUND])
    assert (f"{RIVAL.title} in the place of {FOUND.title}" in said) == speaks == bool(said)


def test_another_form_of_the_same_cause_is_no_rival():
    assert preferred_elsewhere([rival(50.0, FOUND)], [FOUND]) == ""
