"""Words of `compensate` that no cell can mean are refused by their option."""

import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.compensate_report import OWN
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

TARGETS = "q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad\n0.8,-1.1,1.5,-0.3,1.0,-0.1\n"


@pytest.mark.parametrize("option, value, says", [
    ("--tool", "1,2,3,4,5,1e300", "expected 6 or 7 numbers with commas between them, none beyond 1e+06"),
    ("--start", "1e300,0,0,0,0,0", "expected 6 numbers"),
    ("--start", "nan,0,0,0,0,0", "expected 6 numbers"),
    ("--payload", "5000,0,0,80", "expected kg, and its centre in m, within 2 m of the flange"),
    ("--payload", "100000,0,0,0", "expected kg"),
    ("--payload", "-5,0,0,0.1", "expected a mass of 0 or more"),
    ("--start", "-10,-70,80", "expected 6 numbers"),
])
def test_a_word_that_no_cell_can_mean_is_refused(tmp_path, capsys, option, value, says):
    (tmp_path / "targets.csv").write_text(TARGETS)
    words = ["compensate", "ur10", str(tmp_path / "targets.csv"), option, value]
    assert cli.main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"{option} {value}: " in said and says in said
    assert not (tmp_path / "out" / "result.json").exists()


HEAVY = "the arm itself weighs 28.4 kg: is it in g or lb?"


@pytest.mark.parametrize("name, text, words, says", [
    ("targets.csv", TARGETS, ["--payload", "500,0,0,0.1"], f"--payload 500,0,0,0.1: 500 kg, {HEAVY}"),
    ("targets.csv", "".join(f"{line},{more}\n" for line, more in zip(
        TARGETS.splitlines(), ("payload_kg,payload_z_m", "5000,0.1"))), [],
     f"targets.csv, line 2: row 1: its payload is 5000 kg, {HEAVY}"),
    ("part.script", "set_payload(5000, [0, 0, 0.1])\nmovej([0.8, -1.1, 1.5, -0.3, 1.0, -0.1])\n",
     ["--points", "calculated"], f"its payload is 5000 kg, {HEAVY}"),
])
def test_a_payload_in_grams_is_refused_before_any_other_cause(tmp_path, capsys, name, text, words, says):
    (tmp_path / name).write_text(text)
    given = ["compensate", "ur10", str(tmp_path / name), *words, "--out", str(tmp_path / "out"), "--quiet"]
    assert cli.main(given) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and says in said and not (tmp_path / "out/result.json").exists()


def test_what_was_corrected_is_not_corrected_again(tmp_path):
    (tmp_path / "targets.csv").write_text(TARGETS)
    ea.compensate("ur10", tmp_path / "targets.csv").save(tmp_path / "out")
    with pytest.raises(InputError, match="targets.csv: compensate has written it for the real arm"):
        ea.compensate("ur10", tmp_path / "out" / "targets.csv")
    named = ea.compensate("ur10", tmp_path / "out" / "targets.csv", points="row 1")
    assert named.json["correction"]["n"] == 1


@pytest.mark.parametrize("send, name, line", [
    ("joint_trajectory", "trajectory.yaml", 1), ("servoj", "trajectory.script", 2),
    ("krl", "trajectory.src", 2), ("csv", "sent.csv", None)])
@pytest.mark.slow
def test_what_plan_has_written_for_the_real_arm_is_not_corrected(tmp_path, send, name, line):
    robot = load_robot("racer-7-1.4")
    ea.plan(robot, "line", rate_hz=100, send=send, threads=1).save(tmp_path / "plan")
    with pytest.raises(InputError, match=f"{name}: plan has written it"):
        ea.compensate(robot, tmp_path / "plan" / name, points="calculated")
    if line is not None:
        (tmp_path / name).write_bytes((tmp_path / "plan" / name).read_bytes())
        with pytest.raises(InputError, match=f"{name}, line {line}: joint angles for the real arm"):
            ea.compensate(robot, tmp_path / name, points="calculated")


def test_a_table_may_name_its_targets(tmp_path):
    head, row = TARGETS.split()
    (tmp_path / "targets.csv").write_text(f"Punkt;{head.replace(',', ';')}\nP1;{row.replace(',', ';')}\n"
                                          f"H\u00f6he;{row.replace(',', ';')}\n", encoding="utf-8")
    result = ea.compensate("ur10", tmp_path / "targets.csv", points="P*", columns={"Punkt": "name"})
    lines = result.contents["targets.csv"].decode().splitlines()
    assert result.json["correction"]["n"] == 1
    assert lines[0].startswith("Punkt;q_1_rad") and lines[1].startswith("P1;0.")
    assert lines[2] == "H\u00f6he;" + row.replace(",", ";")  # taught: right already


def test_a_krl_program_without_its_data_list_is_told_which_file_is_missing(tmp_path):
    (tmp_path / "Weld.src").write_text("DEF Weld()\nPTP XP1\nEND\n")
    with pytest.raises(InputError, match="Weld.src, line 2: point XP1 is not in Weld.src; expected it in "
                                         "the data list Weld.dat: give both files"):
        ea.compensate("ur10", tmp_path / "Weld.src", points="calculated")


def test_warnings_of_several_programs_name_their_file(tmp_path):
    """They named point and line alone, and were the same for both."""
    axes = "{A1 10,A2 -80,A3 90,A4 -20,A5 60,A6 0}"
    for name in ("one", "two"):
        (tmp_path / f"{name}.src").write_text(f"DEF {name}()\nPTP {axes}\n$X=XP1\nEND\n")
        (tmp_path / f"{name}.dat").write_text(f"DEFDAT {name}\nDECL E6AXIS XP1={axes}\nENDDAT\n")
    files = lambda *names: [tmp_path / f"{name}.{end}" for name in names for end in ("src", "dat")]
    told = ea.compensate("ur10", files("one", "two"), points="calculated").warnings
    left = "no motion that is read goes to XP1: they stay as they are"
    assert [f"one.src: {left}" in told, f"two.src: {left}" in told] == [True, True]
    assert all(line.startswith(("one.src: ", "two.src: ")) for line in told)
    assert left in ea.compensate("ur10", files("one"), points="calculated").warnings


def test_a_model_that_is_the_controllers_own_is_told(tmp_path):
    """All targets were told to be corrected, by some 1e-6 nm."""
    (tmp_path / "targets.csv").write_text(TARGETS)
    told = ea.compensate("ur10", tmp_path / "targets.csv")
    assert told.verdict == OWN and "nm" not in told.verdict and told["warnings"] == [OWN]
    changed = load_robot("ur10").with_controller_frames.with_joint(1, a=-0.63)
    assert "1 of 1 targets corrected" in ea.compensate(changed, tmp_path / "targets.csv").verdict


@pytest.mark.parametrize("name, said", [("tx40", "robot tx40 has not the lengths and axes of ur10"),
                                        ("racer-7-1.4", "is it another robot"), ("ur10", "")])
def test_the_nominal_file_of_another_robot_is_told_first(tmp_path, name, said):
    (tmp_path / "targets.csv").write_text(TARGETS)
    if not said:
        assert ea.compensate("ur10", tmp_path / "targets.csv", nominal=name).verdict == OWN
        return
    with pytest.raises(InputError, match=said):
        ea.compensate("ur10", tmp_path / "targets.csv", nominal=name)


def test_the_line_of_a_target_without_a_name_is_told_once(tmp_path):
    (tmp_path / "p.script").write_text("def p():\n  movej([0, -1.5, 1.5, 0, 1.5, 0])\n"
                                       "  movel(p[0.5, 0.1, 0.4, 0, 3.1, 0])\nend\n")
    with pytest.raises(InputError, match="p.script, line 3: a pose that the controller"):
        ea.compensate("ur10", tmp_path / "p.script", points="calculated")
