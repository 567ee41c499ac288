"""Short runs of every command on a disk with room for files of LEAST_FILE bytes alone:

    python tests/robustness/full_disk.py [COMMAND...]

Prints one line of JSON a command: its folder, its exit code, what it said on stderr, and the results that it
left. Runs are forked from this process, as in kills.py.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
import tempfile
from pathlib import Path

# A process with threads is not forked, and neither is the one that reads tables.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from exactarm import cli
from robustness.kills import MOST_SECONDS, PACKAGE, forked, import_as_runs
from robustness.short_runs import RUNS, environment, prepare, words_of

LEAST_FILE = 4096  # bytes that a file may have


def _run(command: str, folder: Path, told: int) -> None:
    """told: descriptor of a pipe, which has no size, for stderr."""
    os.environ.update(environment(PACKAGE, folder))
    sys.dont_write_bytecode = True  # bytecode that is cut off at the limit would spoil other runs
    resource.setrlimit(resource.RLIMIT_FSIZE, (LEAST_FILE, LEAST_FILE))
    with open(told, "w") as said, contextlib.redirect_stdout(None), contextlib.redirect_stderr(said):
        code = cli.main(words_of(command, folder, folder / "out" / command))
    sys.exit(code)


def on_a_full_disk(command: str, folder: Path) -> dict[str, object]:
    """What the short run of `command` in a prepared `folder` does."""
    out, (read, write) = folder / "out" / command, os.pipe()
    process = forked(_run, command, folder, write)
    os.close(write)
    with open(read) as said:
        told = said.read()
    process.join(MOST_SECONDS)
    left = sorted(str(path) for path in out.rglob("result.json"))
    return {"command": command, "out": str(out), "code": process.exitcode, "told": told, "left": left}


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        forked(prepare, Path(temporary)).join()
        import_as_runs()
        for command in sys.argv[1:] or RUNS:
            print(json.dumps(on_a_full_disk(command, Path(temporary))), flush=True)


if __name__ == "__main__":
    main()
