"""The explorer: a robot under sliders for pose and load, served to browsers on this machine.

Every browser has its own sliders. What it sends is a question, answered like any other: pose, compliance, scene; sent
back is what of the scene the browser says that it does not have.
"""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...errors import InputError, PrupPinError, limits_heard
from ...kinematics import ClosedPose
from ...robot import Robot
from ...spatial import WRENCH_NAMES, Array, as_wrench
from ..scene.elastic import Deflections, fitting_scale
from ..scene.painter import Painter
from ..scene.scene import Scene
from ..text.answer import Answer, rigid_texts, stiffness_table
from ..text.values import clean, coordinate_dimensions, dimension, limits
from .view import Served, message

#: How far sliders of task coordinates reach from where they start: share of the robot's size [m], and [rad].
REACH, TURN = 0.5, np.radians(45)
#: How far those of loads reach, where the load asked for is smaller [N], [N m].
FORCE, MOMENT = 500.0, 100.0
#: Shown unit and its size in SI, by dimension.
_UNITS = {"length": ("mm", 1e-3), "angle": ("°", np.pi / 180), "number": ("", 1.0)}


@dataclass(frozen=True)
class Control:
    """A slider: SI value where it starts, and how far it reaches."""

    name: str
    dimension: str
    value: float
    low: float
    high: float

    def described(self) -> dict[str, Any]:
        """Return what the page makes of it, in the unit that it shows."""
        unit, factor = _UNITS.get(self.dimension, (self.dimension, 1.0))
        shown = {key: float(f"{clean(getattr(self, key)) / factor:.6g}") for key in ("value", "low", "high")}
        return {"name": self.name, "label": self.name, "unit": unit, "factor": factor, **shown}


class Explorer(Served):
    """A robot to be played with in a browser: `serve` returns the address.

    It begins at `pose` (none: home) under `wrench` (6,), with deflections drawn `scale` times larger (none: a round
    number that suits the sliders' loads). Needs nothing from the network. Raises what these ask of the robot.
    """

    def __init__(self, robot: Robot, pose: ClosedPose | None = None, wrench=None, scale: float | None = None):
        self.robot, self.title = robot, robot.name
        self.pose = robot.home if pose is None else pose
        self.wrench = np.zeros(6) if wrench is None else as_wrench(wrench)
        self.painter = Painter(robot, self.pose)
        self.by_task = bool(robot.task_coordinates)
        self.poses = tuple(self._pose_controls())
        self.loads = tuple(self._load_controls()) if robot.mechanism.modules else ()
        self.scale = scale if scale is not None else self._usual_scale()
        #: What is shown first; its size and its place in the page hold for all that follows.
        self.first = self.scene(self.pose, self.wrench, self.scale)

    # -- sliders ---------------------------------------------------------------------------------------------------

    def _pose_controls(self) -> list[Control]:
        robot, mechanism = self.robot, self.robot.mechanism
        values = self.pose.coordinates if mechanism.tasks else self.pose.actuators
        kinds = coordinate_dimensions(robot) if mechanism.tasks else {n: dimension(mechanism, n) for n in values}
        found = []
        for name, value in values.items():
            reach = {"length": REACH * self.painter.size, "angle": TURN}.get(kinds[name], 1.0)
            span = None if mechanism.tasks else limits(mechanism, name)
            low, high = (value - reach, value + reach) if span is None else span
            found.append(Control(name, kinds[name], float(value), min(low, value), max(high, value)))
        return found

    def _load_controls(self) -> list[Control]:
        found = []
        for block, unit, least in ((slice(0, 3), "N", FORCE), (slice(3, 6), "N m", MOMENT)):
            reach = max(least, 2 * float(np.abs(self.wrench[block]).max()))
            values = zip(WRENCH_NAMES[block], self.wrench[block].tolist(), strict=True)
            found += [Control(name, unit, value, -reach, reach) for name, value in values]
        return found

    def _usual_scale(self) -> float | None:
        """Return what suits a load of half the sliders' reach along the softest direction, or the load asked for."""
        if not self.loads:
            return None
        compliance = self.robot.compliance(self.pose)
        load = self.wrench
        if not load.any():
            load = Answer(compliance).load.wrench
            load = load * 0.5 * (FORCE if load[:3].any() else MOMENT)
        return fitting_scale(Deflections(compliance, load), self.painter.size)

    # -- answers ---------------------------------------------------------------------------------------------------

    def pose_at(self, values: Mapping[str, float]) -> ClosedPose:
        """Return the pose at the sliders' values, one for each; raises like `Robot.pose`."""
        wanted = {control.name: float(values[control.name]) for control in self.poses}
        if self.by_task:
            return self.robot.pose(**wanted)
        return self.robot.pose_from_actuators(list(wanted.values()))

    def scene(self, pose: ClosedPose, wrench: Array, scale: float | None) -> Scene:
        """Return the scene of a pose under a load."""
        compliance = self.robot.compliance(pose) if self.loads else None
        return self.painter.scene(pose, compliance, wrench if wrench.any() else None, scale)

    def matrix(self, pose: ClosedPose, wrench: Array) -> dict[str, Any] | None:
        """Return K as the page shows it, or in which directions there is none; None where nothing yields."""
        if not self.loads:
            return None
        answer = Answer(self.robot.compliance(pose), wrench if wrench.any() else None)
        table = stiffness_table(answer)
        if table is None:
            texts = "; ".join(rigid_texts(answer))
            return {"title": "K does not exist", "detail": f"no module yields under {texts}"}
        return asdict(table)

    def message(self) -> dict[str, Any]:
        groups = [("pose", "Pose", self.poses), ("load", "Load on the tool", self.loads)]
        controls = {
            "title": self.robot.name,
            "scale": self.scale,
            "groups": [
                {"name": name, "title": title, "controls": [control.described() for control in controls]}
                for name, title, controls in groups
                if controls
            ],
        }
        return {"controls": controls, "scale": self.scale, **self._told(self.first, self.pose, self.wrench)}

    def reply(self, question: str | bytes) -> dict[str, Any]:
        """Return what makes the page follow its sliders, or the reason why it cannot, in words."""
        try:
            asked = json.loads(question)
            values, load, scale, known = asked["pose"], asked["load"], asked["scale"], set(asked["known"])
            if scale is not None and not 0 < float(scale) < np.inf:
                raise InputError(f"the deflection cannot be drawn {scale} times larger; expected a number above 0")
            wrench = as_wrench({name: float(value) for name, value in load.items()})
            with limits_heard() as heard:
                pose = self.pose_at(values)
            scene = self.scene(pose, wrench, None if scale is None else float(scale))
            said = {"scale": scene.scale or None, "trouble": " ".join(heard)}
            return {**said, **self._told(scene, pose, wrench, known)}
        except PrupPinError as error:
            return {"trouble": str(error)}
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
            return {"trouble": "this question was not understood"}

    def _told(self, scene: Scene, pose: ClosedPose, wrench: Array, known: Container[str] = ()) -> dict[str, Any]:
        return {**message([scene], seen=self.first, known=known), "matrix": self.matrix(pose, wrench)}
