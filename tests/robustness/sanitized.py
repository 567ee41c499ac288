"""Short runs of the commands with a core that is built with sanitizers (`make sanitize`):

    python tests/robustness/sanitized.py FOLDER [COMMAND...]

FOLDER: of the build, with FOLDER/core/_core*.so. Ends with exit 1 if a run ends otherwise than with exit 0,
or a sanitizer reports. Leaks of the interpreter are not looked for; the C++ tests look for ours.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.short_runs import RUNS, environment, prepare, words_of

PACKAGE = Path(__file__).resolve().parents[2] / "python/exactarm"
# The interpreter is not built with them: their library comes first, and the one that throws beside it.
LIBRARIES = ("libasan.so", "libstdc++.so.6")
OPTIONS = {
    "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1:strict_string_checks=1",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
}


def library(name: str) -> str:
    found = subprocess.run(["g++", f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    return found.stdout.strip()


def package(build: Path) -> Path:
    """The folder of a copy of the package with the core of this build alone."""
    copy = build / "package"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(PACKAGE, copy / "exactarm", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    (core,) = (build / "core").glob("_core*.so")
    if b"__asan_init" not in core.read_bytes():
        raise SystemExit(f"{core} is not built with sanitizers")
    shutil.copy(core, copy / "exactarm")
    return copy


def main() -> int:
    build, names = Path(sys.argv[1]).resolve(), sys.argv[2:] or list(RUNS)
    preload = {"LD_PRELOAD": " ".join(library(name) for name in LIBRARIES)}
    failed = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        prepare(folder)
        variables = environment(package(build), folder) | OPTIONS | preload
        for name in names:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            run = subprocess.run([sys.executable, "-m", "exactarm",
                                  *words_of(name, folder, folder / "out" / name)],
                                 env=variables, capture_output=True, text=True, errors="replace", check=False)
            seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            print(f"{name:<14} exit {run.returncode}, {seconds:.0f} s", flush=True)
            if run.returncode != 0 or run.stderr:
                failed.append(name)
                print(run.stderr[-6000:], flush=True)
    print(f"{len(names)} commands under {preload['LD_PRELOAD']}: {len(failed)} failed {' '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
