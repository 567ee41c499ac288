"""Times that are written with too few digits are refused as such, whatever the rows hold beside them; stops
that are read more than once within a second are poses."""

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

RATE_HZ, ROWS = 250.0, 2500


@pytest.fixture(scope="module")
def ur10():
    return load_robot("ur10")


def written(path, q, time, digits):
    columns = [f"q_{i + 1}_rad" for i in range(6)] + ["time_s", "x_m", "y_m", "z_m"]
    place = np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0]), q[:, 1]])
    rows = [",".join([*(f"{v:.6f}" for v in angles), f"{t:.{digits}f}", *(f"{v:.6f}" for v in point)])
            for angles, t, point in zip(q, time, place)]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def swing():
    time = np.arange(ROWS) / RATE_HZ
    return time, 0.5 * np.sin(time[:, None] * np.arange(1.0, 7.0) + np.arange(6.0))


@pytest.mark.parametrize("digits, share, row, first, rows", [
    (0, 1.0, 2, "0", 126), (1, 1.0, 2, "0", 13), (2, 1.0, 2, "0", 2), (2, 1.5, 3, "0.01", 2)])
def test_a_motion_whose_times_have_too_few_digits(ur10, swing, tmp_path, digits, share, row, first, rows):
    """share: of the time between two samples; at 1.5, every third shares its time with the one before."""
    time, q = swing
    with pytest.raises(InputError) as told:
        read_dataset(written(tmp_path / "log.csv", q, share * time, digits), ur10)
    assert str(told.value).endswith(
        f"log.csv, row {row}, column time_s: time {first} s stands in {rows} rows, as others do; expected "
        "the time of each sample, with all its digits")


def test_with_their_digits_they_are_tracked(ur10, swing, tmp_path):
    time, q = swing
    assert read_dataset(written(tmp_path / "log.csv", q, time, 3), ur10).kind == "tracked_motion"


@pytest.mark.parametrize("time", [np.repeat(np.arange(30.0), 5), np.zeros(150), 3600.0 * np.arange(150)])
def test_stops_are_poses(ur10, tmp_path, time):
    """Five readings of each within a second; all of one day; one an hour."""
    random = np.random.default_rng(3)
    q = np.repeat(random.uniform(-1.0, 1.0, (30, 6)), 5, axis=0) + 1e-5 * random.normal(size=(150, 6))
    assert read_dataset(written(tmp_path / "stops.csv", q, time, 0), ur10).kind == "poses"
