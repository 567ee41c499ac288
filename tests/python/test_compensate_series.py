"""Time series between their points: the path that is meant, points in between, what is told."""

import io
from dataclasses import replace

import numpy as np
import pandas
import pytest
import yaml
from scipy.interpolate import BPoly

import exactarm as ea
from compensation_cell import identified, nearby
from exactarm.compensate.law import CompensationModel
from test_compensate import compensate

NAMES = [f"a{i}" for i in range(1, 7)]
STEP_S = 0.8


def smooth_arm():
    arm = identified(effects=False)
    return replace(arm, joints=tuple(replace(joint, cw=None, ccw=None) for joint in arm.joints))


def points(robot, rates):
    """(T, 1 + rates, n) of a curve with large steps."""
    start, turn = nearby(robot, 1)[0], np.array([0.5, -0.3, 0.4, 0.6, 0.3, -0.5])
    at = np.arange(5)[:, None] * STEP_S
    curve = [start + turn * np.sin(at), turn * np.cos(at), -turn * np.sin(at)]
    return np.stack(curve[: 1 + rates], axis=1)


def trajectory(values, newline="\n"):
    keys = ("positions", "velocities", "accelerations")
    lines = ["# \u00e9", f"joint_names: [{', '.join(NAMES)}]", "points:"]
    for k, point in enumerate(values):
        rows = [f"{key}: {row.tolist()}" for key, row in zip(keys, point)]
        whole, rest = divmod(round(1e9 * STEP_S * k), 10**9)
        lines += [f"  - {rows[0]}", *(f"    {row}" for row in rows[1:]),
                  f"    time_from_start: {{sec: {whole}, nanosec: {rest}}}"]
    return (newline.join(lines) + newline).encode()


def read(content, rates):
    """Times and values of a file, as any reader of YAML has them."""
    found = yaml.safe_load(content.decode())["points"]
    times = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in found]
    keys = ("positions", "velocities", "accelerations")[: 1 + rates]
    return np.array(times), np.array([[p[key] for key in keys] for p in found])


def largest_distance(robot, meant, sent, rates):
    """Of the true flange from the path of `meant`, when a controller joins the points of `sent`."""
    model = CompensationModel.of(robot)
    curves = [BPoly.from_derivatives(*read(content, rates)) for content in (meant, sent)]
    times = np.linspace(0.0, 4 * STEP_S, 1001)
    wanted = model.controller.poses(curves[0](times)).position
    there = model.reached(curves[1](times)).position
    return np.linalg.norm(there - wanted, axis=1).max()


@pytest.mark.parametrize("rates", [*(pytest.param(rates, marks=pytest.mark.slow) for rates in (0, 1)), 2])
@pytest.mark.parametrize("newline", ["\n", pytest.param("\r\n", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_points_in_between_keep_the_real_flange_on_its_path(tmp_path, rates, newline):
    robot = smooth_arm()
    file = trajectory(points(robot, rates), newline)
    for name in ("plain", "dense"):
        (tmp_path / name).mkdir()
    _, plain, _ = compensate(tmp_path / "plain", robot, {"t.yaml": file})
    code, dense, result = compensate(tmp_path / "dense", robot, {"t.yaml": file}, "--tolerance-mm", "0.01")
    assert code == 0 and not result["warnings"][rates > 0:]
    assert result["programs"][0]["straight_motions"]
    bent = largest_distance(robot, file, plain["t.yaml"], rates)
    assert bent > 2e-5 and largest_distance(robot, file, dense["t.yaml"], rates) < 1.05e-5
    told = max(bend["off_line_m"] for bend in result["programs"][0]["straight_motions"])
    assert told == pytest.approx(bent, rel=0.1)
    times, _ = read(dense["t.yaml"], rates)
    assert np.all(np.diff(times) > 0.0) and len(times) > 5
    assert dense["t.yaml"].count(b"\r\n") == (newline == "\r\n") * dense["t.yaml"].count(b"\n")


def test_a_series_whose_points_have_more_than_is_known_is_told(tmp_path):
    robot = smooth_arm()
    effort = b"    effort: [0, 0, 0, 0, 0, 0]\n    time_from"
    file = trajectory(points(robot, 0)).replace(b"    time_from", effort)
    _, written, result = compensate(tmp_path, robot, {"t.yaml": file}, "--tolerance-mm", "0.01")
    assert written["t.yaml"].count(b"\n") == file.count(b"\n")
    assert any("where no points in between can be put" in words for words in result["warnings"])


def table(robot, **more):
    """Joint angles in degrees over time, and other columns."""
    q = np.degrees(points(robot, 0)[:, 0])
    angles = {f"q_{i + 1}_deg": q[:, i] for i in range(6)}
    return pandas.DataFrame({"time_s": STEP_S * np.arange(len(q))} | angles | more)


def written_as(table, kind):
    """The bytes of a table and the reader of its new ones; the last line without an end."""
    if kind == "parquet":
        return table.to_parquet(), lambda content: pandas.read_parquet(io.BytesIO(content))
    dialect = {"sep": ";", "decimal": ","} if kind == "semicolons" else {}
    text = table.to_csv(index=False, lineterminator="\r\n", **dialect).removesuffix("\r\n")
    return text.encode(), lambda content: pandas.read_csv(io.BytesIO(content), **dialect)


@pytest.mark.parametrize("kind", ["csv", "semicolons", "parquet"])
def test_a_table_in_time_gets_rows_in_between(tmp_path, kind):
    robot = smooth_arm()
    old = table(robot, session=1, set="validation")
    file, reader = written_as(old, kind)
    name = "t.parquet" if kind == "parquet" else "t.csv"
    (tmp_path / name).write_bytes(file)
    result = ea.compensate(robot, tmp_path / name, tolerance_mm=0.01, threads=1)
    new = reader(result.contents[name])
    bends = result.json["programs"][0]["straight_motions"]
    assert len(new) == len(old) + sum(bend["points_in_between"] for bend in bends) > len(old)
    assert np.all(np.diff(new["time_s"]) > 0.0) and set(old["time_s"]) < set(new["time_s"])
    assert set(new["session"]) == {1} and set(new["set"]) == {"validation"}
    names = [f"q_{i}_rad" for i in range(1, 7)]
    assert list(new) == ["time_s", *names, "session", "set"]
    times, model = np.linspace(0.0, 4 * STEP_S, 801), CompensationModel.of(robot)
    follow = lambda data, q: np.column_stack([np.interp(times, data["time_s"], q[:, i]) for i in range(6)])
    meant = model.controller.poses(follow(old, np.radians(old.filter(like="_deg").to_numpy()))).position
    there = model.reached(follow(new, new[names].to_numpy())).position
    assert np.linalg.norm(there - meant, axis=1).max() < 1.05e-5


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_table_with_a_column_that_nobody_can_fill_is_told_and_stays_as_long(tmp_path, kind):
    robot = smooth_arm()
    file, reader = written_as(table(robot, step=np.arange(5)), kind)
    name = f"t.{kind}"
    (tmp_path / name).write_bytes(file)
    result = ea.compensate(robot, tmp_path / name, tolerance_mm=0.01, threads=1)
    assert len(reader(result.contents[name])) == 5
    (told,) = (words for words in result.json["warnings"] if "can be put (table)" in words)
    assert "row 2 (line 3, 0.0" in told
    fine = ea.compensate(robot, tmp_path / name, tolerance_mm=5.0, threads=1)
    assert not fine.json["programs"][0]["straight_motions"]


def test_a_time_that_does_not_rise_is_told(tmp_path):
    robot = smooth_arm()
    old = table(robot)
    old["time_s"] = [0.0, 0.1, 0.1, 0.2, 0.3]
    (tmp_path / "t.csv").write_bytes(written_as(old, "csv")[0])
    result = ea.compensate(robot, tmp_path / "t.csv", threads=1)
    assert any("time_s does not rise at row 3" in words for words in result.json["warnings"])
