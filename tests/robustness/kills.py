"""Runs of every command, killed (SIGKILL) at random moments:

    python tests/robustness/kills.py [--count 200] [--seed 0] [COMMAND...]

The property: after each, the output folder holds a whole result (`result.json` and every file that it names,
with the SHA-256 that it names) or none; what `accept` puts into the user's library is whole or absent; and
the next run into the same folder ends well and leaves nothing of the killed ones.

Half of the moments lie anywhere, half in the last tenth of a run, where files are written. Runs are forked
from this process once it has imported what a run imports, so that the moments lie in the work.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib
import json
import multiprocessing
import os
import pkgutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

# A process with threads is not forked, and neither is the one that reads tables.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exactarm
from exactarm import cli
from exactarm.files.toml_file import read_toml
from robustness.short_runs import RUNS, environment, prepare, words_of

PACKAGE = Path(cli.__file__).parents[1]
MOST_SECONDS = 600.0  # of a run that nobody kills
ALLOCATOR = "jemalloc_bg_thd"  # Arrow's thread that frees memory; it follows a fork by itself
GROWS = 1.01  # a run, with every kill in its last tenth
LATE = 0.9  # share of a run after which half of the moments lie


def not_whole(folder: Path) -> list[str]:
    """What is wrong with the results below `folder`: files that are missing or are not those of their run."""
    faults = []
    for path in sorted(folder.rglob("result.json")):
        if ".partial" in path.parts:
            continue
        try:
            files = json.loads(path.read_text())["files"]
        except (ValueError, KeyError) as error:
            faults.append(f"{path}: {error!r}")
            continue
        for name, sha256 in files.items():
            file = path.parent / name
            if not file.exists() or hashlib.sha256(file.read_bytes()).hexdigest() != sha256:
                faults.append(f"{file}: missing, or of another run")
    return faults


@dataclass(frozen=True)
class Killed:
    """One kill, `after` seconds of a run; had_ended: it came too late, by the end at `took`."""

    command: str
    after: float
    took: float
    had_ended: bool
    faults: tuple[str, ...]


def _run(command: str, folder: Path) -> None:
    """The short run, in a process and a group of its own."""
    os.setsid()
    os.environ.update(environment(PACKAGE, folder))
    with (folder / "told").open("w") as told, contextlib.redirect_stdout(told), \
            contextlib.redirect_stderr(told):
        code = cli.main(words_of(command, folder, folder / "out" / command))
    sys.exit(code)


def forked(work: Callable[..., None], *given: object) -> multiprocessing.Process:
    threads = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
    assert len([name for name in threads if name != ALLOCATOR]) == 1, f"threads that a fork loses: {threads}"
    process = multiprocessing.get_context("fork").Process(target=work, args=given)
    process.start()
    return process


def _whole_run(command: str, folder: Path) -> float:
    """Seconds of a run that nobody kills; it must end well."""
    began = time.monotonic()
    process = forked(_run, command, folder)
    process.join(MOST_SECONDS)
    out = folder / "out" / command
    if process.exitcode != 0 or not (out / "result.json").exists() or not_whole(out):
        raise AssertionError(f"{command} ends with exit {process.exitcode}: {(folder / 'told').read_text()} "
                             f"{not_whole(out)}")
    if list(out.rglob(".partial")):
        raise AssertionError(f"{command} leaves {list(out.rglob('.partial'))}")
    return time.monotonic() - began


def import_as_runs() -> None:
    """What any run imports: a process that has started no thread and read no table."""
    for module in pkgutil.walk_packages(exactarm.__path__, "exactarm."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)


def _library_faults(folder: Path) -> list[str]:
    faults = []
    for path in (folder / "effects").glob("*.toml"):
        try:
            entries = read_toml(path, "effects").get("effects")
        except Exception as error:
            entries = error
        if not isinstance(entries, list) or not entries:
            faults.append(f"{path}: {entries!r}")
    return faults


def kills(command: str, count: int, folder: Path, random: np.random.Generator) -> Iterator[Killed]:
    """`count` kills of the short run of `command` in a prepared `folder`, then a run that ends well."""
    longest = _whole_run(command, folder)
    for number in range(count):
        after = longest * random.uniform(LATE if number % 2 else 0.0, 1.0)
        began, process = time.monotonic(), forked(_run, command, folder)
        process.join(after)
        took = time.monotonic() - began
        process.kill()
        with contextlib.suppress(ProcessLookupError):  # it has no group yet, or no one is left in it
            os.killpg(process.pid, signal.SIGKILL)
        process.join()
        had_ended = process.exitcode == 0
        # A machine that is shared is faster now and slower then.
        longest = took if had_ended else longest * (GROWS if after > LATE * longest else 1.0)
        faults = not_whole(folder / "out" / command) + _library_faults(folder)
        yield Killed(command, after, took, had_ended, tuple(faults))
    _whole_run(command, folder)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="kills of each command")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("commands", nargs="*", help="default: all")
    arguments = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as temporary:
        forked(prepare, Path(temporary)).join()
        import_as_runs()
        for command in arguments.commands or RUNS:
            random = np.random.default_rng([arguments.seed, list(RUNS).index(command)])
            done = list(kills(command, arguments.count, Path(temporary), random))
            bad = [each for each in done if each.faults]
            failed += len(bad)
            late = sum(each.had_ended for each in done)
            print(f"{command}: {len(done)} kills, {late} after its end, {len(bad)} left what is not whole",
                  flush=True)
            for each in bad:
                print(f"  after {each.after:.3f} s: {'; '.join(each.faults)}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
