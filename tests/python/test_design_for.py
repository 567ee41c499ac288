"""`design --for`: the experiment of a diagnosis becomes poses that can be driven and read back."""

import json

import numpy as np
import pandas as pd
import pytest

from exactarm.cli import main
from exactarm.commands.design_for import experiment_json, minutes_of, read_experiments
from exactarm.data.dataset import read_dataset
from exactarm.diagnose.next_poses import Experiment
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

PLAIN = Experiment(np.deg2rad([[10.0, -60, 70, 20, 30, 40], [-50.0, -80, 90, 10, 20, 0]]), 0.0, 0.4, 1.0,
                   "this or that")
ONE = ('{{"experiments": [{{"poses_rad": [[{q}, -1, 1, 0.3, 0.5, 0.7]], "payload_kg": {kg}, "bits": {bits}, '
       '"open_bits": 1, "between": "this"}}]}}')
LOADED = Experiment(PLAIN.q[:1], 5.0, 0.9, 1.0, "this or that")


@pytest.fixture
def result(tmp_path):
    path = tmp_path / "result.json"
    path.write_text(json.dumps({"experiments": [experiment_json(PLAIN), experiment_json(LOADED)]}))
    return path


def test_what_was_written_is_read(result):
    found = read_experiments(result, load_robot("ur10"))
    assert (
        [e.payload_kg for e in found] == [0.0, 5.0] and np.allclose(found[0].q, PLAIN.q)
        and found[1].bits == 0.9
    )


def test_poses_are_written_for_both_directions_and_can_be_measured(result, tmp_path):
    assert main(["design", "ur10", "--for", str(result), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    path = tmp_path / "out" / "poses.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0] + ",x_m,y_m,z_m"] + [line + ",0.1,0.2,0.3" for line in lines[1:]])
                    + "\n")
    data = read_dataset([path], load_robot("ur10"))
    assert np.allclose(data.joints["q"], np.repeat(PLAIN.q, 2, axis=0), atol=1e-9)
    assert np.array_equal(data.joints["approach"], np.tile([[-1] * 6, [1] * 6], (2, 1)))


@pytest.mark.parametrize("told, warns", [({"robot_name": "ur10"}, False), ({"robot_name": "ur5"}, True),
                                         ({"robot": "panda"}, True), ({"robot": "ur10"}, False),
                                         ({"robot": "cell/robot.toml"}, False), ({"robot_name": 5}, False)])
def test_the_diagnosis_of_another_robot_is_told_in_one_line(result, tmp_path, told, warns):
    result.write_text(json.dumps(json.loads(result.read_text()) | told))
    assert main(["design", "ur10", "--for", str(result), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    said = json.loads((tmp_path / "out" / "result.json").read_text()).get("warnings", [])
    assert [line for line in said if "is the diagnosis of" in line] == (said if warns else [])
    assert len(said) == warns


def test_minutes_of_the_user_choose(result, tmp_path):
    words = ["design", "ur10", "--for", str(result), "--minutes", "payload=0", "--minutes", "visit=1",
             "--out", str(tmp_path / "out"), "--quiet"]
    assert main(words) == 0
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    assert said["experiments"][0]["payload_kg"] == 5.0 and said["minutes"] == {"visit": 1.0, "payload": 0.0}


def test_loaded_poses_say_their_load_and_go_with_the_first_file(result, tmp_path):
    words = ["design", "ur10", "--for", str(result), "--minutes", "payload=0", "--out", str(tmp_path / "out"),
             "--quiet"]
    assert main(words) == 0
    loaded = pd.read_csv(tmp_path / "out" / "poses.csv").assign(x_m=0.1, y_m=0.2, z_m=0.3)
    first = loaded.assign(payload_kg=0.0, **{f"approach_{i}": 0 for i in range(1, 7)})
    paths = [tmp_path / "first.csv", tmp_path / "loaded.csv"]
    for path, table in zip(paths, (first, loaded)):
        table.to_csv(path, index=False)
    data = read_dataset(paths, load_robot("ur10"))
    mass, centre = data.payload
    assert list(mass) == [0.0, 0.0, 5.0, 5.0] and not centre.any()


@pytest.mark.parametrize("word", ["payload", "payload=-1", "visit=0", "coffee=5", "visit=nan"])
def test_minutes_that_are_none_are_refused(word):
    with pytest.raises(InputError, match="--minutes"):
        minutes_of([word])


@pytest.mark.parametrize("text, line", [
    ("{", "cannot be read"), ("[]", "cannot be read"), ("{}", "no experiments"),
    ('{"experiments": []}', "nothing to design"),
    ('{"experiments": [{"poses_rad": [[0, 1]]}]}', "experiment 1 does not fit"),
    ('{"experiments": [{"poses_rad": [[0,0,0,0,0]], "payload_kg": 0, "bits": 1, "open_bits": 1, "between": '
     '""}]}', "6 axes"),
    ("[" * 100_000, "nested too deeply"),
    (ONE.format(q=50.0, kg="0", bits="1"), "experiment 1, pose 1: axis 1 at 50 rad, expected -6.28"),
    (ONE.format(q=1e300, kg="0", bits="1"), "experiment 1, pose 1: axis 1 at 1e.300"),
    (ONE.format(q="1" + 400 * "0", kg="0", bits="1"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg="-5", bits="1"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg="true", bits="1"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg='"5"', bits="1"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg="0", bits="[1]"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg="0", bits="-1"), "experiment 1 does not fit"),
    (ONE.format(q=0.5, kg="0", bits="1").replace('"this"', "{}"), "experiment 1 does not fit"),
])
def test_what_is_no_diagnosis_is_refused_by_name(text, line, tmp_path):
    path = tmp_path / "result.json"
    path.write_text(text)
    with pytest.raises(InputError, match=line) as error:
        read_experiments(path, load_robot("ur10"))
    assert str(path) in str(error.value)
