"""Logs of other people's controllers as recordings: readers, the map between, and a first guess of it."""

from .convert import Conversion, convert
from .guess import Guess, guess
from .log import Log, Stream, read_log, read_logs
from .map import LogMap, read_map, robot_named, unanswered

# What pages name; the rest is for other rooms.
__all__ = ["convert", "guess", "read_log", "read_map"]
