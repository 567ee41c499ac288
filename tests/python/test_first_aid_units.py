"""More usual mistakes in poses: angles in turns, lengths in inches, a file that changes its unit halfway;
and a target that is turned on its flange, which is none."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.identify.evaluate import evaluate_poses
from exactarm.identify.first_aid import first_aid
from test_first_aid import column, position, scaled, ur10  # noqa: F401

HALFWAY = 700  # of 1,495 rows
MISTAKES = {
    "turns as radians": (
        lambda d: column(d, "q", scaled(slice(None), 0.5 / np.pi)), "whole turns labelled as radians",
    ),
    "inches as millimetres": (
        lambda d: position(d, lambda p: p / 25.4), "an arm 25.4 times as large as the measured one",
    ),
    "halfway another unit": (
        lambda d: position(d, lambda p: np.where(np.arange(len(p))[:, None] > HALFWAY, 1e-3 * p, p)),
        "labelled as",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_poses_is_told(ur10, name):  # noqa: F811
    robot, data = ur10
    change, words = MISTAKES[name]
    found = first_aid(robot, change(data))
    assert found and words in found[0], found


def test_the_names_of_the_targets_axes_mean_nothing(ur10):  # noqa: F811
    """A target turned by half a turn on its flange is another tool frame, which the set-up fits."""
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    turned = replace(part, rotation=part.rotation @ np.diag([-1.0, -1.0, 1.0]))
    one, other = (evaluate_poses(robot, each).overall for each in (part, turned))
    assert other.rms == pytest.approx(one.rms, rel=1e-6)
