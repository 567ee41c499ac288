"""The worked example of docs/adding-an-effect.md: one file, and the library, the virtual robot and the
diagnosis know it."""

import json
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import cli, effects
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects import library
from exactarm.errors import ComputationError
from exactarm.robot_file import load_robot
from six_axis import six_axis

PAGE = (Path(__file__).parents[2] / "docs" / "adding-an-effect.md").read_text()


def block(language: str) -> str:
    return re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[1]


@pytest.fixture
def hose_bundle(tmp_path, monkeypatch):
    """The class, with its file in a folder that the library looks through."""
    (tmp_path / "hose_bundle.py").write_text(block("python"))
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    library.cache_clear()
    yield library()["hose_bundle"]
    library.cache_clear()
    module = sys.modules.pop("exactarm.effects.hose_bundle")
    bases = effects.Effect.__subclasses__()
    assert module.HoseBundle in bases
    # subclasses live as long as someone holds them; without a name it is in no library
    module.HoseBundle.name = ""


def installed(folder, monkeypatch, text):
    """A package in a folder, with an entry point for its module."""
    (folder / "hoses.py").write_text(text)
    about = folder / "hoses-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: hoses\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[exactarm.effects]\nhose = hoses\n")
    monkeypatch.syspath_prepend(folder)


@pytest.fixture
def afresh():
    """The library is looked through anew, before and behind a test."""
    library()
    known = {*all_effects(effects.Effect)}
    library.cache_clear()
    yield
    sys.modules.pop("hoses", None)
    for cls in {*all_effects(effects.Effect)} - known:
        cls.name = ""  # as above
    library.cache_clear()


def all_effects(cls):
    for sub in cls.__subclasses__():
        yield sub
        yield from all_effects(sub)


def test_a_package_brings_effects_of_its_own(tmp_path, monkeypatch, afresh):
    installed(tmp_path, monkeypatch, block("python"))
    assert library()["hose_bundle"].__module__ == "hoses"


@pytest.mark.parametrize("text, words", [
    ("import no_such_module", "the effects of the installed package hoses cannot be loaded"),
    (block("python").replace('"hose_bundle"', '"backlash"'), "hoses calls an effect backlash"),
], ids=["broken", "taken"])
def test_a_package_whose_effects_cannot_be_used_is_named_in_one_line(tmp_path, monkeypatch, afresh, text,
                                                                    words):
    installed(tmp_path, monkeypatch, text)
    with pytest.raises(ComputationError, match=words):
        library()


def test_its_derivatives_pass_the_shared_check(hose_bundle):
    robot, random = six_axis(), np.random.default_rng(5)
    data = Dataset.of_arrays("poses", {"q": random.uniform(-1.5, 1.5, (20, 6))}, position=np.zeros((20, 3)))
    layout = Layout.of((library()["gear_ratio"](4, (1e-3,)), hose_bundle(5, (3e-4,))))

    def position(values):
        return predict_poses(robot, layout.at(values), data).position

    assert_derivative(position, layout.values, predict_poses(robot, layout, data).jacobian[:, :3], 1e-4)


@pytest.mark.slow
def test_the_commands_of_the_page_hide_it_and_find_it(hose_bundle, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in re.findall(r"^exactarm (.*)$", PAGE, re.MULTILINE):
        assert cli.main([*shlex.split(line), "--quiet"]) == 0
    result = json.loads((tmp_path / "found/result.json").read_text())
    first = result["effects"][0]
    assert (first["effect"], first["joint"]) == ("hose_bundle", 5)
    low, high = first["parameters"]["press_rad_per_rad2"]["ci95"]
    assert 2.7e-4 < low < high < 3.3e-4
    found = load_robot(tmp_path / "found/robot.toml").effects[0]
    assert (
        found.name == "hose_bundle"
        and set(found.to_table()) == set(re.findall(r"^(\w+) =", block("toml"), re.MULTILINE))
    )
