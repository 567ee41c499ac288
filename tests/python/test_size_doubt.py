"""A known length of the fixture that is wrong makes the whole arm larger, and that is said."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.declared import geometry_layout
from exactarm.identify.size_doubt import scale_doubt, size_doubts
from exactarm.numerics.regression import Fit
from exactarm.robot_file import load_robot
from test_closures import touched


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (1.1, True), (0.94, True)])
def test_a_distance_that_is_wrong_by_some_percent_is_doubted(factor, said):
    robot, data = touched("ur10", "socket", 6, count=15)
    wrong = tuple(replace(each, length=factor * each.length) for each in data.fixture.distances)
    fixture = replace(data.fixture, distances=wrong)
    result = calibrate_closures(robot.nominal, replace(data, fixture=fixture))
    assert result.fit.fit.converged
    assert any("all alike: is a known length" in line for line in result.warnings) == said


@pytest.mark.slow
def test_arms_that_are_right_are_doubted_once_in_ten_thousand():
    """Deviations of any size: 4,000 arms, seed 1; three or more would come once in a hundred such tests."""
    random, doubted = np.random.default_rng(1), 0
    layout: Layout = geometry_layout(load_robot("ur10"))
    drawing = {name: (value, p.plausible) for name, value, p in
               zip(layout.names, layout.values, layout.parameters)}
    count = layout.size
    for size in np.repeat([1e-4, 1e-3, 3e-3, 1e-2], 1000):
        values = layout.values + random.normal(0.0, size, count)
        fit = Fit.__new__(Fit)
        object.__setattr__(fit, "covariance", 1e-10 * np.eye(count))
        doubted += len(size_doubts(layout.at(values), fit, drawing)) > 0
    assert doubted <= 2


@pytest.mark.parametrize(("factor", "own", "said"), [
    (1.5e-3, 0.0, True), (1e-4, 0.0, False),  # of all lengths together
    (0.0, 2e-4, False),  # every length by itself
])
def test_a_factor_that_undoes_the_calibration_is_told(factor, own, said):
    layout: Layout = geometry_layout(load_robot("ur10"))
    lengths = np.where([name.unit == "m" for name in layout.names], layout.values, 0.0)
    drawing = {name: (value, 1e-3) for name, value in zip(layout.names, layout.values)}
    fit = Fit.__new__(Fit)
    covariance = factor**2 * np.outer(lengths, lengths) + own**2 * np.eye(layout.size)
    for name, value in (("covariance", covariance), ("freedom", 100)):
        object.__setattr__(fit, name, value)
    lines = scale_doubt(layout, fit, drawing, 1.3)
    assert bool(lines) == said
    if said:
        assert "to 3 mm per m, 3.9 mm at the arm's reach" in lines[0]
