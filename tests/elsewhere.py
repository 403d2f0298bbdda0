"""Recordings that do not ship with the project: environment variables say where they are, see CONTRIBUTING.md."""

import os
from pathlib import Path

import pytest


def named_by(variable: str) -> tuple[Path, pytest.MarkDecorator]:
    """Return the file or folder that an environment variable names, and a mark for tests that need it."""
    named = os.environ.get(variable)
    # what is named and not there is no reason to skip
    return Path(named or variable), pytest.mark.skipif(
        not named, reason=f"{variable} names no file; see CONTRIBUTING.md"
    )


#: The public recording of a ball-screw axis, emps.csv.
EMPS, needs_emps = named_by("PRUP_PIN_EMPS")
#: A folder with bench tests of practice devices, p01.csv and so on.
PRACTICE, needs_practice = named_by("PRUP_PIN_PRACTICE")
