#!/usr/bin/env bash
# usage: venv.sh DIR   Makes a virtual environment with the first Python >= 3.11 that has headers, venv and pip.
set -euo pipefail

here=$(dirname "$0")
check='import ensurepip, os, sys, sysconfig, venv
sys.exit(not (sys.version_info >= (3, 11) and os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h"))))'

find_python() {
  for name in python3.11 /usr/bin/python3 python3 python3.12 python3.13; do
    if command -v "$name" >/dev/null && "$name" -c "$check" 2>/dev/null; then
      command -v "$name"
      return
    fi
  done
  return 1
}

if ! python=$(find_python); then
  printf 'python3\npython3-venv\npython3-dev\n' | bash "$here/system.sh" /dev/stdin
  python=$(find_python) || { echo "no Python 3.11 or newer with headers and venv was found" >&2; exit 1; }
fi
echo "== virtual environment from $python"
rm -rf "$1"
"$python" -m venv "$1"
