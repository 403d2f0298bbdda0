"""What the loaded simulation is run with: a robot, a recording's inputs, and the deeds of all laws in their order."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..loaded import Conditions, Pull
from ..mechanism import Mechanism
from ..spatial import Array
from .deeds import Deed, HeldMass, JointResistance, Moment, Moved, PoseReport, RememberedStrain, Strain, Strains
from .inputs import Inputs


@dataclass
class Setup:
    """The simulation as laws leave it; `take` lets a law's deeds enter.

    A deed changes no table: it puts another one in its place. What is the same object in two setups is alike.
    """

    mechanism: Mechanism
    inputs: Inputs
    sensed: Array  # (N, 6), the true wrench where the sensor reports that of the inputs
    unsensed: Array  # (N, 6), what acts on the tool beside it, but for what it holds
    travel: Array  # (N, a), added to the actuators' reported positions
    turns: Array  # (N, 3, 3), the tool's orientation before anything deforms
    deeds: tuple[Deed, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)  # geometry: by the robot's parameter names
    values: dict[str, float] = field(default_factory=dict)  # the modules' values
    strains: dict[str, tuple[Strain, ...]] = field(default_factory=dict)
    resistances: tuple[JointResistance, ...] = ()
    remembered: tuple[RememberedStrain, ...] = ()
    offsets: dict[int, Array] = field(default_factory=dict)  # of joints' places by joint id, (6,) or (N, 6)
    loop_offsets: dict[tuple[int, int], Array] = field(default_factory=dict)  # of loops' ends, (6,)
    mass_factors: dict[str, float] = field(default_factory=dict)  # of links
    yielding: dict[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)  # of joints, by name and way
    springs: tuple[Pull, ...] = ()
    base: Array | None = None  # (6, 12), how the base gives way under all that acts, and at home, about its origin
    tool: Array | None = None  # (6, 6), how the tool gives way on its body under what acts on it, about its point
    held: tuple[HeldMass, ...] = ()  # by the tool
    fall: Array = field(default_factory=lambda: np.zeros(3))  # (3,) [m/s^2], gravity beyond the robot file's
    weight: float = 0.0  # share of the links' weight that acts
    spread_weight: bool = False
    reports: tuple[PoseReport, ...] = ()
    tool_motion: tuple[Array, Array] | None = None  # as `BodyMotion.of_frame`, before anything deforms
    later: Array | float = 0.0  # (N, a) [s]: the actuators move as they are reported to do so much later

    @classmethod
    def nominal(
        cls,
        mechanism: Mechanism,
        inputs: Inputs,
        turns: Array | None = None,
        tool_motion: tuple[Array, Array] | None = None,
    ) -> Setup:
        """Return the simulation as the robot file has it; `turns` is the tool's orientation (N, 3, 3), if known.

        tool_motion: how the tool is accelerated, as `BodyMotion.of_frame` tells it; None: it is not known to be.
        """
        if turns is None:
            turns = np.broadcast_to(np.eye(3), (len(inputs), 3, 3))
        wrench = np.array(inputs.wrench, float)
        travel = np.zeros_like(inputs.actuators, float)
        return cls(mechanism, inputs, wrench, np.zeros_like(wrench), travel, turns, tool_motion=tool_motion)

    def copy(self) -> Setup:
        """Return a setup that may take more deeds; this one stays as it is."""
        return copy(self)

    def take(self, deeds: Iterable[Deed]) -> None:
        """Let deeds enter, in their order."""
        for deed in deeds:
            deed.enter(self)
            self.deeds = (*self.deeds, deed)

    # -- what laws may ask of those before them ------------------------------------------------------------------------

    def module_value(self, module: str, quantity: str) -> Any:
        """Return a module's value as changed so far."""
        name = f"{module}.{quantity}"
        return self.values[name] if name in self.values else self.mechanism.module(module).values[quantity]

    def position(self, name: str) -> Array:
        """Return where a driven joint, or one that follows such, is reported to stand, (N,) [m or rad]."""
        mechanism = self.mechanism
        q = np.zeros((len(self.inputs), mechanism.model.nq))
        for column, actuated in enumerate(mechanism.actuated):
            mechanism.joint(actuated).place(q, self.inputs.actuators[:, column])
        mechanism.coupling.place(q)
        return np.asarray(mechanism.joint(name).position(q))

    def gravity(self, samples: np.ndarray | None = None) -> Array:
        """Return the acceleration of free fall, (3,) of all samples or (n, 3) of some or of all of them."""
        given = self.inputs.gravity
        if given is None:
            return np.asarray(self.mechanism.gravity + self.fall)
        return given if samples is None else given[samples]

    def falls(self, arm: Array) -> Array:
        """Return free fall less the acceleration of the tool's point at `arm` (N, 3) [m], base axes [m/s^2]."""
        if self.tool_motion is None:
            return self.gravity()
        accelerated, around = self.tool_motion
        return np.asarray(self.gravity() - accelerated - (around @ arm[..., None])[..., 0])

    def inertia(self, samples: np.ndarray) -> Array | None:
        """Return the wrenches of all links' inertia (n, links, 6), as in `Conditions`; None where none is known."""
        travel, later = self.travel[samples], np.broadcast_to(self.later, self.travel.shape)[samples]
        moving = self.inputs.bodies(self.mechanism, samples, travel, later) if self.mechanism.links else None
        return None if moving is None else moving.loads(self.mechanism.links)

    # -- what the simulation is run with -------------------------------------------------------------------------------

    @property
    def held_weight(self) -> Array:
        """What the tool holds loads it with, (N, 6)."""
        return np.asarray(sum((each.wrench(self) for each in self.held), np.zeros_like(self.unsensed)))

    @property
    def wrench(self) -> Array:
        """What acts on the tool, (N, 6)."""
        return self.sensed + self.unsensed + self.held_weight

    @property
    def memories(self) -> set[str]:
        """How long its deeds remember: any of deeds.BLOCK and deeds.RUN."""
        return {deed.memory for deed in self.deeds if deed.memory}

    def without_memory(self) -> Setup:
        """Return the simulation without the deeds that remember."""
        plain = Setup.nominal(self.mechanism, self.inputs, self.turns, self.tool_motion)
        plain.take(deed for deed in self.deeds if not deed.memory)
        return plain

    def moment(self, samples: np.ndarray) -> Moment:
        """Return when samples (n,) were taken."""
        inputs = self.inputs
        return Moment(inputs.time[samples], inputs.blocks[samples], inputs.run_labels()[samples])

    def conditions(self, samples: np.ndarray) -> Conditions:
        """Return the conditions of samples (n,), without what remembers."""
        travel = self.travel[samples]
        return replace(
            self.loads(samples),
            spread_weight=self.spread_weight,
            strains={name: Strains(item.take(samples) for item in items) for name, items in self.strains.items()},
            actuators=travel if np.any(travel) else None,
            offsets={joint: each if each.ndim < 2 else each[samples] for joint, each in self.offsets.items()},
            loop_offsets=self.loop_offsets,
        )

    def loads(self, samples: np.ndarray) -> Conditions:
        """Return what pulls at the robot at samples (n,), and nothing else."""
        inertia = self.inertia(samples) if self.weight else None
        return Conditions(
            inertia=None if inertia is None else self.weight * inertia,
            wrench=self.wrench[samples],
            gravity=self.gravity(samples) * self.weight if self.weight else None,
            mass_factors=self._masses(),
            springs=self.springs,
        )

    def _masses(self) -> Array | None:
        """Return the factors of all links, (links,); None where the masses are the robot file's."""
        if not self.mass_factors:
            return None
        return np.array([self.mass_factors.get(link.name, 1.0) for link in self.mechanism.links])

    def reported(
        self, position: Array, rotation: Array, frame: str, samples: np.ndarray | None = None
    ) -> tuple[Array, Array]:
        """Return what the pose sensor makes of true poses of a frame, (n, 3) [m] and (n, 3, 3); of some samples or all.

        The latter are the rows of the inputs that the n poses belong to.
        """
        for report in PoseReport.joined(report for report in self.reports if report.frame in (None, frame)):
            position, rotation = report.of(position, rotation, samples)
        return position, rotation

    def as_moved(self, frame: str) -> Moved | None:
        """Return all reports of a frame as one where the sensor does no more than see poses elsewhere; else None."""
        reports = PoseReport.joined(report for report in self.reports if report.frame in (None, frame))
        whole = [report.reported for report in reports if report.rows is None]
        return whole[0] if len(whole) == len(reports) == 1 and isinstance(whole[0], Moved) else None
