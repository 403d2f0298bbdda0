#!/usr/bin/env bash
# The pictures of the README and the documentation, in docs/pictures/.
# Needs bash, Python 3.10 or newer, pip and Chromium; installs into .venv in this folder and nowhere else.
set -euo pipefail

source "$(dirname "${BASH_SOURCE[0]}")/_venv.sh"
use_venv
exec "$VENV_PYTHON" "$(project_folder)/scripts/pictures.py" "$@"
