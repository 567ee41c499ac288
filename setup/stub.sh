#!/usr/bin/env bash
# usage: stub.sh PYTHON   Writes python/exactarm/_core.pyi from the extension that lies beside the sources and compares the
# two (mypy's stubtest). PYTHON has pybind11-stubgen and mypy.
set -euo pipefail
cd "$(dirname "$0")/.."
export PYTHONPATH=$PWD/python
folder=build/stub
mkdir -p $folder
"$1" -m pybind11_stubgen exactarm._core --output-dir $folder --numpy-array-use-type-var > $folder/log 2>&1 \
  || { tail -n 20 $folder/log; exit 1; }
"$1" - $folder/exactarm/_core.pyi python/exactarm/_core.pyi <<'PROGRAM'
import re, sys
from pathlib import Path
text = Path(sys.argv[1]).read_text()
text = re.sub(r"^__all__: .*\n", "", text, flags=re.M)
text = re.sub(r"<exactarm\._core\.\w+ object at 0x[0-9a-f]+>", "...", text)
text = text.replace("-> dict:", "-> dict[str, numpy.typing.NDArray[numpy.float64]]:")  # all that the core gives
head = '"""Types of the compiled core (SI units, radians throughout), written by pybind11-stubgen: setup/stub.sh."""\n'
Path(sys.argv[2]).write_text(head + text[text.index('"""', 3) + 4:])
PROGRAM
# What pybind11 makes has a metaclass of its own and, where nothing makes it from Python, an __init__(*args).
printf 'exactarm\\._core\\.[A-Z]\\w+\nexactarm\\._core\\.[A-Z]\\w+\\.__init__\n' > $folder/allowed.txt
"$1" -m mypy.stubtest exactarm._core --concise --ignore-unused-allowlist --allowlist $folder/allowed.txt
