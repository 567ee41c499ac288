"""Masses that are not those of the robot file: how large they may be, in files and in tables."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.effects import effect_from_table
from exactarm.effects.link_masses import MASS, LinkMasses, tolerance
from exactarm.errors import InputError
from exactarm.robot_file import load_robot
from exactarm.simulate.virtual_robot import parse_effect


def test_the_tolerance_is_a_share_of_every_link():
    robot = load_robot("racer-7-1.4")
    sizes = tolerance(robot)
    assert np.allclose(sizes[::10], [MASS * link.mass for link in robot.links])
    heavy = tuple(replace(link, mass=2.0 * link.mass, inertia=2.0 * link.inertia) for link in robot.links)
    assert tolerance(replace(robot, links=heavy)) == pytest.approx(2.0 * sizes)
    bare = (replace(robot.links[0], mass=0.0, inertia=np.zeros((3, 3))), *robot.links[1:])
    assert not tolerance(replace(robot, links=bare))[:10].any()


def test_a_robot_file_carries_them_and_the_tables_take_them():
    robot = load_robot("racer-7-1.4")
    effect = LinkMasses(None, (0.5, -0.2), (10, 50))
    again = effect_from_table(effect.to_table())
    assert again == effect
    baked = again.bake(robot)
    changes = [new.mass - old.mass for new, old in zip(baked.links, robot.links)]
    assert changes == pytest.approx([0.0, 0.5, 0.0, 0.0, 0.0, -0.2])


def test_without_a_change_it_says_what_is_missing():
    with pytest.raises(InputError, match="m_1_kg"):
        parse_effect("link_masses", 6)
