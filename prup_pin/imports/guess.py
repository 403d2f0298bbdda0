"""A first map, guessed from names, units and numbers, for its user to correct.

What a name says counts first, then what the numbers allow: joints hardly turn further than twice around, and positions
are the integral of velocities, which settles degrees, revolutions and milliseconds at once. Whatever is guessed without
proof is a doubt, and says so in the map.
"""

from __future__ import annotations

from .beside import set_beside
from .by_unit import add_by_unit
from .draft import Guessing
from .joint_columns import add_joints
from .log import Log
from .map_text import Guess, written
from .named import NamedRobot
from .pose_columns import seen_poses
from .time_column import time_column
from .unit_by_numbers import settle_units
from .wrench_columns import wrench_lines


def guess(log: Log, mechanism: NamedRobot | None = None, robot: str | None = None) -> Guess:
    """Return a first map of a log. mechanism and robot: the robot and its name, where they are known."""
    clocks = {stream.name: time_column(stream) for stream in log.streams}
    times = {name for name, _, _ in clocks.values() if name}
    found = Guessing()
    for stream in log.streams:
        add_joints(stream, times, mechanism, found)
    taken = {line.source for line in found.lines}
    loads = wrench_lines(log, taken)
    found.lines += loads
    seen = seen_poses(log, taken | {line.source for line in loads} | times, mechanism)
    found.lines += seen.lines.values()
    if mechanism is not None:
        places = {name for body in seen.others for name in body.place.values()}
        turns = {name for body in (*seen.turns.values(), *seen.others) for name in body.turn}
        add_by_unit(log, {line.source for line in found.lines} | places | turns | times, mechanism, found)
    settle_units(log, clocks, found, mechanism)
    set_beside(log, clocks, found, seen, mechanism)
    return written(log, clocks, found, seen, mechanism, robot)
