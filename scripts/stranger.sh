#!/usr/bin/env bash
# A newcomer's first hour from nothing: an environment of its own, README's install line, every command and block of
# README and tutorial as printed, the examples, a robot of one's own, the diagnosis of the recording that ships.
# Needs bash, Python 3.10 or newer with venv and pip. Everything happens in a temporary folder.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
python="${PYTHON:-python3}"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
unset PYTHONHOME PYTHONPATH VIRTUAL_ENV
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 COLUMNS=100

# What a checkout holds, and nothing that was built in this one.
mkdir "$folder/checkout" "$folder/desk"
cd "$root"
find . -mindepth 1 -maxdepth 1 ! -name .git ! -name .venv ! -name out ! -name '.*_cache' -print0 |
  tar --null --exclude=__pycache__ -T - -cf - | tar -C "$folder/checkout" -xf -
"$python" -m venv "$folder/venv"
PATH="$folder/venv/bin:$PATH"
exec "$folder/venv/bin/python" "$root/scripts/_stranger.py" "$folder/checkout" "$folder/desk"
