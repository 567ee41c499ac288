#!/usr/bin/env bash
# usage: lock.sh   Pins every package that setup installs, with its hashes, in setup/lock/*.txt; run it after a change
# of the requirements in pyproject.toml. Needs `uv`. One file serves all versions of Python from 3.11 on.
set -euo pipefail
cd "$(dirname "$0")/.."

pin() {  # NAME ARGUMENTS...: setup/lock/NAME.txt
  uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --no-emit-index-url \
    --output-file "setup/lock/$1.txt" "${@:2}"
}
pin run pyproject.toml
pin test --extra test --constraint setup/lock/run.txt pyproject.toml
${PYTHON:-python3} setup/requirements.py build > .setup-build.in
trap 'rm -f .setup-build.in' EXIT
pin build .setup-build.in
pin wheel .setup-build.in setup/packages-wheel.txt
