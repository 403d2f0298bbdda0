"""C and K of a mechanism at a pose, and the part of every module: the result a user reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from ..errors import InputError, NoStiffnessError, imported, named
from ..kernel import NEGLIGIBLE_ENERGY, inverse
from ..kinematics import TaskFrame
from ..numbers import number
from ..spatial import TWIST_NAMES, WRENCH_NAMES, Array, as_wrench, as_wrenches, frobenius, symmetric, wrench_text
from .castigliano import Statics
from .elastic_line import ElasticLine, elastic_line
from .vibration import VibrationMode, vibration_modes
from .weight import weight_strains

if TYPE_CHECKING:
    from pandas import DataFrame


#: What of a rigid direction, beside its largest component of 1, is rounding.
_ROUNDING = 1e-6
#: A rigid direction this near to an axis is that axis: robot files give theirs to four digits (rpy="1.5708 0 0").
_ALONG = 1e-4


def dimensionless(length: float) -> Array:
    """Return the factors (6, 6) that make C dimensionless with a characteristic length [m]: 1, L or L^2."""
    scale = np.array([1.0, 1.0, 1.0] + 3 * [length])
    return np.outer(scale, scale)


Found = TypeVar("Found")


class _Once(Generic[Found]):
    """A cached_property without its lock, which takes Python before 3.12 as long as an inverse."""

    def __init__(self, work: Callable[[Any], Found]):
        self._work = work
        self.__doc__ = work.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Found:
        if instance is None:
            return self  # type: ignore[return-value]
        found = instance.__dict__[self._name] = self._work(instance)
        return found


class _Named(Mapping):
    """Read-only view of stacked arrays by module name."""

    def __init__(self, index: Mapping[str, int], get):
        self._index = index
        self._get = get

    def __getitem__(self, name: str) -> Array:
        return self._get(named("module", name, self._index))

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._index)


def yielding_stiffness(compliance: Array, scaling: Array) -> Array:
    """Return the least inverses (..., 6, 6) of compliances, zero in what is rigid.

    scaling (6, 6) makes them dimensionless: 1, L or L^2 with a characteristic length L [m].
    """
    values, vectors = np.linalg.eigh(compliance * scaling)
    yields = values > NEGLIGIBLE_ENERGY * np.maximum(values[..., -1:], 0.0)
    inverse = np.where(yields, 1 / np.where(yields, values, 1.0), 0.0)
    stiffness = (vectors * inverse[..., None, :]) @ vectors.mT * scaling
    return symmetric(stiffness)


def no_stiffness(rigid: Array) -> NoStiffnessError:
    """Return the error that K does not exist, for these rigid directions (n, 6)."""
    listed = "; ".join(wrench_text(direction, 3, _ROUNDING) for direction in rigid)
    return NoStiffnessError(
        f"no K: these {len(rigid)} of 6 directions are rigid (no module yields to them): {listed}. "
        "C is complete; give a compliance to more joints or bodies if these directions should yield",
        rigid,
    )


def natural_basis(space: Array, axes: Array) -> Array:
    """Return a basis (n, 6) of a space of orthonormal columns (6, n): first those of `axes` (m, 6) that lie in it.

    Then come the coordinate axes' shadows in what is left, the longest first, which of equal ones stands first.
    """
    rest: Array = space @ space.T
    found: list[Array] = []
    while len(found) < space.shape[1]:
        lying = [axis for axis in axes if np.linalg.norm(axis - rest @ axis) < _ALONG]
        direction = rest @ lying[0] if lying else rest[int(np.argmax(np.round(np.diagonal(rest), 6)))]
        found.append(direction)
        unit = direction / np.linalg.norm(direction)
        rest = rest - np.outer(unit, unit)
    return np.array(found)


class Compliance:
    """C, K and their parts at one pose.

    All matrices are at the tool point in base axes, SI, (force, moment) -> (translation, rotation).
    """

    def __init__(self, statics: Statics, scaling: Array, load: Array | None):
        """`scaling` (6, 6) makes C dimensionless: 1, L or L^2 with the characteristic length L."""
        self.pose = statics.pose
        self.load = load
        self._statics = statics
        self._scaling = scaling
        deformations, *self._deformed = statics.deformations
        self.C: Array = statics.compliance(deformations)
        self.C.setflags(write=False)

    def __reduce__(self):
        return Compliance, (self._statics, self._scaling, self.load)

    @property
    def characteristic_length(self) -> float:
        """Length [m] with which rotations count as arcs, where what mixes them with translations has to be judged."""
        return float(self._scaling[0, 3])

    # -- the whole -----------------------------------------------------------------------------------------------

    @cached_property
    def rigid_directions(self) -> Array:
        """Wrenches that deflect nothing, (n, 6) [N, N m], each with a largest component of +1; n = 0 where K exists.

        Of all bases the one that speaks of axes: forces and moments along those of the base, then of the tool, as far
        as they are rigid, then what is left, each with a component of its own.
        """
        values, vectors = np.linalg.eigh(self.C * self._scaling)
        rigid = values <= NEGLIGIBLE_ENERGY * max(values.max(), 0.0)
        if not rigid.any():
            return np.zeros((0, 6))
        turned = self.pose.base_from_tool[:3, :3].T
        tool = np.block([[turned, np.zeros((3, 3))], [np.zeros((3, 3)), turned]])
        directions = natural_basis(vectors[:, rigid], np.vstack((np.eye(6), tool))) * self._scaling[0]
        largest = np.abs(directions).argmax(axis=1)[:, None]
        return directions / np.take_along_axis(directions, largest, axis=1) + 0.0

    @_Once
    def K(self) -> Array:  # noqa: N802 - the field's symbol
        """Stiffness, (6, 6). Raises NoStiffnessError where some directions are rigid."""
        scaled = self.C * self._scaling
        inverted = inverse(scaled)
        # The product of Frobenius norms bounds the condition number from above.
        if not 0 < frobenius(inverted) * frobenius(scaled) < 0.1 / NEGLIGIBLE_ENERGY:
            rigid = self.rigid_directions
            if len(rigid):
                raise no_stiffness(rigid)
        k = symmetric(inverted)
        k *= self._scaling
        k.setflags(write=False)
        return k

    @cached_property
    def K_yielding(self) -> Array:  # noqa: N802
        """Stiffness in the directions that yield, (6, 6); zero in those that are rigid, where K does not exist.

        The least inverse of C, rotations counted as arcs of the robot's size: C K_yielding C = C. It is K where K is.
        """
        k = yielding_stiffness(self.C, self._scaling)
        k.setflags(write=False)
        return k

    @cached_property
    def C_task(self) -> Array:  # noqa: N802
        """Compliance in the task coordinates, (t, t) in their order [m, rad per N, N m]: B C B^T.

        What the coordinates give way to loads of their own, B (t, 6) being their rates by the tool's twist: of a planar
        robot forces in its plane and the moment across. Raises InputError where the robot has no task coordinates.
        """
        task = TaskFrame.of(self.pose.mechanism)
        if not task.names:
            raise InputError(
                f"'{self.pose.mechanism.name}' has no task coordinates to take C and K in; name them in its file, "
                "<task_coordinates>, or use C and K of all six"
            )
        rates = task.by_motion(self.pose.base_from_tool)
        c = rates @ self.C @ rates.T
        c = (c + c.T) / 2
        c.setflags(write=False)
        return c

    @cached_property
    def K_task(self) -> Array:  # noqa: N802
        """Stiffness in the task coordinates, (t, t) in their order, the inverse of `C_task` [N, N m per m, rad].

        What holds the coordinates where nothing loads the tool otherwise: of a five-bar the field's 2 x 2 and of a
        planar 3-RPR its 3 x 3, J^-T K_j J^-1 with the Jacobian J and the stiffness K_j of the drives where those alone
        yield. Raises InputError where the robot has no task coordinates, NoStiffnessError where some of them are rigid.
        """
        c, task = self.C_task, TaskFrame.of(self.pose.mechanism)
        scale = np.array([1.0 if unit == "m" else self._scaling[0, 3] for unit in task.units.values()])
        values, vectors = np.linalg.eigh(c * np.outer(scale, scale))
        rigid = vectors[:, values <= NEGLIGIBLE_ENERGY * max(values.max(), 0.0)]
        if rigid.shape[1]:
            wrenches = (scale[:, None] * rigid).T @ task.by_motion(self.pose.base_from_tool)
            raise NoStiffnessError(
                f"no K in {', '.join(task.names)}: no module yields in {rigid.shape[1]} of these {len(c)}; give a "
                "compliance to more joints or bodies",
                wrenches / np.abs(wrenches).max(axis=1, keepdims=True),
            )
        k = (vectors / values) @ vectors.T * np.outer(scale, scale)
        k = (k + k.T) / 2
        k.setflags(write=False)
        return k

    def modes(self) -> tuple[VibrationMode, ...]:
        """Return the vibration modes of the tool, lowest natural frequency first, actuators held, without damping.

        Each has its `frequency` [Hz] and `shape` (6,), the tool's motion [m, rad]. Upper bounds, by the robot file's
        masses. Raises InputError where no body that moves has a mass.
        """
        return vibration_modes(self)

    def deflection(self, wrench, frame: str | None = None) -> Array:
        """Return the deflection (..., 6) [m, rad] of the tool, or of a named frame, under tool wrenches (..., 6).

        The deflection of another frame is that of a point fixed to its body, base axes, by Castigliano's dummy load.
        Several wrenches are answered at once, each along the last axis; {"fx": 300} is one.
        """
        w = as_wrenches(wrench)
        c = self.C if frame is None else self._statics.compliance_of(frame)
        return (c @ w[..., None])[..., 0]

    def elastic_line(self, name: str, wrench, count: int = 25) -> ElasticLine:
        """Return the bent centre line of a beam module under a wrench (6,) on the tool, `count` sections root to tip.

        Linear and unscaled, in base axes. Across the beam it ends at the deflection of its tip frame; along it that
        frame may move besides, as a drive yields or a slide slips. Raises UnknownNameError, and InputError where the
        module is no beam.
        """
        w = as_wrench(wrench)
        root = self.pose.mechanism.module(name).root
        start = self.deflection(w, frame=root.name) if root is not None else np.zeros(6)
        return elastic_line(self._statics, name, w, start, count)

    # -- the parts -----------------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the modules, in the order of the robot file."""
        return tuple(module.name for module in self.pose.mechanism.modules)

    @_Once
    def parts(self) -> Mapping[str, Array]:
        """Compliance J_m^T Lambda_m J_m of each module, (6, 6); they sum to C."""
        statics = self._statics
        wrench, drive = statics.jacobians
        parts, count = np.empty((len(wrench) + len(drive), 6, 6)), len(wrench)
        deformed, driven = self._deformed
        np.matmul(wrench.mT, deformed, parts[:count])
        np.multiply(drive.mT, driven, parts[count:])
        parts.setflags(write=False)
        return _Named(statics.layout.index, parts.__getitem__)

    @cached_property
    def wrench_jacobians(self) -> Mapping[str, Array]:
        """WCMJ of each module, (k, 6): loads in the module's own frame per unit wrench on the tool."""
        wrench, drive = self._statics.jacobians
        return _Named(self._statics.layout.index, [*wrench, *drive].__getitem__)

    @cached_property
    def module_compliances(self) -> Mapping[str, Array]:
        """Lambda of each module, (k, k), in its own frame."""
        wrench, drive = self._statics.lambdas
        return _Named(self._statics.layout.index, [*wrench, *drive].__getitem__)

    def _sum(self, wanted) -> Array:
        chosen = [name for module in self.pose.mechanism.modules if wanted(module) for name in (module.name,)]
        return sum((self.parts[name] for name in chosen), np.zeros((6, 6)))

    @cached_property
    def legs(self) -> dict[str, Array]:
        """Compliance of each leg (modules named '<leg>/…'), (6, 6)."""
        names = dict.fromkeys(module.leg for module in self.pose.mechanism.modules if module.leg)
        return {leg: self._sum(lambda module, leg=leg: module.leg == leg) for leg in names}

    @cached_property
    def bodies(self) -> Array:
        """Compliance of all bodies: rods, branches and screw shafts (Eq. 18), (6, 6)."""
        return self._sum(lambda module: module.kind.is_body)

    @cached_property
    def joints(self) -> Array:
        """Compliance of all joints and drives (Eq. 18), (6, 6)."""
        return self._sum(lambda module: not module.kind.is_body)

    def shares(self, wrench=None, direction=None) -> dict[str, float]:
        """Return each module's share of a deflection, summing to 1, in the order of the robot file.

        `wrench` alone: shares of the work w^T C w. `direction` alone (6,): of the compliance d^T C d along it. Both: of
        the deflection d^T C w along `direction` under `wrench`; single shares can then be negative.
        """
        if wrench is None and direction is None:
            raise InputError("shares need a wrench, a direction, or both; for example shares([0, 0, -300, 0, 0, 0])")
        w = as_wrench(wrench if wrench is not None else direction, "wrench" if wrench is not None else "direction")
        d = as_wrench(direction, "direction") if direction is not None else w
        total = float(d @ self.C @ w)
        # The largest deflection that wrenches of these sizes could cause, rotations weighed by the length.
        scale = self._scaling[0]
        largest = np.trace(self.C * self._scaling) * frobenius(d / scale) * frobenius(w / scale)
        if abs(total) <= 1e-12 * largest:
            raise InputError("this load deflects nothing along this direction; shares of zero have no meaning")
        return {name: float(d @ self.parts[name] @ w) / total for name in self.names}

    # -- weight ----------------------------------------------------------------------------------------------------

    def sag(self, frame: str | None = None) -> Array:
        """Return the deflection (6,) [m, rad] of the tool (or another frame) under the weight of all bodies.

        Weights of links act at their centres; a beam that names its body carries its weight as a continuous load.
        Small deflections; gravity is the robot file's.
        """
        return self._statics.displacement(weight_strains(self._statics), frame)

    # -- to hand on ------------------------------------------------------------------------------------------------

    def to_dict(self, wrench=None) -> dict[str, Any]:
        """Return pose, C, K and the parts as plain numbers and lists, SI; what does not exist is None.

        With a `wrench` (6,) on the tool also the deflection, and each part's share in it where it is not zero.
        """
        pose, load = self.pose, None if wrench is None else as_wrench(wrench)
        shares = self._shares(load)
        modules = {
            module.name: {
                "kind": module.kind.kind,
                "leg": module.leg,
                "group": "bodies" if module.kind.is_body else "joints",
                "C": self.parts[module.name].tolist(),
                "share": shares.get(module.name),
                "deflection": None if load is None else (self.parts[module.name] @ load).tolist(),
            }
            for module in pose.mechanism.modules
        }
        return {
            "robot": pose.mechanism.name,
            "tool": pose.mechanism.need_tool().name,
            "coordinates": {name: float(value) for name, value in pose.coordinates.items()},
            "actuators": pose.actuators,
            "C": self.C.tolist(),
            "K": None if len(self.rigid_directions) else self.K.tolist(),
            "rigid_directions": self.rigid_directions.tolist(),
            "K_task": self._task_stiffness(),
            "wrench": None if load is None else load.tolist(),
            "deflection": None if load is None else self.deflection(load).tolist(),
            "modules": modules,
            "legs": {leg: part.tolist() for leg, part in self.legs.items()},
        }

    def _task_stiffness(self) -> list | None:
        """Return K_task, or None where it does not exist."""
        try:
            return self.K_task.tolist()
        except (InputError, NoStiffnessError):
            return None

    def to_dataframe(self, wrench=None) -> DataFrame:
        """Return a pandas table with a row for each module: its kind, leg, group and part (extra: tables).

        With a `wrench` (6,) its share and its part dx … rz in the tool's deflection [m, rad]; without one the diagonal
        of its C, dx/fx … rz/mz. Raises MissingExtraError.
        """
        load = None if wrench is None else as_wrench(wrench)
        shares = self._shares(load)
        parts = np.array([self.parts[name] for name in self.names])
        rows = []
        for module, part in zip(self.pose.mechanism.modules, parts, strict=True):
            row: dict[str, Any] = {
                "module": module.name,
                "kind": module.kind.kind,
                "leg": module.leg,
                "group": "bodies" if module.kind.is_body else "joints",
            }
            if load is None:
                names = [f"{moved}/{by}" for moved, by in zip(TWIST_NAMES, WRENCH_NAMES, strict=True)]
                row |= dict(zip(names, np.diagonal(part).tolist(), strict=True))
            else:
                row["share"] = shares.get(module.name)
                row |= dict(zip(TWIST_NAMES, (part @ load).tolist(), strict=True))
            rows.append(row)
        return imported("pandas", "tables").DataFrame(rows).set_index("module")

    def _shares(self, load: Array | None) -> dict[str, float]:
        """Return the shares under a load that deflects something."""
        try:
            return {} if load is None else self.shares(load)
        except InputError:
            return {}

    def _repr_html_(self) -> str:
        from ..views.report.cells import compliance_html

        return compliance_html(self)

    def __repr__(self) -> str:
        at = ", ".join(f"{name}={number(value, 4)}" for name, value in self.pose.coordinates.items())
        return f"<Compliance of {self.pose.mechanism.name} at {at or 'a pose'}: {len(self.names)} modules>"
