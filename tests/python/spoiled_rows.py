"""Rows of closures of the Panda that a reader refuses."""

import pytest

from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

PANDA = load_robot("panda")
HEADER = "q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad,q_7_rad"
POSE = "0.1,0.2,0.3,-1.4,0.5,0.6,0.7"


def assert_refused(file, text: str, words: str) -> None:
    """A file of this text is refused with these words."""
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_dataset(file, PANDA)
