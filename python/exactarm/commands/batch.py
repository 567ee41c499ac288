"""`exactarm batch`: many robots from one table; what has not changed is not computed again, a failure stops
no other.

    exactarm batch manifest.csv --out fleet --workers 4

A job is a row: name, command, robot, files (with ; between); further columns are options of its command. Its
key is the SHA-256 of command, options, version, robot file and data; `FOLDER/NAME/.batch` keeps the key of a
finished job and the SHA-256 of its result.json.
"""

from __future__ import annotations

import argparse
import csv
import difflib
import hashlib
import io
import json
import os
import re
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import exactarm
from exactarm.commands.call import AnyTable, command, listed, path_word
from exactarm.commands.execute import execute, parse, parser_of
from exactarm.commands.failure import explain
from exactarm.commands.listing import find_commands, import_command
from exactarm.commands.outcome import Asked
from exactarm.commands.output import ALWAYS, OutputFolder
from exactarm.commands.plain import sha256
from exactarm.commands.publish import publish, sources
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import JOBS, STEPS
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.files.examples import file_or_example
from exactarm.files.file_bytes import file_bytes
from exactarm.files.memory_table import MemoryTable, is_memory_table
from exactarm.files.table import parquet_table
from exactarm.progress import SILENT, Progress
from exactarm.report import Highlight, Highlights, Link, Quantity, Report, Table

NAME = "batch"
HELP = "many robots from one table: one summary, and only what is new is computed"
KEY = ".batch"
COLUMNS = ("name", "command", "robot", "files")
SUMMARY = "summary.parquet"
WRITES = (SUMMARY,)
TOO_MANY = "\0cells"  # key of the cells of a row beyond its columns; no column has this name
_NOT_IN_BATCH = ("batch", "demo")
_GIVEN = ("out", "threads", "quiet", "debug", "help")  # options that the batch gives to every job itself
_OWN_FILES = ("result.json", "report.html", SUMMARY)
_LONGEST_NAME = 100  # characters of a job's folder: every file system takes it
AnyManifest: TypeAlias = "AnyTable | Sequence[Mapping[str, Any]]"


@dataclass(frozen=True)
class Job:
    """One row: where its results go, and the words of its command line without `--out`."""

    name: str
    command: str
    robot: str
    words: tuple[str, ...]
    key: str


@dataclass(frozen=True)
class Outcome:
    """How a job ended: `state` is done, kept or failed; errors are RMS on the rows that judge, in `unit`."""

    name: str
    command: str
    robot: str
    state: str
    verdict: str = ""
    unit: str = ""
    before_rms: float | None = None
    after_rms: float | None = None
    seconds: float = 0.0
    why: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="MANIFEST", nargs=1, type=Path,
                        help="table of jobs: name, command, robot, files; further columns are "
                             "named as options of the commands")
    parser.add_argument("--workers", metavar="N", type=int, default=1,
                        help="processes at once (default %(default)s)")
    parser.add_argument("--again", action="store_true",
                        help="compute all jobs, those whose inputs have not changed too")


@command
def batch(manifest: AnyManifest, folder: str | Path, *, executor: Executor | None = None, again: bool = False,
          seed: int = DEFAULT_SEED, threads: int = 1, progress: Progress = SILENT) -> CommandResult:
    """Runs all jobs of a manifest (a file, a table, or rows as mappings), writes their results and the
    overview into `folder`.

    executor: any of concurrent.futures (processes, Dask's `client.get_executor()`); None: one after the
    other. threads: of each job. A job whose inputs have not changed is kept, unless `again`.
    """
    started = time.perf_counter()
    read = [manifest] if isinstance(manifest, (str, Path)) else []
    manifest = MemoryTable.of(manifest, "manifest") if is_memory_table(manifest) else manifest
    with OutputFolder(Path(folder), [*ALWAYS, *WRITES], read) as place:
        result = _fleet(manifest, Path(folder), executor, again, seed, threads, progress)
        publish(result, place, started, progress)
    return result


def run(arguments: argparse.Namespace) -> CommandResult:
    if arguments.workers < 1:
        raise InputError(f"--workers {arguments.workers}: expected 1 or more")
    given = (arguments.files[0], arguments.out)
    rest = (arguments.again, arguments.seed, max(1, arguments.threads // arguments.workers),
            arguments.progress)
    if arguments.workers == 1:
        return _fleet(*given, None, *rest)
    with ProcessPoolExecutor(arguments.workers) as pool:
        return _fleet(*given, pool, *rest)


def _fleet(manifest: AnyManifest, folder: Path, executor: Executor | None, again: bool, seed: int,
           threads: int, progress: Progress) -> CommandResult:
    jobs = read_jobs(manifest, seed)
    waiting = [job for job in jobs if again or not _kept(job, folder)]
    outcomes = {job.name: _outcome(job, folder, "kept") for job in jobs if job not in waiting}
    progress.plan(STEPS["batch"], long=True)
    progress.stage(JOBS, total=len(waiting))
    if executor is None:
        for job in waiting:
            outcomes[job.name] = run_job(job, folder, threads)
            progress.step(note=job.name)
    else:
        futures: dict[Future[Outcome], Job] = {executor.submit(run_job, job, folder, threads): job
                                               for job in waiting}
        for future in as_completed(futures):
            job, error = futures[future], future.exception()
            outcomes[job.name] = (
                future.result() if error is None else _failed(job, f"the worker ended: {error}"))
            progress.step(note=job.name)
    ended = [outcomes[job.name] for job in jobs]
    read = sources([manifest]) if isinstance(manifest, (str, Path, MemoryTable)) else ()
    failed = sum(outcome.state == "failed" for outcome in ended)
    return CommandResult(
        json={"jobs": [vars(outcome) for outcome in ended]}
        | {state: sum(o.state == state for o in ended) for state in ("done", "kept", "failed")},
        report=_report(ended),
        tables={SUMMARY: {name: [getattr(o, name) for o in ended]
                                    for name in Outcome.__dataclass_fields__}},
        exit_code=1 if failed else 0,
        asked=Asked("batch", f"exactarm.batch({path_word(manifest)}, {str(folder)!r}, seed={seed})"
                    if read else "exactarm.batch(...)", None, read, seed))


def run_job(job: Job, folder: Path, threads: int = 1) -> Outcome:
    """One job in this process; whatever happens is its outcome."""
    started = time.perf_counter()
    place = Path(folder) / job.name
    try:
        (place / KEY).unlink(missing_ok=True)
        module = import_command(job.command)
        published = execute(module,
                            parse(module, [*job.words, "--out", str(place), "--threads", str(threads)]),
                            SILENT)
        if published.result.exit_code:
            return _failed(job, published.report.verdict, time.perf_counter() - started)
        (place / KEY).write_text(_mark(job, place))
    except Exception as error:  # told of this job, and the others still run
        return _failed(job, explain(error)[1], time.perf_counter() - started)
    return _outcome(job, Path(folder), "done")


# -- the manifest ------------------------------------------------------------------------------------
def read_jobs(manifest: AnyManifest, seed: int = DEFAULT_SEED) -> tuple[Job, ...]:
    """The jobs of a manifest; raises InputError with row and column."""
    rows, beside, file = _rows(manifest)
    if not rows:
        raise InputError("no job; expected one row for each", file=file)
    missing = [name for name in ("command", "robot") if name not in rows[0]]
    if missing:
        raise InputError(f"column missing; expected {', '.join(COLUMNS)}, and columns named as options are",
                         file=file, column=missing[0])
    jobs: list[Job] = []
    for number, row in enumerate(rows, start=1):
        if TOO_MANY in row:
            raise InputError(f"has {len(row[TOO_MANY])} cells more than there are columns", file=file,
                             row=number)
        job = _job({key: str(value).strip() for key, value in row.items() if value not in (None, "")}, number,
                   beside, file, seed)
        taken = {*_OWN_FILES, *(other.name.casefold() for other in jobs)}
        if job.name.casefold() in taken:  # some file systems take One and one for the same
            raise InputError(f"{job.name!r} again; expected a name of its own", file=file, row=number,
                             column="name")
        jobs.append(job)
    _require_options(rows, {job.command for job in jobs}, file)
    return tuple(jobs)


def _require_options(rows: Sequence[Mapping[str, Any]], commands: set[str], file: Any) -> None:
    """Every further column is an option of one of the commands, which the batch does not give itself."""
    options = {word for name in commands for word in parser_of(import_command(name))._option_string_actions}
    for column in {name: None for row in rows for name in row if name not in COLUMNS}:
        if column == "options":
            raise InputError("expected a column for each option, named as it is: seed, kind, ...", file=file,
                             column=column)
        word = f"--{str(column).replace('_', '-')}"
        if word not in options or column in _GIVEN:
            why = "the batch itself gives it" if column in _GIVEN else "no option of these commands"
            close = difflib.get_close_matches(word, options, n=1)
            hint = f"; did you mean {close[0].lstrip('-')}?" if close and column not in _GIVEN else ""
            raise InputError(f"{column!r}: {why}{hint}", file=file, column=str(column) or "(no name)")


def _rows(manifest: AnyManifest) -> tuple[list[Mapping[str, Any]], Path, Any]:
    if not isinstance(manifest, (str, Path, MemoryTable)):
        given: list[Any] = listed(manifest)
        if wrong := [row for row in given if not isinstance(row, Mapping)]:
            raise InputError(f"manifest with {type(wrong[0]).__name__}; expected a file, a table, or a "
                             "mapping a row")
        return given, Path(), None
    path, names, rows = Path(str(manifest)), list[str](), list[Mapping[str, Any]]()
    try:
        if isinstance(manifest, MemoryTable):
            names, rows = manifest.names, [dict(zip(manifest.names, row)) for row in manifest.texts]
        elif path.suffix == ".parquet":
            table = parquet_table(path, file_bytes(path))
            names, rows = table.column_names, table.to_pylist()
        else:
            text = io.StringIO(file_bytes(path).decode("utf-8-sig"), newline="")
            reader = csv.DictReader(text, restkey=TOO_MANY, strict=True)
            names, rows = list(reader.fieldnames or []), list(reader)
    except InputError:
        raise
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error}); expected a table of "
                         "jobs", file=path) from None
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError("column given twice; expected once", file=path, column=twice or "(no name)")
    return rows, path.parent, manifest if isinstance(manifest, MemoryTable) else path


def _job(row: Mapping[str, str], number: int, beside: Path, file: Any, seed: int) -> Job:
    known = [name for name in find_commands() if name not in _NOT_IN_BATCH]
    command = row.get("command", "")
    if command not in known:
        close = difflib.get_close_matches(command, known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(known)}"
        raise InputError(f"{command!r}: {hint}", file=file, row=number, column="command")
    if "robot" not in row:
        raise InputError("is empty; expected a robot file or a shipped robot", file=file, row=number,
                         column="robot")
    name = row.get("name", f"{number:03d}_{command}")
    if not re.fullmatch(r"[\w-][\w.-]*", name) or len(name.encode()) > _LONGEST_NAME:
        raise InputError(f"{name[:_LONGEST_NAME]!r}; expected letters, digits, _ . and -, at most "
                         f"{_LONGEST_NAME} bytes", file=file, row=number, column="name")
    near = lambda word: str(beside / word) if os.path.exists(beside / word) else word
    robot, files = near(row["robot"]), [near(word.strip()) for word in row.get("files", "").split(";")
                                        if word.strip()]
    for column, word in [("robot", robot), *(("files", each) for each in files)]:
        if word.startswith("-"):
            raise InputError(f"{word!r}; expected a name, no option", file=file, row=number, column=column)
    words = [robot, *files, "--seed", row.get("seed", str(seed))]
    for key, value in row.items():
        if key in (*COLUMNS, "seed") or value.lower() in ("false", "no"):
            continue
        words += [f"--{key.replace('_', '-')}", *([] if value.lower() in ("true", "yes") else [value])]
    hashes = [sha256(path) for path in map(file_or_example, words) if os.path.isfile(path)]
    key = hashlib.sha256(json.dumps([exactarm.__version__, command, words, hashes]).encode()).hexdigest()
    return Job(name, command, robot, tuple(words), key)


# -- outcomes ----------------------------------------------------------------------------------------
def _mark(job: Job, place: Path) -> str:
    """What a finished job leaves: its key, and its result, which a run of somebody else may replace."""
    return f"{job.key} {sha256(place / 'result.json')}"


def _kept(job: Job, folder: Path) -> bool:
    place = folder / job.name
    try:
        return (place / KEY).read_text() == _mark(job, place)
    except (OSError, ValueError):
        return False


def _failed(job: Job, why: str, seconds: float = 0.0) -> Outcome:
    return Outcome(job.name, job.command, job.robot, "failed", seconds=round(seconds, 3), why=why)


def _outcome(job: Job, folder: Path, state: str) -> Outcome:
    """What a finished job's result.json says."""
    result = json.loads((folder / job.name / "result.json").read_text(encoding="utf-8"))
    before, after = (_rms(result.get(when)) for when in ("before", "after"))
    if after is None:
        after = (result.get("error") or {}).get("rms")
    return Outcome(job.name, job.command, job.robot, state, result.get("verdict", ""),
                   result.get("unit", "m"), before, after, result["seconds"])


def _rms(sets: Any) -> float | None:
    if not isinstance(sets, Mapping):
        return None
    judged = sets.get("validation") or {}
    return judged.get("rms") if judged.get("n") else (sets.get("identification") or {}).get("rms")


def _report(ended: Sequence[Outcome]) -> Report:
    count = {state: sum(outcome.state == state for outcome in ended) for state in ("done", "kept", "failed")}
    first = next((f" {o.name}: {o.why.splitlines()[0]}" for o in ended if o.state == "failed" and o.why), "")
    more = f" ({count['failed'] - 1} more failed)" if count["failed"] > 1 else ""
    verdict = (
        f"{len(ended)} job{'s' if len(ended) != 1 else ''}: {count['done']} computed, {count['kept']} kept "
        f"because nothing had changed, {count['failed']} failed.{first}{more}")
    judged = any(outcome.verdict for outcome in ended)  # of a diagnosis
    row = lambda o: (o.name, o.command, o.robot, o.state, *([o.verdict.replace("_", " ")] if judged else []),
                     Quantity(o.before_rms, o.unit), Quantity(o.after_rms, o.unit), Quantity(o.seconds, "s"),
                     Link(f"{o.name}/report.html", "report") if o.state != "failed" else "")
    header = ("name", "command", "robot", "state", *(["verdict"] if judged else []), "RMS before",
              "RMS after", "time", "page")
    failures = tuple((o.name, o.why) for o in ended if o.state == "failed")
    return Report("Fleet", verdict, (
        Highlights((Highlight("computed", Quantity(count["done"], decimals=0)),
                    Highlight("kept", Quantity(count["kept"], decimals=0)),
                    Highlight("failed", Quantity(count["failed"], decimals=0)))),
        Table("Failed, and why", ("job", "why"), failures),
        Table("Jobs", header, tuple(row(outcome) for outcome in ended),
              "RMS on rows that were never fitted, where there are any."),
    ), "caution" if count["failed"] else "good")
