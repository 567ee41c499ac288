"""Masses of a drawing are uncertain: what they could do as well is said of a cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.mass_tolerance import MASS, mass_tolerance, probability_beside
from exactarm.robot_file import load_robot

ROWS = 400


def fitted(residual):
    """A fit of one parameter, whose column is the first of the identity."""
    basis = np.eye(ROWS)[:, :1]
    return SimpleNamespace(basis=basis, free_residual=residual - basis @ (basis.T @ residual),
                           whiten=lambda response: response.reshape(ROWS, -1),
                           columns=lambda effect: effect.column)


def cause(column):
    parameter = SimpleNamespace(fixed=False, search=())
    return SimpleNamespace(column=column, parameters=lambda: (parameter,))


@pytest.fixture
def columns():
    return np.linalg.qr(np.random.default_rng(1).standard_normal((ROWS, 6)))[0]


@pytest.mark.parametrize("size, stands", [(15.0, False), (150.0, True)])
def test_a_cause_that_masses_imitate_stands_only_beyond_their_tolerance(columns, size, stands):
    """Tolerance 10 noise levels: a movement by 15 of them is one and a half standard deviations of it."""
    noise = np.random.default_rng(2).standard_normal(ROWS)
    residual = size * columns[:, 0] + noise
    tolerance = 10.0 * columns[:, None, :4]
    evidence = 0.5 * ROWS * np.log1p(size**2 / ROWS)
    found = probability_beside(fitted(residual), cause(columns[:, :1]), evidence, tolerance, ROWS)
    assert (found > 0.5) == stands


def test_a_cause_that_no_mass_imitates_stands_as_it_was(columns):
    residual = 15.0 * columns[:, 5] + np.random.default_rng(3).standard_normal(ROWS)
    tolerance = 10.0 * columns[:, None, :4]
    found = probability_beside(fitted(residual), cause(columns[:, 5:]), 40.0, tolerance, ROWS)
    assert found > 0.99


def test_the_tolerance_is_a_share_of_every_link():
    robot = load_robot("racer-7-1.4")
    links, sizes = mass_tolerance(robot)
    assert len(sizes) == len(links.columns) and np.all(sizes > 0.0)
    heavy = tuple(replace(link, mass=2.0 * link.mass, inertia=2.0 * link.inertia) for link in robot.links)
    assert mass_tolerance(replace(robot, links=heavy))[1] == pytest.approx(2.0 * sizes)
    masses = [k for k, column in enumerate(links.columns) if column % 10 == 0]
    assert all(sizes[k] >= MASS * robot.links[links.columns[k] // 10].mass for k in masses)
