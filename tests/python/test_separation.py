"""Separation of two explanations: against the distance that a least-squares fit of the rival really leaves."""

import numpy as np

from exactarm.identify.criterion import information_of
from exactarm.identify.separation import separating_set, separation_of


def sine_blocks(x):
    """Shared model a + b x, rival c sin(x); the truth differs by a signal that only large x tells from the rival."""
    return np.stack([np.ones_like(x), x, np.sin(x), 3.0 * np.tanh(x)], axis=-1)[:, None, :]


def left_by_the_rival(x):
    blocks = sine_blocks(x)[:, 0]
    columns, signal = blocks[:, :-1], blocks[:, -1]
    return np.linalg.norm(signal - columns @ np.linalg.lstsq(columns, signal, rcond=None)[0])


def test_distances_are_those_of_a_fit():
    old, pool = np.linspace(-0.5, 0.5, 9), np.linspace(-3.0, 3.0, 201)
    result = separating_set(sine_blocks(pool), information_of(sine_blocks(old)), 4, np.random.default_rng(0))
    assert np.isclose(result.before, left_by_the_rival(old), rtol=1e-2, atol=2e-4)
    together = np.concatenate([old, pool[result.chosen]])
    assert np.isclose(separation_of(information_of(sine_blocks(together))), result.after, rtol=1e-3)
    assert np.isclose(result.after, left_by_the_rival(together), rtol=1e-3)


def test_chosen_experiments_separate_better_than_random_ones():
    old, pool = np.linspace(-0.5, 0.5, 9), np.linspace(-3.0, 3.0, 201)
    result = separating_set(sine_blocks(pool), information_of(sine_blocks(old)), 4, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    best = max(left_by_the_rival(np.concatenate([old, rng.choice(pool, 4)])) for _ in range(500))
    assert result.after >= best and result.after > 3.0 * result.before


def test_is_deterministic():
    pool = np.linspace(-3.0, 3.0, 101)
    known = information_of(sine_blocks(np.linspace(-0.5, 0.5, 9)))
    one, other = (separating_set(sine_blocks(pool), known, 3, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one.chosen, other.chosen)
