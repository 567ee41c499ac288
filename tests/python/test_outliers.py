"""Outliers: wrong rows that stand alone are left out; wrong rows that lie together are a structure, not
outliers."""

from types import SimpleNamespace

import numpy as np

from exactarm.effects.outliers import Outliers

NOISE = 1e-4


def view(predicted: np.ndarray, residual: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(
        measured=predicted, data=SimpleNamespace(position=predicted + residual),
        signals={"measured": predicted}
    )


def noise(rows: int, seed: int) -> tuple[np.random.Generator, np.ndarray]:
    random = np.random.default_rng(seed)
    return random, NOISE * random.standard_normal((rows, 3))


def test_single_wrong_rows_are_found():
    random, residual = noise(150, 1)
    wrong = random.choice(150, 8, replace=False)
    push = random.standard_normal((8, 3))
    residual[wrong] += 30 * NOISE * push / np.linalg.norm(push, axis=1)[:, None]
    seen = view(random.uniform(-1.0, 1.0, (150, 3)), residual)
    (found,) = Outliers.candidates(None, seen)
    assert set(np.flatnonzero(~found.keep(seen))) == set(wrong)


def test_repeated_visits_are_not_neighbours_of_themselves():
    random, residual = noise(180, 2)
    wrong = random.choice(180, 9, replace=False)
    residual[wrong] += 30 * NOISE
    poses = random.uniform(-1.0, 1.0, (60, 3))
    assert len(Outliers.candidates(None, view(np.tile(poses, (3, 1)), residual))) == 1


def test_neighbours_that_a_wrong_row_pulled_the_other_way_do_not_make_a_structure():
    random, residual = noise(120, 3)
    predicted = random.uniform(-1.0, 1.0, (120, 3))
    wrong = np.array([10, 40, 70, 100])
    push = 30 * NOISE * random.standard_normal((4, 3))
    predicted[wrong + 1] = predicted[wrong] + 1e-3
    residual[wrong] += push
    residual[wrong + 1] -= 0.4 * push
    assert len(Outliers.candidates(None, view(predicted, residual))) == 1


def test_a_corner_of_the_workspace_that_is_wrong_is_no_set_of_outliers():
    random, residual = noise(150, 4)
    predicted = random.uniform(-1.0, 1.0, (150, 3))
    corner = np.argsort(np.linalg.norm(predicted - 1.0, axis=1))[:12]
    residual[corner] += 15 * NOISE
    assert len(Outliers.candidates(None, view(predicted, residual))) == 0


def test_regions_that_gross_rows_pull_along_stay():
    random, residual = noise(300, 5)
    predicted = np.tile(random.uniform(-1.0, 1.0, (150, 3)), (2, 1))[random.permutation(300)]
    for row, push in ((40, 100 * NOISE), (150, -80 * NOISE)):
        near = np.exp(-np.sum((predicted - predicted[row]) ** 2, axis=1) / (2.0 * 0.5**2))[:, None]
        residual += 0.06 * push * near * np.array([0.6, 0.0, 0.8])  # the least-squares fit gives way
        residual[row] += push
    seen = view(predicted, residual)
    (found,) = Outliers.candidates(None, seen)
    assert set(np.flatnonzero(~found.keep(seen))) == {40, 150}
