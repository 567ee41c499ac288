"""The core names the columns of its identification Jacobian."""

import numpy as np
import pytest

from exactarm import _core
from exactarm.robot_file import load_robot


@pytest.mark.parametrize("axes", [1, 6, 7])
def test_every_column_has_one_name(axes):
    named = [column for part in _core.identification_layout(axes).values()
             for column in range(_core.identification_columns(axes))[part]]
    assert sorted(named) == list(range(_core.identification_columns(axes)))


def test_the_columns_by_the_joint_angles_are_the_geometric_jacobian():
    core, q = load_robot("ur10").core, np.random.default_rng(1).uniform(-2.0, 2.0, (20, 6))
    columns = _core.identification_jacobian(core, q)[2]
    by_angles = columns[:, :, _core.identification_layout(6)["q"]]
    np.testing.assert_allclose(by_angles, _core.geometric_jacobian(core, q), atol=1e-14)


def test_a_shift_of_the_base_moves_the_target_as_it_is():
    core, q = load_robot("ur10").core, np.random.default_rng(2).uniform(-2.0, 2.0, (5, 6))
    columns = _core.identification_jacobian(core, q)[2]
    by_base = columns[:, :, _core.identification_layout(6)["base"]]
    np.testing.assert_array_equal(by_base[:, :3, :3], np.broadcast_to(np.eye(3), (5, 3, 3)))
