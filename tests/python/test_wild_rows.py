"""Single readings that belong to no path, and what is none of them."""

import numpy as np

from exactarm.identify.wild_rows import single_wild_rows

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
