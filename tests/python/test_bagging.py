"""Bagged probabilities: a lead that every piece of a record shares counts, one that hangs on a few does
not."""

import numpy as np
import pytest

from exactarm.diagnose.bagging import bagged, squares_by_piece

COUNT, PIECES = 2000.0, 40
NONE = np.zeros(2)


def squares(falls):
    """(2, B) of two models, the first better by `falls` (B,), in units of the noise."""
    noise = np.full(PIECES, COUNT / PIECES)
    return np.stack([noise, noise + falls])


def lead(of):
    """Log evidence of two models with such square sums, without a price."""
    return -0.5 * COUNT * np.log(of.sum(axis=1))


def test_a_lead_that_all_pieces_share_is_sure():
    even = squares(np.full(PIECES, 1.0))
    assert np.ptp(lead(even)) > 15.0 and bagged(lead(even), even, NONE, COUNT)[0] > 0.999


def test_a_lead_that_one_piece_gives_is_not_sure():
    single = squares(40.0 * (np.arange(PIECES) == 3))
    assert np.ptp(lead(single)) > 15.0
    # The share of draws that have this piece at all, 1 - (1 - 1/B)^B, and half of the others.
    missing = (1.0 - 1.0 / PIECES) ** PIECES
    assert bagged(lead(single), single, NONE, COUNT)[0] == pytest.approx(1.0 - 0.5 * missing, abs=0.04)


def test_what_belongs_to_no_piece_is_in_every_draw():
    alike = squares(np.zeros(PIECES))
    kept = np.array([0.0, 40.0])
    evidence = -0.5 * COUNT * np.log(alike.sum(axis=1) + kept)
    assert bagged(evidence, alike, kept, COUNT)[0] > 0.999


def test_draws_are_the_same_for_the_same_data():
    some = squares(np.random.default_rng(1).normal(0.1, 1.0, PIECES))
    first, second = (bagged(lead(some), some, NONE, COUNT) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_rows_fall_into_their_pieces_and_priors_into_none():
    residual, pieces = np.arange(1.0, 9.0), np.array([0, 1, 0])
    by_piece, kept = squares_by_piece(residual, 6, pieces)
    np.testing.assert_allclose(by_piece, [1 + 4 + 25 + 36, 9 + 16])
    assert kept == 49 + 64
