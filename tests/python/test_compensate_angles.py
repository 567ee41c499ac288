"""Orientations as makers write them, against scipy's: at random, at half a turn, at none, at the gimbal."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exactarm.compensate import angles

TURNS = [np.zeros(3), [np.pi, 0.0, 0.0], [0.0, np.pi, 0.0], [0.0, 0.0, np.pi], [1e-9, 2e-9, -1e-9], [1e-4,
                                                                                                     0.0,
                                                                                                     0.0],
         np.full(3, (np.pi - 1e-7) / np.sqrt(3.0)), *np.random.default_rng(1).normal(size=(50, 3))]


@pytest.mark.parametrize("vector", TURNS)
def test_each_form_is_the_same_turn_as_with_scipy(vector):
    wanted = Rotation.from_rotvec(vector).as_matrix()
    assert np.abs(angles.from_vector(np.array(vector)) - wanted).max() < 4e-15
    wxyz = angles.to_quaternion(wanted, np.array([1.0, 0.1, 0.2, 0.3]))
    assert wxyz @ [1.0, 0.1, 0.2, 0.3] >= 0.0
    assert np.abs(angles.from_quaternion(3.0 * wxyz) - wanted).max() < 1e-14
    a, b, c = angles.to_zyx(wanted, np.array([0.1, 0.2, 7.0]))
    assert np.abs(Rotation.from_euler("ZYX", [a, b, c]).as_matrix() - wanted).max() < 1e-14
    assert np.abs(angles.from_zyx((a, b, c)) - wanted).max() < 1e-14
    for turns in (-1, 0, 2):
        near = np.array(vector) * (1.0 + turns * 2.0 * np.pi / max(np.linalg.norm(vector), 1e-3))
        back = angles.to_vector(wanted, near)
        assert np.abs(angles.from_vector(back) - wanted).max() < 1e-14 * (1.0 + abs(turns)) * 10
        assert np.linalg.norm(back - near) < 1.5 * np.pi


def test_the_quaternion_of_nothing_is_refused():
    with pytest.raises(ValueError, match="zeros"):
        angles.from_quaternion(np.zeros(4))
