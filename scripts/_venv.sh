# Sourced by the other scripts: makes the project's own virtual environment.
#
#   use_venv [EXTRAS]  makes .venv in the project folder, or reuses it, with `.` or `.[EXTRAS]` installed,
#                      and sets VENV_PYTHON to its interpreter.
#
# Needs bash and Python 3.10 or newer with venv and pip. PYTHON=/path/to/python chooses the interpreter. Another
# virtual environment that is active does no harm.

project_folder() {
  cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd
}

_fail() {
  printf 'Error: %s\n' "$*" >&2
  exit 1
}

# Print the first interpreter that is new enough.
_find_python() {
  local candidate
  local oldest='import sys; sys.exit(sys.version_info < (3, 10))'
  for candidate in ${PYTHON:+"$PYTHON"} python3 python3.14 python3.13 python3.12 python3.11 python3.10 python; do
    if command -v "$candidate" >/dev/null 2>&1 && "$candidate" -c "$oldest" >/dev/null 2>&1; then
      command -v "$candidate"
      return 0
    fi
    if [ -n "${PYTHON:-}" ] && [ "$candidate" = "$PYTHON" ]; then
      _fail "PYTHON=$PYTHON is not a Python 3.10 or newer."
    fi
  done
  _fail "Python 3.10 or newer is needed; found $(python3 --version 2>&1 || echo none). Set PYTHON=/path/to/python."
}

_venv_python() {
  local path
  for path in "$1/bin/python" "$1/Scripts/python.exe"; do
    if [ -x "$path" ]; then
      printf '%s\n' "$path"
      return 0
    fi
  done
  return 1
}

# Run a command quietly with a dot every few seconds; show its output only when it fails.
_with_dots() {
  local message="$1" log status
  shift
  log="$(mktemp)"
  printf '%s ' "$message"
  "$@" >"$log" 2>&1 &
  local job=$!
  while kill -0 "$job" 2>/dev/null; do
    printf '.'
    sleep 2
  done
  status=0
  wait "$job" || status=$?
  printf '\n'
  if [ "$status" -ne 0 ]; then
    cat "$log" >&2
  fi
  rm -f "$log"
  return "$status"
}

use_venv() {
  local extras="${1:-}" root venv python wanted mark what
  root="$(project_folder)"
  what="${extras:+[$extras]}"
  venv="$root/.venv"
  unset PYTHONHOME PYTHONPATH
  python="$(_find_python)" || exit 1
  # An environment that was left half made, or that moved, is made anew.
  if ! VENV_PYTHON="$(_venv_python "$venv")" || ! "$VENV_PYTHON" -m pip --version >/dev/null 2>&1; then
    "$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
      _fail "this Python has no venv module. On Debian and Ubuntu: apt-get install python3-venv"
    rm -rf "$venv"
    _with_dots "Making the virtual environment .venv" "$python" -m venv "$venv" ||
      _fail "python -m venv failed; see above."
    VENV_PYTHON="$(_venv_python "$venv")" || _fail "python -m venv made no interpreter in $venv."
  fi
  # What was installed from which pyproject.toml, so that a second run need not ask pip.
  mark="$venv/.installed-$(printf '%s' "$extras" | tr ',' '-')"
  wanted="$(cksum <"$root/pyproject.toml") $root"
  if [ ! -f "$mark" ] || [ "$(cat "$mark")" != "$wanted" ] || ! "$VENV_PYTHON" -c 'import prup_pin' >/dev/null 2>&1; then
    _with_dots "Installing prup_pin$what and what it needs, one to some minutes" \
      "$VENV_PYTHON" -m pip install --quiet --disable-pip-version-check --no-input -e "$root$what" ||
      _fail "pip could not install prup_pin$what; see above."
    printf '%s\n' "$wanted" >"$mark"
  fi
}
