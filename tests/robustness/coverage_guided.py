"""Coverage-guided fuzzing of the readers (atheris): inputs that reach new lines are kept and changed further.

    python tests/robustness/coverage_guided.py [TARGET ...] [--seconds 600] [--corpus build/fuzz]

Each target has a process and a corpus of its own (CORPUS/TARGET), which the next run begins with. The
property is that of the trials: an input is read, or refused by InputError in one line that names the file.
What breaks it is left beside the corpus as
`crash-...`, and a run that found anything ends with exit 1. `--one FILE TARGET` does a single input again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

LONGEST = 20_000  # bytes of an input
SLOWEST_S, MOST_MB = 20, 4096


def _targets() -> dict[str, tuple[bytes, Callable[[Path], object]]]:
    """Name of the file -> a valid content, and its reader."""
    import numpy as np

    from exactarm.commands.accept import accept
    from exactarm.errors import InputError
    from exactarm.numerics.formula import Formula, FormulaError
    from robustness.samples import samples
    from robustness.trials import READERS

    valid = samples()
    found = {name: (valid[name], read) for name, read in READERS.items()
             if not name.endswith((".parquet", ".src"))}

    def formula(path: Path) -> object:
        try:
            parsed = Formula.of(path.read_text(errors="replace"))
        except FormulaError as error:
            raise InputError(str(error), file=path) from None
        with np.errstate(all="ignore"):
            return parsed({name: np.array([-1.3, 0.0, 0.7]) for name in parsed.names})

    found["formula.txt"] = (b"a*(q_4 + q_6)^2 + b*sin(3*q_1)", formula)
    found["draft.toml"] = (valid["draft.toml"], accept)
    return found


def _fuzz(target: str, corpus: Path, seconds: int, one: Path | None, folder: Path) -> None:
    """In a process of its own, which ends by itself at once: another one removes `folder` of its files."""
    import atheris

    with atheris.instrument_imports(include=["exactarm"]):
        import exactarm.commands.accept
        import exactarm.compensate.formats
        import exactarm.data.dataset
        import exactarm.data.fixture
        import exactarm.numerics.formula
        import exactarm.plan.path_file
        import exactarm.robot_file  # noqa: F401
        from exactarm.errors import InputError
    os.environ["EXACTARM_EFFECTS"] = str(folder / "effects")
    content, read = _targets()[target]
    path = folder / target

    def once(data: bytes) -> None:
        path.write_bytes(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                read(path)
            except InputError as error:
                said = str(error.within(path))
                assert len(said.splitlines()) == 1 and path.name in said, f"refused by {said!r}"

    if one is not None:
        once(one.read_bytes())
        return
    corpus.mkdir(parents=True, exist_ok=True)
    (corpus / "valid").write_bytes(content)
    options = ["-len_control=0", f"-max_total_time={seconds}", f"-max_len={LONGEST}", f"-timeout={SLOWEST_S}",
               f"-rss_limit_mb={MOST_MB}",
               f"-artifact_prefix={corpus.parent}/{target}-", "-print_final_stats=0"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], once)
    atheris.Fuzz()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", metavar="TARGET", nargs="*")
    parser.add_argument("--seconds", type=int, default=600, help="of each target")
    parser.add_argument("--corpus", type=Path, default=Path("build/fuzz"))
    parser.add_argument("--one", type=Path, help="a single input, done again")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside:
        _fuzz(arguments.targets[0], arguments.corpus / arguments.targets[0], arguments.seconds, arguments.one,
              arguments.inside)
        return 0
    with tempfile.TemporaryDirectory(prefix="exactarm-fuzz-") as folder:
        return _in_processes(arguments, folder)


def _in_processes(arguments: argparse.Namespace, folder: str) -> int:
    failed = []
    for target in arguments.targets or _targets():
        words = [target, "--inside", folder, "--seconds", str(arguments.seconds),
                 "--corpus", str(arguments.corpus), *(["--one", str(arguments.one)] if arguments.one else [])]
        done = subprocess.run([sys.executable, __file__, *words], capture_output=True, text=True,
                              errors="replace")
        print(f"{target}: {'held' if done.returncode == 0 else 'BROKEN'}", flush=True)
        if done.returncode:
            failed.append(target)
            print((done.stdout + done.stderr)[-2000:], flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
