"""Runs of every command, killed (SIGKILL) at random moments:

    python tests/robustness/kills.py [--count 200] [--seed 0] [COMMAND...]

The property: after each, the output folder holds a whole result (`result.json` and every file that it names,
with the SHA-256 that it names) or none; what `accept` puts into the user's library is whole or absent; and
the next run into the same folder ends well and leaves nothing of the killed ones.

Half of the moments lie anywhere, half in the last tenth of a run, where files are written.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from exactarm import cli
from exactarm.files.toml_file import read_toml
from robustness.short_runs import RUNS, environment, prepare, words_of

PACKAGE = Path(cli.__file__).parents[1]
MOST_SECONDS = 600.0  # of a run that nobody kills
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
    """One kill, `after` seconds of a run that takes `of`; had_ended: it came too late."""

    command: str
    after: float
    of: float
    had_ended: bool
    faults: tuple[str, ...]


def _started(command: str, folder: Path) -> subprocess.Popen:
    words = words_of(command, folder, folder / "out" / command)
    return subprocess.Popen([sys.executable, "-m", "exactarm", *words], env=environment(PACKAGE, folder),
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)


def _whole_run(command: str, folder: Path) -> float:
    """Seconds of a run that nobody kills; it must end well."""
    began = time.monotonic()
    with _started(command, folder) as process:
        said = process.communicate(timeout=MOST_SECONDS)[1]
    out = folder / "out" / command
    if process.returncode != 0 or not (out / "result.json").exists() or not_whole(out):
        raise AssertionError(f"{command} ends with exit {process.returncode}: {said.decode()} "
                             f"{not_whole(out)}")
    if list(out.rglob(".partial")):
        raise AssertionError(f"{command} leaves {list(out.rglob('.partial'))}")
    return time.monotonic() - began


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
        with _started(command, folder) as process:
            try:
                process.wait(after)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
            had_ended = process.wait() == 0
        faults = not_whole(folder / "out" / command) + _library_faults(folder)
        yield Killed(command, after, longest, had_ended, tuple(faults))
    _whole_run(command, folder)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="kills of each command")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("commands", nargs="*", help="default: all")
    arguments = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as temporary:
        prepare(Path(temporary))
        for command in arguments.commands or RUNS:
            random = np.random.default_rng([arguments.seed, list(RUNS).index(command)])
            done = list(kills(command, arguments.count, Path(temporary), random))
            bad = [each for each in done if each.faults]
            failed += len(bad)
            late = sum(each.had_ended for each in done)
            print(f"{command}: {len(done)} kills, {late} after its end, {len(bad)} left what is not whole",
                  flush=True)
            for each in bad:
                print(f"  after {each.after:.3f} of {each.of:.1f} s: {'; '.join(each.faults)}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
