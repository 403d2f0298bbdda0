#!/usr/bin/env bash
# The main job on a clean clone: stiffness of the 3-PRUP robot at one pose, each module's share, two pictures in out/.
# Needs bash, Python 3.10 or newer and pip; installs into .venv in this folder and nowhere else.
set -euo pipefail

source "$(dirname "${BASH_SOURCE[0]}")/_venv.sh"
use_venv
exec "$VENV_PYTHON" "$(project_folder)/scripts/demo.py" "$@"
