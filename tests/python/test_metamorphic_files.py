"""Laws of the commands that make files of files. What comes out follows what goes in: of `merge` rows in
another order, other units, moved frames, doubled rows; of `export` an axis that counts the other way, the
mirror image, a moved base, larger effects, a second export; of `accept` entries in another order, twice, with
larger values; of `batch` jobs in another order, twice, by other workers, alone."""

import csv
import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import exactarm as ea
from compensation_cell import identified
from exactarm import cli
from exactarm.compensate.law import CompensationModel
from exactarm.effects import effect_from_table, library
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.export.chain import lost, reported_chain
from exactarm.numerics.rotation import exp
from exactarm.robot.mdh_frames import compose
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import read_urdf
from test_every_command import lasting
from test_metamorphic_mirror import MIRROR, mirrored_robot

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from robustness.samples import samples

COUNT, REVERSED = 12, 3  # points; the axis (from 0) that counts the other way
RANDOM = np.random.default_rng(11)
ANGLES, POINTS = RANDOM.uniform(-2.0, 2.0, (COUNT, 6)), RANDOM.uniform(0.2, 0.9, (COUNT, 3))
NAMES = [f"p{i}" for i in range(COUNT)]
TURN, SHIFT = exp(np.array([0.3, -0.5, 1.1])), np.array([3.0, -1.0, 0.5])


# -- merge -------------------------------------------------------------------------------------------------
def merged(folder, *, log=range(COUNT), points=range(COUNT), named=True, position=POINTS,
           per_metre=("m", 1.0), angle=("rad", 1.0), axes=range(6)):
    """`merge` of two files; log and points: the rows of each, in that order."""
    unit, factor = per_metre
    head = (["name"] if named else []) + [f"q_{i + 1}_{angle[0]}" for i in axes]
    lines = [",".join([NAMES[k]] * named + [repr(float(ANGLES[k, i] * angle[1])) for i in axes]) for k in log]
    (folder / "log.csv").write_text("\n".join([",".join(head), *lines, ""]))
    cells = [[NAMES[k]] * named + [repr(float(value * factor)) for value in position[k]] for k in points]
    (folder / "points.txt").write_text("".join(" ".join(row) + "\n" for row in cells))
    return ea.merge("ur10", folder / "log.csv", folder / "points.txt", unit=unit,
                    by="name" if named else "row")


SHUFFLED = np.random.default_rng(2).permutation(COUNT)
SAME_TABLE = {
    "points in another order": {"points": SHUFFLED},
    "lengths in mm": {"per_metre": ("mm", 1e3)},
    "lengths in inches": {"per_metre": ("in", 1.0 / 0.0254)},
    "angles in degrees": {"angle": ("deg", 180.0 / np.pi)},
    "columns in another order": {"axes": [5, 2, 0, 1, 4, 3]},
    "row by row": {"named": False},
}


@pytest.mark.parametrize("law", SAME_TABLE)
@pytest.mark.slow
def test_merged_rows_are_the_same(law, tmp_path):
    found = merged(tmp_path, **SAME_TABLE[law]).data
    np.testing.assert_allclose(found.joints["q"], ANGLES, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(found.position, POINTS, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("named", [True, False])
def test_merged_rows_follow_the_log(named, tmp_path):
    points = range(COUNT) if named else SHUFFLED
    found = merged(tmp_path, log=SHUFFLED, points=points, named=named).data
    assert np.array_equal(found.joints["q"], ANGLES[SHUFFLED])
    assert np.array_equal(found.position, POINTS[SHUFFLED])


def test_of_doubled_rows_all_are_written_and_what_the_next_command_leaves_out_is_said(tmp_path):
    twice = np.repeat(np.arange(COUNT), 2)
    result = merged(tmp_path, log=twice, points=twice, named=False)
    written, said = result.tables["poses.csv"], f"{COUNT} of {2 * COUNT} rows are copies of others"
    assert result["rows"] == len(written["x_m"]) == 2 * COUNT and len(result.data) == COUNT
    assert any(said in each for each in result["warnings"])
    assert f"{2 * COUNT} poses are written" in (shown := str(result)) and said in shown
    assert np.array_equal(np.stack([written[f"{axis}_m"] for axis in "xyz"], axis=1), POINTS[twice])


def test_merged_points_move_with_their_frame(tmp_path):
    found = merged(tmp_path, position=POINTS @ TURN.T + SHIFT).data
    assert np.array_equal(found.joints["q"], ANGLES)
    assert np.array_equal(found.position, POINTS @ TURN.T + SHIFT)


# -- export ------------------------------------------------------------------------------------------------
def rigid(robot: Robot) -> Robot:
    return replace(robot, joints=tuple(replace(joint, cw=None, ccw=None, spring_linear=None)
                                       for joint in robot.joints))


ARM = rigid(identified(effects=False))


def flange(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    reached = CompensationModel.of(robot.with_controller_frames).reached(q)
    return reached.position, reached.rotation


def read_back(robot: Robot, format: str, folder) -> Robot:
    """The robot that the exported file describes."""
    (content,) = ea.export(robot, format=format).contents.values()
    if format == "urdf":
        (folder / "arm.urdf").write_bytes(content)
        return read_urdf(folder / "arm.urdf", "base_link", "flange")
    number = {"sign": "sign", "zero_rad": "zero", "d_m": "d", "a_m": "a", "alpha_rad": "alpha",
              "q_offset_rad": "q_offset", "controller_offset_rad": "controller_offset"}
    rows = csv.DictReader(io.StringIO(content.decode()))
    joints = [replace(joint, beta=float(row["beta_rad"]) or None,
                      **{ours: float(row[name]) for name, ours in number.items()})
              for joint, row in zip(robot.joints, rows, strict=True)]
    return replace(robot, joints=tuple(joints))


def axis_reversed(robot: Robot) -> Robot:
    one = robot.joints[REVERSED]
    there = replace(one, sign=-one.sign, q_offset=-one.q_offset, controller_offset=-one.controller_offset,
                    q_min=-one.q_max, q_max=-one.q_min)
    return replace(robot, joints=(*robot.joints[:REVERSED], there, *robot.joints[REVERSED + 1:]))


def mirror_image(robot: Robot) -> Robot:
    over = lambda place: Placement(place.rotation * np.outer(MIRROR, MIRROR), place.position * MIRROR)
    frames = {name: over(getattr(robot.controller, name)) for name in ("base", "flange")}
    return replace(mirrored_robot(robot), controller=replace(robot.controller, **frames))


def base_moved(robot: Robot) -> Robot:
    base = compose(Placement(TURN, SHIFT), robot.controller.base)
    return replace(robot, controller=replace(robot.controller, base=base))


EXPORTS = {  # law -> (the arm, its angles, its flange) by those of the arm as it is
    axis_reversed: (lambda q: q * np.where(np.arange(6) == REVERSED, -1.0, 1.0), lambda p, R: (p, R)),
    mirror_image: (lambda q: -q, lambda p, R: (p * MIRROR, R * np.outer(MIRROR, MIRROR))),
    base_moved: (lambda q: q, lambda p, R: (p @ TURN.T + SHIFT, TURN @ R)),
}


@pytest.mark.parametrize("format", ["urdf", "csv"])
@pytest.mark.parametrize("law", EXPORTS)
def test_the_exported_arm_follows(law, format, tmp_path):
    angles, moved = EXPORTS[law]
    expected = moved(*flange(read_back(ARM, format, tmp_path), ANGLES))
    found = flange(read_back(law(ARM), format, tmp_path), angles(ANGLES))
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("format", ["urdf", "csv"])
def test_an_exported_arm_is_exported_as_itself(format, tmp_path):
    twice = read_back(read_back(ARM, format, tmp_path), format, tmp_path)
    for one, other in zip(flange(ARM, ANGLES), flange(twice, ANGLES), strict=True):
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9)


def test_what_an_export_loses_grows_with_the_effect():
    of = lambda scale: replace(ARM, effects=(JointCompliance(2, (scale * 4e-8, 0.0)),))
    one, three = (lost(of(scale), reported_chain(ARM).poses) for scale in (1.0, 3.0))
    assert one.mean > 1e-6 and [three.mean, three.largest] == pytest.approx(
        [3.0 * one.mean, 3.0 * one.largest], rel=1e-2)


# -- accept ------------------------------------------------------------------------------------------------
ENTRY = """\
[[effects]]
effect = "expression"
title = "{title}"
station = "GEAR"
joint = {joint}
of = ["q_4", "q_6"]
form = "{form}"
values = {{ a = {value} }}
plausible = {{ a = 3e-4 }}
"""
FIRST = {"title": "a square", "joint": 5, "form": "a*(q_4 + q_6)^2", "value": 3.1e-4}
SECOND = {"title": "a product", "joint": 2, "form": "a*q_4*q_6", "value": 2e-4}


def accepted(folder, *entries, name="draft.toml"):
    (folder / name).write_text("\n".join(ENTRY.format(**entry) for entry in entries))
    return ea.accept(folder / name)


def turned(entry: dict) -> np.ndarray:
    """Where the flange goes by an accepted effect."""
    arm = replace(ARM, effects=(effect_from_table(entry),))
    return flange(arm, ANGLES)[0] - flange(ARM, ANGLES)[0]


def test_entries_in_another_order_are_the_same_library(tmp_path):
    one = accepted(tmp_path, FIRST, SECOND)["effects"]
    other = accepted(tmp_path, SECOND, FIRST)["effects"]
    assert other == one[::-1] and {"a square", "a product"} <= {each.get("title") for each in other}


def test_what_is_accepted_twice_is_there_once(tmp_path, monkeypatch):
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path / "mine"))
    first, known = accepted(tmp_path, FIRST), set(library())
    assert accepted(tmp_path, FIRST)["file"] == first["file"] and set(library()) == known
    assert len(list((tmp_path / "mine").iterdir())) == 1


def test_an_accepted_effect_follows_its_formula_and_its_values(tmp_path):
    accepts = lambda **changes: turned(accepted(tmp_path, FIRST | changes)["effects"][0])
    one = accepts()
    assert np.abs(one).max() > 1e-5
    np.testing.assert_allclose(accepts(form="a*(q_6 + q_4)*(q_4 + q_6)"), one, atol=1e-15)
    np.testing.assert_allclose(accepts(form="-1*a*(q_4 + q_6)^2", value=-3.1e-4), one, atol=1e-15)
    np.testing.assert_allclose(accepts(form="2*a*(q_4 + q_6)^2"), accepts(value=6.2e-4), atol=1e-15)
    small, twice = accepts(value=1e-8), accepts(value=2e-8)
    np.testing.assert_allclose(twice, 2.0 * small, atol=1e-4 * np.abs(small).max())


# -- batch -------------------------------------------------------------------------------------------------
JOBS = {"poses": "evaluate,ur10,poses.csv", "table": "export,ur10,,csv", "urdf": "export,racer-7-1.4,,urdf"}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """jobs -> name -> result of each, less what every run has anew; workers as words."""
    folder = tmp_path_factory.mktemp("fleets")
    (folder / "poses.csv").write_bytes(samples()["poses.csv"])
    made = iter(range(100))

    def run(jobs, *words):
        here = folder / str(next(made))
        here.mkdir()
        exports = any(JOBS[job].startswith("export") for _, job in jobs)
        text = "\n".join(["name,command,robot,files" + ",format" * exports,
                          *(f"{name},{JOBS[job]}" for name, job in jobs), ""])
        (folder / "manifest.csv").write_text(text)
        assert cli.main(["batch", str(folder / "manifest.csv"), "--out", str(here), "--quiet", *words]) == 0
        assert [job["name"] for job in json.loads((here / "result.json").read_text())["jobs"]] == [
            name for name, _ in jobs]
        return {name: lasting(json.loads((here / name / "result.json").read_text())) for name, _ in jobs}

    return run


@pytest.mark.slow
def test_jobs_in_another_order_or_by_more_workers_have_the_same_results(fleet):
    jobs = [(name, name) for name in JOBS]
    one = fleet(jobs)
    assert fleet(jobs[::-1]) == one == fleet(jobs, "--workers", "2") and one["poses"]["error"]["rms"] > 0.0


@pytest.mark.slow
def test_a_job_twice_is_the_same_result_twice_and_that_of_the_job_alone(fleet):
    both = fleet([("first", "poses"), ("second", "poses")])
    assert both["first"] == both["second"] == fleet([("alone", "poses")])["alone"]
