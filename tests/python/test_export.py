"""Exports: every format stands for the identified chain, a patched URDF changes nothing but its origins."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import exactarm as ea
from compensation_cell import identified
from exactarm.cli import main
from exactarm.compensate.law import CompensationModel
from exactarm.errors import InputError
from exactarm.export.chain import lost, not_carried, reported_chain
from exactarm.export.mjcf import mjcf_text
from exactarm.export.robodk import station_script
from exactarm.export.ur_description import kinematics_yaml, link_origins
from exactarm.export.urdf import patched_urdf
from exactarm.robot.urdf import read_urdf
from exactarm.robot_file import load_robot, write_robot
from urdf_sample import random_urdf


def deviated(robot, seed=5):
    """The robot with other frames and offsets, as a calibration gives them back."""
    rng, kept = np.random.default_rng(seed), robot.with_controller_frames
    for i, joint in enumerate(kept.joints):
        length, angle = (lambda: 5e-4 * rng.normal()), (lambda: 1e-3 * rng.normal())
        moved = {"d": joint.d + length()} if joint.beta is None else {"beta": joint.beta + angle()}
        moved |= {"a": joint.a + length(), "alpha": joint.alpha + angle(),
                  "q_offset": joint.q_offset + angle()}
        kept = kept.with_joint(i, controller_offset=float(robot.controller_offsets[i]), **moved)
    return kept


def flange(robot, q):
    """Positions and rotations of the flange by the whole model."""
    reached = CompensationModel.of(robot.with_controller_frames).reached(q)
    return reached.position, reached.rotation


def random_q(robot, count=50):
    return np.random.default_rng(4).uniform(-2.0, 2.0, (count, robot.axes))


def bare(robot):
    """Without what a rigid chain cannot carry."""
    for i in range(robot.axes):
        robot = robot.with_joint(i, cw=None, ccw=None, spring_linear=None)
    return robot


def test_the_chain_is_the_identified_one_where_a_rigid_chain_can_carry_it():
    robot = bare(identified(effects=False))
    q = random_q(robot)
    position, rotation = flange(robot, q)
    found = reported_chain(robot).poses(q)
    assert np.abs(found.position - position).max() < 1e-12 and np.abs(found.rotation - rotation).max() < 1e-12
    assert lost(robot, reported_chain(robot).poses).largest < 1e-12


def test_what_is_lost_is_measured_and_named():
    robot = identified()
    cost = lost(robot, reported_chain(robot).poses)
    assert 1e-5 < cost.mean < cost.largest < 5e-3
    parts = not_carried(robot)
    assert any("gear harmonics" in part for part in parts) and "backlash_3" in parts


@pytest.mark.parametrize("joints", ["frrfrrrrf", "rrrrrrf", "rprcrff"])
def test_a_urdf_is_patched_in_place(tmp_path, joints):
    text = random_urdf(np.random.default_rng(7), joints)
    text = text.replace('<axis', '<!-- <origin xyz="9 9 9"/> --><axis',
                        1).replace("</robot>", '<link name="x\u00fc"/>' + "</robot>")
    source = tmp_path / "arm.urdf"
    text = text.replace('<link name="x\u00fc"/>', "")
    source.write_text(text)
    robot = deviated(read_urdf(source))
    new = patched_urdf(robot, str(source))
    assert re.sub(rb'(xyz|rpy)="[^"]*"', b"", new) == re.sub(rb'(xyz|rpy)="[^"]*"', b"", source.read_bytes())
    assert b'<!-- <origin xyz="9 9 9"/> -->' in new
    (tmp_path / "new.urdf").write_bytes(new)
    again, q = read_urdf(tmp_path / "new.urdf"), random_q(robot)
    (here, turn), (there, turned) = flange(robot, q), flange(again, q)
    assert np.abs(here - there).max() < 1e-9 and np.abs(turn - turned).max() < 1e-9


def test_the_urdf_of_another_arm_is_refused(tmp_path):
    source = tmp_path / "arm.urdf"
    source.write_text(random_urdf(np.random.default_rng(8), "rrrrrrf"))
    with pytest.raises(InputError, match="of this arm"):
        patched_urdf(identified(), str(source))


def test_ur_description_holds_the_drawing_and_the_identified_arm():
    nominal = load_robot("ur10")
    values = yaml.safe_load(kinematics_yaml(nominal))["kinematics"]
    assert (
        values["shoulder"]["z"] == pytest.approx(0.1273) and values["forearm"]["x"] == pytest.approx(-0.612)
    )
    assert values["wrist_2"]["y"] == pytest.approx(-0.1157) and values["hash"].startswith("calib_")
    robot = deviated(nominal).with_joint(5, a=0.0, alpha=0.0)
    read = yaml.safe_load(kinematics_yaml(robot, "calib_7"))["kinematics"]
    assert read["hash"] == "calib_7" and list(read)[:6] == ["shoulder", "upper_arm", "forearm", "wrist_1",
                                                            "wrist_2", "wrist_3"]
    q = random_q(robot)
    position, rotation = np.zeros((len(q), 3)), np.tile(np.eye(3), (len(q), 1, 1))
    for i, name in enumerate(list(read)[:6]):
        link = read[name]
        position = position + rotation @ np.array([link["x"], link["y"], link["z"]])
        turn = Rotation.from_euler("xyz", [link["roll"], link["pitch"], link["yaw"]]).as_matrix()
        about = Rotation.from_rotvec(q[:, i : i + 1] * [0.0, 0.0, 1.0]).as_matrix()
        rotation = rotation @ turn @ about
    here = flange(bare(robot), q)
    assert np.abs(position - here[0]).max() < 1e-12 and np.abs(rotation - here[1]).max() < 1e-12
    assert len(link_origins(robot)) == 6
    with pytest.raises(InputError, match="six turning axes"):
        kinematics_yaml(load_robot("racer-7-1.4").with_joint(0, sign=-1.0))


@pytest.mark.parametrize("format, given, said", [
    ("ur_description", "x y", "--hash 'x y': expected calib_ and a whole number"),
    ("ur_description", "calib_1\nmalicious: 1", "expected calib_ and a whole number"),
    ("urdf", "calib_7", "--hash acts with --format ur_description only"),
])
def test_a_hash_of_another_form_is_refused(format, given, said):
    with pytest.raises(InputError, match=said):
        ea.export("ur10", format=format, hash=given)


@pytest.mark.parametrize("name", ["tx40", "racer-7-1.4", "gen3lite"])
def test_ur_description_of_another_arm_is_refused(tmp_path, capsys, name):
    words = ["export", name, "--format", "ur_description", "--out", str(tmp_path / "out"), "--quiet"]
    assert main(words) == 2 and "arm" in (said := capsys.readouterr().err) and "of Universal Robots" in said
    assert not (tmp_path / "out/default_kinematics.yaml").exists()


def test_mujoco_builds_the_identified_arm():
    mujoco = pytest.importorskip("mujoco")
    robot = bare(identified(effects=False))
    model = mujoco.MjModel.from_xml_string(mjcf_text(robot))
    data, q = mujoco.MjData(model), random_q(robot, 10)
    position, rotation = flange(robot, q)
    for angles, p, r in zip(q, position, rotation):
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        assert np.abs(data.site("flange").xpos - p).max() < 1e-9
        assert np.abs(data.site("flange").xmat.reshape(3, 3) - r).max() < 1e-9
    assert model.body_mass.sum() == pytest.approx(sum(link.mass for link in robot.links))


@pytest.mark.parametrize("format, name", [
    ("urdf", "robot.urdf"), ("ur_description", "default_kinematics.yaml"), ("mjcf", "robot.xml"),
    ("csv", "parameters.csv"),
    ("offsets", "offsets.txt"), ("robodk", "station.py"),
])
def test_the_command_writes_the_file_and_what_it_loses(tmp_path, format, name):
    write_robot(tmp_path / "robot.toml", deviated(load_robot("ur10")))
    code = main(["export", str(tmp_path / "robot.toml"), "--format", format, "--out", str(tmp_path / "out"),
                 "--quiet"])
    result = json.loads((tmp_path / "out/result.json").read_text())
    assert code == 0 and (tmp_path / "out" / name).read_text() and result["file"] == name
    if format == "offsets":  # a page, no arm: the deviated lengths are not in it
        assert result["lost_max_m"] is None and "lengths and directions" in result["not_carried"][0]
    else:
        assert result["lost_max_m"] < (5e-3 if format == "ur_description" else 1e-9)


def test_a_page_of_offsets_has_no_loss_and_none_is_calculated(monkeypatch):
    def refused(*_):
        raise AssertionError("a loss that nothing tells")

    monkeypatch.setattr("exactarm.commands.export.lost", refused)
    result = ea.export(deviated(load_robot("ur10")), format="offsets")
    assert result["lost_mean_m"] is None and "off by" not in result.report.verdict


class _Item:
    """As much of an item of RoboDK as the script calls."""

    def __init__(self, station, name, chain=None):
        self.station, self.name, self.chain, self.pose = station, name, chain, None

    def Valid(self):
        return True

    def Parent(self):
        return "base"

    def setPose(self, pose):
        self.pose = np.array(pose.rows)

    def SolveFK(self, joints):
        matrix = np.eye(4)
        matrix[:3, 3] = 1e3 * self.chain.poses(np.radians([joints])).position[0] + [0.0, 0.0, 0.5]
        return _Mat(matrix)


class _Mat:
    def __init__(self, rows):
        self.rows = rows

    def Pos(self):
        return [row[3] for row in self.rows][:3]


def test_the_station_script_shows_the_identified_axes_and_measures_the_model(capsys, monkeypatch):
    """Run against a stand-in for RoboDK whose flange is half a millimetre off."""
    import sys
    from types import ModuleType

    robot = bare(identified(effects=False))
    chain, frames = reported_chain(robot), []

    class Station:
        def Item(self, name, kind):
            return _Item(self, name, chain)

        def AddFrame(self, name, parent):
            frames.append(_Item(self, name))
            return frames[-1]

    link, maths = ModuleType("robodk.robolink"), ModuleType("robodk.robomath")
    link.ITEM_TYPE_ROBOT, link.Robolink, maths.Mat = 2, Station, _Mat
    modules = {"robodk": ModuleType("robodk"), "robodk.robolink": link, "robodk.robomath": maths}
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    exec(compile(station_script(robot), "station.py", "exec"), {"__name__": "__main__"})
    assert "by 0.500 mm on average, 0.500 mm at most" in capsys.readouterr().out
    axes = [f"identified axis {i} at zero" for i in range(1, 7)]
    assert [frame.name for frame in frames] == [*axes, "identified flange at zero"]
    for frame, start, direction in zip(frames, chain.starts, chain.directions(), strict=False):
        np.testing.assert_allclose(frame.pose[:3, 2], direction, atol=1e-12)
        np.testing.assert_allclose(frame.pose[:3, 3], 1e3 * start.position, atol=1e-9)


def test_an_exact_file_is_said_to_be_exact_and_a_loss_has_its_size():
    result = ea.export("ur10", format="csv")
    assert result["lost_max_m"] < 1e-12
    assert result.verdict.endswith("exact to rounding.") and "nm" not in result.summary()
    lossy = ea.export("racer-7-1.4", format="csv")
    assert lossy["lost_mean_m"] > 1e-6 and "on average" in lossy.verdict and "lost, mean" in lossy.summary()


def test_a_coupling_of_the_controller_is_said_with_every_chain(tmp_path, capsys):
    """Its file's angles are those of the axes: at reported ones the flange is decimetres off."""
    robot = load_robot("ur10")
    coupled = replace(robot, controller=replace(robot.controller, coupling=((3, 2, 1.0), (6, 5, -0.5))))
    rule = "q_3 = reported_3 + reported_2, q_6 = reported_6 - 0.5 reported_5"
    write_robot(tmp_path / "coupled.toml", coupled)
    for form in ("urdf", "mjcf"):
        out = tmp_path / form
        assert main(["export", str(tmp_path / "coupled.toml"), "--format", form, "--out", str(out)]) == 0
        result = json.loads((out / "result.json").read_text())
        assert result["not_carried"][0] == f"coupling of axes: {rule}"
        assert "the file's joint angles are not those that the controller reports" in " ".join(
            capsys.readouterr().out.split())
    assert rule in (tmp_path / "urdf" / "robot.urdf").read_text()
