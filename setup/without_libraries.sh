#!/usr/bin/env bash
# usage: without_libraries.sh COMMAND...   Runs a command for which the system's Ipopt, MUMPS, BLAS and Fortran cannot be
# read: in a mount namespace of its own an empty file lies over each of them.
set -euo pipefail

mapfile -t hidden < <(ldconfig -p | sed -n 's/.*=> //p' | xargs -r readlink -f | sort -u \
  | grep -E '/lib(ipopt|[dscz]mumps|mumps|pord|mpiseq|blas|lapack|openblas|scotch|esmumps|metis|gfortran|quadmath)[^/]*$' || true)
[ ${#hidden[@]} -gt 0 ] || { echo "no library to hide was found" >&2; exit 1; }
echo "hidden: ${hidden[*]##*/}"
as_root=(); [ "$(id -u)" = 0 ] || as_root=(--map-root-user)
empty=$(mktemp); trap 'rm -f "$empty"' EXIT
HIDDEN="${hidden[*]}" EMPTY=$empty unshare --mount "${as_root[@]}" bash -c '
  for file in $HIDDEN; do mount --bind "$EMPTY" "$file"; done
  exec "$@"' bash "$@"
