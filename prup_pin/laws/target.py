"""A measured target that does not sit in the tool frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array, rotation_exp, rotation_log
from .deeds import Deed, Moved, PoseReport
from .in_recording import InRecording
from .law import Effect, Law, Place, Sharing
from .setup import Setup


class TargetMisalignment(Law):
    """The target sits beside the tool frame: the sensor sees p + R t and R exp(r), with t and r in the tool's axes."""

    physics = "target_misalignment"
    summary = "a measured target that is turned or shifted on the tool"
    sensor = "target"
    remedy = (
        "measure where the target sits on the tool, or declare that it is not known (tolerances "
        "target_position and target_rotation)"
    )
    quantities = (
        *(Quantity(name, "m", f"shift along {name}", 1e-4, lower=-1.0, upper=1.0) for name in ("x", "y", "z")),
        *(Quantity(name, "rad", f"turn about {name[1]}", 1e-3, lower=-3.2, upper=3.2) for name in ("rx", "ry", "rz")),
    )
    neutral: ClassVar = {quantity.name: 0.0 for quantity in quantities}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("target")] if mechanism.tool is not None else []

    def on(self, mechanism: Mechanism) -> str:
        """Return the frame that the target is on."""
        return mechanism.need_tool().name

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [self.on(mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        shift = np.array([values[name] for name in ("x", "y", "z")])
        turn = rotation_exp(np.array([values[name] for name in ("rx", "ry", "rz")]))
        yield PoseReport(Moved.on_body(shift, turn), self.on(setup.mechanism))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the measured target {_beside(values, 'the tool frame')}"


class MarkerMisalignment(TargetMisalignment):
    """The same of a marker on another frame. Which frames have one is the recording's to say."""

    summary = "a marker that is turned or shifted on its frame"
    remedy = (
        "measure where the marker sits, or declare that it is not known (tolerances target_position and "
        "target_rotation)"
    )

    def __init__(self, frame: str):
        self.frame = frame
        vars(self).update(variant=f"marker {frame}")

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("target", self.variant)] if self.frame in mechanism.frame_names else []

    def on(self, mechanism: Mechanism) -> str:
        return self.frame

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the marker {_beside(values, f'the frame {self.frame}')}"


def _beside(values: Mapping[str, float], frame: str) -> str:
    """Return in words how a target sits on a frame: turned only where a turn was found, which positions do not show."""
    shift = float(np.linalg.norm([values[name] for name in ("x", "y", "z")]))
    turn = float(np.linalg.norm([values[name] for name in ("rx", "ry", "rz")]))
    sits, turned = f"is {quantity(shift, 'm')} away from {frame}", f"is turned by {quantity(turn, 'rad')}"
    if not turn:
        return sits
    return f"{sits} and {turned}" if shift else f"{turned} on {frame}"


def of_markers(mechanism: Mechanism, names: Iterable[str] | None = None) -> tuple[MarkerMisalignment, ...]:
    """Return the law of each marker at frames of these names, or at any frame but the tool's."""
    tool = None if mechanism.tool is None else mechanism.tool.name
    known = mechanism.frame_names if names is None else [name for name in names if name in mechanism.frame_names]
    return tuple(MarkerMisalignment(name) for name in known if name != tool)


def sits_turned(turn: Array, frame: str, group: Sharing | None, mechanism: Mechanism) -> Effect:
    """Return the effect of a target whose axes are turned (3, 3) against its frame's; group: in which recordings."""
    is_tool = mechanism.tool is not None and mechanism.tool.name == frame
    target: Law = TargetMisalignment() if is_tool else MarkerMisalignment(frame)
    law = target if group is None else InRecording(target, group)
    angles = zip(("rx", "ry", "rz"), map(float, rotation_log(turn[None])[0]), strict=True)
    return Effect(law, law.places(mechanism)[0], {"x": 0.0, "y": 0.0, "z": 0.0, **dict(angles)})
