"""Which columns are places and orientations: of frames of the robot by what bodies are called, else of the tool."""

from __future__ import annotations

import numpy as np

from .bodies import bodies_of, frame_of
from .draft import Line, Seen
from .log import Log, Stream
from .named import NamedRobot
from .units import spelled
from .words import unit_in_name


def seen_poses(log: Log, taken: set[str], mechanism: NamedRobot | None) -> Seen:
    """Return the lines of positions and orientations of bodies: of those called like a frame, else of the tool."""
    seen = Seen()
    frames = mechanism.frame_names if mechanism is not None else ()
    found = [body for stream in log.streams for body in bodies_of(stream, taken, frames)]
    homes = {body.called: frame_of(body.called, frames) for body in found}
    nobody = [body for body in found if not homes[body.called]]
    for body in sorted(found, key=lambda body: len(body.called)):  # tool0 comes before its markers
        frame = homes[body.called]
        place = f".{frame}" if frame else ""
        if (not frame and len(nobody) > 1) or f"p{place}.x" in seen.lines or f"r{place}" in seen.turns:
            seen.others.append(body)
            continue
        for axis, name in body.place.items():
            seen.lines[f"p{place}.{axis}"] = place_line(f"p{place}.{axis}", name, body.stream, bool(frame))
        if body.turn:
            seen.turns[f"r{place}"] = body
    return seen


def place_line(target: str, name: str, stream: Stream, framed: bool) -> Line:
    """Return the line of one coordinate of a body: of a frame of the robot (`framed`), or of who knows what."""
    said = stream.units.get(name) or unit_in_name(name)
    unit = spelled(said) if said else None
    doubt = "" if framed else "is it the tool point, measured from outside, in base axes? Else p.<frame>"
    if unit is None:
        reach = float(np.nanmax(np.abs(stream.columns[name]), initial=0.0))
        unit = "mm" if reach > 20 else "m"
        doubt = doubt or (f"up to {reach:.4g}, so taken as mm" if unit == "mm" else "")
    return Line(target, name, unit, doubt=doubt)
