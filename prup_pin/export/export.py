"""A corrected model becomes a URDF or an MJCF file.

Every effect is in the file, in part, or left out: laws say which (`laws/law.py: Law.written`), and the file's format
says what it has words for. What is left out is listed with the share of the residual that it explained.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
from lxml import etree

from .. import __version__, robots
from ..dynamics.inertial import SOME_BODY, of_pseudo_inertia, pseudo_inertia, some_body
from ..errors import InputError, RobotFileError, SingularPoseError, UnreachablePoseError
from ..files import write_whole
from ..laws import Effect, Inputs, Setup
from ..laws.efforts import EffortLaw
from ..mechanism import Changes, JointDynamics, Mechanism
from ..mechanism.description import RobotDescription
from ..mechanism.mjcf_writer import MJCF_ENDINGS, mjcf_of
from ..mechanism.readers import read_content
from ..mechanism.redrawn import dynamics_of, redrawn
from ..mechanism.writer import plain_urdf, urdf_of
from ..mechanism.xml_file import parse_again
from ..numbers import number, quantity
from ..parameters import SMALLEST_VALUE, Quantity
from ..robot import Robot
from ..simulation import CorrectedModel, Known
from ..spatial import Array


@dataclass(frozen=True)
class Said:
    """An effect that is in the file, wholly or in part: where it acts, and its values with their 95 % intervals."""

    physics: str
    place: str
    values: tuple[str, ...]
    share: float | None = None


@dataclass(frozen=True)
class LeftOut:
    """What of an effect the file cannot say, in words.

    `share` of the held-out squared residual that it explained; None where that is not known, or a part is in the file.
    """

    physics: str
    place: str
    what: str
    share: float | None = None


@dataclass(frozen=True, eq=False)
class Exported:
    """A robot file made of a corrected model.

    mechanism: as this package reads the file. dynamics: of its joints, as far as the format has words for them.
    remarks: what other readers of the file should know.
    """

    content: bytes
    mechanism: Mechanism
    dynamics: Mapping[str, JointDynamics]
    said: tuple[Said, ...]
    left_out: tuple[LeftOut, ...]
    remarks: tuple[str, ...]


def export_model(model: CorrectedModel, path: str | Path) -> Exported:
    """Write a corrected model as a robot file, a URDF or (.xml) an MJCF file, and return it with what it leaves out.

    The file is there as a whole or as it was before. Raises InputError for an ending that is no format, where no
    robot file can hold the robot, and where the file cannot be written or is the robot's
    own.
    """
    path = Path(path).expanduser()
    made = exported(model, path)
    write_whole({path: (made.content.decode("utf-8"),)})
    return made


def exported(model: CorrectedModel, path: Path) -> Exported:
    """Return what `export_model` writes. Raises likewise."""
    target = _target(path)
    own = robots.as_path(model.robot)
    if robots.is_file(own) and path.exists() and path.samefile(own):
        raise InputError(f"'{path}' is the robot file from which the model was made; give another file")
    robot = model.load()
    mechanism = robot.mechanism
    if mechanism.locked:
        raise InputError(f"locked joints ({', '.join(sorted(mechanism.locked))}) have no place in a robot file")
    changes, said, left = _gathered(model, mechanism, target)
    if mechanism.description.source != "URDF":  # without what its own format says besides
        changes.mechanism = Mechanism(read_content(plain_urdf(mechanism), path))
    possible = tuple(make_possible(changes))
    described = redrawn(changes, _home(changes, path))
    remarks = (*target.remarks(mechanism, changes), *_seen(changes), *_kept(described, changes), *possible)
    comment = _comment(model, said, left, remarks)
    try:
        content = urdf_of(described)
        found = Mechanism(read_content(content, path, described.package_folders))
        _check_loops(found)
        dynamics = {**dynamics_of(found.description), **changes.dynamics}
        content = target.content(content, found, dynamics, comment)
        mechanism = Mechanism(read_content(content, path, described.package_folders))
    except RobotFileError as error:
        raise InputError(f"'{robot.name}' cannot be written as '{path}': {error}") from error
    return Exported(content, mechanism, target.spoken(dynamics), said, left, remarks)


def _home(changes: Changes, path: Path) -> Array | None:
    """Return where the joints of the changed robot stand at home, with its loops closed; None without loops."""
    if not (changes.geometric and changes.mechanism.loops):
        return None
    first = redrawn(changes)
    try:
        return Robot(Mechanism(read_content(urdf_of(first), path, first.package_folders))).home.q
    except (RobotFileError, UnreachablePoseError):
        return None  # told when the file is checked


def _check_loops(mechanism: Mechanism) -> None:
    """Raise InputError where loops close only as parts give way: a robot file has them rigid."""
    try:
        _ = Robot(mechanism).home if mechanism.loops else None
    except SingularPoseError:
        pass  # it closes there; other poses may be regular
    except UnreachablePoseError as error:
        raise InputError(
            f"the loops of the corrected '{mechanism.name}' close only as its parts give way, and a robot file has "
            "them rigid: its joints stand aslant in a mechanism that is tighter than it needs to be. Take directions "
            f"and positions of joints out of the model, or leave the motions across free in the robot file. {error}"
        ) from error


# -- formats -----------------------------------------------------------------------------------------------------------


class _Urdf:
    """<dynamics> have damping and friction."""

    @staticmethod
    def content(
        urdf: bytes, mechanism: Mechanism, dynamics: Mapping[str, JointDynamics], comment: Sequence[str]
    ) -> bytes:
        root = parse_again(urdf)
        note = etree.Comment("\n" + "".join(f"  {line}".rstrip() + "\n" for line in comment))
        note.tail = "\n"
        root.addprevious(note)
        return etree.tostring(root.getroottree(), encoding="utf-8", xml_declaration=True) + b"\n"

    @staticmethod
    def spoken(dynamics: Mapping[str, JointDynamics]) -> dict[str, JointDynamics]:
        return {name: JointDynamics(item.damping, item.friction) for name, item in dynamics.items()}

    @staticmethod
    def unsaid(joint: str, item: JointDynamics, mechanism: Mechanism) -> Iterator[str]:
        if item.armature:
            yield f"rotor inertia {_with_unit('armature', item.armature, joint, mechanism)}: a URDF has no word for it"
        if item.stiffness or item.preload:
            yield f"a spring {_spring(item, joint, mechanism)}: a URDF has no word for it"

    @staticmethod
    def remarks(mechanism: Mechanism, changes: Changes) -> Iterator[str]:
        if mechanism.loops:
            yield "loops stand in <prup_pin>; other readers of URDF ignore it: their tree is open"
        if mechanism.modules or changes.compliances:
            yield "compliant modules stand in <prup_pin>; other readers take all parts as rigid"
        if changes.gravity.any():
            yield (
                f"gravity ({', '.join(number(value, 6) for value in changes.fall)}) m/s^2 stands in <prup_pin>: set it "
                "in the other simulator too, a URDF has no word for it"
            )


class _Mjcf:
    """MuJoCo's joints have damping, frictionloss, armature, and a spring."""

    @staticmethod
    def content(
        urdf: bytes, mechanism: Mechanism, dynamics: Mapping[str, JointDynamics], comment: Sequence[str]
    ) -> bytes:
        try:
            home = Robot(mechanism).home.q
        except SingularPoseError:
            home = mechanism.home_configuration()
        return mjcf_of(mechanism, _Mjcf.spoken(dynamics), home, comment)

    @staticmethod
    def spoken(dynamics: Mapping[str, JointDynamics]) -> dict[str, JointDynamics]:
        return {
            name: item if item.stiffness > 0 else JointDynamics(item.damping, item.friction, item.armature)
            for name, item in dynamics.items()
        }

    @staticmethod
    def unsaid(joint: str, item: JointDynamics, mechanism: Mechanism) -> Iterator[str]:
        if item.stiffness <= 0 and (item.stiffness or item.preload):
            yield f"a spring {_spring(item, joint, mechanism)}: MuJoCo's are stiffer than nothing"

    @staticmethod
    def remarks(mechanism: Mechanism, changes: Changes) -> Iterator[str]:
        if mechanism.modules or changes.compliances:
            yield (
                "compliant modules stand in <custom>, where this package finds them; MuJoCo takes all parts as rigid"
            )
        partly = [loop.name for loop in mechanism.loops if loop.free and loop.free != {"rx", "ry", "rz"}]
        if partly:
            yield (
                f"MuJoCo closes loops by points and welds: {', '.join(partly)} leave{'' if len(partly) > 1 else 's'} "
                "other motions free, which a light body between the ends has"
            )
        yield "shapes and meshes stay with the URDF: the file holds what moves, weighs and resists"


_FORMATS: dict[str, type[_Urdf] | type[_Mjcf]] = {".urdf": _Urdf, **dict.fromkeys(MJCF_ENDINGS, _Mjcf)}


def _target(path: Path) -> type[_Urdf] | type[_Mjcf]:
    found = _FORMATS.get(path.suffix.lower())
    if found is None:
        given = f"'{path.suffix}' is no ending of a robot file" if path.suffix else f"'{path}' has no ending"
        raise InputError(f"{given}; expected .urdf, or .xml for MuJoCo's MJCF")
    return found


def _with_unit(quantity_: str, value: float, joint: str, mechanism: Mechanism) -> str:
    slides = mechanism.joint(joint).slides
    unit = {"armature": ("kg m^2", "kg"), "stiffness": ("N m/rad", "N/m"), "preload": ("N m", "N")}[quantity_][slides]
    return quantity(value, unit)


def _spring(item: JointDynamics, joint: str, mechanism: Mechanism) -> str:
    stiffness, force = (_with_unit(key, getattr(item, key), joint, mechanism) for key in ("stiffness", "preload"))
    return f"of {stiffness} with {force} at zero"


def _seen(changes: Changes) -> Iterator[str]:
    """Yield what frames were added for what a pose sensor sees."""
    frames = [name for name in changes.views if name is not None]
    if frames:
        names = ", ".join(f"{name}_measured" for name in frames)
        yield f"{names}: what the corrected model says of {', '.join(frames)}, where the measured target sits"
    if any(not np.array_equal(outside, np.eye(4)) for outside, _ in changes.views.values()):
        yield "pose_sensor: the frame, fixed to the base, in which the pose sensor reports"


def _kept(described: RobotDescription, changes: Changes) -> Iterator[str]:
    """Yield what the robot file says of joints that no effect speaks of."""
    kept = [name for name in dynamics_of(described) if name not in changes.dynamics]
    if kept:
        yield f"<dynamics> of {', '.join(kept)} are the robot file's own: no effect of the model speaks of them"


# -- effects -----------------------------------------------------------------------------------------------------------


def _gathered(
    model: CorrectedModel, mechanism: Mechanism, target: type[_Urdf] | type[_Mjcf]
) -> tuple[Changes, tuple[Said, ...], tuple[LeftOut, ...]]:
    """Return what changes in the file, which effects are in it, and what is left out."""
    setup = Setup.nominal(mechanism, Inputs.empty(len(mechanism.actuated)))
    every: list[tuple[Effect, Changes, list[str]]] = []
    for effect in model.effects:
        own = Changes(mechanism)
        checked = effect.checked(mechanism)
        left = list(checked.law.written(checked.place, checked.values, setup, own))
        for joint, item in own.dynamics.items():
            # zero for what a model holds as the least size
            item = JointDynamics(*(0.0 if abs(value) <= SMALLEST_VALUE else value for value in astuple(item)))
            own.dynamics[joint] = item
            left += target.unsaid(joint, item, mechanism)
        every.append((checked, own, left))
        setup.take(checked.deeds(setup))
    _settle(every)
    changes, said, left_out = Changes(mechanism), [], []
    for index, (effect, own, left) in enumerate(every):
        known = model.known_of(index)
        physics, place = effect.law.physics, str(effect.place)
        changes.add(own)
        spoken = target.spoken(own.dynamics)
        acts = {name: item for name, item in spoken.items() if item != JointDynamics()}
        if not replace(own, dynamics=acts).empty or _is_none(effect, mechanism):
            said.append(Said(physics, place, tuple(_values(effect, mechanism, known)), known.share))
            left_out += [LeftOut(physics, place, f"{text}; the rest of it is in the file") for text in left]
        else:
            left_out += [LeftOut(physics, place, text, known.share) for text in left]
    return changes, tuple(said), tuple(left_out)


def _settle(every: Sequence[tuple[Effect, Changes, list[str]]]) -> None:
    """Where poses and efforts told one thing, keep it of those that see it better; say that it was told twice.

    Poses see an encoder's zero itself, efforts to first order; efforts see masses, centres, inertias and friction,
    poses what hangs on the weight.
    """
    efforts = [own for effect, own, _ in every if isinstance(effect.law, EffortLaw)]
    poses = [own for effect, own, _ in every if not isinstance(effect.law, EffortLaw)]
    zeros = {joint for own in poses for joint in own.zeros}
    rubbing = {joint for own in efforts for joint in own.dynamics}
    weighed = any(own.bodies for own in efforts)
    for effect, own, left in every:
        if isinstance(effect.law, EffortLaw):
            for joint in sorted(zeros & set(own.zeros)):
                del own.zeros[joint]
                left.append(f"the zero of {joint} as efforts told it: the file has the one that poses told")
            continue
        for joint in sorted(rubbing & set(own.dynamics)):
            del own.dynamics[joint]
            left.append(f"the friction of {joint} as poses told it: the file has the one that efforts told")
        if weighed and own.weighs:
            own.forget_masses()
            left.append("masses as poses told them: the file has those that efforts told")


def _is_trace(item: Quantity, value: float) -> bool:
    """Return True of a value that a fit left at zero, as a model holds what must be above zero: as the least size."""
    return item.positive and item.lower == 0 and value <= SMALLEST_VALUE


def _is_none(effect: Effect, mechanism: Mechanism) -> bool:
    """Return True of an effect that does nothing: what of it makes it act was found to be zero."""
    items = {item.name: item for item in effect.law.quantities_at(effect.place, mechanism)}
    acting = [name for name, none in effect.law.neutral.items() if none == 0 and name in items]
    return bool(acting) and all(_is_trace(items[name], effect.values[name]) for name in acting)


def _values(effect: Effect, mechanism: Mechanism, known: Known) -> Iterator[str]:
    """Yield an effect's values with units and intervals; of many that are as drawn none."""
    for item in effect.law.quantities_at(effect.place, mechanism):
        if item.name not in effect.values:
            continue
        value, unit = effect.values[item.name], item.unit if item.unit != "1" else ""
        if _is_trace(item, value):
            yield f"{item.name} = 0 {unit}".rstrip() + " (none was found)"
            continue
        text = f"{item.name} = {number(value, 6)} {unit}".rstrip()
        ends = known.intervals.get(item.name)
        yield text if ends is None else f"{text} (95 %: {number(ends[0], 6)} to {number(ends[1], 6)})"


# -- the comment at the head -------------------------------------------------------------------------------------------


def _comment(
    model: CorrectedModel, said: Sequence[Said], left: Sequence[LeftOut], remarks: Sequence[str]
) -> tuple[str, ...]:
    """Return the lines that a file begins with: where it comes from, what is in it, what is not."""
    lines = [f"The corrected model of '{Path(model.robot).name}', exported by prup_pin {__version__}."]
    lines += model.notes.splitlines()
    if said:
        lines += ["", "In this file:"]
    for item in said:
        lines.append(f"  {item.physics} at {item.place}{_share(item.share)}")
        lines += [f"    {value}" for value in item.values]
    if left:
        lines += ["", "Left out:"]
    lines += [f"  {item.physics} at {item.place}{_share(item.share)}: {item.what}" for item in left]
    if remarks:
        lines += ["", "To know:", *(f"  {text}" for text in remarks)]
    # two hyphens end a comment
    return tuple(line.replace("--", "- -").rstrip("- ") for line in lines)


def _share(share: float | None) -> str:
    return "" if share is None else f" ({share_in_words(share)})"


def share_in_words(share: float) -> str:
    """Return what an effect explains, in words."""
    return f"explains {number(100 * share, 3)} % of the held-out squared residual"


# -- bodies that can exist ---------------------------------------------------------------------------------------------


#: The lightest body that is written, as a share of one that weighs as much as the robot.
_LIGHTEST = 1e-9
#: What is below nothing by less than that share is rounding.
_ROUNDING = 1e-12


def make_possible(changes: Changes) -> Iterator[str]:
    """Let bodies that were found to be a little less than nothing be the nearest that can exist; yield that in words.

    Little is what any link may hold beyond what is drawn (`SOME_BODY`). A body that lacks more is left as it was found:
    whoever writes it refuses it.
    """
    mechanism = changes.mechanism
    scale = np.linalg.cholesky(some_body(mechanism, 0.3))
    for name, added in changes.bodies.items():
        drawn = mechanism.model.inertias[mechanism.joint(name).id].toDynamicParameters()
        found = pseudo_inertia(drawn + added)
        nearest = _nearest(found, scale)
        if nearest is None:
            continue
        more = of_pseudo_inertia(nearest - found)
        changes.bodies[name] = added + more
        yield (
            f"the body of {name} is the nearest that can exist to what was found, by {quantity(float(more[0]), 'kg')}: "
            "the motion told nothing else of it"
        )


def _nearest(found: np.ndarray, scale: np.ndarray) -> Array | None:
    """Return the nearest matrix of second moments (4, 4) that a body has; None where it is one, or lacks too much.

    scale: the Cholesky factor of that of a body as heavy as the robot, in whose units all second moments are compared.
    """
    inner = np.linalg.solve(scale, np.linalg.solve(scale, found).T)
    values, axes = np.linalg.eigh((inner + inner.T) / 2)
    if values[0] >= -_ROUNDING or values[0] < -SOME_BODY:
        return None
    clipped = axes @ np.diag(np.maximum(values, _LIGHTEST)) @ axes.T
    return scale @ clipped @ scale.T
