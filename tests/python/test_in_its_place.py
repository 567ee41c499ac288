"""The set of an effect that was found step by step: itself and its rivals, never more than one in all."""

from dataclasses import replace

import pytest

from exactarm.diagnose.scan import Candidate
from exactarm.diagnose.selected import Accepted
from exactarm.effects.backlash import Backlash
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.joint_coupling import JointCoupling

OWN, OTHER, THIRD = GearRatio(2, (1e-4,)), Backlash(2, (1e-4, 0.0)), JointCoupling(3, (2.0, 1e-4))


def accepted(probability, *rivals, credible=()):
    """rivals: (effect, nats behind)."""
    found = tuple(Candidate(effect, 1.0, 1, 1, 20.0 - behind) for effect, behind in rivals)
    return Accepted(OWN, 20.0, probability, found, 0, credible)


@pytest.mark.parametrize("probability, rivals, members", [
    (1.0, (), {"gear_ratio": 1.0}),
    (0.97, ((OTHER, 3.5),), {"gear_ratio": 0.97}),
    (0.6, ((OTHER, 1.0), (THIRD, 9.0)), {"gear_ratio": 0.6, "backlash": 0.6 * 0.3679}),
    (0.6, ((OTHER, 0.0),), {"gear_ratio": 0.6, "backlash": 0.4}),  # no more than is left
    (0.6, ((GearRatio(2, (2e-4,)), 0.0),), {"gear_ratio": 0.6}),  # another form of it is no rival
])
def test_rivals_share_what_is_left_by_their_evidence(probability, rivals, members):
    found = accepted(probability, *rivals).in_its_place()
    assert {name: sure for name, _, sure in found} == pytest.approx(members, abs=1e-4)
    assert sum(sure for *_, sure in found) <= 1.0 + 1e-12
    assert found[0][:2] == ("gear_ratio", 2)


@pytest.mark.parametrize("share, members", [
    (0.6, {"gear_ratio": 0.54, "unknown": 0.4, "backlash": 0.06}),
    (0.3, {"unknown": 0.7, "gear_ratio": 0.27}),
])
def test_what_the_library_lacks_is_in_the_set(share, members):
    """It stood beside probabilities of 0.59 as sets of 0.92 (KR300), without what takes the rest."""
    found = replace(accepted(0.9, (OTHER, 1.0)), share=share).in_its_place()
    assert {name: sure for name, _, sure in found} == pytest.approx(members, abs=1e-4)


def test_what_the_posterior_says_stands():
    known = (("backlash", 1, 0.96),)
    assert accepted(0.6, (OTHER, 0.0), credible=known).in_its_place() == known
