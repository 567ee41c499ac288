"""Many robots: one summary, only what is new is computed, a failure stops no other, any executor runs the
jobs."""

import re
from concurrent.futures import ThreadPoolExecutor

import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.batch import Job, Outcome, _report, read_jobs
from exactarm.report.terminal import render_text

SERIES = str(ea.example("ur10/series_B"))


@pytest.fixture
def manifest(tmp_path):
    (tmp_path / "poses.csv").write_text("q_1_rad\n0\n")
    path = tmp_path / "manifest.csv"
    path.write_text("name,command,robot,files,robust\n"
                    f"good,evaluate,ur10,{SERIES},\nbad,evaluate,ur10,poses.csv,\n"
                    f"third,calibrate,ur10,{SERIES},true\n")
    return path


@pytest.mark.slow
def test_a_failed_job_stops_no_other_and_the_summary_tells_of_all(manifest, tmp_path, capsys):
    assert cli.main(["batch", str(manifest), "--out", str(tmp_path / "fleet"), "--quiet"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"exactarm: error: {tmp_path}/fleet: 3 jobs: 2 computed, 0 kept")
    assert said.count("\n") == 1
    import pandas

    table = pandas.read_parquet(tmp_path / "fleet/summary.parquet").set_index("name")
    assert list(table["state"]) == ["done", "failed", "done"]
    assert "poses.csv" in table["why"]["bad"] and table["after_rms"]["third"] < table["before_rms"]["third"]
    page = (tmp_path / "fleet/report.html").read_text()
    assert 'href="good/report.html"' in page and "Failed, and why" in page
    assert (
        (tmp_path / "fleet/third/robot.toml").exists() and not (tmp_path / "fleet/bad/result.json").exists()
    )


def test_the_line_of_a_failed_batch_names_the_first_cause(tmp_path, capsys):
    (tmp_path / "manifest.csv").write_text("name,command,robot,files\nfirst,evaluate,ur10,missing.csv\n")
    words = ["batch", str(tmp_path / "manifest.csv"), "--out", str(tmp_path / "fleet"), "--quiet"]
    assert cli.main(words) == 1
    assert capsys.readouterr().err.endswith(
        "1 job: 0 computed, 0 kept because nothing had changed, 1 failed. first: missing.csv: no such file; "
        "expected a CSV or Parquet file\n")


@pytest.mark.slow
def test_what_has_not_changed_is_kept_and_what_has_is_computed(tmp_path):
    rows = [{"name": "one", "command": "evaluate", "robot": "ur10", "files": SERIES}]
    first = ea.batch(rows, tmp_path)
    again = ea.batch(rows, tmp_path)
    assert [r["jobs"][0]["state"] for r in (first, again)] == ["done", "kept"]
    assert again["jobs"][0]["after_rms"] == first["jobs"][0]["after_rms"]
    assert ea.batch(rows, tmp_path, again=True)["done"] == 1
    assert ea.batch(rows, tmp_path, seed=2)["done"] == 1


@pytest.mark.parametrize("spoil", [
    lambda place: ea.export("racer-7-1.4", format="urdf").save(place),
    lambda place: (place / "result.json").write_text('{"exactarm"'),
    lambda place: (place / "result.json").unlink(),
    lambda place: (place / ".batch").write_bytes(b"\xff"),
])
@pytest.mark.slow
def test_a_result_that_is_not_the_jobs_own_is_computed_again(spoil, tmp_path):
    rows = [{"name": "one", "command": "export", "robot": "ur10", "format": "csv"}]
    assert ea.batch(rows, tmp_path)["done"] == 1 and ea.batch(rows, tmp_path)["kept"] == 1
    spoil(tmp_path / "one")
    assert ea.batch(rows, tmp_path)["done"] == 1
    assert "ur10" in (tmp_path / "one/result.json").read_text()


@pytest.mark.parametrize("robot, files", [("x" * 300, SERIES), ("ur10", "x" * 300)])
def test_a_name_that_no_file_can_have_fails_its_job_alone(robot, files, tmp_path):
    rows = [{"command": "evaluate", "robot": robot, "files": files},
            {"command": "export", "robot": "ur10", "format": "csv"}]
    fleet = ea.batch(rows, tmp_path)
    assert [job["state"] for job in fleet["jobs"]] == ["failed", "done"]
    assert fleet["jobs"][0]["why"].startswith("x" * 300 + ": ")


@pytest.mark.parametrize("error, said", [
    (OSError(28, "No space left on device", "a.csv"), "a.csv: No space left on device"),
    (MemoryError("1 TB"), "not enough memory (1 TB); expected fewer rows at a time"),
])
def test_a_limit_of_the_machine_is_no_fault_of_a_job(error, said, tmp_path, monkeypatch):
    def full(*_):
        raise error

    monkeypatch.setattr("exactarm.commands.batch.execute", full)
    fleet = ea.batch([{"command": "export", "robot": "ur10", "format": "csv"}], tmp_path)
    assert fleet["jobs"][0]["why"] == said and fleet.exit_code == 1


@pytest.mark.slow
def test_any_executor_runs_the_jobs(manifest, tmp_path):
    with ThreadPoolExecutor(2) as pool:
        fleet = ea.batch(manifest, tmp_path / "fleet", executor=pool)
    assert list(fleet.to_dataframe()["state"]) == ["done", "failed",
                                                   "done"], list(fleet.to_dataframe()["why"])
    assert "1 failed" in str(fleet)


@pytest.mark.slow
def test_a_cluster_of_dask_runs_the_jobs(tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the package distributed (dask)")
    rows = [{"command": "evaluate", "robot": "ur10", "files": SERIES}]
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False,
                                  dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            assert ea.batch(rows, tmp_path, executor=client.get_executor())["done"] == 1


@pytest.mark.parametrize("row, message", [
    ({"command": "calibrte", "robot": "ur10"}, "row 1, column command: 'calibrte': did you mean calibrate"),
    ({"command": "calibrate", "robot": ""}, "row 1, column robot: is empty"),
    ({"name": "../up", "command": "calibrate", "robot": "ur10"},
     "row 1, column name: '../up'; expected letters"),
    ({"robot": "ur10"}, "column command: column missing"),
])
def test_a_wrong_row_is_refused_with_its_place(row, message):
    with pytest.raises(ea.InputError, match=message.replace("(", r"\(")):
        read_jobs([row])


@pytest.mark.parametrize("text, message", [
    ("command,robot,help\nevaluate,ur10,yes", "column help: 'help': the batch itself gives it"),
    ("command,robot,out\nevaluate,ur10,x", "column out: 'out': the batch itself gives it"),
    ("command,robot,fixtur\nevaluate,ur10,x", "column fixtur: 'fixtur': no option of these commands; "
                                               "did you mean fixture"),
    ("command,robot,\nevaluate,ur10,5", "column (no name)"),
    ("command,robot,options\nevaluate,ur10,--seed 2", "column options: expected a column for each option"),
    ("command,robot,files,files\nevaluate,ur10,a.csv,b.csv", "column files: column given twice"),
    ("command,robot\nevaluate,ur10,a.csv,b.csv", "row 1: has 2 cells more than there are columns"),
    ("command,robot\nevaluate,-h", "row 1, column robot: '-h'; expected a name, no option"),
    ("command,robot,files\nevaluate,ur10,--help", "row 1, column files: '--help'; expected a name"),
    ("name,command,robot\nA,evaluate,ur10\na,evaluate,ur10", "row 2, column name: 'a' again"),
    ("name,command,robot\nresult.json,evaluate,ur10", "row 1, column name: 'result.json' again"),
    (f"name,command,robot\n{'a' * 300},evaluate,ur10", "at most 100 bytes"),
])
def test_a_manifest_that_means_something_else_is_refused_before_any_job(tmp_path, text, message):
    (tmp_path / "manifest.csv").write_text(text + "\n")
    with pytest.raises(ea.InputError, match=re.escape(message)) as refused:
        read_jobs(tmp_path / "manifest.csv")
    assert "manifest.csv" in str(refused.value)


def test_a_manifest_of_a_spreadsheet_with_a_byte_order_mark_is_read(tmp_path):
    (tmp_path / "manifest.csv").write_text("name,command,robot\none,evaluate,ur10\n", encoding="utf-8-sig")
    assert [job.name for job in read_jobs(tmp_path / "manifest.csv")] == ["one"]


def test_options_become_words_and_files_are_found_beside_the_manifest(manifest):
    good, bad, third = read_jobs(manifest)
    assert third.words[-1] == "--robust" and "--robust" not in good.words
    assert bad.words[1] == str(manifest.parent / "poses.csv")
    assert good.key != third.key and isinstance(good,
                                                Job) and Outcome("a", "b", "c", "kept").before_rms is None


def test_the_overview_counts_in_whole_numbers_and_has_a_verdict_only_where_one_was_given():
    def overview(*verdicts):
        report = _report([Outcome(f"job_{k}", "evaluate", "ur10", "done", verdict)
                          for k, verdict in enumerate(verdicts)])
        return render_text(report)

    plain, judged = overview("", ""), overview("", "explained")
    assert "computed  2\n" in plain and "verdict" not in plain
    assert "verdict" in judged and "explained" in judged
