"""What a user of the package calls: one import, results that speak, robots and results as values."""

import doctest
import importlib
import inspect
import pickle
import re
import resource
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import exactarm as ea
from exactarm import cli
from exactarm.chain import Layout, predict_poses
from exactarm.commands.arguments import DEFAULT_SEED
from exactarm.commands.execute import parser_of
from exactarm.commands.listing import find_commands, import_command
from exactarm.effects import effect_from_table

matplotlib.use("agg")
SERIES = ea.example("ur10/series_B")
LONG_EXAMPLES = ("diagnose", "design")


@pytest.fixture(scope="module")
def result():
    return ea.calibrate("ur10", SERIES, threads=1)


def test_every_public_name_is_there_and_documented():
    for name in ea.NAMES:
        assert getattr(ea, name).__doc__, name
    present = set(find_commands())
    for name in set(ea.COMMANDS) & present:
        function = getattr(importlib.import_module(f"exactarm.commands.{name}"), name)
        assert inspect.getdoc(function), name
        assert (
            callable(getattr(ea, name))
            and str(inspect.signature(getattr(ea, name))) == str(inspect.signature(function))
        )


def test_every_public_name_is_in_the_reference():
    page = (Path(__file__).parents[2] / "docs" / "api.md").read_text()
    assert not {name for name in ea.__all__ if not re.search(rf"[.:]\s?{name}\b|\bea\.{name}\b", page)} - {
        "Result"}  # CommandResult by its name in the package
    assert "CommandResult" in page and "0x" not in str(inspect.signature(ea.calibrate))


def test_a_room_of_the_package_stays_a_module_and_is_the_command_of_its_name():
    module = importlib.import_module("exactarm.plan.optimal")
    assert inspect.ismodule(ea.plan) and ea.plan.optimal is module
    assert ea.plan("racer-7-1.4", "line", rate_hz=100)["solver"]["status"] == "solved"
    told = inspect.getdoc(ea.plan)  # by help(ea.plan), and ea.plan? at a prompt
    assert told.startswith("exactarm.plan(robot: 'AnyRobot', path:") and "also a package: Offline" in told


def test_shipped_data_are_named_as_shipped_robots_are(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["evaluate", "ur10", "ur10/series_B", "--out", "out", "--quiet"]
    assert cli.main(words) == 0 and str(SERIES) in (tmp_path / "out/result.json").read_text()
    assert ea.read("ur10/series_B", "ur10").sources == ea.read(SERIES, "ur10").sources
    (tmp_path / "ur10").mkdir()
    (tmp_path / "ur10/series_B").write_text("q_1_rad\n")  # the user's own file comes first
    assert cli.main(words) == 2
    assert "ur10/series_B: " in capsys.readouterr().err
    (tmp_path / "ur10/series_B").unlink()
    for name in ("ur10/series_X", "x" * 300, "ur10", "../ur10/series_B"):
        assert cli.main(["evaluate", "ur10", name, "--out", "out"]) == 2
        assert name[:100] in capsys.readouterr().err


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="calibrte"):
        _ = ea.calibrte


def processor_seconds(*words):
    """Of one run of the interpreter with these words, and what it has printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, run.stdout


@pytest.mark.slow
def test_help_imports_no_numerics_and_is_quick():
    """Below 0.2 s where an interpreter that does nothing takes 0.02 s: as a ratio it holds on a busy machine
    too, where the same work takes twice the processor time. The least of three runs each."""
    program = "import sys; from exactarm.cli import main; main(['--help']); print('numpy' in sys.modules)"
    ours, said = min(processor_seconds("-c", program) for _ in range(3))
    nothing, _ = min(processor_seconds("-c", "pass") for _ in range(3))
    assert said.endswith("False\n") and "calibrate" in said
    assert ours < 10.0 * nothing, (ours, nothing)


@pytest.mark.slow
def test_no_command_imports_plots_before_it_draws():
    """A wrong word or file is told without the half second that matplotlib takes."""
    program = ("import sys; from exactarm.commands.listing import find_commands, import_command\n"
               "print(len([import_command(name) for name in find_commands()]), 'matplotlib' in sys.modules)")
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    count, drawn = run.stdout.split()
    assert int(count) >= len(ea.COMMANDS) and drawn == "False"


@pytest.mark.parametrize("name", [name for name in ea.COMMANDS if name in find_commands()])
def test_python_and_command_line_have_one_default_seed(name):
    module = import_command(name)
    assert parser_of(module).get_default("seed") == DEFAULT_SEED
    if name != "accept":  # copies a draft: nothing is drawn, and the function has no seed
        assert inspect.signature(getattr(module, name)).parameters["seed"].default == DEFAULT_SEED


@pytest.mark.slow
def test_a_result_says_its_verdict_in_ten_lines(result):
    lines = str(result).splitlines()
    assert (
        4 <= len(lines) <= 10 and lines[1].startswith("The mean position error on poses that were never "
                                                      "fitted falls")
    )
    assert result.verdict in result.summary().replace("\n", " ") and "<table>" in result._repr_html_()


@pytest.mark.slow
def test_a_result_answers_by_key_by_name_and_as_a_table(result):
    assert result["after"]["validation"]["mean"] == result.after["validation"].mean
    assert result.after["validation"].mean < result.before["validation"].mean
    table = result.to_dataframe()
    validation = table[table["set"] == "validation"]
    assert validation["error_after_m"].mean() == pytest.approx(result.after["validation"].mean)
    with pytest.raises(ea.InputError, match="residuals.csv"):
        result.to_dataframe("residual.csv")


def test_plots_take_axes_and_give_axes(result):
    axes = Figure().subplots()
    assert result.plot(axes, "error_histogram") is axes and axes.has_data()
    assert len(result.plot(what="parameters")) > 1
    axes = Figure().subplots()  # of several panels one
    assert result.plot(axes, "parameters") is axes and axes.has_data() and axes.get_xlabel() == "change [mm]"
    with pytest.raises(ea.InputError, match="no figure 'parameter'; expected one of .*, parameters"):
        result.plot(axes, "parameter")


@pytest.mark.parametrize("make", [
    lambda: ea.plan("racer-7-1.4", "line", rate_hz=100),
    lambda: ea.identifiable("ur10", SERIES),
    lambda: ea.gear("kr300", [ea.example("kr300/run_A"), ea.example("kr300/run_B")]),
    pytest.param(lambda: ea.identify("tx40", ea.example("tx40/motion"), friction_only=True),
                 marks=pytest.mark.slow),  # it has none of one panel
])
@pytest.mark.slow
def test_a_figure_is_drawn_on_axes_that_exist(make):
    made = make()
    axes = Figure().subplots()
    assert made.plot(axes) is axes and axes.has_data() and axes.get_xlabel()


@pytest.mark.slow
@pytest.mark.drawn
def test_a_result_is_saved_as_the_command_line_saves_it(result, tmp_path):
    page = result.save(tmp_path / "out")
    assert page.read_text().count("SHA-256") == 1 and "exactarm.calibrate(" in page.read_text()
    assert ea.load_robot(tmp_path / "out" / "robot.toml").joints == result.robot.joints


@pytest.mark.slow
def test_results_are_values(result):
    again = ea.calibrate("ur10", ea.read(SERIES, "ur10"), threads=1)
    assert again == result and hash(again) == hash(result)
    assert pickle.loads(pickle.dumps(result)) == result
    assert ea.calibrate("ur10", SERIES, seed=2, threads=1) != result


def test_robots_are_values():
    one, other = ea.load_robot("racer-7-1.4"), ea.load_robot("racer-7-1.4")
    assert one.core is not None  # what is computed and kept takes no part
    assert one == other and hash(one) == hash(other) and pickle.loads(pickle.dumps(one)) == one
    assert one != one.with_joint(0, d=0.1) and one.joints[0] != one.joints[1]
    assert len({one, other, one.with_joint(0, d=0.1)}) == 2


def test_the_pose_at_the_controllers_angles_is_that_of_the_calibrated_chain(result):
    """To 1e-12 m; the core's kinematics at the same angles leave out the offsets that a calibration found."""
    robot, data = result.robot, ea.read(SERIES, "ur10")
    found = robot.fk(data.joints["q"][:50], of="target", seen_from="device")
    chain = predict_poses(robot, Layout.of(robot.effects, estimate=False), data.select(np.arange(50)),
                          tangents=False)
    np.testing.assert_allclose(found.position, chain.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rotation, chain.rotation, rtol=0, atol=1e-12)


def test_inverse_kinematics_of_a_calibrated_robot_returns_the_controllers_angles(result):
    random = np.random.default_rng(5)
    for q in random.uniform(-1.2, 1.2, (5, 6)):
        pose = result.robot.fk(q, of="target")
        np.testing.assert_allclose(result.robot.fk(result.robot.ik(pose, of="target"), of="target").matrix,
                                   pose.matrix, atol=2e-10)
        np.testing.assert_allclose(result.robot.ik(pose.matrix, q + 0.05, of="target"), q, atol=1e-7)


def test_the_jacobian_is_that_of_the_whole_chain():
    robot = ea.load_robot("racer-7-1.4")
    robot = ea.Robot(robot.name, robot.joints, robot.links, effects=(
        effect_from_table({"effect": "joint_compliance", "joint": 2, "linear_rad_per_Nm": 1e-5,
                           "cubic_rad_per_Nm3": 0.0}),))
    q, step = np.array([0.1, 1.2, 0.3, 0.4, 0.5, 0.6]), 1e-4
    slope = robot.jacobian(q)
    for axis, unit in enumerate(np.eye(6)):
        change = (robot.fk(q + step * unit).position - robot.fk(q - step * unit).position) / (2.0 * step)
        np.testing.assert_allclose(slope[:3, axis], change, atol=1e-7)
    assert slope.shape == (6, 6) and robot.jacobian(np.stack([q, q])).shape == (2, 6, 6)


def test_gravity_torque_follows_the_true_joint_angles():
    robot = ea.load_robot("racer-7-1.4")
    q, turned = np.array([0.1, 1.2, 0.3, 0.4, 0.5,
                          0.6]), robot.with_joint(1, q_offset=robot.joints[1].q_offset + 0.01,
                                                                          controller_offset=robot.joints[
                                                                              1
                                                                          ].q_offset)
    rigid = [arm.with_joint(1, spring_linear=None) for arm in (robot, turned)]
    np.testing.assert_allclose(rigid[1].inverse_dynamics(q),
                               rigid[0].inverse_dynamics(q + 0.01 * np.eye(6)[1]), atol=1e-2)
    assert abs(rigid[1].inverse_dynamics(q)[1] - rigid[0].inverse_dynamics(q)[1]) > 0.1


@pytest.mark.parametrize("module", [
    "exactarm.robot.robot", "exactarm.commands.call",
    *(pytest.param(f"exactarm.commands.{name}", marks=pytest.mark.slow if name in LONG_EXAMPLES else ())
      for name in ea.COMMANDS if name in find_commands()),
])
@pytest.mark.slow
def test_the_examples_in_the_docstrings_run(module):
    outcome = doctest.testmod(importlib.import_module(module),
                              optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert outcome.failed == 0


def test_a_robot_is_shown_in_a_line_and_a_wrong_name_gets_the_right_one():
    shown = repr(ea.load_robot("racer-7-1.4"))
    assert shown == "<Robot racer-7-1.4: 6 axes>"
    with pytest.raises(AttributeError, match="did you mean calibrate?"):
        ea.calibarte
    assert not hasattr(ea, "__wrapped__")


@pytest.mark.parametrize("ask, said", [
    (lambda robot: robot.fk([0.0] * 5), r"q has the shape (5,); expected (6,)"),
    (lambda robot: robot.fk([[0.0] * 7]), r"q has the shape (1, 7); expected (1, 6)"),
    (lambda robot: robot.fk([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]), "q[1] is nan; expected a finite number"),
    (lambda robot: robot.jacobian([np.inf] + [0.0] * 5), "q[0] is inf"),
    (lambda robot: robot.fk("home"), "q: no numbers"),
    (lambda robot: robot.fk([[0.0], [0.0, 1.0]]), "q: no numbers"),
    (lambda robot: robot.ik(np.eye(3)), "pose has the shape (3, 3); expected (4, 4)"),
    (lambda robot: robot.ik(np.full((4, 4), np.nan)), "pose[0, 0] is nan"),
    (lambda robot: robot.ik(robot.fk([0.1] * 6), start=[0.0] * 5), "start has the shape (5,)"),
    (lambda robot: robot.inverse_dynamics([0.0] * 6, [0.0] * 3), "q_dot has the shape (3,); expected (6,)"),
])
def test_a_robot_refuses_angles_that_are_none(ask, said):
    """A missing angle (nan) was taken as zero."""
    with pytest.raises(ea.InputError, match=re.escape(said)):
        ask(ea.load_robot("racer-7-1.4"))
