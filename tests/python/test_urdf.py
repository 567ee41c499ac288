"""URDF in and out: the same poses and masses as the text says, by its own rules and by an independent
parser."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from exactarm import _core
from exactarm.errors import InputError
from exactarm.robot.robot import GearTable, Joint, Link, Placement, Robot
from exactarm.robot.urdf import read_urdf, reported_shift, roll_pitch_yaw, urdf_text, write_urdf
from exactarm.robot_file import load_robot, shipped_robots
from random_robot import random_rotation
from urdf_sample import link, random_urdf, urdf_pose

CHAINS = ["rrrrrr", "frrfrrrf", "rprcpr", "ccccccc", "pppr", "r", "frf", "prrrrrrrr"]
TIGHT = 1e-9  # m and rad, as promised


def read(tmp_path, text: str, ends: str = "", name: str = "sample.urdf") -> Robot:
    path = tmp_path / name
    path.write_text(text)
    return load_robot(f"{path}{ends}")


def poses(robot: Robot, q: np.ndarray) -> np.ndarray:
    position, rotation = _core.forward_kinematics(robot.core, q)
    out = np.tile(np.eye(4), (len(q), 1, 1))
    out[:, :3, 3], out[:, :3, :3] = position, rotation
    return out


# -- in ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("chain", CHAINS)
def test_read_robot_moves_as_the_text_says(tmp_path, chain, seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, chain)
    robot = read(tmp_path, text)
    names = [f"joint_{i}" for i, letter in enumerate(chain, start=1) if letter != "f"]
    assert robot.axes == len(names)
    q = rng.uniform(-2.5, 2.5, (10, robot.axes))
    expected = [urdf_pose(text, f"link_{len(chain)}", dict(zip(names, row))) for row in q]
    np.testing.assert_allclose(poses(robot, q), expected, atol=1e-12)
    np.testing.assert_allclose(robot.fk(q).matrix, expected, atol=1e-12)  # of its last link in its first


@pytest.mark.parametrize("seed", range(8))
def test_read_robot_weighs_as_an_independent_parser_says(tmp_path, seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, "rfrprrfrf")
    robot = read(tmp_path, text)
    model = pin.buildModelFromXML(text)
    data = model.createData()
    for _ in range(5):
        q, qd, qdd = rng.uniform(-2, 2, (3, robot.axes))
        expected = pin.rnea(model, data, q, qd, qdd)
        torque = _core.inverse_dynamics(robot.core, q[None], qd[None], qdd[None])
        np.testing.assert_allclose(np.ravel(torque), expected, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("angle, hayati",
                         [(0.0, True), (np.pi, True), (1e-3, True), (0.2, False), (np.pi / 2, False)])
def test_nearly_parallel_axes_get_hayatis_frame(tmp_path, angle, hayati):
    text = f"""<robot name="two"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="one" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
      <joint name="two" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
        <origin xyz="0.3 0.1 0.2" rpy="{angle!r} 0 0"/></joint></robot>"""
    robot = read(tmp_path, text)
    assert (robot.joints[0].beta is not None) == hayati
    if hayati:
        assert robot.joints[0].d == 0.0 and abs(robot.joints[0].alpha) < 0.01
        assert robot.joints[1].sign == (-1.0 if angle == np.pi else 1.0)


def test_limits_friction_and_ratio_are_read(tmp_path):
    text = """<robot name="one"><link name="a"/><link name="b"/>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="2" velocity="3" effort="4"/><dynamics damping="5" friction="6"/></joint>
      <transmission name="t"><joint name="j"/>
        <actuator name="m"><mechanicalReduction>-50.5</mechanicalReduction></actuator>
      </transmission></robot>"""
    joint = read(tmp_path, text).joints[0]
    assert (joint.q_min, joint.q_max, joint.q_dot_max, joint.torque_max) == (-1, 2, 3, 4)
    assert (joint.viscous, joint.coulomb, joint.ratio) == (5, 6, -50.5)
    assert read(tmp_path, text.replace("-50.5", "1")).joints[0].ratio is None
    for wrong in ("0", "nan", "many"):
        with pytest.raises(InputError, match="transmission of joint j: .*expected a gear ratio"):
            read(tmp_path, text.replace("-50.5", wrong))
    continuous = read(tmp_path, text.replace('"revolute"', '"continuous"')).joints[0]
    assert continuous.q_min is None and continuous.q_dot_max == 3


def test_gravity_follows_the_first_frame(tmp_path):
    text = """<robot name="wall"><link name="a"/><link name="b"/>
      <joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>
    </robot>"""
    robot = read(tmp_path, text)
    np.testing.assert_allclose(robot.base.rotation @ robot.gravity, [0, 0, -9.81], atol=1e-12)
    np.testing.assert_allclose(robot.gravity[2], 0.0, atol=1e-12)


# -- which chain -------------------------------------------------------------------------------------
def tree(*joints: str, name: str = "tree") -> str:
    """One joint as "parent>child" (turns) or "parent=child" (fixed)."""
    links, out = [], []
    for index, joint in enumerate(joints):
        kind, ends = ("continuous", joint.split(">")) if ">" in joint else ("fixed", joint.split("="))
        links += [end for end in ends if end not in links]
        out.append(f'<joint name="j{index}" type="{kind}"><parent link="{ends[0]}"/><child '
                   f'link="{ends[1]}"/></joint>')
    return f'<robot name="{name}">' + "".join(f'<link name="{end}"/>'
                                              for end in links) + "".join(out) + "</robot>"


def test_fixed_branches_do_not_stop_the_reader(tmp_path):
    text = tree("world=base", "base=camera", "base>a", "a=cover", "a>b", "b=tool0", "b=sensor")
    assert read(tmp_path, text).axes == 2


def test_a_branching_chain_is_refused_with_the_tips(tmp_path):
    text = tree("base>a", "a>left", "a>right", "right=hand")
    with pytest.raises(InputError, match="branches at link a; expected a tip, as in sample.urdf#TIP, of a, "
                                         "left, hand"):
        read(tmp_path, text)
    assert read(tmp_path, text, "#hand").axes == 2
    assert read(tmp_path, text, "#a:hand").axes == 1
    with pytest.raises(InputError, match="no link 'elbow'; expected one of base, a, left"):
        read(tmp_path, text, "#elbow")
    with pytest.raises(InputError, match="no way from link left to link hand"):
        read(tmp_path, text, "#left:hand")


@pytest.mark.parametrize(
    "text, words",
    [
        ("<robot", "no valid XML"),
        ("<sdf/>", "expected <robot>"),
        ('<robot name="r"/>', "no <link>"),
        ('<robot name="r"><link name="a"/></robot>', "no joint moves"),
        (tree("a=b"), "no joint moves"),
        (tree("a>b", "c>d"), "2 links without a parent"),
        (tree("a>b", "b>a"), "loop"),
        (tree("r>s", "a>b", "b>a"), "loop"),
        (tree("a>b", "c>b"), "child of two joints"),
        (tree("a>b", "b=c", "b=d"), "several ends"),
        (tree("a>b").replace('link="b"/></joint>', 'link="x"/></joint>'), "no link 'x'"),
        (tree("a>b").replace("continuous", "floating"), "type 'floating'"),
        (tree("a>b").replace("</joint>", '<origin xyz="0 0 ${height}"/></joint>'), "joint j0: xyz="),
        (tree("a>b").replace("</joint>", '<origin xyz="0 0"/></joint>'), "3 finite number"),
        (tree("a>b").replace("</joint>", '<axis xyz="0 0 0"/></joint>'), "axis of length 0"),
        (tree("a>b").replace('<link name="b"/>', '<link name="b"/><link name="b"/>', 1),
         "link b: name given twice"),
    ],
)
def test_a_file_that_is_no_chain_is_refused(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert words in str(caught.value) and str(tmp_path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_robot(tmp_path / "none.urdf")


# -- out ---------------------------------------------------------------------------------------------
def calibrated(seed: int, axes: int = 6) -> Robot:
    """A robot as a calibration leaves it: every parameter off its round value, offsets other than the
    controller's."""
    rng = np.random.default_rng(seed)
    joints = []
    for index in range(axes):
        zero, alpha, offset, reported = rng.choice([0.0, np.pi / 2, -np.pi / 2],
                                                   4) + rng.normal(size=4) * 1e-3
        hayati = index in (1, 2)
        geometry = {"beta": rng.normal() * 1e-3, "d": 0.0} if hayati else {"d": rng.uniform(-1, 1)}
        kind = "prismatic" if seed % 3 == 0 and index == 3 else "revolute"
        limits = {"q_min": -2.0, "q_max": 2.5} if index % 2 else {}
        joints.append(
            Joint(kind, rng.choice([-1.0, 1.0]), zero, a=rng.uniform(-1, 1), alpha=alpha, q_offset=offset,
                  controller_offset=reported, ratio=100.0, **geometry, **limits)
        )
    spread = lambda: random_rotation(rng) @ np.diag(rng.uniform(0.2, 0.3, 3))
    links = []
    for _ in range(axes):
        half = spread()
        links.append(Link(rng.uniform(1, 9), rng.uniform(-0.2, 0.2, 3), half @ half.T))
    place = lambda: Placement(random_rotation(rng), rng.uniform(-2, 2, 3))
    return Robot("calibrated & <checked>", tuple(joints), tuple(links), base=place(), tool=place())


def reported_and_real(robot: Robot, seed: int) -> tuple[np.ndarray, np.ndarray]:
    reported = np.random.default_rng(seed).uniform(-2, 2, (20, robot.axes))
    theta = (reported - robot.controller_offsets) * robot.controller_ratios
    return reported, theta / robot.ratios + robot.offsets


@pytest.mark.parametrize("seed", range(12))
def test_written_robot_moves_as_the_calibrated_one(seed):
    robot = calibrated(seed)
    reported, real = reported_and_real(robot, seed)
    text = urdf_text(robot)
    expected = poses(robot, real)
    found = [urdf_pose(text, "tool", {f"joint_{i + 1}": value for i, value in enumerate(row)})
             for row in reported]
    np.testing.assert_allclose(found, expected, atol=TIGHT)
    assert abs(reported_shift(robot, 0)) > 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_an_independent_parser_reads_the_same_poses_and_torques(tmp_path, seed):
    robot = calibrated(seed)
    # the parser's gravity is the device's
    robot = replace(robot, base=Placement(position=robot.base.position))
    robot = replace(robot, joints=tuple(replace(joint, q_min=-9.0, q_max=9.0) for joint in robot.joints))
    write_urdf(tmp_path / "out.urdf", robot)
    model = pin.buildModelFromUrdf(str(tmp_path / "out.urdf"))
    data = model.createData()
    rates = np.random.default_rng(seed).normal(size=(2, 20, robot.axes))
    for reported, real, expected, qd, qdd in zip(*reported_and_real(robot, seed),
                                                 poses(robot, reported_and_real(robot, seed)[1]), *rates):
        pin.framesForwardKinematics(model, data, reported)
        found = data.oMf[model.getFrameId("tool")].homogeneous
        np.testing.assert_allclose(found, expected, atol=TIGHT)
        torque = _core.inverse_dynamics(robot.core, real[None], qd[None], qdd[None])
        np.testing.assert_allclose(pin.rnea(model, data, reported, qd, qdd), np.ravel(torque), rtol=1e-8,
                                   atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_a_simulator_reads_the_same_poses(seed):
    robot = calibrated(seed)
    # The simulator would melt fixed links into their parents, and the target with them.
    text = urdf_text(robot).replace("</robot>", '<mujoco><compiler fusestatic="false"/></mujoco></robot>')
    model = mujoco.MjModel.from_xml_string(text)
    data, tool = mujoco.MjData(model), mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "tool")
    reported, real = reported_and_real(robot, seed)
    for q, expected in zip(reported, poses(robot, real)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.xpos[tool], expected[:3, 3], atol=TIGHT)
        np.testing.assert_allclose(data.xmat[tool].reshape(3, 3), expected[:3, :3], atol=TIGHT)


@pytest.mark.parametrize("name", [name for name in shipped_robots() if load_robot(name).has_geometry])
def test_shipped_robots_survive_the_way_out_and_in(tmp_path, name):
    robot = load_robot(name)
    write_urdf(tmp_path / "out.urdf", robot)
    back = read_urdf(tmp_path / "out.urdf")
    q = np.random.default_rng(1).uniform(-2, 2, (30, robot.axes))
    np.testing.assert_allclose(poses(back, q), poses(robot, q), atol=1e-12)
    for one, other in zip(robot.joints, back.joints):
        for field in ("d", "a", "alpha", "ratio", "q_min", "q_max", "q_dot_max", "torque_max", "coulomb",
                      "viscous"):
            if getattr(one, field) is None:
                assert getattr(other, field) is None
            # the Racer's frames follow the thesis, not Hayati at axis 2
            elif field != "d" or name != "racer-7-1.4":
                np.testing.assert_allclose(getattr(other, field), getattr(one, field), atol=1e-12)


def test_what_urdf_cannot_carry_is_told():
    text = urdf_text(load_robot("racer-7-1.4"))
    comment = text[text.index("<!--") : text.index("-->")]
    for words in ("gear harmonics of joint 3", "spring of joint 6", "rotor inertia of joint 1",
                  "controller reports"):
        assert words in comment
    gear = replace(calibrated(1).joints[0], cw=GearTable(np.ones(1), np.ones(1), np.ones(1)))
    assert "gear harmonics of joint 1" in urdf_text(Robot("a--b", (gear,)))
    with pytest.raises(InputError, match="no geometry"):
        urdf_text(load_robot("kr300"))


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-5, 3.0])
def test_roll_pitch_yaw_is_exact_also_at_its_singularity(pitch):
    rng = np.random.default_rng(3)
    for roll, yaw in rng.uniform(-3, 3, (20, 2)):
        rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
        np.testing.assert_allclose(pin.rpy.rpyToMatrix(*roll_pitch_yaw(rotation)), rotation, atol=1e-15)


def test_a_mass_off_the_chain_is_carried(tmp_path):
    rng = np.random.default_rng(7)
    text = tree("base>a", "a=box", "a>b", "b=tool0")
    text = text.replace('<link name="box"/>', link("box", rng)).replace('<link name="a"/>', link("a", rng))
    robot = read(tmp_path, text)
    model = pin.buildModelFromXML(text)
    np.testing.assert_allclose(robot.links[0].mass, model.inertias[1].mass)
    assert robot.links[1].mass == 0.0
