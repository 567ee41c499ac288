"""Bits about a cause: against the information itself by simulation, and its limits."""

import numpy as np
import pytest

from exactarm.diagnose.cause_information import Field, Hypothesis, chosen_for


def field(apart, p=(0.5, 0.5), spread=0.0):
    size = spread * np.eye(2) + 1e-9 * np.eye(2)
    return Field((Hypothesis(p[0], np.array([0.0, 0.0]), size),
                  Hypothesis(p[1], np.array([apart, 0.0]), size)))


ROW = np.array([[[1.0, 0.0]]])  # one row that sees the first parameter
BLIND = np.array([[[0.0, 1.0]]])


def bits_of(one, rows):
    """(C,) bits of experiments (C, r, P)."""
    return one.seen_in(rows.reshape(-1, 2)).bits(np.arange(rows[..., 0].size).reshape(rows.shape[:2]))


def simulated(apart, p, count=400_000):
    """Mutual information in bits between the cause and one reading of unit noise."""
    rng = np.random.default_rng(0)
    cause = rng.uniform(size=count) < p[1]
    reading = rng.normal(size=count) + apart * cause
    weights = np.stack([p[0] * np.exp(-0.5 * reading**2), p[1] * np.exp(-0.5 * (reading - apart) ** 2)])
    posterior = weights / weights.sum(axis=0)
    left = -np.mean(np.sum(posterior * np.log2(posterior + 1e-300), axis=0))
    return -sum(each * np.log2(each) for each in p) - left


@pytest.mark.parametrize("apart", [0.3, 1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("p", [(0.5, 0.5), (0.9, 0.1)])
def test_a_lower_bound_that_is_not_far_below(apart, p):
    bits = bits_of(field(apart, p), ROW)[0]
    truth = simulated(apart, p)
    assert 0.45 * truth - 1e-3 <= bits <= truth + 2e-3


@pytest.mark.parametrize("apart", [0.5, 2.0, 5.0])
def test_simulated_bits_are_the_information(apart):
    assert field(apart).simulated_bits(ROW[0], np.random.default_rng(1),
                                       20_000) == pytest.approx(simulated(apart, (0.5, 0.5)), abs=0.01)


def test_blind_rows_tell_nothing_and_far_causes_all():
    bits = bits_of(field(30.0), np.concatenate([ROW, BLIND]))
    assert bits == pytest.approx([1.0, 0.0], abs=1e-6)


def test_what_is_uncertain_in_either_cause_is_no_evidence():
    assert bits_of(field(3.0, spread=100.0), ROW)[0] < 0.02 < 0.5 < bits_of(field(3.0), ROW)[0]


def test_a_row_twice_tells_as_much_as_one_of_less_noise():
    one, two = bits_of(field(1.0), ROW)[0], bits_of(field(1.0), np.repeat(ROW, 2, axis=1))[0]
    assert one < two == pytest.approx(bits_of(field(np.sqrt(2.0)), ROW)[0])


def test_the_telling_row_is_chosen_until_enough_is_known():
    chosen, bits = chosen_for([field(2.0)], [np.concatenate([BLIND, ROW])], 20, 0.9)
    assert set(chosen) == {1} and bits[-1] >= 0.9 > bits[-2] and np.all(np.diff(bits) > 0.0)


def test_bits_of_two_places_add_up():
    _, one = chosen_for([field(2.0)], [ROW], 1, 1.0)
    _, both = chosen_for([field(2.0), field(2.0)], [ROW, ROW], 1, 1.0)
    assert both[0] == pytest.approx(2.0 * one[0])
