"""Single readings that belong to no path, and what is none of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm.data.split import DEFAULT_SEED
from exactarm.diagnose.noise import noise_floor
from exactarm.identify.wild_rows import single_wild, single_wild_rows, wild_elsewhere_line

ROWS = np.arange(1000)


def errors():
    return np.abs(1.0 + 0.2 * np.sin(ROWS / 30.0))


def test_single_readings_are_found():
    error = errors()
    error[[5, 300, 301, 302]] = 20.0
    assert np.flatnonzero(single_wild_rows(error, [ROWS])).tolist() == [5, 300, 301, 302]


def test_what_stays_longer_is_the_models():
    error = errors()
    error[300:304] = 20.0
    assert not single_wild_rows(error, [ROWS]).any()


def test_many_are_no_exceptions():
    error = errors()
    error[::40] = 20.0
    assert not single_wild_rows(error, [ROWS]).any()


def test_rows_of_two_runs_are_no_neighbours():
    error = errors()
    error[498:502] = 20.0
    assert single_wild_rows(error, [ROWS[:500], ROWS[500:]]).sum() == 4


def test_a_wild_row_that_was_not_fitted_is_named_with_what_the_others_miss_by():
    error = np.full(24, 5e-5)
    error[[3, 7]] = [np.nan, 1e-2]
    assert wild_elsewhere_line(error, "row {}".format) == (
        "row 7 misses by 10 mm, more than 8 times the median of the 23 rows that were not fitted; the others "
        "miss by 0.05 mm (RMS): a wrong reading?")
    # to what the fit knows of these rows
    assert "row 7" in wild_elsewhere_line(error, "row {}".format, np.full(error.size, 1e-3))
    assert wild_elsewhere_line(error, "row {}".format, np.full(error.size, 2e-3)) is None
    error[8:12] = 2e-2
    several = wild_elsewhere_line(error, "row {}".format)
    assert several.startswith("row 8, row 9, row 10, ... miss by up to 20 mm")
    assert wild_elsewhere_line(error[:3], "row {}".format) is None
    assert wild_elsewhere_line(np.zeros(0), "row {}".format) is None
    assert wild_elsewhere_line(1e-7 * error, "row {}".format) is None  # exact data


@pytest.mark.slow
def test_a_gross_validation_row_is_no_noise_and_no_lack_of_poses():
    data = ea.simulate("ur10", count=60, noise=3e-5, counts=0, seed=1).data  # seeds 2 to 6 say the same
    position, row = data.position.copy(), int(np.flatnonzero(~data.split(DEFAULT_SEED))[5])
    position[row, 0] += 1e-2
    wrong = replace(data, position=position)
    for result in (ea.diagnose("ur10", wrong), ea.calibrate("ur10", wrong)):
        told = [line for line in result.json["warnings"] if "misses by" in line]
        assert len(told) == 1 and told[0].startswith(wrong.place_of(row))
    text = " ".join(ea.diagnose("ur10", wrong).summary().split())
    assert "Look first at what the warning names" in text and "times as large as on the fitted" not in text
    assert "are noise is what the fit says" not in text


def test_a_single_wild_row_is_no_noise_of_the_others():
    """One row of 80 some twenty times as far off: the floor is that of the others, and says so."""
    random = np.random.default_rng(0)  # seeds 0 to 7 give the same
    residual = 1e-4 * random.normal(size=(80, 3))
    residual[7] = 4e-3, 0.0, 0.0
    alone = np.delete(residual, 7, axis=0)
    rms = lambda rows: float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))
    problem = SimpleNamespace(kind="poses", error_of_unit_noise=lambda fitted: rms(fitted.residual),
                              repeat_noise=lambda fitted: None, reading_noise=lambda fitted: None,
                              data=SimpleNamespace(session=np.ones(80)))
    fitted = SimpleNamespace(residual=residual, sigma=np.ones(3), weight=np.ones(80), noise=None,
                             view=SimpleNamespace(q=random.uniform(-1.0, 1.0, (80, 6))))
    floor = noise_floor(problem, fitted)
    assert floor.value == pytest.approx(rms(alone)) and not floor.measured
    assert floor.source.endswith("(an upper bound); without 1 row far beside the others")
    error = np.linalg.norm(residual, axis=1)
    line = wild_elsewhere_line(error, lambda row: f"row {row + 1}", which="fitted rows")
    assert line.startswith("row 8 misses by ") and "median of the 80 fitted rows" in line
    assert np.flatnonzero(single_wild(error)).tolist() == [7] and not single_wild(error[:20]).any()
