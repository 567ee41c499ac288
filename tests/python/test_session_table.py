"""A table of sessions gives every row what holds for its set-up, and refuses what it cannot mean."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import exactarm as ea
from exactarm.cli import main
from exactarm.data.dataset import Dataset
from exactarm.data.session_table import with_sessions
from exactarm.errors import InputError
from exactarm.first_aid.load_mistakes import payload_mistakes
from exactarm.robot_file import load_robot

DATA = Dataset.of_arrays(
    "poses", {"q": np.zeros((3, 2))}, session=np.array([2, 1, 2]), covariates={"humidity": np.ones(3)},
)


def given(tmp_path, text):
    path = tmp_path / "sessions.csv"
    path.write_text(text)
    return with_sessions(DATA, path)


def test_every_row_gets_the_columns_of_its_session(tmp_path):
    text = "session,payload_kg,payload_z_mm,temperature_degC\n1,0,0,20\n2,5.5,80,23\n3,1,0,9\n"
    data = given(tmp_path, text)
    mass, centre = data.payload
    np.testing.assert_allclose(mass, [5.5, 0.0, 5.5])
    np.testing.assert_allclose(centre, [[0, 0, 0.08], [0, 0, 0], [0, 0, 0.08]])
    np.testing.assert_allclose(data.covariates["temperature_degC"], [23.0, 20.0, 23.0])
    assert DATA.payload is None and "humidity" in data.covariates


@pytest.mark.parametrize("text, says", [
    ("payload_kg\n1\n", "column session: column missing"),
    ("session,payload_kg\n1,2\n", "session 2 of the data has no line"),
    ("session,payload_kg\n1,2\n2,3\n1,4\n", "row 3, column session: session 1 a second time"),
    ("session,payload_kg\n1,2\n2,-3\n", "row 2, column payload_kg: -3; expected a mass"),
    ("session,payload_kg\n1,2\n2,1e20\n",
     "row 2, column payload_kg: 1e+20 in SI units; expected at most 10000"),
    ("session,payload_z_m\n1,2\n2,200\n", "row 2, column payload_z_m: 200 in SI units; expected at most 100"),
    ("session,humidity\n1,2\n2,3\n", "column humidity: is given already"),
    ("session,q_1_rad\n1,2\n2,3\n", "column q_1_rad: is measured row by row"),
    ("session,payload_x_inch\n1,2\n2,3\n", "unknown unit"),
    ("session,payload_kg,payload_zmm\n1,0,0\n2,5,80\n",
     "column payload_zmm: would not be read; did you mean payload_z_mm?"),
    ("session,paylod_kg\n1,2\n2,3\n", "column paylod_kg: would not be read; did you mean payload_kg?"),
])
def test_what_it_cannot_mean_is_refused(tmp_path, text, says):
    with pytest.raises(InputError) as refused:
        given(tmp_path, text)
    assert says in str(refused.value)


def test_grams_and_millimetres_of_a_payload_are_told():
    robot = load_robot("ur10")
    payloads = lambda kg, z: Dataset.of_arrays("poses", {"q": np.zeros((2, 6))}, covariates={
        "payload_kg": np.array([0.0, kg]), "payload_z_m": np.array([0.0, z])})
    said = lambda kg, z: " ".join(each.text for each in payload_mistakes(robot, payloads(kg, z)))
    assert said(10.0, 0.08) == ""
    assert "payload_kg is up to 5000 kg, the arm itself weighs" in said(5000.0, 0.08)
    assert "80 m from the flange: is it in mm?" in said(10.0, 80.0)


@pytest.fixture(scope="module")
def two_set_ups():
    """Poses of an arm in two set-ups, of which a table tells the payloads."""
    poses = ea.simulate("ur10", count=60, counts=0, noise=1e-5, frames="declared").to_dataframe()
    return poses.assign(session=1 + (np.arange(len(poses)) % 2)).drop(columns="set", errors="ignore")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["calibrate", "evaluate"])
def test_the_table_is_named_with_its_hash(command, two_set_ups, tmp_path):
    """In the footer and in result.json; a robot file's `data` are the measured rows alone."""
    path, text = tmp_path / "sessions.csv", "session,payload_kg\n1,0\n2,4\n"
    path.write_text(text)
    hashed = hashlib.sha256(text.encode()).hexdigest()
    made = getattr(ea, command)("ur10", two_set_ups, sessions=path, threads=1)
    assert f"sessions={str(path)!r}" in made.asked.line
    made.save(tmp_path / "out")
    inputs = json.loads((tmp_path / "out/result.json").read_text())["inputs"]
    assert {"file": str(path), "sha256": hashed, "rows": 2} in inputs and len(inputs) == 2
    assert hashed[:12] in (tmp_path / "out/report.html").read_text()
    if made.robot is not None:
        data = ea.load_robot(tmp_path / "out/robot.toml").record["data"]
        assert [entry["file"] for entry in data] == ["table 1 in memory"]


def test_the_command_line_names_table_and_fixture_with_their_hashes(two_set_ups, tmp_path):
    touched = two_set_ups.assign(sphere=-1)
    touched.to_csv(tmp_path / "poses.csv", index=False)
    (tmp_path / "sessions.csv").write_text("session,payload_kg\n1,0\n2,4\n")
    (tmp_path / "fixture.toml").write_text('[[radii]]\ncontact = "sphere"\nnumber = 0\nradius_mm = 12.7\n')
    words = ["--sessions", str(tmp_path / "sessions.csv"), "--fixture", str(tmp_path / "fixture.toml")]
    words += ["--out", str(tmp_path / "out")]
    assert main(["evaluate", "ur10", str(tmp_path / "poses.csv"), *words]) == 0
    inputs = json.loads((tmp_path / "out/result.json").read_text())["inputs"]
    assert {Path(each["file"]).name for each in inputs} == {"poses.csv", "sessions.csv", "fixture.toml"}
    assert all(each["sha256"] == hashlib.sha256(Path(each["file"]).read_bytes()).hexdigest()
               for each in inputs)
