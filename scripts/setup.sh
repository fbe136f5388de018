#!/bin/sh
# Make the virtual environment .venv and install ballpass into it; say what is missing where something is.
# usage: scripts/setup.sh [EXTRAS]      EXTRAS e.g. dev,docs
set -eu
extras=labelled${1:+,$1}  # the Python of the README gives labelled results
python=${PYTHON:-python3}
venv=${VENV:-.venv}

missing() { printf 'setup: %s\n' "$1" >&2; exit 2; }

command -v "$python" >/dev/null 2>&1 ||
  missing "$python not found. Install Python 3.11 or newer (Debian: apt install python3 python3-venv), or name one: make PYTHON=/path/to/python3"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
  missing "$("$python" --version 2>&1) is too old: Python 3.11 or newer is needed. Name another: make PYTHON=python3.12"
"$python" -c 'import venv, ensurepip' 2>/dev/null ||
  missing "Python's venv module is missing (Debian: apt install python3-venv)"
if ! command -v cc >/dev/null 2>&1 && ! command -v gcc >/dev/null 2>&1 && ! command -v clang >/dev/null 2>&1; then
  printf '%s\n' "setup: no C compiler found (Debian: apt install gcc; without root, later: $venv/bin/pip install ziglang). Going on without: simulations run in CasADi's virtual machine, some ten times slower." >&2
fi

# an environment with pip, not just a folder: a setup that was interrupted is taken up again
"$venv/bin/python" -c 'import pip, sys; sys.exit(sys.prefix == sys.base_prefix)' 2>/dev/null ||
  { printf '%s\n' "setup: making $venv"; "$python" -m venv "$venv"; }
printf '%s\n' "setup: installing ballpass with $extras into $venv (first time: some 180 MB of downloads, a minute or so)"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c requirements.txt -e ".[$extras]"
