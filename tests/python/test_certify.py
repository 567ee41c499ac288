"""Certificates: rows that were never fitted, ISO 9283, the budget of uncertainty, the page and its
refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.data.rows import Source
from exactarm.errors import InputError
from exactarm.report import Highlights, printing
from exactarm.robot.writer import write_robot
from exactarm.verify.held_out import FRAME_POSES, choose_rows, controllers_robot, judge
from exactarm.verify.iso_9283 import LEAST_VISITS, iso_9283, repeatability
from exactarm.verify.uncertainty import budget, mean_with_interval
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis

NOISE_M = 5e-5


@pytest.fixture(scope="module")
def arm():
    return six_axis(springs=False, placed=False)


@pytest.fixture
def rng():
    return np.random.default_rng(12)


def visited(arm, truth, rng, poses=5, visits=30, others=40, **columns):
    """`poses` visited `visits` times among `others` visited once."""
    q = joints_in_limits(arm, poses + others, rng)
    order = np.concatenate([np.tile(np.arange(poses), visits), np.arange(poses, poses + others)])
    return measured(arm, [truth], [q[order]], NOISE_M, rng, **columns)


# -- which rows ----------------------------------------------------------------------------------------
def test_rows_of_an_unknown_file_find_frames_by_some_poses_and_judge_by_the_others(arm, rng):
    data = visited(arm, at_random_place(arm, rng), rng)
    rows = choose_rows((arm,), data, 1)
    assert not np.any(rows.judged & rows.frames) and np.all(rows.judged | rows.frames)
    assert rows.frames.sum() >= FRAME_POSES and np.all(rows.judged[:150])  # repeated poses judge
    assert rows.unseen and not rows.warnings


def test_rows_that_the_record_shows_as_fitted_do_not_judge(arm, rng):
    sources = (Source("one.csv", "aa", 40), Source("two.csv", "bb", 40))
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 80, rng)], NOISE_M, rng)
    data = replace(data, sources=sources, file_index=np.repeat([0, 1], 40))
    known = lambda *files: replace(
        arm, record={"command": "diagnose", "seed": 7, "data": [{"file": f, "sha256": f} for f in files]}
    )
    both = choose_rows((known("aa", "bb"),), data, 1)
    np.testing.assert_array_equal(both.judged, ~data.split(7))
    np.testing.assert_array_equal(both.frames, data.split(7))
    one = choose_rows((known("bb"),), data, 1)
    assert not one.judged[40:].any() and one.judged[:40].all() and one.warnings
    earlier = replace(arm, record={"command": "gear", "previous": known("aa", "bb").record})
    np.testing.assert_array_equal(choose_rows((earlier,), data, 1).judged, both.judged)
    alone = data.select(np.arange(40, 80))
    alone = replace(alone, sources=sources[1:], file_index=np.zeros(40, int))
    assert not choose_rows((known("aa", "bb"),), alone, 1).unseen


def test_the_column_set_is_obeyed(arm, rng):
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 60, rng)], NOISE_M, rng)
    marked = replace(data, identification=np.arange(60) < 30)
    np.testing.assert_array_equal(choose_rows((arm,), marked, 1).judged, np.arange(60) >= 30)


def test_too_few_poses_for_the_frames_are_told(arm, rng):
    data = visited(arm, at_random_place(arm, rng), rng, others=0)
    rows = choose_rows((arm,), data, 1)
    assert rows.judged.all() and rows.frames.all() and "5 different poses" in rows.warnings[0]


def test_before_is_the_chain_that_the_controller_works_with(arm, rng):
    better = arm.with_controller_frames.with_joint(
        1,
        a=arm.joints[1].a + 1e-3,
        q_offset=arm.offsets[1] + 1e-3,
        controller_offset=float(arm.offsets[1]),
        ratio=82.1,
        controller_ratio=82.0,
    )
    assert [j.a for j in controllers_robot(better).joints] == [j.a for j in arm.joints]
    np.testing.assert_array_equal(controllers_robot(better).offsets, arm.offsets)
    np.testing.assert_array_equal(controllers_robot(better).ratios, arm.ratios)
    with pytest.raises(InputError, match="expected --before"):
        controllers_robot(replace(arm, record={"command": "calibrate"}))


# -- the measures --------------------------------------------------------------------------------------
def test_repeatability_is_mean_distance_and_three_standard_deviations():
    points = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 2.0, 0], [0, -2.0, 0]])
    assert repeatability(points) == pytest.approx(1.5 + 3.0 * np.std([1, 1, 2, 2], ddof=1))


def test_accuracy_repeatability_directions_drift_and_distances_of_known_errors():
    """A pose 3 mm off along x from one side and 1 mm from the other, drifting by 2 mm along y; noise of 10
    um."""
    rng, visits = np.random.default_rng(3), 40
    q = np.repeat([[0.1, 0.2], [0.3, -0.4]], visits, axis=0)
    side = np.tile([-1.0, 1.0], visits)[:, None] * np.ones(2)
    time = np.tile(np.arange(visits) * 60.0, 2)
    error = np.zeros((2 * visits, 3))
    error[:, 0] = np.where(side[:, 0] > 0, 3e-3, 1e-3)
    drifting = np.where(np.arange(2 * visits) < visits, 2e-3 * time / time.max(), 0.0)
    error[:, 1] = drifting
    error += rng.normal(0.0, 1e-5, error.shape)
    predicted = np.repeat([[0.0, 0, 0], [1.0, 0, 0]], visits, axis=0)
    data = Dataset.of_arrays("poses", {"q": q, "approach": side}, position=predicted + error, time=time)
    none = np.zeros_like(error)
    found = iso_9283(data, error, none, predicted + error, predicted, 1)
    assert len(found.poses) == 4 and found.visits == visits // 2
    still = sorted(test.accuracy_before for test in found.poses if test.row >= visits)
    np.testing.assert_allclose(still, [1e-3, 3e-3], atol=1e-5)
    assert found.directions[0] == pytest.approx(2e-3, abs=2e-5) and found.directions[1] == 0.0
    assert found.directions[2] == 2
    # along y, from the side that is 1 mm off: mean of the first four and the last three of its twenty visits
    first, last = 2e-3 * 3.0 / 39.0, 2e-3 * 36.0 / 39.0
    assert found.drift[0] == pytest.approx(np.hypot(1e-3, last) - np.hypot(1e-3, first), abs=2e-5)
    assert found.drift[1] == 0.0 and found.drift[3] == pytest.approx(38.0 / 60.0)
    # of two poses with two sides each; what the sides differ by is no scatter
    assert sorted(found.distances.length) == pytest.approx([0.998, 1.0, 1.0, 1.002], abs=1e-4)
    assert found.distances.repeatability < 1e-4  # 3 sqrt(2) times 10 um are 4e-5, of the largest of four
    assert abs(found.distances.after[0]) < 1e-12 and found.distances.repeatability is not None
    assert not found.missing


def test_what_the_rows_do_not_allow_is_named_with_its_reason():
    data = Dataset.of_arrays("poses", {"q": np.arange(8.0).reshape(4, 2)}, position=np.eye(4, 3))
    found = iso_9283(data, np.zeros((4, 3)), np.zeros((4, 3)), np.eye(4, 3), np.eye(4, 3), 1)
    assert not found.poses and found.directions is None and found.drift is None
    assert f"{LEAST_VISITS} times" in found.missing["pose accuracy AP and repeatability RP"]
    assert "approach_i" in found.missing["multi-directional pose accuracy variation vAP"]
    assert "time_s" in found.missing["drift of pose accuracy dAP and of repeatability dRP"]
    assert len(found.distances.length) == 6 and "distance repeatability RD" in found.missing


# -- the budget ----------------------------------------------------------------------------------------
def test_the_budget_finds_the_noise_and_covers_the_held_out_rows(arm, rng):
    """The true model: repeatability is the noise, and 95 % of the rows lie within the radius."""
    data = visited(arm, at_random_place(arm, rng), rng, poses=20, visits=10, others=400)
    rows = choose_rows((arm,), data, 1)
    found = budget(data.select(rows.judged), judge(arm, data, rows), 2e-5)
    entries = {entry.source: entry for entry in found.entries}
    assert entries["repeatability"].u == pytest.approx(NOISE_M, rel=4.0 / np.sqrt(2.0 * 540))
    assert entries["repeatability"].freedom == 540 and entries["instrument"].u == 2e-5
    assert entries["model"].u < 0.5 * NOISE_M and entries["frames"].u < 0.3 * NOISE_M
    assert found.u == pytest.approx(np.sqrt(sum(entry.u**2 for entry in found.entries)))
    assert found.expanded == pytest.approx(found.coverage_factor * found.u)
    assert 1.9 < found.coverage_factor < 2.0
    assert 0.94 < found.share_within < 1.0


def test_an_instrument_that_makes_the_whole_residual_counts_once(arm, rng):
    data = visited(arm, at_random_place(arm, rng), rng, poses=0, visits=0, others=400)
    rows = choose_rows((arm,), data, 1)
    unknown, known = (budget(data.select(rows.judged), judge(arm, data, rows), u) for u in (None, NOISE_M))
    assert known.entries[-1].u < 0.5 * NOISE_M and known.u < 1.1 * unknown.u


def test_the_interval_of_the_mean_counts_poses_not_rows(arm):
    """Every pose ten times with one error: the interval is that of the poses."""
    rng = np.random.default_rng(8)
    each = rng.exponential(1e-3, 30)
    data = Dataset.of_arrays("poses", {"q": np.repeat(rng.normal(size=(30, 6)), 10, axis=0)})
    mean, low, high = mean_with_interval(data, np.repeat(each, 10))
    assert mean == pytest.approx(each.mean())
    assert high - low == pytest.approx(2 * 2.045 * each.std(ddof=1) / np.sqrt(30), rel=1e-3)


# -- the command -----------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """A calibrated virtual arm on data that it has not seen, with visits, directions and times."""
    folder, rng = tmp_path_factory.mktemp("certify"), np.random.default_rng(5)
    arm = six_axis(springs=False, placed=False)
    truth = true_robot(arm, rng)
    fitted = measured(arm, [truth], [joints_in_limits(arm, 120, rng)], NOISE_M, rng)
    write_robot(folder / "nominal.toml", arm)
    write_dataset(folder / "fitted.csv", fitted, arm)
    result = ea.calibrate(folder / "nominal.toml", folder / "fitted.csv", compliance=(), threads=1)
    result.save(folder / "calibrated")
    order = np.concatenate([np.tile(np.arange(5), 30), np.arange(5, 65)])
    q, rows = joints_in_limits(arm, 65, rng)[order], len(order)
    approach = np.repeat(rng.choice([-1.0, 1.0], rows)[:, None], 6, axis=1)
    new = measured(
        arm, [truth], [q], NOISE_M, rng, joints={"approach": approach}, time=60.0 * np.arange(rows)
    )
    write_dataset(folder / "new.csv", new, arm)
    (folder / "about.toml").write_text('serial = "20-1"\nmeasured = 2026-03-02\ninstrument = "tracker"\n')
    words = [
        str(folder / "calibrated" / "robot.toml"),
        str(folder / "new.csv"),
        "--out",
        str(folder / "out"),
        "--quiet",
    ]
    assert (
        cli.main(["certify", *words, "--about", str(folder / "about.toml"), "--instrument-u-mm", "0.01"]) == 0
    )
    return folder


@pytest.mark.slow
def test_the_command_certifies_by_rows_that_were_never_fitted(certified):
    result = json.loads((certified / "out" / "result.json").read_text())
    before, after = (result[when]["validation"] for when in ("before", "after"))
    assert before["mean"] > 1e-3 > 3e-4 > after["mean"]
    for when, summary in (("before", before), ("after", after)):
        value = result["mean_error_m"][when]
        assert (
            value["value"] == pytest.approx(summary["mean"])
            and value["ci95"][0] < summary["mean"] < value["ci95"][1]
        )
    iso = result["iso_9283"]
    assert iso["AP_after_max_m"] < 3e-4 < iso["AP_before_max_m"] and len(iso["pose_tests"]) == 10
    expected = NOISE_M * (
        np.sqrt(8.0 / np.pi) + 3.0 * np.sqrt(3.0 - 8.0 / np.pi)
    )  # of Maxwell's distribution
    assert iso["RP_max_m"] == pytest.approx(expected, rel=0.5)
    assert (
        iso["vAP_after_m"] < 2e-4
        and iso["drift_hours"] > 2.0
        and iso["AD_after_max_m"] < iso["AD_before_max_m"]
    )
    sources = [entry["source"] for entry in result["uncertainty"]["budget"]]
    assert sources == ["instrument", "repeatability", "frames", "model"]
    assert result["about"] == {
        "serial": "20-1",
        "instrument": "tracker",
        "instrument_u_mm": 0.01,
        "measured": "2026-03-02",
    }
    assert len(result["inputs"]) == 3 and len(result["robot_sha256"]) == 64
    (warning,) = result["warnings"]
    assert "asks for 30 visits" in warning
    assert result["rows"]["judged"] + result["rows"]["frames"] == 210


@pytest.mark.slow
def test_the_page_names_arm_instrument_and_hashes(certified):
    page, result = (
        (certified / "out" / "report.html").read_text(),
        json.loads((certified / "out" / "result.json").read_text()),
    )
    for text in (
        "20-1",
        "tracker",
        "2026-03-02",
        "pose accuracy AP",
        "Uncertainty (GUM)",
        result["inputs"][1]["sha256"],
    ):
        assert text in page, text


@pytest.mark.slow
def test_the_page_is_printed_where_a_browser_is_there(certified):
    said = json.loads((certified / "out" / "result.json").read_text())["pdf"]
    if said["file"] is None:
        assert not (certified / "out" / "certificate.pdf").exists() and said["why"]
        pytest.skip(said["why"])
    assert (certified / "out" / "certificate.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
def test_without_a_browser_the_certificate_is_complete_and_says_so(certified, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(printing.shutil, "which", lambda name: None)
    words = [str(certified / "calibrated" / "robot.toml"), str(certified / "new.csv"), "--out", str(tmp_path)]
    assert cli.main(["certify", *words]) == 0
    said = json.loads((tmp_path / "result.json").read_text())
    assert (
        said["pdf"]["file"] is None
        and "no browser" in said["pdf"]["why"]
        and "no PDF" in capsys.readouterr().out
    )
    assert any("not on this certificate: robot, serial no.;" in warning for warning in said["warnings"])


@pytest.mark.slow
def test_rows_that_were_fitted_are_left_out_by_the_record(certified):
    result = ea.certify(certified / "calibrated" / "robot.toml", certified / "fitted.csv", threads=1)
    assert result["rows"]["judged"] == 36 and "held out" in result["rows"]["why"]
    alone = ea.load_robot(certified / "calibrated" / "robot.toml")
    assert alone.record["seed"] == 1


@pytest.mark.slow
def test_fitted_rows_are_never_certified_without_a_word(certified, tmp_path):
    """All files were fitted together with another one: everything counts as fitted, and the page says so."""
    robot = ea.load_robot(certified / "calibrated" / "robot.toml")
    data = [*robot.record["data"], {"file": "other.csv", "sha256": "0" * 64}]
    write_robot(tmp_path / "robot.toml", replace(robot, record={**robot.record, "data": data}))
    result = ea.certify(tmp_path / "robot.toml", certified / "fitted.csv", threads=1)
    assert any("all rows were fitted" in warning for warning in result.warnings)
    assert "never fitted" not in result.verdict and result.report.tone == "caution"


@pytest.mark.slow
@pytest.mark.parametrize(
    "change, line",
    [
        (["--instrument-u-mm", "fine"], "--instrument-u-mm: 'fine'; expected a standard uncertainty in mm"),
        (["--instrument-u-mm", "-1"], "--instrument-u-mm: '-1'; expected a standard uncertainty in mm"),
        (["--measured", "2.3.2026"], "--measured: '2.3.2026'; expected a date as 2026-03-02"),
        (["--before", "kr300"], "robot kr300: expected a declared geometry"),
    ],
)
def test_wrong_options_are_refused_in_one_line(certified, tmp_path, capsys, change, line):
    words = [
        str(certified / "calibrated" / "robot.toml"),
        str(certified / "new.csv"),
        "--out",
        str(tmp_path / "o"),
        "--quiet",
    ]
    assert cli.main(["certify", *words, *change]) == 2
    error = capsys.readouterr().err.strip()
    assert line in error and "\n" not in error and not (tmp_path / "o" / "result.json").exists()


@pytest.mark.slow
def test_poses_at_rest_are_no_path(certified, tmp_path, capsys):
    """A path of 61 m, with an accuracy of its own, stood on the certificate."""
    robot, poses = str(certified / "calibrated" / "robot.toml"), certified / "new.csv"
    again = tmp_path / "again.csv"
    again.write_text(poses.read_text() + "\n")
    for path, line in ((poses, "the file of the poses"), (again, "s apart, as of poses at rest")):
        words = ["certify", robot, str(poses), "--path", str(path), "--out", str(tmp_path / "o"), "--quiet"]
        assert cli.main(words) == 2
        error = capsys.readouterr().err
        assert f"{path}: --path: " in error and line in error and error.count("\n") == 1


@pytest.mark.slow
def test_a_wrong_key_or_cell_is_named_with_its_file(certified, tmp_path, capsys):
    (tmp_path / "about.toml").write_text("serialnumber = 3\n")
    robot = str(certified / "calibrated" / "robot.toml")
    code = cli.main(
        [
            "certify",
            robot,
            str(certified / "new.csv"),
            "--about",
            str(tmp_path / "about.toml"),
            "--out",
            str(tmp_path / "o"),
        ]
    )
    error = capsys.readouterr().err
    assert code == 2 and "about.toml: key 'serialnumber' is unknown; expected one of number, serial" in error
    text = (certified / "new.csv").read_text().splitlines()
    text[4] = text[4].replace(text[4].split(",")[0], "x", 1)
    (tmp_path / "bad.csv").write_text("\n".join(text) + "\n")
    assert cli.main(["certify", robot, str(tmp_path / "bad.csv"), "--out", str(tmp_path / "o")]) == 2
    error = capsys.readouterr().err
    assert "bad.csv, row 4, column time_s" in error and error.count("\n") == 1


@pytest.mark.slow
def test_shipped_measurements_of_another_set_up_certify_the_calibration(tmp_path):
    """Calibrated on series B, certified on series C, of which nothing was fitted: as `evaluate` finds it."""
    robot = ea.calibrate("ur10", ea.example("ur10/series_B"), threads=1).robot
    result = ea.certify(robot, ea.example("ur10/series_C"), threads=1)
    assert result["before"]["validation"]["mean"] > 0.85e-3 > 0.5e-3 > result["after"]["validation"]["mean"]
    assert (
        result["after"]["validation"]["n"] > 1900 and 0.9 < result["uncertainty"]["share_within_radius"] < 1.0
    )


def test_a_file_that_was_never_calibrated_is_not_compared_with_itself():
    """Its error is said once: it used to stay at 1.04 mm, "2.28 mm to 2.28 mm"."""
    result = ea.certify("ur10", ea.example("ur10/series_B"), threads=1)
    assert "by one model alone" in result.report.verdict and " to 2." not in result.report.verdict
    assert sum("before and after are one model" in warning for warning in result["warnings"]) == 1
    highlights = next(each for each in result.report.sections if isinstance(each, Highlights))
    assert all(item.before is None for item in highlights.items)


@pytest.mark.slow
def test_a_robot_of_python_knows_what_it_was_fitted_to():
    """Its rows were told to have been never fitted: the record came with the robot file alone."""
    data = ea.read("ur10", "ur10/series_B")
    made = ea.calibrate("ur10", data, compliance=(), threads=1)
    record = made.robot.record
    assert record["command"] == "calibrate" and record["seed"] == 1 and "date" not in record
    assert [entry["sha256"] for entry in record["data"]] == [source.sha256 for source in data.sources]
    told = ea.certify(made.robot, data, threads=1)
    assert told["rows"]["judged"] == np.sum(~data.split(1))
    again = ea.calibrate(made.robot, data, compliance=(), seed=2, threads=1).robot.record
    assert again["seed"] == 2 and again["previous"]["seed"] == 1
