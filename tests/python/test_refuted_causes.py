"""Causes that only the fitted rows ask for: where held-out rows refute them, nothing need be missing."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.posterior import Causes, Place
from exactarm.diagnose.verdict import NOTHING, without_refuted
from exactarm.effects.gear_ratio import GearRatio
from exactarm.robot_file import load_robot


def causes(nothing, *names):
    places = tuple(Place(name, GearRatio(1, (1e-4,)), 0.7, 1.0, (), 0, 0.9) for name in names)
    return Causes(("declared", "with them"), places, (), nothing, 0.1, None, None, 0.0, 0.0)


@pytest.mark.parametrize("nothing, sure, gain, calmed", [
    (0.3, (1e-6,), -4.0, True), (0.3, (1e-6, 0.4), -4.0, True), (0.3, (1e-6, 0.6), -4.0, False),
    (0.01, (1e-6,), -1.0, False), (0.01, (1e-6,), -2.0, True), (1e-6, (1e-6,), -9.0, False),
    (0.01, (1e-6,), 9.0, False)])
def test_all_must_be_refuted_and_nothing_be_likely_by_all_rows(nothing, sure, gain, calmed):
    given = causes(nothing, *"ab"[: len(sure)])
    expected = replace(given, fits=("declared",), places=(), probability_nothing=0.9) if calmed else None
    assert without_refuted(given, sure, gain) == expected


@pytest.mark.parametrize("given", [None, causes(1.0)])
def test_without_a_name_nothing_is_withdrawn(given):
    assert without_refuted(given, (), 0.0) is None


@pytest.mark.slow
def test_a_chance_of_the_fitted_rows_is_told_and_not_called_unexplained():
    """Clean poses visited from two set-ups. Of seeds 400 to 439 this one was `unexplained`, the others were
    right: the fitted rows give a bending link 0.66 and no cause 0.30, the others take 14 nats from it."""
    made = ea.simulate("ur10", count=60, visits=3, noise=3e-5, counts=0, seed=407).data
    other = np.flatnonzero(np.arange(len(made)) % 2)
    turned = np.array([[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]])
    position, session = made.position.copy(), made.session.copy()
    position[other], session[other] = position[other] @ turned.T + [0.3, -0.2, 1.0], session.max() + 1
    result = diagnose(load_robot("ur10"), replace(made, position=position, session=session))
    assert result.verdict == NOTHING and not result.findings and len(result.selection.fits) == 1
    assert result.errors_after is result.errors_before
    # 0.87 before wobbles of axes and a tool that sags were among what could act, and shared its prior
    assert result.causes.probability_nothing == pytest.approx(0.88, abs=0.01)
    assert "(The fitted rows alone asked for link compliance of axis 3; rows that" in result.sentence
