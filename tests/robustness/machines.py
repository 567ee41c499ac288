"""The short runs of the commands on one machine beside another: results equal to 1e-9, words alike.

    python tests/robustness/machines.py files FOLDER              what the runs read, to copy to the other
    python tests/robustness/machines.py run FOLDER [COMMAND...]   on each machine
    python tests/robustness/machines.py compare FOLDER FOLDER     anywhere; exit 1 where they differ

What may differ: times (also in a sentence), the run's name, and the place of files.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.same_numbers import EQUAL, differences
from robustness.short_runs import RUNS, environment, prepare, words_of


def run(folder: Path, names: list[str]) -> int:
    os.environ |= environment(Path(), folder)
    from exactarm.cli import main as exactarm

    ended = 0
    for name in names or list(RUNS):
        code = exactarm(words_of(name, folder / "files", folder / name))
        print(f"{name:<14} exit {code}", flush=True)
        ended = ended or code
    return ended


def compare(first: Path, second: Path) -> int:
    bad = 0
    for file in sorted(first.glob("*/result.json")):
        name = file.parent.name
        pair = [json.loads((folder / name / "result.json").read_text().replace(str(folder), ""))
                for folder in (first, second)]
        found = sorted(differences(*pair), reverse=True)
        worst = found[0][0] if found else 0.0
        print(f"{name:<14} largest difference {worst:.1e}")
        for size, words in found[:12]:
            if size > EQUAL:
                print(f"    {size:.1e} {words[:150]}")
        bad += worst > EQUAL
    print(f"{bad} commands differ by more than {EQUAL:g}")
    return bool(bad)


if __name__ == "__main__":
    task, folder, *words = sys.argv[1:]
    if task == "files":
        prepare(Path(folder) / "files")
    elif task == "run":
        sys.exit(run(Path(folder).resolve(), words))
    else:
        sys.exit(compare(Path(folder).resolve(), Path(words[0]).resolve()))
