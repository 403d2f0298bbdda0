"""What sits between a robot's last body and its tool frame gives way: a gripper, a force sensor, a probe's stem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..parameters import Quantity
from .deeds import Deed, YieldingTool
from .gives_way import GivesWay, GivesWayAtPoint, GivesWayByAxis, alike, by_axis, of_point
from .law import Place

_BY_AXIS, _POINT = by_axis(1e-7, 1e-5), of_point("tool")


class ToolCompliance(GivesWay):
    """The tool moves by c f along the force and turns by r m about the moment that act on it, m about the tool point.

    Alike in all directions. The robot before it bears the same load, and what stands on its bodies does not move.
    """

    physics = "tool_compliance"
    summary = "what sits between the last joint's body and the tool gives way"
    called = "gripper, finger, force sensor, flange, end effector, tool changer, probe stem, spindle"
    remedy = "tighten or stiffen what the tool is held by, or measure the robot at its flange"
    source = "Rivin, Stiffness and Damping in Mechanical Design, ch. 7"
    gives = summary
    quantities: ClassVar[tuple[Quantity, ...]] = alike("tool", 1e-7, 1e-5)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        carried = mechanism.tool_part
        return [] if carried is None else [Place(carried, self.variant)]

    def moved(self, compliance: tuple[tuple[float, ...], ...], values: Mapping[str, float]) -> Deed:
        return YieldingTool(compliance)


class UnevenToolCompliance(GivesWayByAxis, ToolCompliance):
    """The same with a compliance of its own along and about each axis of the tool: a stem bends, and is stiff along."""

    variant = "by axis"
    quantities: ClassVar[tuple[Quantity, ...]] = _BY_AXIS


class UnevenToolAtPoint(GivesWayAtPoint, UnevenToolCompliance):
    """The same seen at a point beside the tool's, in its axes: where it is held, or half-way along a bending stem."""

    variant = "by axis, about a point"
    summary = "what sits between the last joint's body and the tool gives way, about a point"
    cost = 16.0  # where the tool's own point will do, that is where
    usual, far = 0.1, 1.0  # a tool is so long
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, *_POINT)
