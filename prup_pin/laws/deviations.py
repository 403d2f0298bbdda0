"""What is a little off in every real robot: each parameter that the robot file gives a value to, and what it does.

A deviation is no law: nobody left it out, it is there within a tolerance. All of them together act as one law,
`Calibration`, whose parameters are the values that a calibration found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from ..mechanism import Changes, Mechanism, MovedParts
from ..mechanism.tolerances import kind_of_value, of_one_material, value_tolerances, values_following
from ..numbers import quantity as quantity_in_words
from ..parameters import Quantity
from ..spatial import WRENCH_NAMES, Array, rotation_exp
from .deeds import (
    ChangedLength,
    ChangedValue,
    Deed,
    Moved,
    MovedJoint,
    MovedLoopEnd,
    PoseReport,
    ScaledMass,
    Travel,
    WrenchReading,
)
from .encoder import late
from .joint_places import SeatPosition, across, parts
from .law import Law, Place, Sharing
from .setup import Setup

_AXES = "xyz"
#: A direction shorter than this is none.
_SMALL = 1e-9
#: Kinds of tolerance of which a robot at rest shows nothing.
_DELAYS = ("encoder_delay", "pose_delay")
#: Kinds of tolerance that no measured pose has anything to say of, each with the reason.
_NOT_FELT = {
    "inertia": "a robot at rest does not feel its inertia",
    "effort_gain": "efforts are not compared",
    "effort_bias": "efforts are not compared",
}


@dataclass(frozen=True)
class Deviation:
    """A parameter that may be a little off.

    `kind` is the key under which a tolerance of all its like is declared. `act(value, setup)` returns what another
    value does. `relative`: its tolerance is a share of the nominal value, and it stays positive. Beyond its tolerance
    it is a finding, of `physics` at `place`. `group`: the recordings to which it belongs, where these are not all.
    `adds_up`: what is off a little more does so on top of what acts, in whatever order; not so of turns after turns.
    `together`: what one law moves that moves this and others.
    """

    name: str
    kind: str
    unit: str
    nominal: float
    relative: bool
    physics: str
    place: str
    act: Callable[[float, Setup], Iterable[Deed]]
    group: Sharing | None = None
    adds_up: bool = True
    together: str = ""

    def value(self, amount: float) -> float:
        """Return the value that is off by `amount`: absolute [unit], or of the logarithm where it is relative."""
        return float(self.nominal * np.exp(amount)) if self.relative else self.nominal + amount

    def amount(self, value: float) -> float:
        """Return by how much a value is off, likewise."""
        return float(np.log(value / self.nominal)) if self.relative else value - self.nominal

    def per_amount(self, value: float) -> float:
        """Return d(value)/d(amount)."""
        return value if self.relative else 1.0


class Calibration(Law):
    """Every parameter of the robot file, its sensors and frames at the value that a calibration found."""

    physics = "calibration"
    summary = "parameters at their calibrated values"
    quantities = ()
    neutral: ClassVar = {}
    partial = True

    def __init__(self, deviations: Sequence[Deviation]):
        self.deviations = tuple(deviations)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot")]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(item.name, item.unit, item.kind, item.nominal, item.relative, 0.0 if item.relative else -np.inf)
            for item in self.deviations
        )

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for item in self.deviations:
            value = values.get(item.name, item.nominal)
            if value != item.nominal:
                yield from item.act(value, setup)

    def written(self, place: Place, values: Mapping[str, float], setup: Setup, changes: Changes) -> Sequence[str]:
        left = []
        for item in self.deviations:
            value = values.get(item.name, item.nominal)
            if value != item.nominal and None in [deed.redraw(changes) for deed in item.act(value, setup)]:
                left.append(f"{item.name} = {quantity_in_words(value, item.unit)}")
        return left

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{len(values)} parameters stand at their calibrated values"


def deviations_of(
    mechanism: Mechanism,
    markers: Sequence[str] = (),
    groups: Mapping[str, Sequence[Sharing]] | None = None,
    moves: bool = True,
) -> tuple[Deviation, ...]:
    """Return all parameters of a robot, of its sensors, and of the frames of its tool and of `markers`.

    What acts on a pose's report comes last, the targets before the frame in which they are reported. groups: recordings
    that share what is of a kind, where not all do, by the kind; each group has its own parameters. moves: the actuators
    do, and delays show.
    """
    groups = groups or {}
    of_all = [item for item in _of_all(mechanism, markers) if moves or item.kind not in _DELAYS]
    return tuple(each for item in of_all for each in _of_groups(item, groups.get(item.kind)))


def _of_groups(item: Deviation, groups: Sequence[Sharing] | None) -> Iterator[Deviation]:
    """Yield a deviation as often as groups of recordings have it, or once where all do."""
    if groups is None:
        yield item
    for group in groups or ():
        name = f"{item.name} in {group.label}" if group.label else item.name
        yield replace(item, name=name, act=partial(_within, item.act, group.sources), group=group)


def _within(act: Callable, sources: Sequence[int], value: float, setup: Setup) -> Iterator[Deed]:
    for deed in act(value, setup):
        yield deed.within(setup.inputs.from_sources(sources))


def _of_all(mechanism: Mechanism, markers: Sequence[str]) -> tuple[Deviation, ...]:
    return (
        *_values(mechanism),
        *_lengths(mechanism),
        *_masses(mechanism),
        *_joint_places(mechanism),
        *_loop_ends(mechanism),
        *_seats(mechanism),
        *_encoders(mechanism),
        *_wrench_sensor(),
        *_targets(mechanism, markers),
        *_frame(),
    )


def calibration_of(mechanism: Mechanism) -> Calibration:
    """Return the law of all parameters of a robot, markers at any of its frames included."""
    tool = mechanism.tool
    markers = [name for name in mechanism.frame_names if tool is None or name != tool.name]
    return Calibration(deviations_of(mechanism, markers))


def amounts_of(deviations: Sequence[Deviation], mechanism: Mechanism, kinds: Mapping[str, float]) -> dict[str, float]:
    """Return one standard deviation of the amount by which each parameter is off, of those that have a tolerance.

    kinds: what is declared for all of a kind (`Tolerances.declared`); the robot file's own tolerances win.
    """
    values = value_tolerances(mechanism, kinds)
    found = {}
    for item in deviations:
        own = values.get(item.name)
        if own is not None:
            found[item.name] = own / item.nominal if item.relative else own
            continue
        declared = kinds if item.group is None else item.group.tolerances
        if item.kind in declared and item.kind not in ("stiffness", "bending"):
            found[item.name] = declared[item.kind]
    return found


def without_effect(kinds: Mapping[str, float]) -> list[str]:
    """Return sentences on declared kinds of tolerance that change nothing, by their reasons."""
    reasons: dict[str, list[str]] = {}
    for kind in kinds:
        if kind in _NOT_FELT:
            reasons.setdefault(_NOT_FELT[kind], []).append(kind)
    return [
        f"the tolerance{'s' if len(names) > 1 else ''} {' and '.join(names)} change{'' if len(names) > 1 else 's'} "
        f"nothing here: {reason}"
        for reason, names in reasons.items()
    ]


# -- modules and bodies ------------------------------------------------------------------------------------------------


def _values(mechanism: Mechanism) -> Iterator[Deviation]:
    for module in mechanism.modules:
        for quantity in module.kind.quantities:
            name = f"{module.name}.{quantity.name}"
            kind, value = kind_of_value(module.kind, quantity), module.values[quantity.name]
            scaled = of_one_material(mechanism, module.name, quantity.name)
            act: Callable = partial(_other_value, module.name, scaled, value)
            if kind is None and mechanism.parameters[name].tolerance is not None:
                kind, act = "value", partial(_with_what_follows, name)
            if kind is not None and np.ndim(value) == 0 and np.isfinite(value) and value > 0:
                yield Deviation(
                    name,
                    kind,
                    mechanism.parameters[name].unit,
                    float(value),
                    True,
                    "stiffness_changed",
                    module.name,
                    act,
                    adds_up=kind != "value",
                )


def _other_value(module: str, quantities: Sequence[str], nominal: float, value: float, setup: Setup) -> Iterator[Deed]:
    for quantity in quantities:
        yield ChangedValue(module, quantity, setup.module_value(module, quantity) * (value / nominal))


def _with_what_follows(name: str, value: float, setup: Setup) -> Iterator[Deed]:
    """Yield the changes of a value and of all that follows from it, each in proportion to what it was."""
    module = setup.mechanism.module(name.rpartition(".")[0])
    for quantity, other in values_following(setup.mechanism, name, value).items():
        share = other / float(module.values[quantity])
        yield ChangedValue(module.name, quantity, setup.module_value(module.name, quantity) * share)


def _lengths(mechanism: Mechanism) -> Iterator[Deviation]:
    for length in mechanism.description.lengths:
        name, nominal = length.parameter.name, float(length.parameter.value)
        act = partial(_other_length, name, nominal)
        yield Deviation(name, "length", "m", nominal, False, "geometric_offset", name.rpartition(".")[0], act)


def _other_length(name: str, nominal: float, value: float, setup: Setup) -> Iterator[Deed]:
    parts = setup.mechanism.moved_by_length[name]
    if not parts.only_joints:  # a fixed joint places frames, too: the robot is drawn anew
        yield ChangedLength(name, value - nominal)
        return
    for joint, rate in parts.joints.items():
        shift = (value - nominal) * rate
        yield MovedJoint(setup.mechanism.joint(joint).name, (*shift.tolist(), 0.0, 0.0, 0.0))


def _masses(mechanism: Mechanism) -> Iterator[Deviation]:
    for link in mechanism.links:
        act = partial(_other_mass, link.name, link.mass)
        yield Deviation(f"{link.name}.mass", "mass", "kg", link.mass, True, "inertial_parameters", link.name, act)


def _other_mass(link: str, nominal: float, value: float, setup: Setup) -> Iterator[Deed]:
    yield ScaledMass(link, value / nominal)


# -- geometry ----------------------------------------------------------------------------------------------------------


def _joint_places(mechanism: Mechanism) -> Iterator[Deviation]:
    for part, joint in parts(mechanism).items():
        left = _not_told_by_lengths(mechanism, joint.id)
        for column, axis in enumerate(_AXES):
            if np.any(left[column]):
                act = partial(_moved, joint.name, np.concatenate((left[column], np.zeros(3))))
                yield _geometric(f"{joint.name}.{axis}", "position", "m", part, act)
        if joint.nv == 1:
            for name, turn in across(joint.axis).items():
                act = partial(_moved, joint.name, np.concatenate((np.zeros(3), turn)))
                yield _geometric(f"{joint.name}.{name}", "direction", "rad", part, act)


def _not_told_by_lengths(mechanism: Mechanism, joint: int) -> Array:
    """Return the displacements (3, 3), by rows, that a joint's position along x, y and z stands for.

    The axes, less the directions in which lengths place the joint that have a tolerance of their own: that one says
    how far the joint is off there. What is left scatters alike in all other directions.
    """
    told = [moved.joints[joint] for moved in _toleranced(mechanism) if joint in moved.joints]
    return _beside(told)


def _toleranced(mechanism: Mechanism) -> list[MovedParts]:
    """Return what lengths move that have a tolerance of their own."""
    names = [length.parameter.name for length in mechanism.description.lengths]
    return [mechanism.moved_by_length[name] for name in names if mechanism.parameters[name].tolerance is not None]


def _beside(told: Sequence[Array]) -> Array:
    """Return the axes (3, 3), by rows, less the directions that are told."""
    basis, sizes, _ = np.linalg.svd(np.array(told).reshape(-1, 3).T, full_matrices=True)
    span = basis[:, : int((sizes > _SMALL).sum())]
    left = np.eye(3) - span @ span.T
    return np.where(np.linalg.norm(left, axis=1, keepdims=True) > _SMALL, left, 0.0)


def _loop_ends(mechanism: Mechanism) -> Iterator[Deviation]:
    toleranced = _toleranced(mechanism)
    for index, loop in enumerate(mechanism.loops):
        for end, frame in enumerate((loop.first, loop.second)):
            left = _beside([moved.loop_ends[index, end] for moved in toleranced if (index, end) in moved.loop_ends])
            for column, axis in enumerate(_AXES):
                if not np.any(left[column]):
                    continue
                act = partial(_moved_end, loop.name, end, np.concatenate((left[column], np.zeros(3))))
                yield _geometric(f"{loop.name}.{frame.name}.{axis}", "position", "m", frame.name, act)


def _moved_end(loop: str, end: int, unit: Array, value: float, setup: Setup) -> Iterator[Deed]:
    yield MovedLoopEnd(loop, end, tuple((value * unit).tolist()))


def _seats(mechanism: Mechanism) -> Iterator[Deviation]:
    """Where a platform sits on the joint that carries it, as its loops' ends say it of the others."""
    law = SeatPosition()
    for place in law.places(mechanism):
        for quantity in law.quantities_at(place, mechanism):
            act = partial(_seated, place, quantity.name)
            yield _geometric(f"{place.name}.seat_{quantity.name}", "position", "m", place.name, act)


def _seated(place: Place, axis: str, value: float, setup: Setup) -> Iterator[Deed]:
    yield from SeatPosition().deeds(place, {axis: value}, setup)


def _geometric(name: str, kind: str, unit: str, place: str, act) -> Deviation:
    return Deviation(name, kind, unit, 0.0, False, "geometric_offset", place, act)


def _column(index: int) -> Array:
    return np.eye(6)[index]


def _moved(joint: str, unit: Array, value: float, setup: Setup) -> Iterator[Deed]:
    yield MovedJoint(joint, tuple((value * unit).tolist()))


def _encoders(mechanism: Mechanism) -> Iterator[Deviation]:
    for column, name in enumerate(mechanism.actuated):
        unit = mechanism.joint(name).unit or "rad"
        offset, slope = partial(_encoder_offset, column), partial(_encoder_slope, column)
        for kind, of, physics, act in (
            ("encoder_offset", unit, "encoder_offset", offset),
            ("encoder_slope", "1", "lead_error", slope),
        ):
            yield Deviation(f"{name}.{kind}", kind, of, 0.0, False, physics, name, act, together=f"travel of {name}")
        delay = partial(late, column)
        yield Deviation(f"{name}.encoder_delay", "encoder_delay", "s", 0.0, False, "encoder_delay", name, delay)
    if mechanism.actuated:
        yield Deviation("encoders.delay", "pose_delay", "s", 0.0, False, "encoder_delay", "robot", _all_late)


def _encoder_offset(column: int, value: float, setup: Setup) -> Iterator[Deed]:
    yield Travel(column, value)


def _all_late(value: float, setup: Setup) -> Iterator[Deed]:
    for column in range(len(setup.mechanism.actuated)):
        yield from late(column, value, setup)


def _encoder_slope(column: int, value: float, setup: Setup) -> Iterator[Deed]:
    yield Travel(column, value * setup.inputs.actuators[:, column])


# -- sensors -----------------------------------------------------------------------------------------------------------


def _wrench_sensor() -> Iterator[Deviation]:
    place = "wrench_sensor"
    for column, name in enumerate(WRENCH_NAMES):
        unit, force = ("N", "force") if column < 3 else ("N m", "moment")
        bias, gain = partial(_bias, column), partial(_gain, column)
        kind = f"wrench_bias_{force}"
        yield Deviation(
            f"{place}.bias_{name}", kind, unit, 0.0, False, "wrench_sensor_bias", place, bias, adds_up=False
        )
        yield Deviation(
            f"{place}.gain_{name}", "wrench_gain", "1", 1.0, True, "wrench_sensor_gain", place, gain, adds_up=False
        )
    for column, axis in enumerate(_AXES):
        turn = partial(_turned_wrench, np.eye(3)[column])
        physics = "wrench_sensor_misalignment"
        yield Deviation(f"{place}.r{axis}", "wrench_rotation", "rad", 0.0, False, physics, place, turn, adds_up=False)


def _bias(column: int, value: float, setup: Setup) -> Iterator[Deed]:
    yield WrenchReading(partial(np.add, -value * np.eye(6)[column]))


def _gain(column: int, value: float, setup: Setup) -> Iterator[Deed]:
    yield WrenchReading(partial(np.multiply, 1 + (value - 1) * np.eye(6)[column]))


def _turned_wrench(unit: Array, value: float, setup: Setup) -> Iterator[Deed]:
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation_exp(value * unit)
    yield WrenchReading(partial(_mapped, turn=turn))


def _mapped(reported: Array, turn: Array) -> Array:
    return reported @ turn.T


def _targets(mechanism: Mechanism, markers: Sequence[str]) -> Iterator[Deviation]:
    tool = mechanism.tool
    named = [("target", tool.name)] if tool is not None else []
    for place, frame in [*named, *((f"marker {name}", name) for name in markers)]:
        for column in range(6):
            unit, axis = ("m", _AXES[column]) if column < 3 else ("rad", f"r{_AXES[column - 3]}")
            kind = "target_position" if column < 3 else "target_rotation"
            act = partial(_target, frame, _column(column))
            yield Deviation(f"{place}.{axis}", kind, unit, 0.0, False, "target_misalignment", place, act, adds_up=False)


def _target(frame: str, unit: Array, value: float, setup: Setup) -> Iterator[Deed]:
    yield PoseReport(Moved.on_body(value * unit[:3], rotation_exp(value * unit[3:])), frame)


def _frame() -> Iterator[Deviation]:
    for column in range(6):
        unit, axis = ("m", _AXES[column]) if column < 3 else ("rad", f"r{_AXES[column - 3]}")
        kind = "frame_position" if column < 3 else "frame_rotation"
        act = partial(_sensor_frame, _column(column))
        physics, place = "pose_sensor_misalignment", "pose_sensor"
        yield Deviation(f"{place}.{axis}", kind, unit, 0.0, False, physics, place, act, adds_up=False)


def _sensor_frame(unit: Array, value: float, setup: Setup) -> Iterator[Deed]:
    yield PoseReport(Moved.from_frame(rotation_exp(value * unit[3:]), value * unit[:3]))
