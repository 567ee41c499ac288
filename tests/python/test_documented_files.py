"""The examples in docs/files.md are files that the program reads, and its table names what the reader
knows."""

import re
from pathlib import Path

import numpy as np

from exactarm.commands.listing import find_commands
from exactarm.data.columns import JOINT_UNITS, SCALAR_UNITS
from exactarm.data.dataset import read_dataset
from exactarm.plan.path_file import CHOICES, COMMON, load_path, shipped_paths
from exactarm.robot.robot import Joint, Robot
from exactarm.robot_file import load_robot, shipped_robots

PAGE = (Path(__file__).parents[2] / "docs" / "files.md").read_text()


def block(language: str, first: str = "") -> str:
    """The first block of a language that begins with `first`."""
    return re.search(rf"```{language}\n({re.escape(first)}.*?)```", PAGE, re.DOTALL)[1]


def test_the_table_of_data_is_read(tmp_path):
    (tmp_path / "poses.csv").write_text(block("csv"))
    data = read_dataset(tmp_path / "poses.csv", Robot("two", (Joint(), Joint())))
    assert data.kinds == ("poses",) and len(data) == 2
    np.testing.assert_allclose(data.joints["q"][:, 1], [np.pi / 2, np.pi / 4])
    np.testing.assert_allclose(data.position[0], [0.5123, -0.0201, 0.834])


def test_the_robot_file_is_read(tmp_path):
    (tmp_path / "robot.toml").write_text(block("toml", "name = "))
    robot = load_robot(tmp_path / "robot.toml")
    assert [effect.name for effect in robot.effects] == ["payload"]
    np.testing.assert_allclose([robot.joints[0].alpha, robot.joints[1].q_offset], np.pi / 2)
    assert robot.core.axes == 2


def test_every_quantity_and_unit_is_documented():
    table = PAGE[PAGE.index("| column |") : PAGE.index("What is analysed")]
    for name in (*(f"{quantity}_i" for quantity in JOINT_UNITS), *SCALAR_UNITS):
        assert f"`{name}`" in table, name
    for units in (*JOINT_UNITS.values(), *SCALAR_UNITS.values()):
        assert all(f"`{unit}`" in table for unit in units if unit)


def test_shipped_robots_are_named():
    assert all(f"`{name}`" in PAGE for name in shipped_robots())


def test_the_path_file_is_read_and_every_kind_is_documented(tmp_path):
    written = re.search(r'```toml\n(kind = "line".*?)```', PAGE, re.DOTALL)[1]
    (tmp_path / "path.toml").write_text(written)
    path, bare = load_path(tmp_path / "path.toml"), tmp_path / "bare.toml"
    bare.write_text("\n".join(line for line in written.splitlines()
                              if line.split()[0] in ("kind", "start_m", "end_m", "duration_s")))
    defaults = load_path(bare)
    for key in ("rate_hz", "nu", *CHOICES):
        assert getattr(path, key) == getattr(defaults, key)
    for key in (*COMMON, *(name for options in CHOICES.values() for name in options), *shipped_paths()):
        assert re.search(rf'["`]?{key}\b', PAGE), key


def test_the_controllers_keys_are_read(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "compensate.md").read_text()
    block = re.search(r"```toml\n(.*?)```", page, re.DOTALL)[1]
    frame = block[block.index("[[controller.frames]]") :]
    (tmp_path / "robot.toml").write_text('name = "six"\n' + 6 * "[[joints]]\n" + block + 5 * frame)
    controller = load_robot(tmp_path / "robot.toml").controller
    assert (
        controller.chain == "calibrated" and controller.coupling == ((3, 2, 1.0),)
        and len(controller.frames) == 6
    )


def test_the_result_of_every_command_is_documented():
    page = (Path(__file__).parents[2] / "docs" / "results.md").read_text()
    told = {line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| `")}
    assert {f"`{name}`" for name in find_commands()} <= told
