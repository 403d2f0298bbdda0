#!/usr/bin/env bash
# The lower bounds of pyproject.toml, tried together: an environment with the oldest of everything, a few commands and the
# tests of mechanism, statics and building. PYTHON=/path/to/python chooses the interpreter, the oldest that is at hand.
# Needs bash, Python 3.10 or newer with venv and pip. Everything happens in a temporary folder.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
unset PYTHONHOME PYTHONPATH VIRTUAL_ENV
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

"${PYTHON:-python3}" -m venv "$folder/venv"
python="$folder/venv/bin/python"
# "name>=1.2" of the dependencies becomes "name==1.2"; pin says which numpy goes with it.
sed -n -e '/^dependencies = \[/,/^\]/p' -e '/^\(robots\|check\) = /p' "$root/pyproject.toml" |
  sed -nE 's/^ *([a-z]+ = \[)?"([A-Za-z0-9_-]+)>=([0-9.]+)".*$/\2==\3/p' | grep -v '^numpy==' >"$folder/oldest.txt"
"$python" -m pip install --quiet --disable-pip-version-check --no-input --prefer-binary -c "$folder/oldest.txt" \
  "$root[robots,check]" 'pytest>=8.0'
"$python" -m pip list --disable-pip-version-check 2>/dev/null |
  grep -iE "^($(sed 's/==.*//' "$folder/oldest.txt" | paste -sd'|')|numpy) "

cd "$folder"
for line in "examples --copy desk" "info desk/delta.urdf" "stiffness desk/six_ups.urdf --wrench fx=100" \
  "view ur5 --joint-stiffness 1e4 --html view.html" "report desk/gantry.urdf --wrench fx=100 --out report.html"; do
  # shellcheck disable=SC2086 # words
  "$folder/venv/bin/prup-pin" $line >log 2>&1 || { cat log; exit 1; }
done
cd "$root"
# Old libraries deprecate what they use of each other: warnings are theirs here.
"$python" -m pytest -q -p no:cacheprovider -W ignore tests/build tests/mechanism/test_save.py \
  tests/mechanism/test_other_readers.py tests/statics/test_textbooks.py tests/kinematics/test_closing.py
