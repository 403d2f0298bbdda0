"""Logs that are read in no other way, for tests of the physics in them: to look for other ways takes longer."""

from dataclasses import replace

from prup_pin.recordings import Convention, Recording


def as_written(recording: Recording, groups: str = "p q r") -> Recording:
    """Return a log that declares of these groups of columns that they are as they say."""
    return replace(recording, conventions=tuple(Convention(group, "as_written") for group in groups.split()))
