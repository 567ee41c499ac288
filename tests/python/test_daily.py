"""Days of a check, as a report names them."""

import pytest

from exactarm.verify.daily import day_label


@pytest.mark.parametrize("day, label", [
    (1.0, "day 1"), (20260101.0, "day 20260101"), (202601011530.0, "day 202601011530"), (-3.0, "day -3"),
    (0.0, "day 0"), (1.5, "day 1.5"), (20260101.25, "day 20260101.25"),
])
def test_a_day_is_named_by_its_number_as_it_was_written(day, label):
    assert day_label(day) == label
