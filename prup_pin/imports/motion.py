"""What was seen beside what the joints did: which body carries a marker that no name leads to, which of two clocks is
ahead, which rows belong together, and whether it is that robot at all. Found from motion.

A marker that sits on a body, seen from where nothing moves, is at s = B (t + R o) + b: t and R the body as the joints
have it, o the place of the marker on it, B and b where the tracker stands. In B^-1 s = t + R o + B^-1 b it is linear
where B may be any matrix; with a rotation nine numbers are fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from scipy import special
from scipy.optimize import least_squares, linear_sum_assignment, minimize_scalar
from scipy.spatial.transform import Rotation

from ..mechanism import Mechanism
from ..numbers import number
from ..spatial import Array
from .bodies import Body
from .columns import place_lines
from .convert import at_rest, rests, turns_of
from .draft import Draft, Line
from .log import Stream
from .map import Orientation
from .units import Unit, factor_of

#: What is left of the way of a marker that moves as its body does, as a share; of one that hardly does.
_LEFT, _HARDLY = 0.05, 0.2


@dataclass(frozen=True, eq=False)
class BodyPath:
    """A body as the joints have it: position (n, 3) [m] and rotation (n, 3, 3) in base axes, at times or rows (n,)."""

    time: Array
    position: Array
    rotation: Array

    def of_point(self, placement: Array) -> BodyPath:
        """Return the path of a frame that sits on the body so, (4, 4)."""
        turned = self.rotation @ placement[:3, :3]
        return replace(self, position=self.position + self.rotation @ placement[:3, 3], rotation=turned)

    def seen_from(self, other: BodyPath) -> BodyPath:
        """Return the path in the axes of another body."""
        turned = other.rotation.mT
        place = np.einsum("nij,nj->ni", turned, self.position - other.position)
        return replace(self, position=place, rotation=turned @ self.rotation)

    def __getitem__(self, rows: np.ndarray) -> BodyPath:
        return BodyPath(self.time[rows], self.position[rows], self.rotation[rows])


def paths_of(
    draft: Draft, joints: Mapping[str, Array], time: Array, bodies: Iterable[int], most: int
) -> dict[int, BodyPath]:
    """Return the paths of bodies, by the ids of their joints, in rows in which the time and all joints are known.

    joints: positions (N,) by name [m, rad], others stand at home; time (N,); most: rows at most.
    """
    assert draft.mechanism is not None
    rows = np.flatnonzero(np.isfinite(np.column_stack([time, *joints.values()])).all(axis=1))
    rows = rows[:: max(1, -(-len(rows) // most))]
    wanted = list(bodies)
    placed = np.array([draft.mechanism.placements(q)[wanted] for q in draft.configurations(joints, rows)])
    placed = placed.reshape(len(rows), len(wanted), 4, 4)
    return {body: BodyPath(time[rows], placed[:, k, :3, 3], placed[:, k, :3, :3]) for k, body in enumerate(wanted)}


def _affine(seen: Array, path: BodyPath) -> tuple[Array, float]:
    """Return the 15 numbers that bring places (n, 3) that were seen to a path's, and what share of its way they leave.

    They are a map (3, 3), which may be any matrix, its shift, and the marker's place on the body: position + rotation @
    offset = map @ (seen - its mean) + shift.
    """
    rows = np.zeros((len(seen), 3, 15))
    for k in range(3):
        rows[:, k, 3 * k : 3 * k + 3], rows[:, k, 9 + k] = seen - seen.mean(axis=0), 1.0
        rows[:, k, 12:] = -path.rotation[:, k]
    matrix, wanted = rows.reshape(-1, 15), (path.position - path.position.mean(axis=0)).ravel()
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    return found, float(np.linalg.norm(wanted - matrix @ found) / max(np.linalg.norm(wanted), 1e-300))


def _nearest_rotation(matrix: Array) -> Array:
    """Return the rotation (3, 3) that is nearest to a matrix."""
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def _prove(joints: Mapping[str, Line]) -> None:
    """Take the doubts off joints whose positions what was seen has proven."""
    for line in joints.values():
        line.doubt = ""
        line.because("what was seen goes with it")


# -- which body carries a marker ---------------------------------------------------------------------------------------


#: Rows that are compared at most, and rows without which nine numbers fit anything.
_ROWS, _FEWEST = 500, 8
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
class Carried:
    """A marker on a body, by joint id, as a tracker on another body (None: on the floor) sees it.

    offset (3,): in the body's axes [m]; along the rows of free (k, 3) no row tells it. apart (n,): how far it was seen
    from there [m]. path: of the body, and seen (n, 3): where the marker was [m]. rivals: others that chance would have
    as well.
    """

    body: int
    seen_from: int | None
    offset: Array
    free: Array
    apart: Array
    path: BodyPath
    seen: Array
    rivals: Sequence[Carried] = ()

    @property
    def off(self) -> float:
        """How far it was seen from its place on the body [m], in the middle of the rows."""
        return float(np.median(self.apart))

    @property
    def share(self) -> float:
        """The same, as a share of its way."""
        way = np.median(np.linalg.norm(self.seen - np.median(self.seen, axis=0), axis=1))
        return self.off / max(float(way), np.finfo(float).tiny)

    def distance(self, place: Array) -> float:
        """Return how far a place (3,) on the body is from the marker's [m], in the directions that are told."""
        less = place - self.offset
        return float(np.linalg.norm(less - self.free.T @ np.linalg.lstsq(self.free.T, less, rcond=None)[0]))

    def beside(self, place: Array) -> float:
        """Return how far the marker was seen from a place (3,) on the body [m], were the tracker's axes the base's."""
        there = self.path.position + self.path.rotation @ place
        return float(np.median(np.linalg.norm(self.seen - there, axis=1)))

    def further(self, other: Carried) -> bool:
        """Return whether a marker is further from another body's place than from this one's, in more rows than chance.

        A test of signs: it asks nothing of how the distances scatter.
        """
        nearer = int(np.count_nonzero(self.apart < other.apart))
        return bool(special.bdtrc(nearer - 1, len(self.apart), 0.5) < _CHANCE)

    def in_words(self, mechanism: Mechanism) -> str:
        """Return how the marker moves, beside how the robot's bodies do."""

        def named(one: Carried) -> str:
            whence = "" if one.seen_from is None else f" seen from {mechanism.bodies[one.seen_from]}"
            return f"{mechanism.bodies[one.body]}{whence}"

        part = f"{number(100 * self.share, 2)} % of its travel"
        if self.share > _HARDLY:
            return f"moves as no body of the robot does; {named(self)} comes nearest, to {part}"
        also = f", or as {named(self.rivals[0])}" if self.rivals else ""
        return f"moves as {named(self)}{also}; median distance from it {number(1e3 * self.off, 2)} mm, {part}"

    def doubt(self, mechanism: Mechanism) -> str:
        """Return what is not sure of the body that carries the marker, or ''."""
        asked = (
            (self.share > _HARDLY, "do these rows belong to these joints?"),
            (self.share > _LEFT, "markers that were taken for one another, or another robot?"),
            (
                self.off > _NEAR,
                "more than a robot is beside its file: is it this robot, and are these its joints and units?",
            ),
            (self.off < _COMPUTED, "measured from outside, or computed from the joints?"),
            (bool(self.rivals), "which one carries it?"),
        )
        question = next((question for holds, question in asked if holds), "")
        return question and f"{self.in_words(mechanism)}: {question}"


def carry(draft: Draft) -> None:
    """Say of each marker without a name, in the same rows as the joints, on which body it sits: lines of p.<frame>.

    Several markers on a body each take a frame of it, the nearest one. Where all move as bodies of the robot do, the
    joints' units and order are proven, and rows without a time are poses at rest.
    """
    mechanism, joints = draft.mechanism, draft.joints
    homes = {draft.stream_of(line).name: draft.stream_of(line) for line in joints.values()}
    if mechanism is None or mechanism.loops or len(homes) != 1:
        return
    ((called, home),) = homes.items()
    bodies = [body for body in draft.unnamed if body.stream is home and len(body.place) == 3]
    draft.copies |= _copies(bodies)
    single = [body for body in bodies if body.called not in draft.copies]
    named = [line.target[2:-2] for line in draft.of("p.") if draft.stream_of(line) is home]
    frames = [frame for frame in dict.fromkeys(named) if all(f"p.{frame}.{axis}" in draft.targets for axis in "xyz")]
    if not (single or frames):
        return
    values = {name: draft.in_si(line) for name, line in joints.items()}
    ids = [mechanism.joint_id(name) for name in joints]
    paths = paths_of(draft, values, np.arange(len(home), dtype=float), ids, _ROWS)
    _doubt_named(draft, frames, paths)
    found = {body.called: _carrying(draft, body, paths) for body in single}
    told = {name: one for name, one in found.items() if one is not None}
    if not told:
        return
    _tell_carried(draft, bodies, told)
    if all(name in told and name not in draft.movers and not told[name].doubt(mechanism) for name in found):
        for line in joints.values():
            line.doubt = ""
        if draft.clocks[called][0] == "":
            draft.clocks[called] = "", "s", ""


def _tell_carried(draft: Draft, bodies: Sequence[Body], told: Mapping[str, Carried]) -> None:
    """Write the lines of markers on bodies of the robot, in the place of what was guessed of these by their names."""
    mechanism = draft.mechanism
    assert mechanism is not None
    frames = _frames(mechanism, {name: one for name, one in told.items() if one.seen_from is None})
    known = [body for body in bodies if body.called in told or body.called in draft.copies]
    taken = {name for body in known for name in body.place.values()}
    draft.lines = [line for line in draft.lines if line.source not in taken]
    draft.others = [body for body in draft.others if body not in known]
    turned = [body for body in draft.turns.values() if body in known]
    draft.turns = {target: body for target, body in draft.turns.items() if body not in known}
    alone = sum(body.called not in draft.copies for body in bodies) == 1
    for body in (body for body in known if body.called in told):
        best = told[body.called]
        words, doubt = best.in_words(mechanism), best.doubt(mechanism)
        if body.called not in frames:
            draft.others.append(body)
            draft.movers[body.called] = words
            if best.seen_from:
                draft.movers[body.called] += (
                    ": a tracker that the robot carries; a recording has places in base axes, and they are that of a "
                    f"robot file that begins at {mechanism.bodies[best.seen_from]}"
                )
            continue
        frame = mechanism.frame(frames[body.called])
        # the only body in the table, on the tool, or the one at its place: it is the tool's pose, not a marker
        at_tool = mechanism.tool is not None and frame.name == mechanism.tool.name
        of_tool = at_tool and (alone or best.distance(mechanism.tip.placement[:3, 3]) < _NEAR)
        suffix = "" if of_tool else f".{frame.name}"
        lines = place_lines(f"p{suffix}", body, True)
        lines[0].doubt, lines[0].reason = doubt, "" if doubt else words  # what fits proves the unit
        draft.lines += lines
        if body in turned:
            draft.turns[f"r{suffix}"] = body
        place = frame.placement[:3, 3]
        if best.beside(place) > _NEAR:  # it may sit as far from its frame as the next larger round number
            draft.carried[body.called] = next((r for r in _REACHES if best.distance(place) < r), _REACHES[-1])


def _carrying(draft: Draft, body: Body, paths: Mapping[int, BodyPath]) -> Carried | None:
    """Return the body that carries a marker best, None where too few rows tell.

    Where no body does as seen from the floor, trackers that the robot carries are tried too.
    """
    assert draft.mechanism is not None
    places = np.column_stack([draft.in_si(line) for line in place_lines("", body, True)])
    every = list(_fits(paths, places, None))
    if all(one.share > _LEFT for one in every):
        every += [one for base in paths for one in _fits(paths, places, base)]
    if not every:
        return None
    best, *others = sorted(every, key=lambda one: one.off)
    rivals = [one for one in others if not best.further(one)]
    tip = draft.mechanism.tip
    for one in (best, *rivals):  # a marker where the robot's tool is, or where it ends, is no other body's
        near = one.seen_from is None and one.body == tip.joint and one.share < _LEFT
        if near and one.distance(tip.placement[:3, 3]) < _NEAR:
            return one
    return replace(best, rivals=rivals)


def _doubt_named(draft: Draft, frames: Sequence[str], paths: Mapping[int, BodyPath]) -> None:
    """Note on places of bodies that are called like a frame, in the joints' rows, that they are not where it is."""
    assert draft.mechanism is not None
    for name in frames:
        lines = [draft.targets[f"p.{name}.{axis}"] for axis in "xyz"]
        frame = draft.mechanism.frame(name)
        own = {body: path for body, path in paths.items() if body == frame.joint}
        for best in _fits(own, np.column_stack([draft.in_si(line) for line in lines]), None):
            beside = best.distance(frame.placement[:3, 3])
            if best.share > _LEFT or best.off > _NEAR:
                lines[0].doubt = best.doubt(draft.mechanism)
            elif beside > _NEAR:
                far = f"but {number(1e3 * beside, 3)} mm beside {name}: is it another point of it?"
                lines[0].doubt = f"{best.in_words(draft.mechanism)}, {far}"


def _copies(bodies: Sequence[Body]) -> dict[str, str]:
    """Return markers whose columns are those of an earlier one, number by number, with that one."""
    found: dict[str, str] = {}
    for k, body in enumerate(bodies):
        for other in bodies[:k]:
            own, its = ([one.stream.columns[one.place[axis]] for axis in "xyz"] for one in (body, other))
            if np.array_equal(own, its, equal_nan=True):
                found.setdefault(body.called, other.called)
    return found


def _fits(paths: Mapping[int, BodyPath], seen: Array, base: int | None) -> Iterator[Carried]:
    """Yield the marker (N, 3) [m] as it would sit on each body that moves, seen from another one or from the floor."""
    for body, path in paths.items():
        places = seen[path.time.astype(int)]
        known = np.isfinite(places).all(axis=1)
        if body == base or known.sum() < _FEWEST:
            continue
        whole = path if base is None else path.seen_from(paths[base])
        offset, free, apart = _rigid(whole[known], places[known])
        yield Carried(body, base, offset, free, apart, whole[known], places[known])


def _rigid(path: BodyPath, seen: Array) -> tuple[Array, Array, Array]:
    """Return where on a body a marker sits (3,) [m], along which directions (k, 3) no row tells that, and how far from
    there (n,) [m] it was seen.

    Along what no row tells, as along the axes of a robot whose axes are all parallel, the marker sits as near to its
    body's joint as it can.
    """
    start = _affine(seen, path)[0]
    turned = Rotation.from_matrix(_nearest_rotation(start[:9].reshape(3, 3)).T)

    def left(x: Array) -> Array:
        placed = (path.position + path.rotation @ x[6:]) @ (turned * Rotation.from_rotvec(x[3:6])).as_matrix().T
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


def _frames(mechanism: Mechanism, carried: Mapping[str, Carried]) -> dict[str, str]:
    """Return a frame of its body for each marker, the nearest ones altogether; none where a body has too few."""
    links = {frame.name for frame in mechanism.model.frames if frame.type == pin.FrameType.BODY}
    out: dict[str, str] = {}
    for body in dict.fromkeys(one.body for one in carried.values()):
        own = [name for name, one in carried.items() if one.body == body]
        frames = [name for name in mechanism.frame_names if mechanism.frame(name).joint == body]
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


# -- two clocks, and rows side by side ---------------------------------------------------------------------------------


#: Poses that are calculated at most.
_POSES = 4000
#: Steps of the common clock on which speeds are compared, and the share of the shorter stream that has to overlap.
_STEPS, _OVERLAP = 4000, 0.5
#: Speeds that are less alike belong to another motion.
_ALIKE = 0.8
#: How much more must be left two steps beside the delay: a short smooth path goes with any other.
_SHARP = 2.0
#: Places that an affine map and a marker's place on its link, 15 numbers, cannot bring to any other.
_FEWEST_PLACES = 15
#: With so many rests, poses of a robot that moved are left out.
_RESTS = 10


def set_beside(draft: Draft) -> None:
    """Note of each stream of bodies how it goes with the joints, where these are two devices.

    Where the places agree with what the joints' positions make of the robot, these positions, their units and their
    order are proven, and what was doubtful of them is not any more.
    """
    joints = draft.joints
    if not joints:
        return
    home = draft.stream_of(next(iter(joints.values())))
    mine, timed = _time_of(draft, home)
    if timed and not draft.of("tau."):
        known = np.isfinite(mine)
        moved = [draft.in_si(line)[known] for line in joints.values() if draft.stream_of(line) is home]
        count = rests(at_rest(mine[known], moved))
        draft.rests = count if count >= _RESTS else 0
    for stream in draft.log.streams:
        places = {line.target: line for line in draft.of("p") if draft.stream_of(line) is stream}
        place = next(iter(places), "").rpartition(".")[0]
        axes = [places.get(f"{place}.{axis}") for axis in "xyz"]
        if stream is home or None in axes:
            continue
        points = np.column_stack([draft.in_si(line) for line in axes if line is not None])
        frame = place.removeprefix("p").removeprefix(".")
        theirs, told = _time_of(draft, stream)
        if not (told and timed):
            path = _path(draft, home, np.arange(len(home), dtype=float), frame)
            _row_by_row(draft, home, stream, path, points)
            continue
        path = _path(draft, home, mine, frame)
        delay = None if path is None else delay_of(path, theirs, points)
        body = draft.turns.get(f"r{place.removeprefix('p')}")
        if path is not None and delay is not None and body is not None:
            turn = Orientation(body.turn, body.manner, Unit(body.unit or "1", factor_of(body.unit)))
            body.askew = _askew(path, theirs - delay, points, *turns_of(draft.log, stream, turn))
        if delay is not None:
            draft.delays[stream.name] = delay, "the motion tells how far it is ahead", ""
            _prove(joints)
        elif min(mine[-1], theirs[-1]) - max(mine[0], theirs[0]) > 0.5 * min(np.ptp(mine), np.ptp(theirs)):
            unsure = "the motion does not tell whether it goes with the joints' clock; else its delay [s]"
            draft.delays[stream.name] = 0.0, "", unsure
        else:
            unsure = "another clock: taken as begun together with the joints'"
            draft.delays[stream.name] = float(theirs[0] - mine[0]), "", unsure


def _time_of(draft: Draft, stream: Stream) -> tuple[Array, bool]:
    """Return the times (N,) [s] of a stream as they are told, and whether they are told at all."""
    name, unit, _ = draft.clocks[stream.name]
    if name == "":
        return np.arange(len(stream), dtype=float), False
    raw = stream.clock if name is None else stream.columns[name]
    assert raw is not None
    return raw * factor_of(unit), True


def _path(draft: Draft, home: Stream, time: Array, name: str) -> BodyPath | None:
    """Return the path of a frame, of the tip where it is not named, by the joints' rows.

    None where the robot or a joint is not known, or loops leave it open.
    """
    mechanism, joints = draft.mechanism, draft.joints
    if mechanism is None or mechanism.loops or not set(draft.driven) <= set(joints):
        return None
    if any(draft.stream_of(line) is not home for line in joints.values()):
        return None
    frame = mechanism.frame(name) if name else mechanism.tip
    positions = {joint: draft.in_si(line) for joint, line in joints.items()}
    return paths_of(draft, positions, time, [frame.joint], _POSES)[frame.joint].of_point(frame.placement)


def _row_by_row(draft: Draft, home: Stream, stream: Stream, path: BodyPath | None, points: Array) -> None:
    """Put a list of points beside a list of joints, where one of them tells no time and there are as many of both."""
    if len(stream) != len(home):
        unsure = f"{len(stream)} rows, but {len(home)} of the joints: which row belongs to which?"
        draft.delays[stream.name] = 0.0, "", unsure
        return
    alone, other = (stream, home) if draft.clocks[stream.name][0] == "" else (home, stream)
    draft.alike[alone.name] = other.name
    agrees = None
    if path is not None:
        places = points[path.time.astype(int)]
        known = np.isfinite(places).all(axis=1)
        if known.sum() >= _FEWEST_PLACES:
            agrees = _affine(places[known], path[known])[1] < _LEFT
    told = "row by row, and the places agree with the joints" if agrees else "row by row with the joints"
    unsure = "these places do not agree with the joints row by row" if agrees is False else ""
    draft.delays[stream.name] = 0.0, told, unsure
    if agrees:
        _prove(draft.joints)
        if draft.clocks[home.name][0] == "":
            draft.clocks[home.name] = "", "s", ""


def delay_of(path: BodyPath, time: Array, seen: Array) -> float | None:
    """Return by how much stamps (M,) of what was seen, (M, 3) [m], are ahead of the path's; None where no motion tells.

    First the speeds are shifted along each other, for they know nothing of where the camera stood; then the places
    are brought together, with the marker anywhere on its link.
    """
    known = np.isfinite(seen).all(axis=1) & np.isfinite(time)
    time, seen = time[known], seen[known]
    if len(time) < 20 or len(path.time) < 20:
        return None
    spans = path.time[-1] - path.time[0], time[-1] - time[0]
    step = max(max(spans) / _STEPS, 2 * float(np.median(np.diff(time))), 2 * float(np.median(np.diff(path.time))))
    shift = _shift(_speeds(path.time, path.position, step), _speeds(time, seen, step))
    if shift is None:
        return None

    near = (time[0] - path.time[0]) - shift * step

    def left(more: float) -> float:
        return _brought(path, time - near - more, seen)[1]

    beyond = 2 * step
    found = float(minimize_scalar(left, bounds=(-beyond, beyond), method="bounded", options={"xatol": 1e-8 * step}).x)
    least, beside = left(found), min(left(found - beyond), left(found + beyond))
    return float(near + found) if least < _LEFT and beside > _SHARP * least else None


def _speeds(time: Array, position: Array, step: float) -> Array:
    even = np.arange(time[0], time[-1], step)
    places = np.column_stack([np.interp(even, time, position[:, k]) for k in range(3)])
    return np.linalg.norm(np.diff(places, axis=0), axis=1)


def _shift(first: Array, second: Array) -> int | None:
    """Return at which place of the first row of speeds the second begins; None where they are nowhere alike."""
    best, at = _ALIKE, None
    least = max(10, int(_OVERLAP * min(len(first), len(second))))
    for shift in range(-len(second) + least, len(first) - least + 1):
        a = first[max(shift, 0) : shift + len(second)]
        b = second[max(-shift, 0) : max(-shift, 0) + len(a)]
        if a.std() > 0 and b.std() > 0:
            alike = float(np.corrcoef(a, b)[0, 1])
            if alike > best:
                best, at = alike, shift
    return at


def _brought(path: BodyPath, time: Array, seen: Array) -> tuple[Array, float, np.ndarray, BodyPath]:
    """Return what brings places that were seen to a path (`_affine`), which of them it covers, and the path there."""
    inside = (time >= path.time[0]) & (time <= path.time[-1])
    at = time[inside]
    position = np.column_stack([np.interp(at, path.time, path.position[:, k]) for k in range(3)])
    there = BodyPath(at, position, path.rotation[np.clip(np.searchsorted(path.time, at), 0, len(path.time) - 1)])
    if len(at) < max(_FEWEST_PLACES, _OVERLAP * min(len(time), len(path.time))):
        return np.eye(5, 3).ravel(), np.inf, inside, there
    return *_affine(seen[inside], there), inside, there


def _askew(path: BodyPath, time: Array, seen: Array, turned: np.ndarray, turns: Rotation) -> float:
    """Return the angle [rad] between a frame's axes and those of the body that was seen there.

    time (M,): on the path's clock; seen (M, 3) [m]: the body in the camera's axes; turned (M,): where it was seen how
    the body is turned, and these turns.
    """
    known = np.isfinite(seen[turned]).all(axis=1) & np.isfinite(time[turned])
    found, _, inside, there = _brought(path, time[turned][known], seen[turned][known])
    home = Rotation.from_matrix(_nearest_rotation(found[:9].reshape(3, 3)))
    return float((Rotation.from_matrix(there.rotation).inv() * home * turns[known][inside]).mean().magnitude())
