"""What a sweep can be asked for, each quantity once: its name, unit, shape, and how it follows from solved statics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product as every
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, NoStiffnessError, NotConvergedError, UnknownNameError
from ..kernel import NEGLIGIBLE_ENERGY, largest
from ..kinematics import ClosedPose
from ..loaded import chain_of, find_loaded_pose
from ..mechanism import Mechanism
from ..spatial import TWIST_NAMES, WRENCH_NAMES, Array, symmetric
from ..statics import Compliance, Statics, StaticsLayout, solve_statics, yielding_stiffness
from .indices import along, homogenised, principal_stiffnesses, softest

#: Corners of a cube (3, 4), one of each opposite pair: norms are convex, they are largest at corners of the box.
_HALF = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])


@dataclass(frozen=True)
class Asked:
    """What is wanted at every pose.

    `quantities` are names; `force` [N] and `moment` [N m] the half sides of the box of wrenches; `wrench` (6,) a load
    of its own; `direction` (3,) in base axes, or in the tool's where `of_tool`; `length` [m] makes rotations arcs.
    """

    quantities: tuple[str, ...]
    force: float | None = None
    moment: float | None = None
    wrench: tuple[float, ...] | None = None
    direction: tuple[float, ...] | None = None
    of_tool: bool = False
    length: float | None = None

    @property
    def box(self) -> Array:
        """Largest size of each component of a wrench, (6,)."""
        assert self.force is not None
        assert self.moment is not None
        return np.array(3 * [self.force] + 3 * [self.moment])


class Solved:
    """The statics of n poses, and what follows from them; each is worked out once, where it is asked for."""

    def __init__(self, poses: ClosedPose, layout: StaticsLayout, scaling: Array, asked: Asked):
        self.poses, self.layout, self.scaling, self.asked = poses, layout, scaling, asked

    @classmethod
    def of_known(cls, known: Mapping[str, Array], layout: StaticsLayout, scaling: Array, asked: Asked) -> Solved:
        """Return poses of which C or K (n, 6, 6), or both, and nothing else is known."""
        solved = cls.__new__(cls)
        solved.layout, solved.scaling, solved.asked = layout, scaling, asked
        solved.__dict__.update(known)
        return solved

    @property
    def length(self) -> float:
        """Length that makes rotations arcs [m]: what was asked for, else the robot's characteristic length."""
        return float(self.scaling[0, 3]) if self.asked.length is None else self.asked.length

    @cached_property
    def statics(self) -> Statics:
        return solve_statics(self.layout, self.poses)

    @cached_property
    def deformations(self) -> tuple[Array, Array, Array]:
        return self.statics.deformations

    @cached_property
    def C(self) -> Array:  # noqa: N802 - the field's symbol
        """(n, 6, 6)."""
        return self.statics.compliance(self.deformations[0])

    @cached_property
    def K(self) -> Array:  # noqa: N802
        """(n, 6, 6), NaN where C has no inverse."""
        scaled = self.C * self.scaling
        k = np.full_like(scaled, np.nan)
        try:
            inverse = np.linalg.inv(scaled)
        except np.linalg.LinAlgError:
            inverse = np.full_like(scaled, np.nan)
            values = np.linalg.eigvalsh(scaled)
            good = values[:, 0] > NEGLIGIBLE_ENERGY * values[:, -1]
            inverse[good] = np.linalg.inv(scaled[good])
        squares = (inverse * inverse).sum(axis=(-1, -2)) * (scaled * scaled).sum(axis=(-1, -2))
        sure = (squares > 0) & (np.sqrt(squares) < 0.1 / NEGLIGIBLE_ENERGY)
        if not sure.all():
            values = np.linalg.eigvalsh(scaled)
            sure |= values[:, 0] > NEGLIGIBLE_ENERGY * values[:, -1]
        k[sure] = (inverse * self.scaling)[sure]
        return symmetric(k)

    @cached_property
    def K_task(self) -> Array:  # noqa: N802
        """(n, t, t), NaN where some task coordinates are rigid."""
        count = len(self.layout.mechanism.tasks)
        return self.singly(_task_stiffness, (count, count))

    def stiff(self, name: str) -> NDArray[np.bool_]:
        """Return where K, or K_task, exists, (n,)."""
        return np.asarray(np.isfinite(getattr(self, name)).all(axis=(-2, -1)))

    @cached_property
    def eigenvalues(self) -> Array:
        """Of K, ascending, (n, 6)."""
        return self._where_stiff(np.linalg.eigvalsh)  # type: ignore[arg-type]

    @cached_property
    def homogenised(self) -> Array:
        """Eigenvalues of K, ascending, rotations as arcs, (n, 6)."""
        return self._where_stiff(lambda k: homogenised(k, self.length))

    def _where_stiff(self, values_of: Callable[[Array], Array]) -> Array:
        """Return six values of each K, (n, 6); NaN where it does not exist."""
        values, stiff = np.full((len(self.K), 6), np.nan), self.stiff("K")
        values[stiff] = values_of(self.K[stiff])
        return values

    @cached_property
    def extremes(self) -> Array:
        """Largest translation and rotation over the corners of the box, (n, 2)."""
        most = []
        columns = self.C * self.asked.box
        for rows in (slice(0, 3), slice(3, 6)):
            by_force, by_moment = (columns[..., rows, part] @ _HALF for part in (slice(0, 3), slice(3, 6)))
            # |a + b|^2 and |a - b|^2 at once
            squares = ((part * part).sum(axis=-2) for part in (by_force, by_moment))
            forces, moments = squares
            both = forces[..., :, None] + moments[..., None, :] + abs(by_force.mT @ (2.0 * by_moment))
            most.append(largest(list(np.moveaxis(both.reshape(*both.shape[:-2], 16), -1, 0))))
        return np.sqrt(np.stack(most, axis=-1))

    @property
    def direction(self) -> Array:
        """What the stiffness is wanted along, base axes, (3,) or (n, 3)."""
        along = np.array(self.asked.direction)
        if not self.asked.of_tool:
            return along
        tool = self.layout.mechanism.need_tool()
        return tool.at(self.poses.placements)[..., :3, :3] @ along

    def singly(self, value: Callable[[Compliance], Array | float], size: tuple[int, ...] = ()) -> Array:
        """Return what follows from the `Compliance` of each pose, one after the other, (n, *size)."""
        out = np.empty((len(self.poses.q), *size))
        for index in range(len(out)):
            pose = self.poses.single(index)
            out[index] = value(Compliance(solve_statics(self.layout, pose), self.scaling, None))
        return out

    @cached_property
    def buckling_margins(self) -> Array:
        """Factor on the wrench at which the robot gives way, (n,)."""
        chain = chain_of(self.layout)

        def margin(compliance: Compliance) -> float:
            try:
                return find_loaded_pose(chain, compliance.pose, self.asked.wrench, self.scaling).buckling_margin()
            except NotConvergedError as error:
                return error.reached

        return self.singly(margin)

    @cached_property
    def shares(self) -> Array:
        """Each module's share of the work, in the order of the robot file, (n, modules)."""
        works = []
        for jacobian, deformation in zip(self.statics.jacobians, self.deformations[1:], strict=True):
            if self.asked.wrench is None:
                # The mean over all corners: cross terms cancel.
                work = ((jacobian * deformation).sum(axis=-2) * self.asked.box**2).sum(axis=-1)
            else:
                w = np.array(self.asked.wrench)
                work = ((jacobian @ w) * (deformation @ w)).sum(axis=-1)
            works.append(work)
        work = np.concatenate(works, axis=-1)
        order = [self.layout.index[module.name] for module in self.layout.mechanism.modules]
        return (work / work.sum(axis=-1, keepdims=True))[..., order]


#: The three principal stiffnesses, as they ascend.
_RANKS = ("softest", "middle", "stiffest")
#: What of a matrix' entry, beside the two on its diagonal, is rounding.
_ROUNDING = 1e-9
_AXES, _POINT, _KINDS = ("1", "2", "3"), ("x", "y", "z"), ("translation", "rotation")
_MODES = ("1", "2", "3", "4", "5", "6")
_DISPLACEMENT = ("m", "m", "m", "rad", "rad", "rad")
#: What an axis of a quantity counts.
Labels = Sequence[str] | Callable[[Mechanism], Sequence[str]]


@dataclass(frozen=True)
class Quantity:
    """`value` (n, *shape) of solved poses, in `unit`; `labels` name the entries along each axis.

    `units`: of a single entry by its place, where they differ and the entries are few.

    `elastic`: needs compliant modules; `box`: needs force and moment of the box of wrenches; `stiff`: the matrix
    that has to exist, K or K_task; `wrench`, `direction`: needs that (of box and wrench, one); `after`: follows from C
    or K alone, by what no straight line of operations does; `by_one`: is worked out pose by pose, which takes some
    hundred times as long.
    """

    name: str
    unit: str
    summary: str
    value: Callable[[Solved], Array]
    labels: tuple[Labels, ...] = ()
    elastic: bool = True
    box: bool = False
    stiff: str = ""
    symmetric: bool = False
    wrench: bool = False
    direction: bool = False
    after: str = ""
    by_one: bool = False
    units: Sequence[str] | Callable[..., str] | None = None

    def unit_of(self, mechanism: Mechanism, place: tuple[int, ...]) -> str:
        """Return the unit of one entry; `unit`, which may name several, where the entries have none of their own."""
        if self.units is None:
            return self.unit
        return self.units(mechanism, *place) if callable(self.units) else self.units[place[0]]

    def entry(self, values: Array, place: tuple[int, ...]) -> Array:
        """Return one entry (...) of many poses' values (..., *shape); of a symmetric matrix, rounding is zero."""
        there: tuple[Any, ...] = (..., *place)
        entry: Array = values[there]
        if not self.symmetric or place[0] == place[1]:
            return entry
        sizes = [np.abs(values[..., index, index]).max(initial=0.0, where=np.isfinite(entry)) for index in place]
        return np.where(np.abs(entry) < _ROUNDING * np.sqrt(np.prod(sizes)), 0.0, entry)

    def axes(self, mechanism: Mechanism) -> list[Sequence[str]]:
        """Return the names of the entries along each axis."""
        return [labels(mechanism) if callable(labels) else labels for labels in self.labels]

    def shape(self, mechanism: Mechanism) -> tuple[int, ...]:
        return tuple(map(len, self.axes(mechanism)))

    def title(self, mechanism: Mechanism, place: tuple[int, ...]) -> str:
        """Return the name of one entry as people read it: 'translational 1, softest'."""
        words = [labels[index] for labels, index in zip(self.axes(mechanism), place, strict=True)]
        rank = f", {_RANKS[place[0]]}" if self.labels == (_AXES,) else ""
        return " ".join((self.name, *words)) + rank

    def columns(self, mechanism: Mechanism) -> list[tuple[str, tuple[int, ...]]]:
        """Return the names of a table's columns and where each stands in an entry; of a symmetric one half."""
        return [(".".join((self.name, *labels)), place) for labels, place in self.entries(mechanism)]

    def entries(self, mechanism: Mechanism) -> list[tuple[tuple[str, ...], tuple[int, ...]]]:
        """Return the labels of each entry and where it stands; of a symmetric matrix one half."""
        named = [[*enumerate(labels)] for labels in self.axes(mechanism)]
        out = []
        for entry in every(*named):
            place = tuple(index for index, _ in entry)
            if not self.symmetric or place[0] <= place[1]:
                out.append((tuple(label for _, label in entry), place))
        return out


def _modules(mechanism: Mechanism) -> Sequence[str]:
    return [module.name for module in mechanism.modules]


def _joints(mechanism: Mechanism) -> Sequence[str]:
    return [joint.name for joint in mechanism.joints if joint.nv == 1]


def _tasks(mechanism: Mechanism) -> Sequence[str]:
    return [task.name for task in mechanism.tasks]


def _unit(mechanism: Mechanism, joint: str) -> str:
    return mechanism.joint(joint).unit or ""


def _task_stiffness_unit(mechanism: Mechanism, *places: int) -> str:
    angles = sum(mechanism.tasks[place].component not in "xyz" for place in places)
    return ("N/m", "N/rad", "N m/rad")[angles]


def _frequencies(compliance: Compliance) -> Array:
    found = [mode.frequency for mode in compliance.modes()]
    return np.array(found + [np.inf] * (6 - len(found)))


def _task_stiffness(compliance: Compliance) -> Array | float:
    try:
        return compliance.K_task
    except NoStiffnessError:
        return np.nan


def _joint_values(solved: Solved) -> Array:
    mechanism, q = solved.layout.mechanism, solved.poses.q
    return np.stack([joint.position(q) for joint in mechanism.joints if joint.nv == 1], axis=-1)


def _actuator_values(solved: Solved) -> Array:
    mechanism, q = solved.layout.mechanism, solved.poses.q
    return np.stack([mechanism.joint(name).position(q) for name in mechanism.actuated], axis=-1)


def _position(solved: Solved) -> Array:
    tool = solved.layout.mechanism.need_tool()
    return tool.at(solved.poses.placements)[..., :3, 3]


QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity(
            "C", "m/N, 1/N, rad/(N m)", "compliance", lambda s: s.C, (TWIST_NAMES, WRENCH_NAMES), symmetric=True
        ),
        Quantity(
            "K", "N/m, N, N m/rad", "stiffness", lambda s: s.K, (WRENCH_NAMES, TWIST_NAMES), stiff="K", symmetric=True
        ),
        Quantity(
            "eigenvalues", "mixed: SI", "eigenvalues of K, ascending, as the paper has them", lambda s: s.eigenvalues,
            (_MODES,), stiff="K", after="K",
        ),
        Quantity(
            "ksi", "mixed: SI", "kinematic stiffness index of the paper: least by largest eigenvalue of K",
            lambda s: s.eigenvalues[:, 0] / s.eigenvalues[:, -1], stiff="K", after="K",
        ),
        Quantity(
            "extremes", "m, rad", "largest norm of translation and of rotation over the box of wrenches",
            lambda s: s.extremes, (_KINDS,), box=True, units=("m", "rad"),
        ),
        Quantity(
            "extreme_components", "m, rad", "largest size of each component over the box of wrenches",
            lambda s: np.abs(s.C) @ s.asked.box, (TWIST_NAMES,), box=True, units=_DISPLACEMENT,
        ),
        Quantity(
            "shares", "1", "each module's share of the work: under `wrench`, else the mean over the box's corners",
            lambda s: s.shares, (_modules,), box=True, wrench=True,
        ),
        Quantity(
            "translational", "N/m", "stiffness against a force alone in the principal directions, softest first",
            lambda s: principal_stiffnesses(s.C[..., :3, :3]), (_AXES,), after="C",
        ),
        Quantity(
            "rotational", "N m/rad", "stiffness against a moment alone in the principal directions, softest first",
            lambda s: principal_stiffnesses(s.C[..., 3:, 3:]), (_AXES,), after="C",
        ),
        Quantity(
            "softest", "1", "direction in which a force moves the tool most, base axes",
            lambda s: softest(s.C[..., :3, :3]), (_POINT,), after="C",
        ),
        Quantity(
            "homogenised", "N/m", "eigenvalues of K, ascending, rotations as arcs of radius `length`",
            lambda s: s.homogenised, (_MODES,), stiff="K", after="K",
        ),
        Quantity(
            "homogenised_ksi", "1", "least by largest of the homogenised eigenvalues",
            lambda s: s.homogenised[:, 0] / s.homogenised[:, -1], stiff="K", after="K",
        ),
        Quantity(
            "directional", "N/m", "stiffness along `direction`, other forces and moments free",
            lambda s: along(s.C, s.direction), direction=True,
        ),
        Quantity(
            "K_task", "N, N m per m, rad", "stiffness in the task coordinates: a planar robot's 2 x 2 or 3 x 3",
            lambda s: s.K_task, (_tasks, _tasks), stiff="K_task", symmetric=True, by_one=True,
            units=_task_stiffness_unit,
        ),
        Quantity(
            "K_yielding", "N/m, N, N m/rad", "stiffness in the directions that yield, zero in those that are rigid",
            lambda s: yielding_stiffness(s.C, s.scaling), (WRENCH_NAMES, TWIST_NAMES), symmetric=True, after="C",
        ),
        Quantity(
            "deflection", "m, rad", "deflection of the tool under one load, `wrench`",
            lambda s: s.C @ np.array(s.asked.wrench), (TWIST_NAMES,), wrench=True, units=_DISPLACEMENT,
        ),
        Quantity(
            "sag", "m, rad", "deflection under the robot's own weight", lambda s: s.singly(lambda c: c.sag(), (6,)),
            (TWIST_NAMES,), by_one=True, units=_DISPLACEMENT,
        ),
        Quantity(
            "frequencies", "Hz", "natural frequencies, ascending; infinite where nothing swings",
            lambda s: s.singly(_frequencies, (6,)), (_MODES,), by_one=True,
        ),
        Quantity(
            "buckling_margin", "1", "factor on `wrench` at which the robot gives way; infinite where it does not",
            lambda s: s.buckling_margins, wrench=True, by_one=True,
        ),
        Quantity(
            "q", "m, rad", "configuration of Pinocchio's model", lambda s: s.poses.q,
            (lambda mechanism: [*map(str, range(mechanism.model.nq))],), elastic=False,
        ),
        Quantity(
            "joints", "m, rad", "position of every joint with one freedom", _joint_values, (_joints,), elastic=False,
            units=lambda mechanism, place: _unit(mechanism, _joints(mechanism)[place]),
        ),
        Quantity(
            "actuators", "m, rad", "positions of the actuated joints", _actuator_values,
            (lambda mechanism: mechanism.actuated,), elastic=False,
            units=lambda mechanism, place: _unit(mechanism, mechanism.actuated[place]),
        ),
        Quantity("position", "m", "the tool's position", _position, (_POINT,), elastic=False),
    )
}  # fmt: skip


def chosen(names: Sequence[str], force: float | None, moment: float | None, wrench: Any, direction: Any) -> None:
    """Raise InputError where quantities are unknown, or lack the loads that they need."""
    if isinstance(names, str):
        raise InputError(f'quantities="{names}": expected a list, for example quantities=["{names}"]')
    if not names:
        raise InputError(f"quantities is empty; ask for some of {', '.join(QUANTITIES)}")
    for name in names:
        if name not in QUANTITIES:
            raise UnknownNameError("quantity", str(name), list(QUANTITIES))
        quantity = QUANTITIES[name]
        either = quantity.box and quantity.wrench  # as shares are
        if quantity.box and (force is None or moment is None) and not (either and wrench is not None):
            raise InputError(
                f'"{name}" needs the box of wrenches: force= [N] and moment= [N m], for example force=300, moment=100'
            )
        if quantity.wrench and not either and wrench is None:
            raise InputError(f'"{name}" needs a load: wrench=[fx, fy, fz, mx, my, mz] [N, N m]')
        if quantity.direction and direction is None:
            raise InputError(f'"{name}" needs direction=[x, y, z], base axes, or direction="tool z"')


def unused(names: Sequence[str], **given: Any) -> Iterator[str]:
    """Yield sentences on what was given, `wrench` or `direction`, and none of the quantities makes use of."""
    for what, value in given.items():
        users = [name for name, quantity in QUANTITIES.items() if getattr(quantity, what)]
        if value is not None and not set(users) & set(names):
            yield f"{what} is not used by {', '.join(names)}: ask for {', '.join(users)} as well"
