"""Evidence by the scatter of the rows: noisy rows earn a candidate nothing, and a true cause loses nothing
that matters."""

from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.cluster_robust import robust_evidence
from exactarm.diagnose.scan import log_evidence

ROWS = 300


def nothing_free(residual):
    return SimpleNamespace(free_residual=residual, data_numbers=residual.size,
                           cleared=lambda columns: columns)


def evidence_of(column, residual, tried=500.0):
    """Evidence as in the scan and by the scatter of the rows, of one column (3 N,) on a white picture without
    a basis."""
    gain = float((column @ residual) ** 2 / (column @ column))
    plain = log_evidence(float(residual @ residual), gain, residual.size, 1, tried)
    fitted = nothing_free(residual)
    candidate = SimpleNamespace(evidence=plain, gain=gain)
    return plain, robust_evidence(fitted, candidate, column[:, None], np.arange(ROWS), float(residual.size))


def along_one_direction(values):
    """(3 N,) with `values` (N,) along z and nothing beside."""
    return np.column_stack([np.zeros((len(values), 2)), values]).ravel()


def test_structure_along_one_direction_earns_no_other_wave_its_place():
    """All of the residual lies along z, the wave too: the scan takes the mean of all directions for the
    noise."""
    rng = np.random.default_rng(4)
    angle = rng.uniform(-3.0, 3.0, ROWS)
    false = [
        evidence_of(along_one_direction(np.cos(order * angle)), along_one_direction(rng.normal(size=ROWS)))
        for order in range(3, 103)
    ]
    plain, robust = np.array(false).T
    assert np.all(robust <= plain)
    # A wave that is not there: sixfold the evidence's mean pull in the scan, one degree of freedom by the
    # rows.
    offset = np.log(500.0) + 0.5 * np.log(3 * ROWS)
    assert np.mean(2.0 * (plain + offset)) > 2.0
    assert np.mean(2.0 * (robust + offset)) == pytest.approx(1.0, abs=0.6)


def test_true_cause_keeps_its_evidence():
    rng = np.random.default_rng(5)
    wave = along_one_direction(np.cos(7.0 * rng.uniform(-3.0, 3.0, ROWS)))
    plain, robust = evidence_of(wave, 3.0 * wave + rng.normal(size=3 * ROWS))
    assert robust == plain > 100.0


def test_too_few_groups_say_nothing():
    rng = np.random.default_rng(6)
    column, residual = rng.normal(size=(2, 12))
    fitted = nothing_free(residual)
    candidate = SimpleNamespace(evidence=7.0, gain=1.0)
    assert robust_evidence(fitted, candidate, column[:, None], np.arange(4), 12.0) == 7.0
