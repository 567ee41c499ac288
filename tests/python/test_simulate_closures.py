"""Virtual closures: the true target touches the fixture, the declared one does not; the files are those that
are read."""

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.cli import main
from exactarm.data.dataset import read_dataset
from exactarm.data.fixture import load_fixture
from exactarm.measurement.closures import predict_closures
from exactarm.measurement.contacts import TOUCHED
from exactarm.robot_file import load_robot


@pytest.mark.parametrize("contact", [*TOUCHED, pytest.param("pair", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_the_true_target_touches_within_the_noise(tmp_path, contact):
    words = ["simulate", "panda", "--measure", "closures", "--contact", contact, "--places", "2", "--count",
             "5",
             "--deviation", "1", "--effect", "gear_ratio joint=2 scale=1e-3", "--noise", "1e-6", "--counts",
             "0",
             "--out", str(tmp_path), "--quiet"]
    assert main(words) == 0
    truth = load_robot(tmp_path / "truth.toml")
    data = read_dataset(tmp_path / "closures.csv", truth, fixture=load_fixture(tmp_path / "fixture.toml"))
    assert data.kind == "closures" and set(data.session) == {1, 2}
    held = Layout.of(truth.effects, estimate=False)
    points = predict_closures(truth, held, data, tangents=False).view.signals["target"]
    if contact == "pair":
        for session, number in {(s, k) for s, k in zip(data.session, data.contacts["pair"])}:
            at = (data.session == session) & (data.contacts["pair"] == number)
            assert at.sum() == 2 and np.ptp(points[at], axis=0).max() < 6e-6
        return
    for session in (1, 2):
        for number in np.unique(data.contacts[contact]):
            thing = TOUCHED[contact](None, (), session, int(number))
            at = thing.rows(data)
            length = None if data.length is None else data.length[at]
            lack = thing.start(points[at], length).touch(points[at])[0]
            lack = lack if length is None else lack - length[:, None]
            assert at.sum() == 5 and np.max(np.abs(lack)) < 2e-5
