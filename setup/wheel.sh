#!/usr/bin/env bash
# usage: wheel.sh [PYTHON...]   Builds wheels that run anywhere into dist/, one for each interpreter, and tests each.
#
# Ipopt, MUMPS and what they need are put inside (auditwheel), with their licences and a bill of materials. Built on
# Debian 12 a wheel asks for glibc 2.36 (manylinux_2_36). The test runs in a fresh environment and in a mount namespace
# in which the system's own copies of these libraries cannot be read. CPU=native (or a name of -march) in the environment
# makes a wheel with one build only.
set -euo pipefail
cd "$(dirname "$0")/.."

PLATFORM=manylinux_2_36_x86_64
MOST_BYTES=$((25 * 1000 * 1000))
FOLDER=build/wheel
pip() { "$1" -m pip --disable-pip-version-check --quiet "${@:2}"; }

[ $# -gt 0 ] || set -- python3
for python in "$@"; do
  tag=$("$python" -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
  echo "== $tag: building"
  rm -rf "$FOLDER/$tag-env" "$FOLDER/$tag-raw" "$FOLDER/$tag-whole"
  "$python" -m venv "$FOLDER/$tag-env"
  own=$FOLDER/$tag-env/bin/python
  pip "$own" install --require-hashes -r setup/lock/wheel.txt
  PATH="$PWD/$FOLDER/$tag-env/bin:$PATH" pip "$own" wheel --no-build-isolation --no-deps --wheel-dir "$FOLDER/$tag-raw" \
    --config-settings="build-dir=build/wheel-$tag" --config-settings="cmake.define.EXACTARM_CPU=${CPU:-dispatch}" .

  echo "== $tag: libraries, licences, bill of materials"
  PATH="$PWD/$FOLDER/$tag-env/bin:$PATH" "$own" -m auditwheel repair --strip --plat "$PLATFORM" \
    --wheel-dir "$FOLDER/$tag-whole" "$FOLDER/$tag-raw"/exactarm-*.whl > "$FOLDER/$tag-repair.log" 2>&1 \
    || { tail -n 30 "$FOLDER/$tag-repair.log"; exit 1; }
  mkdir -p dist
  "$own" setup/notices.py "$FOLDER/$tag-whole"/exactarm-*.whl dist
  wheel=$(ls -t dist/exactarm-*-"$tag"-*.whl | head -n 1)
  bytes=$(stat -c %s "$wheel")
  [ "$bytes" -lt $MOST_BYTES ] || { echo "$wheel: $bytes bytes, expected below $MOST_BYTES" >&2; exit 1; }

  echo "== $tag: testing $wheel ($bytes bytes)"
  rm -rf "$FOLDER/$tag-clean"
  "$python" -m venv "$FOLDER/$tag-clean"
  pip "$FOLDER/$tag-clean/bin/python" install --require-hashes -r setup/lock/run.txt
  pip "$FOLDER/$tag-clean/bin/python" install --no-deps "$wheel"
  bash setup/without_libraries.sh "$FOLDER/$tag-clean/bin/python" setup/try_wheel.py
done
