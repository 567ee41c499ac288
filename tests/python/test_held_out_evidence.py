"""Rows that were not fitted judge what was found: they may object."""

from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.dossier import Dossier, Follows
from exactarm.diagnose.held_out_evidence import (
    AGAINST,
    allowed,
    carried_over,
    held_out_gains,
    log_density,
    with_held_out,
)
from exactarm.diagnose.signal import Quantity, Signal, turn_of
from exactarm.diagnose.verdict import (
    EXPLAINED,
    NOTHING,
    UNEXPLAINED,
    rises,
    sentence_of,
    verdict_of_causes,
)
from exactarm.identify.statistics import summarise
from exactarm.noise.estimate import normal_noise


def normal(scale, seed, count=400):
    return scale * np.abs(np.random.default_rng(seed).standard_normal(count))


def fit(identification, validation):
    return {"identification": identification, "validation": validation}


def test_the_gain_of_a_normal_law_is_that_of_the_square_sums():
    one, other = normal(1.0, 1), normal(0.8, 2)
    gains = held_out_gains([fit(one, one), fit(other, other)], 1, 0.5)
    expected = 0.25 * len(one) * np.log(np.sum(one**2) / np.sum(other**2))
    assert gains == pytest.approx((expected,), rel=1e-9) and expected > 10.0


def test_an_error_that_rises_on_held_out_rows_speaks_against_its_round_alone():
    first, better, overfitted = normal(1.0, 1), normal(0.7, 1), normal(0.75, 1)
    gains = held_out_gains([fit(first, first), fit(better, better), fit(0.8 * better, overfitted)], 1, 1.0)
    assert gains[0] > 0.0 > gains[1]


def test_wrong_rows_decide_nothing():
    """A few gross rows that are the worse with the effect, while all others are better with it."""
    before, after = normal(1.0, 3), 0.8 * normal(1.0, 3)
    before[:4], after[:4] = 40.0, 45.0
    assert np.mean(after**2) > np.mean(before**2)
    assert held_out_gains([fit(before, before), fit(after, after)], 1, 1.0)[0] > 10.0


def test_the_density_of_three_numbers_is_that_of_three_normal_ones():
    vectors = np.random.default_rng(4).standard_normal((500, 3))
    variance = np.mean(vectors**2)
    expected = -0.5 * np.sum(np.log(2 * np.pi * variance) + vectors**2 / variance)
    assert log_density(np.linalg.norm(vectors, axis=1), 3, np.inf) == pytest.approx(expected)
    assert log_density(np.linalg.norm(vectors, axis=1), 3, 1e7) == pytest.approx(expected, rel=1e-5)


def test_no_probability_outlives_rows_that_speak_against_it():
    assert allowed(0.999, AGAINST + 0.01) == 0.999
    assert allowed(0.999, AGAINST - 0.01) < 0.05
    assert allowed(0.01, AGAINST - 0.01) == 0.01


def test_a_cause_that_held_out_rows_do_not_show_does_not_stand():
    assert carried_over(1.0, 1.0, 0.01) == 1.0 and carried_over(0.9, 0.8, 0.01) == 0.9
    assert carried_over(1.0, 0.0, 0.01) < 0.05 and carried_over(1.0, -1.0, 0.01) < 0.001
    assert carried_over(1.0, 0.25, 0.01) < 0.5 < carried_over(1.0, 0.5, 0.01)
    # rows that cannot feel it say nothing
    assert carried_over(0.99, 0.0, np.inf) == 0.99
    assert carried_over(0.99, -3.0, 1e4) == pytest.approx(0.99, abs=1e-3)


def test_held_out_rows_multiply_the_odds_against_no_cause():
    odds = lambda p: p / (1.0 - p)
    for gain in (-4.0, 0.0, 3.0):
        assert odds(with_held_out(0.8, 1.0, gain)) == pytest.approx(4.0 * np.exp(gain))
    # what is against it is a rival, which gains as much
    assert with_held_out(0.8, 0.0, -4.0) == pytest.approx(0.8)
    assert 0.0 <= with_held_out(1.0 - 1e-9, 1.0, -1e6) < 1e-9 < with_held_out(1.0, 1.0, -1e6) <= 1.0


def test_an_error_that_rises_is_told_from_one_that_does_not_change():
    summary = lambda rms: {"validation": summarise(np.full(4, rms))}
    assert rises(summary(1.0), summary(1.01)) and not rises(summary(1.0), summary(1.004))
    assert not rises({"validation": summarise(np.zeros(0))}, {"validation": summarise(np.zeros(0))})


@pytest.mark.parametrize("nothing, verdict", [(0.4, NOTHING), (0.01, UNEXPLAINED)])
def test_without_a_name_nothing_is_missing_unless_the_posterior_excludes_it(nothing, verdict):
    causes = SimpleNamespace(probability_something_else=0.0, places=(), probability_nothing=nothing,
                             noise=normal_noise(np.ones((4, 3))))
    after = {"validation": summarise(np.ones(4))}
    assert verdict_of_causes(causes, after, SimpleNamespace(measured=False, value=1.0), 1.0, False) == verdict


@pytest.mark.parametrize("structure, verdict", [(False, EXPLAINED), (True, UNEXPLAINED)])
def test_what_follows_the_posture_after_all_causes_is_not_explained(structure, verdict):
    causes = SimpleNamespace(probability_something_else=0.03, places=(None,), probability_nothing=0.0,
                             noise=normal_noise(np.ones((4, 3))))
    after = {"validation": summarise(np.ones(4))}
    floor = SimpleNamespace(measured=False, value=1.0)
    assert verdict_of_causes(causes, after, floor, 1.0, structure) == verdict


def test_a_structure_of_the_posture_is_told_from_one_of_time():
    """What wanders from row to row is noise that they share; where the arm stands comes again."""
    follows = lambda signal, p: Follows(signal, turn_of(2), 0.3, p)
    in_time = follows(Signal(Quantity.TIME), 1e-9), follows(Signal("temperature_degC"), 1e-9)
    assert Dossier(in_time, 0.9).structure and not Dossier(in_time, 0.9).of_posture
    for signal in (Signal(Quantity.ANGLE, 2), Signal(Quantity.LOAD, 3), Signal(Quantity.TWO_ANGLES)):
        assert Dossier((*in_time, follows(signal, 1e-9)), 0.9).of_posture
        assert not Dossier((*in_time, follows(signal, 2e-4)), 0.9).of_posture


def test_nothing_held_out_says_nothing():
    rows, none = normal(1.0, 1), np.zeros(0)
    assert held_out_gains([fit(rows, none), fit(0.5 * rows, none)], 1, 1.0) == (0.0,)
    assert held_out_gains([fit(rows, rows)], 1, 1.0) == ()


def test_the_sentence_says_that_rows_speak_against_it():
    finding = SimpleNamespace(effect=SimpleNamespace(title="backlash of axis 2"), probability=0.99,
                              likelier="")
    sets = {"identification": summarise(np.full(5, 1.0)), "validation": summarise(np.full(5, 1.0))}
    said = [sentence_of(EXPLAINED, [finding], [], sets, sets, None, 1.0, (), gain) for gain in (-2.0, -4.0)]
    assert ["speak against it" in each for each in said] == [False, True]  # a nat or two are chance


def test_an_effect_that_held_out_rows_refute_is_not_what_the_model_lacks():
    right, wrong = (SimpleNamespace(effect=SimpleNamespace(title=title), probability=p, likelier="")
                    for title, p in (("backlash of axis 2", 0.99), ("gear ratio of axis 5", 0.0)))
    sets = {"identification": summarise(np.full(5, 1.0)), "validation": summarise(np.full(5, 1.0))}
    both, alone = (sentence_of(EXPLAINED, found, [], sets, sets, None, 1.0)
                   for found in ([right, wrong], [wrong]))
    assert both.startswith("The model lacks backlash of axis 2; with it the")
    assert both.endswith("holds gear ratio of axis 5, less likely than not.")
    assert alone.startswith("The fitted rows ask for gear ratio of axis 5;") and "speak against it" in alone


def test_what_left_the_model_is_no_part_of_what_its_error_is_said_of():
    effects = (SimpleNamespace(title=title) for title in ("backlash of axis 2", "gear ratio of axis 5"))
    held, gone = (SimpleNamespace(effect=each, probability=0.1, likelier="it wobbles", contradicted=True)
                  for each in effects)
    sets = {"identification": summarise(np.full(5, 1.0)), "validation": summarise(np.full(5, 1.0))}
    said = lambda found, dropped: sentence_of(EXPLAINED, found, [], sets, sets, None, 1.0, dropped=dropped)
    assert said([held], [gone]).startswith("The fitted rows ask for backlash of axis 2; with it the")
    also = "also ask for gear ratio of axis 5, which rows that were not fitted contradict."
    assert also in said([held], [gone])
    assert said([], [gone]).startswith("The fitted rows ask for gear ratio of axis 5; with it the")
    assert "also ask" not in said([], [gone])


def test_of_effects_that_are_right_held_out_rows_rarely_speak_against():
    """Sizes from 100 rows, 40 others judge; the effect is as small as its own error: the worst case."""
    random, against = np.random.default_rng(5), 0
    for _ in range(400):
        signal = random.normal(size=140)
        measured = 0.1 * signal + random.normal(size=140)
        size = np.sum(signal[:100] * measured[:100]) / np.sum(signal[:100] ** 2)
        without, other = ({"identification": each[:100], "validation": each[100:]}
                          for each in (np.abs(measured), np.abs(measured - size * signal)))
        against += held_out_gains([without, other], 1, 1.0)[0] < AGAINST
    assert against <= 0.05 * 400
