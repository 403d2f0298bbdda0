#!/usr/bin/env bash
# The main job on a clean clone: stiffness of the 3-PRUP robot at one pose, each module's share, two pictures in out/.
# Arguments go to `prup-pin stiffness` in the place of the demo's pose and load.
# Needs bash, Python 3.10 or newer and pip; installs into .venv in this folder and nowhere else.
set -euo pipefail

source "$(dirname "${BASH_SOURCE[0]}")/_venv.sh"
use_venv
[ $# -gt 0 ] || set -- 3prup --at z=0.4,theta=25deg,phi=15deg --wrench fx=300,mz=100
printf '\n$ prup-pin stiffness %s --pictures out\n\n' "$*"
exec "$VENV_PYTHON" -m prup_pin stiffness "$@" --pictures "$(project_folder)/out"
