"""Which body of the robot carries a marker that no name leads to: found from how it moves with the joints.

A marker that sits on a body, seen from where nothing moves, is at s = B (t + R o) + b: t and R the body as the joints
have it, o the place of the marker on it, B and b where the tracker stands. Nine numbers, fitted body by body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy import special
from scipy.optimize import least_squares, linear_sum_assignment
from scipy.spatial.transform import Rotation

from ..mechanism import Mechanism
from ..numbers import number
from ..spatial import Array
from .bodies import Body
from .clocks import equations_of_marker
from .columns import Clocks, place_lines
from .draft import Guessing, Seen, configurations, in_si
from .log import Log, Stream
from .units import UNITS

#: Rows that are compared at most, and rows without which nine numbers fit anything.
_ROWS, _FEWEST = 500, 8
#: What is left of the way of a marker that moves as its body does, as a share; of one that hardly does.
_LEFT, _HARDLY = 0.05, 0.2
#: A body that is further off in so many more rows than chance would have it does not carry the marker.
_CHANCE = 0.01
#: Numbers that agree so well [m] were hardly measured: the controller computed them from its joints.
_COMPUTED = 1e-6
#: A direction that changes what is seen by less than this share of what another one does is not determined.
_UNDETERMINED = 1e-6
#: A robot that works is nearer to its file than that [m]: what is seen as near to its tool is the tool.
_NEAR = 5e-3
#: A marker sits no further from its frame than the next larger of these [m]; a tolerance holds no more than the last.
_REACHES = (0.05, 0.1, 0.2, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class _Path:
    """A body as the joints have it, row by row: position (n, 3) [m] and rotation (n, 3, 3) in base axes."""

    position: Array
    rotation: Array


@dataclass(frozen=True, eq=False)
class Carried:
    """A marker on a body of the robot, by its joint, as a tracker on another body (None: on the floor) sees it.

    offset (3,): in the body's axes [m]; along the rows of free (k, 3) no row tells it. apart (n,): how far it was seen
    from there [m]. share: their median, as a share of its way. body: how that moved, and seen (n, 3): where the marker
    was [m].
    """

    joint: str
    seen_from: str | None
    offset: Array
    free: Array
    apart: Array
    share: float
    body: _Path
    seen: Array

    def distance(self, place: Array) -> float:
        """Return how far a place (3,) on the body is from the marker's [m], in the directions that are told."""
        less = place - self.offset
        return float(np.linalg.norm(less - self.free.T @ np.linalg.lstsq(self.free.T, less, rcond=None)[0]))

    def beside(self, place: Array) -> float:
        """Return how far the marker was seen from a place (3,) on the body [m], were the tracker's axes the base's."""
        there = self.body.position + self.body.rotation @ place
        return float(np.median(np.linalg.norm(self.seen - there, axis=1)))


def carry(log: Log, clocks: Clocks, found: Guessing, seen: Seen, mechanism: Mechanism | None) -> None:
    """Say of each marker without a name, in the same rows as the joints, on which body it sits: lines of p.<frame>.

    Several markers on a body each take a frame of it, the nearest one. Where all move as bodies of the robot do, the
    joints' units and order are proven, and rows without a time are poses at rest.
    """
    joints = {line.target[2:]: line for line in found.lines if line.target.startswith("q.")}
    homes = {log.stream_of(line.source).name for line in joints.values()}
    if mechanism is None or mechanism.loops or len(homes) != 1:
        return
    home = next(stream for stream in log.streams if stream.name in homes)
    values = {name: in_si(log, line) for name, line in joints.items()}
    _doubt_named(mechanism, home, values, seen)
    bodies = [body for body in seen.unnamed if body.stream is home and body.place]
    seen.copies |= _copies(bodies)
    single = [body for body in bodies if body.called not in seen.copies]
    told = _told(mechanism, single, values) if single else {}
    if not told:
        return
    frames = _frames(mechanism, {name: best for name, (best, _) in told.items() if best.seen_from is None})
    known = [body for body in bodies if body.called in told or body.called in seen.copies]
    taken = {name for body in known for name in body.place.values()}
    found.lines = [line for line in found.lines if line.source not in taken]
    seen.lines = {target: line for target, line in seen.lines.items() if line.source not in taken}
    seen.others = [body for body in seen.others if body not in known]
    turned = {target: body for target, body in seen.turns.items() if body in known}
    seen.turns = {target: body for target, body in seen.turns.items() if body not in known}
    sure = len(told) == len(single)
    for body in (body for body in known if body.called in told):
        best, rivals = told[body.called]
        words, doubt = _in_words(mechanism, best, rivals), _doubt(mechanism, best, rivals)
        sure &= not doubt and body.called in frames
        if body.called not in frames:
            where = ""
            if best.seen_from:
                where = (
                    ": a tracker that the robot carries; a recording has places in base axes, and they are that of a "
                    f"robot file that begins at {_body(mechanism, best.seen_from)}"
                )
            seen.others.append(body)
            seen.movers[body.called] = f"{words}{where}"
            continue
        frame = frames[body.called]
        # the only body in the table, on the tool, or the one at its place: it is the tool's pose, not a marker
        at_tool = mechanism.tool is not None and frame == mechanism.tool.name
        of_tool = at_tool and (len(single) == 1 or best.distance(mechanism.tip.placement[:3, 3]) < _NEAR)
        suffix = "" if of_tool else f".{frame}"
        lines = place_lines(f"p{suffix}", body, True)
        lines[0].doubt = doubt  # what fits proves the unit
        lines[0].reason = "" if doubt else words
        found.lines += lines
        seen.turns |= {f"r{suffix}": body for other in turned.values() if other is body}
        if best.beside(mechanism.frame(frame).placement[:3, 3]) > _NEAR:
            seen.carried[body.called] = _reach(mechanism, frame, best)
    if sure:
        for line in joints.values():
            line.doubt = ""
        if clocks[home.name][0] == "":
            clocks[home.name] = "", "s", ""


def _told(
    mechanism: Mechanism, bodies: Sequence[Body], joints: Mapping[str, Array]
) -> dict[str, tuple[Carried, list[Carried]]]:
    """Return of each marker the body that carries it best, and those that chance would as well; joints (N,) [m, rad].

    Where no body does as seen from the floor, trackers that the robot carries are tried too.
    """
    rows, paths = _some_rows(mechanism, joints)
    told: dict[str, tuple[Carried, list[Carried]]] = {}
    for body in bodies:
        places = _points(body)[rows]
        every = list(_fits(paths, places, None))
        if all(one.share > _LEFT for one in every):
            every += [one for base in paths for one in _fits(paths, places, base)]
        every.sort(key=lambda one: float(np.median(one.apart)))
        if every:
            best, rivals = every[0], [one for one in every[1:] if not _further(every[0], one)]
            tools = [one for one in (best, *rivals) if _at_the_tip(mechanism, one)]
            told[body.called] = (tools[0], []) if tools else (best, rivals)
    return told


def _at_the_tip(mechanism: Mechanism, one: Carried) -> bool:
    """Return whether a marker is where the robot's tool is, or where it ends; then it is no other body's."""
    tip = mechanism.tip
    same = one.seen_from is None and mechanism.joint_id(one.joint) == tip.joint
    return same and one.share < _LEFT and one.distance(tip.placement[:3, 3]) < _NEAR


def _some_rows(mechanism: Mechanism, joints: Mapping[str, Array]) -> tuple[np.ndarray, dict[str, _Path]]:
    """Return some rows in which all joints (N,) are known, and the paths of the bodies behind them there."""
    values = np.column_stack(list(joints.values()))
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    rows = rows[:: max(1, -(-len(rows) // _ROWS))]
    return rows, _paths(mechanism, list(joints), values[rows])


def _doubt_named(mechanism: Mechanism, home: Stream, joints: Mapping[str, Array], seen: Seen) -> None:
    """Note on places of bodies that are called like a frame, in the joints' rows, that they are not where it is."""
    named = [target for target, line in seen.lines.items() if target.startswith("p.") and line.source in home.columns]
    frames = dict.fromkeys(target[2:-2] for target in named if target.count(".") > 1)
    if not frames:
        return
    rows, paths = _some_rows(mechanism, joints)
    for frame in frames:
        lines = [seen.lines[f"p.{frame}.{axis}"] for axis in "xyz"]
        placed = mechanism.frame(frame)
        carrying = {name: path for name, path in paths.items() if mechanism.joint_id(name) == placed.joint}
        factors = [UNITS["length"].get(line.unit or "m", 1.0) for line in lines]
        places = np.column_stack([home.columns[line.source] * f for line, f in zip(lines, factors, strict=True)])
        for best in _fits(carrying, places[rows], None):
            beside = best.distance(placed.placement[:3, 3])
            if best.share > _LEFT or float(np.median(best.apart)) > _NEAR:
                lines[0].doubt = _doubt(mechanism, best, [])
            elif beside > _NEAR:
                lines[0].doubt = (
                    f"{_in_words(mechanism, best, [])}, but {number(1e3 * beside, 3)} mm beside {frame}: is it another "
                    "point of it?"
                )


def _copies(bodies: Sequence[Body]) -> dict[str, str]:
    """Return markers whose columns are those of another one, number by number, with that one."""
    found: dict[str, str] = {}
    for k, body in enumerate(bodies):
        for other in bodies[:k]:
            same = [np.array_equal(_column(body, a), _column(other, a), equal_nan=True) for a in "xyz"]
            if all(same) and other.called not in found:
                found[body.called] = other.called
    return found


def _column(body: Body, axis: str) -> Array:
    return body.stream.columns[body.place[axis]]


def _points(body: Body) -> Array:
    """Return the places (N, 3) [m] of a marker."""
    lines = dict(zip(body.place, place_lines("", body, True), strict=True))
    return np.column_stack([_column(body, a) * UNITS["length"].get(lines[a].unit or "m", 1.0) for a in "xyz"])


def _paths(mechanism: Mechanism, joints: Sequence[str], values: Array) -> dict[str, _Path]:
    """Return the path of the body behind each joint by their values (n, joints) [m, rad]; others stand at home."""
    data, positions = mechanism.model.createData(), dict(zip(joints, values.T, strict=True))
    out = {name: _Path(np.empty((len(values), 3)), np.empty((len(values), 3, 3))) for name in joints}
    for row, q in enumerate(configurations(mechanism, positions, range(len(values)))):
        pin.forwardKinematics(mechanism.model, data, q)
        for name, path in out.items():
            placed = data.oMi[mechanism.joint_id(name)]
            path.position[row], path.rotation[row] = placed.translation, placed.rotation
    return out


def _fits(paths: Mapping[str, _Path], seen: Array, base: str | None) -> Iterator[Carried]:
    """Yield the marker (n, 3) [m] as it would sit on each body that moves, seen from another one or from the floor."""
    for joint, path in paths.items():
        known = np.isfinite(seen).all(axis=1)
        if joint == base or known.sum() < _FEWEST:
            continue
        position, rotation = path.position[known], path.rotation[known]
        if base is not None:
            turned = paths[base].rotation[known].transpose(0, 2, 1)
            position = np.einsum("nij,nj->ni", turned, position - paths[base].position[known])
            rotation = turned @ rotation
        offset, free, apart = _rigid(position, rotation, seen[known])
        way = float(np.median(np.linalg.norm(seen[known] - np.median(seen[known], axis=0), axis=1)))
        share = float(np.median(apart)) / max(way, np.finfo(float).tiny)
        yield Carried(joint, base, offset, free, apart, share, _Path(position, rotation), seen[known])


def _rigid(position: Array, rotation: Array, seen: Array) -> tuple[Array, Array, Array]:
    """Return where on a body a marker sits (3,) [m], along which directions (k, 3) no row tells that, and how far from
    there (n,) [m] it was seen.

    It starts from B^-1 s = t + R o + B^-1 b, which is linear where B may be any matrix. Along what no row tells, as
    along the axes of a robot whose axes are all parallel, the marker sits as near to its body's joint as it can.
    """
    equations = equations_of_marker(seen - seen.mean(axis=0), rotation)
    start = np.linalg.lstsq(equations, position.ravel(), rcond=None)[0]
    u, _, vt = np.linalg.svd(start[:9].reshape(3, 3))
    turned = Rotation.from_matrix((u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt).T)

    def left(x: Array) -> Array:
        placed = (position + rotation @ x[6:]) @ (turned * Rotation.from_rotvec(x[3:6])).as_matrix().T
        return placed + x[:3] - seen

    first = np.r_[np.zeros(6), start[12:]]
    first[:3] = -left(first).mean(axis=0)
    scale = max(float(np.median(np.abs(left(first)))), 1e-6)
    fitted = least_squares(lambda x: left(x).ravel(), first, loss="soft_l1", f_scale=scale)
    _, sizes, directions = np.linalg.svd(fitted.jac, full_matrices=False)
    free = directions[sizes < _UNDETERMINED * sizes[0]]
    nearest = fitted.x - free.T @ np.linalg.lstsq(free[:, 6:].T, fitted.x[6:], rcond=None)[0]
    apart, there = (np.linalg.norm(left(x), axis=1) for x in (fitted.x, nearest))
    if np.allclose(there, apart, rtol=1e-3, atol=_COMPUTED):
        return nearest[6:], free[:, 6:], there
    return fitted.x[6:], np.zeros((0, 3)), apart


def _further(best: Carried, other: Carried) -> bool:
    """Return whether a marker is further from another body's place than from the best one's, in more rows than chance.

    A test of signs: it asks nothing of how the distances scatter.
    """
    nearer = int(np.count_nonzero(best.apart < other.apart))
    return bool(special.bdtrc(nearer - 1, len(best.apart), 0.5) < _CHANCE)


def _frames(mechanism: Mechanism, carried: Mapping[str, Carried]) -> dict[str, str]:
    """Return a frame of its body for each marker, the nearest ones altogether; none where a body has too few."""
    out: dict[str, str] = {}
    for joint in dict.fromkeys(one.joint for one in carried.values()):
        own = [name for name, one in carried.items() if one.joint == joint]
        body = mechanism.joint_id(joint)
        frames = [name for name in mechanism.frame_names if mechanism.frame(name).joint == body]
        links = [frame.name for frame in mechanism.model.frames if frame.type == pin.FrameType.BODY]
        own_links = [name for name in frames if name in links]
        frames = own_links if len(own_links) >= len(own) else frames  # a fixed joint says the same as its link
        far = np.zeros((len(own), len(frames)))
        for row, name in enumerate(own):
            for column, frame in enumerate(frames):
                # of places that the rows do not tell apart, the tool's
                near = carried[name].distance(mechanism.frame(frame).placement[:3, 3])
                far[row, column] = max(near, _NEAR) - _COMPUTED * (frame == mechanism.tip.name)
        for row, column in zip(*linear_sum_assignment(far), strict=True):
            out[own[row]] = frames[column]
    return out


def _reach(mechanism: Mechanism, frame: str, best: Carried) -> float:
    """Return how far a marker may sit from its frame [m], a round number."""
    far = best.distance(mechanism.frame(frame).placement[:3, 3])
    return next((reach for reach in _REACHES if far < reach), _REACHES[-1])


def _doubt(mechanism: Mechanism, best: Carried, rivals: Sequence[Carried]) -> str:
    """Return what is not sure of the body that carries a marker, or ''."""
    words = _in_words(mechanism, best, rivals)
    if best.share > _HARDLY:
        return f"{words}: do these rows belong to these joints?"
    if best.share > _LEFT:
        return f"{words}: markers that were taken for one another, or another robot?"
    if float(np.median(best.apart)) > _NEAR:
        return f"{words}: more than a robot is beside its file: is it this robot, and are these its joints and units?"
    if float(np.median(best.apart)) < _COMPUTED:
        return f"{words}: measured from outside, or computed from the joints?"
    return f"{words}: which one carries it?" if rivals else ""


def _in_words(mechanism: Mechanism, best: Carried, rivals: Sequence[Carried]) -> str:
    """Return how a marker moves, beside how the robot's bodies do."""

    def named(one: Carried) -> str:
        whence = "" if one.seen_from is None else f" seen from {_body(mechanism, one.seen_from)}"
        return f"{_body(mechanism, one.joint)}{whence}"

    if best.share > _HARDLY:
        least = f"{named(best)} comes nearest, to {number(100 * best.share, 2)} % of its travel"
        return f"moves as no body of the robot does; {least}"
    also = f", or as {named(rivals[0])}" if rivals else ""
    away = f"{number(1e3 * float(np.median(best.apart)), 2)} mm, {number(100 * best.share, 2)} % of its travel"
    return f"moves as {named(best)}{also}; median distance from it {away}"


def _body(mechanism: Mechanism, joint: str) -> str:
    return mechanism.bodies[mechanism.joint_id(joint)]
