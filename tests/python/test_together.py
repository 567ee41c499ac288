"""Rows that lie together and err the same way are told from rows that are wrong by themselves."""

import numpy as np
import pytest

from exactarm.numerics.together import BY_CHANCE, lie_together

SETS = 400


@pytest.mark.slow
@pytest.mark.parametrize("alike", [False, True])
def test_wrong_rows_here_and_there_pass_for_a_structure_as_rarely_as_stated(alike):
    """Each in its own way, or all in one, as of a beam that is broken: what counts is where they are."""
    rng, alarms = np.random.default_rng(17), 0
    for _ in range(SETS):
        rows = int(rng.integers(40, 300))
        wrong = np.zeros(rows, bool)
        wrong[rng.choice(rows, int(rng.integers(2, 9)), replace=False)] = True
        residual = 1e-4 * rng.standard_normal((rows, 3))
        push = np.array([0.6, 0.0, 0.8]) if alike else rng.standard_normal((wrong.sum(), 3))
        residual[wrong] += 2e-3 * push
        alarms += lie_together(residual, wrong, rng.uniform(-1.0, 1.0, (rows, 3)))
    expected = BY_CHANCE * SETS
    assert alarms <= expected + 3.0 * np.sqrt(expected)


def test_the_unit_of_a_place_does_not_matter():
    rng = np.random.default_rng(5)
    place, residual = rng.uniform(-1.0, 1.0, (120, 3)), 1e-4 * rng.standard_normal((120, 3))
    wrong = np.zeros(120, bool)
    wrong[np.argsort(np.linalg.norm(place - 1.0, axis=1))[:6]] = True
    residual[wrong] += 2e-3
    assert lie_together(residual, wrong, place) and lie_together(1e3 * residual, wrong, 1e3 * place)
    assert not lie_together(residual, wrong, place[rng.permutation(120)])
