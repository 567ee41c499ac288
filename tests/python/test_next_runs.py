"""What is proposed where no run of one axis tells two causes apart."""

import pytest

from exactarm.diagnose.next_runs import _instead
from exactarm.effects.backlash import Backlash
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.gyro_scale import GyroScale
from exactarm.effects.hysteresis import Hysteresis


@pytest.mark.parametrize("one, other, said", [
    (GyroScale, GearRatio, "another axis with the same sensor"),  # a payload parts nothing
    (Backlash, Hysteresis, "another known payload"),
    (Hysteresis, GearHarmonics, "a count of the teeth, or an encoder")])
def test_the_proposal_follows_what_the_causes_hang_on(one, other, said):
    made = [cls(None if cls is GyroScale else 3, (0.0,)) for cls in (one, other)]
    assert said in _instead(*made) and said in _instead(*made[::-1])
