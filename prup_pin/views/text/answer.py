"""A compliance and a load, ready to be shown: what text, JSON and pictures have in common."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from ...errors import InputError, JointLimitWarning, NoStiffnessError, PrupPinError
from ...robot import Robot
from ...spatial import Array, as_wrench
from ...statics import Compliance

#: Decimals of a share that are more than rounding.
_SHARE_DIGITS = 9
#: What of a displacement is rounding, as a share of it.
_ROUNDING = 1e-10
#: What counts as beside a pose: so far on [rad, robot's sizes], each joint by another step.
_BESIDE = 0.05


@dataclass(frozen=True)
class Load:
    """A wrench on the tool (6,) [N, N m], and whether the user gave it."""

    wrench: Array
    given: bool

    @property
    def turns(self) -> bool:
        """True where the load is a pure moment, so that rotations are what to look at."""
        return not self.wrench[:3].any()


def softest_load(compliance: Compliance) -> Load:
    """Return a unit force along the softest direction; a unit moment where no force moves the tool."""
    wrench = np.zeros(6)
    for block in (slice(0, 3), slice(3, 6)):
        values, vectors = np.linalg.eigh(compliance.C[block, block])
        if values[-1] > 0:
            direction = vectors[:, -1]
            # of equally soft directions the one nearest to a coordinate axis, so that the answer repeats
            alike = vectors[:, values > values[-1] * (1 - 1e-6)]
            if alike.shape[1] > 1:
                along = alike @ alike.T
                direction = along[:, int(np.argmax(np.round(np.diagonal(along), 6)))]
                direction = direction / np.linalg.norm(direction)
            direction = np.where(np.abs(direction) < 1e-9, 0.0, direction)
            wrench[block] = direction * np.sign(direction[int(np.argmax(np.abs(direction)))])
            return Load(wrench, given=False)
    return Load(wrench, given=False)


def ranked(shares: Mapping[str, float]) -> list[str]:
    """Return the names, the largest share first.

    Shares that differ by rounding alone (mirrored legs, parts that carry nothing) stay as the robot file has them.
    """
    return sorted(shares, key=lambda name: -round(shares[name], _SHARE_DIGITS))


def softest(shares: Mapping[str, float]) -> list[str]:
    """Return the names with the largest share: several where they differ by rounding alone."""
    first, *others = ranked(shares)
    least = round(shares[first], _SHARE_DIGITS)
    return [first, *(name for name in others if round(shares[name], _SHARE_DIGITS) == least)]


def yielding_beside(robot: Robot, compliance: Compliance) -> int | None:
    """Return in how many directions the tool yields a little beside a pose, or None where no such pose is found."""
    pose = compliance.pose
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", JointLimitWarning)
        try:
            if pose.mechanism.loops:
                units = [pose.mechanism.joint(name).unit for name in pose.actuators]
                size = np.array([1.0 if unit == "rad" else robot.characteristic_length for unit in units])
                moved = np.array([*pose.actuators.values()]) + _BESIDE * _unequal(len(size)) * size
                beside = robot.pose_from_actuators(moved, near=pose)
            else:
                model = pose.mechanism.model
                beside = robot.pose_from_configuration(pin.integrate(model, pose.q, _BESIDE * _unequal(model.nv)))
            return 6 - len(robot.compliance(beside, compliance.load).rigid_directions)
        except PrupPinError:
            return None


def _unequal(count: int) -> Array:
    """Return numbers (count,) between 1 and 2 of which no two are alike."""
    return np.asarray(1.0 + (np.arange(1, count + 1) * 0.618034) % 1.0, float)


def _rounded(vector: Array) -> Array:
    """Return a vector (3,) without components that are only rounding of the others."""
    return np.where(np.abs(vector) < _ROUNDING * np.abs(vector).max(), 0.0, vector)


class Answer:
    """All numbers of one question, computed once. SI throughout."""

    def __init__(self, compliance: Compliance, wrench=None, frame: str | None = None):
        self.compliance = compliance
        self.mechanism = compliance.pose.mechanism
        self.load = softest_load(compliance) if wrench is None else Load(as_wrench(wrench), given=True)
        self.frame = frame
        if frame is not None:
            self.mechanism.frame(frame)

    @property
    def tool(self) -> str:
        """Name of the tool frame."""
        assert self.mechanism.tool is not None  # without a tool there is no compliance
        return self.mechanism.tool.name

    @cached_property
    def stiffness(self) -> Array | None:
        """K, or None where some directions are rigid."""
        try:
            return self.compliance.K
        except NoStiffnessError:
            return None

    @cached_property
    def task_stiffness(self) -> Array | None:
        """K in the task coordinates of a robot with fewer than six; None where it has others or some are rigid."""
        try:
            return self.compliance.K_task if len(self.mechanism.tasks) < 6 else None
        except (InputError, NoStiffnessError):
            return None

    @cached_property
    def deflection(self) -> Array:
        """Deflection (6,) of the tool [m, rad]; what is only rounding is zero."""
        c, w = self.compliance.C, self.load.wrench
        bound = np.sqrt(np.abs(np.diagonal(c)) * abs(float(w @ c @ w)))  # Cauchy-Schwarz
        found = self.compliance.deflection(w)
        return np.where(np.abs(found) < _ROUNDING * bound, 0.0, found)

    @cached_property
    def frame_deflection(self) -> Array | None:
        """Deflection (6,) of the other frame asked for, rounding away, or None."""
        if self.frame is None:
            return None
        found = self.compliance.deflection(self.load.wrench, frame=self.frame)
        return np.concatenate([_rounded(found[:3]), _rounded(found[3:])])

    @cached_property
    def sag(self) -> Array:
        """Deflection (6,) of the tool under the robot's weight [m, rad], rounding away."""
        found = self.compliance.sag()
        return np.concatenate([_rounded(found[:3]), _rounded(found[3:])])

    @cached_property
    def shares(self) -> dict[str, float] | None:
        """Share of each module in the work of the load, or None where the load deflects nothing."""
        try:
            return self.compliance.shares(self.load.wrench)
        except InputError:
            return None

    def share_of(self, part: Array) -> float | None:
        """Return the share of a (6, 6) part of C in the work of the load."""
        w = self.load.wrench
        total = float(w @ self.compliance.C @ w)
        return None if self.shares is None else float(w @ part @ w) / total

    @property
    def motion(self) -> tuple[slice, str]:
        """The part of a displacement that is shown per module: translation, or rotation under a pure moment."""
        return (slice(3, 6), "rotation") if self.load.turns else (slice(0, 3), "translation")

    @cached_property
    def amount(self) -> float:
        """Length of the tool's translation [m], or rotation [rad] under a pure moment."""
        return float(np.linalg.norm(self.deflection[self.motion[0]]))

    @cached_property
    def contributions(self) -> dict[str, float]:
        """Each module's part of `amount`, along the direction in which the tool moves; they sum to it."""
        block, _ = self.motion
        along = self.deflection[block] / self.amount if self.amount else np.zeros(3)
        w = self.load.wrench
        parts = {name: float(along @ (self.compliance.parts[name] @ w)[block]) for name in self.compliance.names}
        return {name: part if abs(part) > _ROUNDING * self.amount else 0.0 for name, part in parts.items()}

    @cached_property
    def nonlinear(self) -> tuple[str, ...]:
        """Names of modules whose compliance depends on the load."""
        return tuple(module.name for module in self.mechanism.modules if module.kind.nonlinear)
