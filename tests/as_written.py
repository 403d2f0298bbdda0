"""Logs that are read in no other way, for tests of the physics in them: to look for other ways takes longer."""

import json
from dataclasses import replace
from pathlib import Path

from prup_pin.recordings import Convention, Recording


def as_written(recording: Recording, groups: str = "p q r") -> Recording:
    """Return a log that declares of these groups of columns that they are as they say."""
    return replace(recording, conventions=tuple(Convention(group, "as_written") for group in groups.split()))


def declare_as_written(path: Path, groups: str = "p q r wrench") -> None:
    """Write the same into the JSON file beside a table."""
    beside = path.with_suffix(".json")
    told = json.loads(beside.read_text(encoding="utf-8"))
    told["conventions"] = dict.fromkeys(groups.split(), "as_written")
    beside.write_text(json.dumps(told), encoding="utf-8")
