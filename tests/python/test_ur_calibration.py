"""The factory calibration of an arm of Universal Robots: the chain that its deltas stand for, and
refusals."""

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp


def written(folder, deltas, name="calibration.conf"):
    lines = ["[mounting]", *(f"{key} = [ {', '.join(map(repr, values))} ]" for key, values in deltas.items())]
    (folder / name).write_text("\n".join([*lines, "calibration_status = 2"]) + "\n")
    return f"{folder / name}#ur10"


def small(scale=1.0):
    """Deltas that keep the flange near: without the large theta and d."""
    random = np.random.default_rng(3)
    sizes = {"delta_theta": 1e-3, "delta_a": 1e-3, "delta_d": 1e-3, "delta_alpha": 1e-3}
    return {key: (scale * size * random.normal(size=6)).tolist() for key, size in sizes.items()}


def product(robot, deltas, q):
    """Denavit and Hartenberg's product written out."""
    place = np.eye(4)
    for i, joint in enumerate(robot.joints):
        theta, a, d, alpha = (deltas[key][i] for key in ("delta_theta", "delta_a", "delta_d", "delta_alpha"))
        step = np.eye(4)
        step[:3, :3] = exp(np.array([0, 0, q[i] + robot.offsets[i] + theta])) @ exp(
            np.array([joint.alpha + alpha, 0, 0])
        )
        angle = q[i] + robot.offsets[i] + theta
        step[:3, 3] = [(joint.a + a) * np.cos(angle), (joint.a + a) * np.sin(angle), joint.d + d]
        place = place @ step
    return place


def parallel_far():
    """Small deltas whose axes 2 to 4 are written with d of hundreds of metres: a shift along axis 2 and
    back."""
    deltas = small()
    tilt, way = 2e-5, 300.0  # rad, m: 6 mm at the flange
    deltas["delta_d"][1] += way
    deltas["delta_d"][2] -= way
    deltas["delta_alpha"][1] = tilt
    return deltas


@pytest.mark.parametrize("deltas", [small(), parallel_far()])
def test_the_arm_is_the_product_of_the_frames_with_their_deltas(tmp_path, deltas):
    nominal, robot = ea.load_robot("ur10"), ea.load_robot(written(tmp_path, deltas))
    for q in np.random.default_rng(2).uniform(-3.0, 3.0, (20, 6)):
        expected = product(nominal, deltas, q)
        np.testing.assert_allclose(robot.fk(q, of="target", seen_from="device").matrix, expected, atol=1e-9)
    assert robot.controller.chain == "calibrated" and len(robot.controller.frames) == 6
    assert max(abs(joint.d) for joint in robot.joints) < 1.0  # nothing is hundreds of metres away
    heavy = [arm.inverse_dynamics(np.full(6, 0.4)) for arm in (nominal, robot)]
    np.testing.assert_allclose(heavy[0], heavy[1], atol=1.0)


def test_no_deltas_are_the_nominal_arm(tmp_path):
    nominal, robot = ea.load_robot("ur10"), ea.load_robot(written(tmp_path, small(0.0)))
    q = np.random.default_rng(2).uniform(-3.0, 3.0, (20, 6))
    found, expected = (arm.fk(q, of="target", seen_from="device") for arm in (robot, nominal))
    np.testing.assert_allclose(found.position, expected.position, atol=1e-12)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"delta_a": [1.0, 2.0]}, "line 3: delta_a has 2 numbers; expected 6"),
        ({"delta_d": ["x"] * 6}, "line 4: delta_d: expected 6 numbers"),
        ({"delta_d": [0.0, 10.0, 0.0, 0.0, 0.0, 0.0]}, "puts the flange 10000 mm from that of ur10"),
    ],
)
def test_a_wrong_file_is_refused_by_its_line(tmp_path, capsys, change, said):
    robot = written(tmp_path, small(0.0) | change)
    with pytest.raises(InputError, match=said):
        ea.load_robot(robot)
    words = ["evaluate", robot, str(ea.example("ur10/series_B")), "--out", str(tmp_path / "o"), "--quiet"]
    assert cli.main(words) == 2 and capsys.readouterr().err.count("\n") == 1


def test_a_missing_key_or_nominal_arm_is_named(tmp_path):
    deltas = small()
    del deltas["delta_alpha"]
    with pytest.raises(InputError, match="delta_alpha is missing"):
        ea.load_robot(written(tmp_path, deltas))
    with pytest.raises(InputError, match="expected the nominal arm behind it, as calibration.conf#ur10"):
        ea.load_robot(written(tmp_path, small()).partition("#")[0])


@pytest.mark.parametrize("arm", ["tx40", "racer-7-1.4"])
def test_an_arm_that_is_not_built_so_is_refused(tmp_path, arm):
    with pytest.raises(InputError, match="is not built as an arm of Universal Robots"):
        ea.load_robot(written(tmp_path, small()).replace("ur10", arm))


def test_a_xacro_that_cannot_be_expanded_is_refused_with_the_line_of_its_include(tmp_path):
    text = (
        '<robot xmlns:xacro="x" name="a">\n<!-- <xacro:macro> -->\n<xacro:include filename="b"/>\n</robot>\n'
    )
    (tmp_path / "a.urdf.xacro").write_text(text)
    with pytest.raises(InputError, match=r"a.urdf.xacro, line 3: xacro cannot expand it: No such file"):
        ea.export("ur10", format="urdf", source=tmp_path / "a.urdf.xacro")
    with pytest.raises(InputError, match="is a xacro; expected it expanded"):
        ea.load_robot(tmp_path / "a.urdf.xacro")
