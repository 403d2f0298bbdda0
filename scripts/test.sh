#!/usr/bin/env bash
# All checks: ruff, mypy, the documentation site, pytest. Options: --slow runs the slow tests too; everything else goes to pytest.
# Needs bash, Python 3.10 or newer and pip; installs into .venv in this folder and nowhere else.
set -euo pipefail

source "$(dirname "${BASH_SOURCE[0]}")/_venv.sh"

selection=(-m "not slow")
rest=()
for argument in "$@"; do
  if [ "$argument" = "--slow" ]; then
    selection=()
  else
    rest+=("$argument")
  fi
done

use_venv test
cd "$(project_folder)"
# Every worker, and every command that a test starts, would else compile all modules for itself.
unset PYTHONDONTWRITEBYTECODE

# Checks run beside one another; what each says is told in their order.
logs="$(mktemp -d)"
trap 'rm -rf "$logs"' EXIT
names=()
jobs=()
check() {
  names+=("$1")
  shift
  "$@" >"$logs/${#names[@]}" 2>&1 &
  jobs+=("$!")
}
distributions() {
  rm -rf out/dist && mkdir -p out
  "$VENV_PYTHON" -m build --no-isolation --outdir out/dist >out/build.log && "$VENV_PYTHON" -m twine check --strict out/dist/*
}

# Else every worker would rewrite the assertions of all tests for itself.
collected() {
  mkdir -p out
  "$VENV_PYTHON" -m pytest --collect-only -qqq >out/collected.log || { tail -n 30 out/collected.log; return 1; }
}

# Older Python gets an older numpy, whose types are told less exactly.
if "$VENV_PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
  check "mypy" "$VENV_PYTHON" -m mypy
else
  check "mypy" echo "left out, its checks need Python 3.11 or newer"
fi
export NO_MKDOCS_2_WARNING=1
check "collection" collected
check "documentation" "$VENV_PYTHON" -m mkdocs build --strict --quiet --site-dir out/site
check "wheel and sdist" distributions
check "ruff check" "$VENV_PYTHON" -m ruff check .
check "ruff format" "$VENV_PYTHON" -m ruff format --check .
failed=()
for index in "${!names[@]}"; do
  wait "${jobs[$index]}" || failed+=("${names[$index]}")
  printf '== %s\n' "${names[$index]}"
  cat "$logs/$((index + 1))"
done
if [ "${#failed[@]}" -gt 0 ]; then
  printf '== failed: %s\n' "${failed[*]}"
fi
# One worker more than cores, as some wait for a browser or a shell, each with one thread of linear algebra; `-n 0` among
# the options runs the tests in one process.
workers="$("$VENV_PYTHON" -c 'import os; print(1 + (os.cpu_count() or 1))')"
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# pytest comes last, so that its closing line is the last one; OpenSees would say goodbye after it, on stderr.
printf '== pytest\n'
status=0
"$VENV_PYTHON" -m pytest -n "$workers" --dist worksteal ${selection[@]+"${selection[@]}"} ${rest[@]+"${rest[@]}"} \
  2> >(grep -v '^Process 0 Terminating$' >&2) || status=$?
if [ "$status" -eq 0 ] && [ "${#failed[@]}" -gt 0 ]; then
  status=1
fi
exit "$status"
