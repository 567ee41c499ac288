"""Results and data at a Python prompt: shown in a line, compared, listed; calls that cannot be meant."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import exactarm as ea
from exactarm.errors import InputError


@pytest.fixture(scope="module")
def data():
    return ea.read(ea.example("ur10/series_B"), "ur10")


@pytest.fixture(scope="module")
def result(data):
    return ea.calibrate("ur10", data, compliance=(2,), threads=1)


@pytest.mark.slow
def test_data_are_a_value_that_shows_in_one_line(data):
    assert repr(data) == "<Dataset: 1495 rows, poses, 6 axes; series_B.csv>"
    same = pickle.loads(pickle.dumps(data))
    assert same == data and hash(same) == hash(data) and copy.deepcopy(data) == data
    other = data.select([True] * 10 + [False] * (len(data) - 10))
    assert other != data and len({data, same, other}) == 2


@pytest.mark.slow
def test_estimates_are_a_table(result):
    table = result.parameters
    assert list(table.columns) == ["value", "low", "high"]
    assert ((table["low"] < table["value"]) & (table["value"] < table["high"])).all()
    assert table.loc["a_2_m", "value"] == result["parameters"]["a_2_m"]["value"]
    assert "joint_compliance_2.linear_rad_per_Nm" in table.index


def test_estimates_of_causes_are_a_table():
    from exactarm.commands.outcome import Asked
    from exactarm.commands.result import CommandResult, estimate
    from exactarm.report import Report

    def found(effects):
        return CommandResult({"effects": effects}, Report("t", "v"), asked=Asked("diagnose", ""))

    width, mass = estimate(4e-4, 3.8e-4, 4.2e-4), {"value": 2.0, "ci95": None}
    effects = [{"effect": "backlash", "joint": 2, "parameters": {"width_rad": width}},
               {"effect": "payload", "joint": None, "parameters": {"mass_kg": mass}}]
    table = found(effects).parameters
    assert list(table.index) == ["backlash_2.width_rad", "payload.mass_kg"]
    assert table.loc["backlash_2.width_rad"].tolist() == [4e-4, 3.8e-4, 4.2e-4]
    assert table.loc["payload.mass_kg"].isna().tolist() == [False, True, True]
    assert len(found([]).parameters) == 0
    with pytest.raises(AttributeError, match="has no estimated parameters; its keys are"):
        _ = CommandResult({"O1": 0.5, "effects": ["a sentence"]}, Report("t", "v")).parameters


def test_estimates_of_gears_are_a_table():
    from exactarm.commands.result import CommandResult, estimate
    from exactarm.report import Report

    gear = {"joint": 2, "direction": "cw", "ratio": estimate(101.0, 100.9, 101.1),
            "harmonics": [{key: estimate(1.0, 0.9, 1.1) for key in ("order", "a", "b")}]}
    table = CommandResult({"gears": [gear]}, Report("t", "v")).parameters
    assert list(table.index) == [f"gear_2_cw.{name}" for name in ("ratio", "order_1", "a_1", "b_1")]


def test_a_result_is_a_mapping_of_its_keys(result):
    assert list(result) == list(result.keys()) and dict(result)["unit"] == "m"
    with pytest.raises(KeyError, match="'zz': a result of calibrate has data_kind, unit, before, after"):
        result["zz"]


def test_a_summary_shows_as_lines(result):
    assert isinstance(result.summary(), str) and repr(result.summary()) == str(result.summary())
    assert repr(pickle.loads(pickle.dumps(result.summary()))) == result.summary()


def test_a_table_is_found_by_its_stem(result):
    assert result.to_dataframe("residuals").equals(result.to_dataframe("residuals.csv"))
    with pytest.raises(InputError, match="no table 'poses'; expected one of residuals.csv"):
        result.to_dataframe("poses")


def test_a_figure_given_as_axes_is_told():
    bare = ea.export("ur10", format="csv")
    with pytest.raises(InputError, match="a figure is named by what='parameters'"):
        bare.plot("parameters")
    with pytest.raises(InputError, match="a result of export holds no figure"):
        bare.plot()


def test_corrected_programs_are_a_value(tmp_path):
    header = ",".join(f"q_{i}_deg" for i in range(1, 7))
    (tmp_path / "targets.csv").write_text(f"{header}\n5,-70,70,0,60,0\n")
    result = ea.compensate("ur10", tmp_path / "targets.csv")
    assert pickle.loads(pickle.dumps(result)) == result and result.figures
    axes = Figure().subplots()
    assert result.plot(axes) is axes and axes.has_data()
    with pytest.raises(InputError, match="ax is of the type object; expected matplotlib axes"):
        result.plot(object())


def _first(rows):
    return pd.read_csv(ea.example("ur10/series_B")).head(rows)


REFUSED = {
    "table 1 in memory, column q_2_rad: column missing":
        lambda data: ea.identifiable("ur10", pd.DataFrame({"q_1_rad": [0.0]})),
    "data given as int; expected files": lambda data: ea.calibrate("ur10", [1, 2]),
    "data given as Dataset; expected robot programs": lambda data: ea.compensate("ur10", data),
    "expected a path, then a robot": lambda data: ea.write_robot("ur10", "x.toml"),
    "expected a name that ends with .toml": lambda data: ea.write_robot("x.urdf", ea.load_robot("ur10")),
    "no folder nowhere; expected": lambda data: ea.write_robot("nowhere/x.toml", ea.load_robot("ur10")),
    "table new 2 in memory: the same content as table before in memory": lambda data: ea.check(
        "ur10", _first(20), [_first(30), _first(20)]),
    "ur10: no such file": lambda data: ea.read("ur10", "ur10"),
    "use='poses'; expected one of 'auto', 'position', 'pose'":
        lambda data: ea.calibrate("ur10", data, use="poses"),
    "joint 6; expected 0 to 5, the first axis is 0": lambda data: ea.load_robot("ur10").with_joint(6, a=0.1),
    "use='poses'; expected one of 'position', 'pose'": lambda data: ea.identifiable("ur10", use="poses"),
}


@pytest.mark.parametrize("said", REFUSED)
def test_a_call_that_cannot_be_meant_is_refused_in_words(said, data):
    with pytest.raises(InputError, match=said):
        REFUSED[said](data)


@pytest.mark.parametrize("robot", ["ur10", "file", "value"])
@pytest.mark.slow
def test_data_are_read_with_the_robot_first_too(robot, data, tmp_path):
    """As in every command; callers that name the files first are not disturbed."""
    arm = ea.load_robot("ur10")
    ea.write_robot(tmp_path / "arm.toml", arm)
    given = {"ur10": "ur10", "file": tmp_path / "arm.toml", "value": arm}[robot]
    file = ea.example("ur10/series_B")
    assert ea.read(given, file) == ea.read(file, given) == ea.read(files=file, robot=given) == data
    assert ea.read(given, [pd.read_csv(file)]).position.shape == data.position.shape


def test_data_are_asked_for_what_they_can_show(data):
    rows = data.select(np.arange(len(data)) < 60)
    named = ea.identifiable("ur10", rows)
    assert "60 measured poses" in named.summary()
    same = ea.identifiable("ur10", _first(60))
    assert np.array_equal(named.json["singular_values"], same.json["singular_values"])
