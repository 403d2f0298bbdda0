"""Are the positions, orientations and joints of a log written as it says? Other ways compete before any physics does.

Measured poses of few postures against the drawn rigid ones, with the tracker's and the target's frames freed, which
every bench leaves open. A convention is told where it leaves a third of what the log leaves as it is written, on
postures that were held out too. Of positions, whatever components were measured are compared: a planar bench has two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ..errors import PrupPinError
from ..kinematics import ClosedPose
from ..mechanism import Mechanism
from ..recordings import Convention, Recording, read_as
from ..recordings.conventions import Evidence, is_right_handed, merged
from ..robot import Robot
from ..simulation import drawn_for
from ..spatial import Array, rotation_exp, turn_between
from .criteria import AS_GOOD, CONVENTION_FINE, FAR_LESS, FEW_ROUNDS, LEAST_REACH, MOSTLY
from .readings import Columns, Found, Reading, Tried, likeliest, readings
from .sensor_frames import nearest_turns, orientations_left, positions_left
from .thinning import evenly_spaced

#: Postures that are looked at, of robots with loops, which take longer to close, and of others.
_POSTURES, _OF_TREES = 12, 40


@dataclass(frozen=True, eq=False)
class _Misfit:
    """Root mean squares of positions [m] and orientations [rad] against the drawing, by posture (n,); NaN: unmeasured.

    squares (n, 2). spread (2,): how far the drawn postures are apart, or
    measured positions as they are read where these are nearer to each other.
    """

    squares: Array
    spread: Array

    @property
    def sizes(self) -> Array:
        """Both together, (2,); 0 of what was not measured."""
        known = np.isfinite(self.squares)
        sums = np.where(known, self.squares, 0.0).sum(axis=0)
        return np.sqrt(sums / np.maximum(known.sum(axis=0), 1))


_Read = Found[_Misfit]


class _Postures:
    """A few postures of a recording and the drawn robot in them, with one question: how far apart are they?"""

    def __init__(self, robot: Robot, recording: Recording):
        self.robot, self.mechanism = robot, robot.mechanism
        self.drawn = drawn_for(robot)
        few = _POSTURES if self.mechanism.loops else _OF_TREES
        self.recording = recording.select(_quietest(recording, self.mechanism, few))
        frames = [name for name in recording.marker_names if name in self.mechanism.frame_names]
        self.frames = list(dict.fromkeys(frames))
        self._places: dict[bytes, tuple[dict[str, Array], Array]] = {}
        self._placed: dict[bytes, Array] = {}
        self._ways: dict[tuple[Reading, tuple[bool, bool]], list[tuple[Reading, Recording]]] = {}
        self.turning = np.array([self.mechanism.joint(name).turns for name in self.mechanism.actuated], bool)
        home = robot.home.base_from_tool if self.mechanism.tool is not None else np.eye(4)
        sizes = [float(np.linalg.norm(home[:3, 3]))]
        sizes += [
            float(np.nanmedian(np.linalg.norm(at[:, :3, 3], axis=1))) if np.isfinite(at).any() else 0.0
            for at in self.places(self.recording).values()
        ]
        self.reach = max(*sizes, LEAST_REACH)
        self.floor = np.array([CONVENTION_FINE * self.reach, CONVENTION_FINE])

    def places(self, recording: Recording) -> dict[str, Array]:
        """Return placements (n, 4, 4) of the tool ('') and the markers as drawn; NaN where the robot cannot be."""
        return self._drawn_at(recording)[1]

    def _drawn_at(self, recording: Recording) -> tuple[bytes, dict[str, Array], Array]:
        """Return the postures of a recording, as a key, what is drawn in them, and how far that is apart."""
        actuators = recording.actuator_positions(self.mechanism.actuated)
        key = actuators.tobytes()
        if key not in self._places:
            frames = {name: self.mechanism.frame(name) for name in self.frames}
            if self.mechanism.tool is not None:
                frames[""] = self.mechanism.tool
            found = {name: np.full((len(recording), 4, 4), np.nan) for name in frames}
            for row, pose in self._poses(actuators):
                for name, frame in frames.items():
                    found[name][row] = pose.placements[frame.joint] @ frame.placement
            self._places[key] = found, self._spread(recording, found)
        return key, *self._places[key]

    def beyond(self, recording: Recording) -> bool:
        """Return whether there are postures that the robot cannot be in."""
        return any(bool(np.isnan(at).any()) for at in self.places(recording).values())

    def _poses(self, actuators: Array) -> Iterator[tuple[int, ClosedPose]]:
        """Yield the postures that the robot can be in, by their places, until it cannot be in most of them."""
        lost = reached = 0
        for row, values in enumerate(actuators):
            if self.mechanism.loops and np.abs(values[self.turning]).max(initial=0.0) > 2 * np.pi:
                continue  # chains that close do not turn round and round
            try:
                pose = self.robot.pose_from_actuators(values)
            except PrupPinError:
                lost += 1
                if lost > reached + 1:
                    return
                continue
            reached += 1
            yield row, pose

    def misfit(self, recording: Recording, near: bool, fitted: np.ndarray | None = None) -> _Misfit:
        """Return how far measured poses are from the drawn ones.

        near: only a small frame of the sensor is taken away, else any; fitted (n,): postures by which it is fitted.
        """
        return self.misfits([recording], near, fitted)[0]

    def misfits(
        self,
        recordings: Sequence[Recording],
        near: bool,
        fitted: np.ndarray | None = None,
        joints: Recording | None = None,
    ) -> list[_Misfit]:
        """Return the misfits of readings of what one log measured, their joints as they are in `joints` where given."""
        if not recordings:
            return []
        k, n = len(recordings), len(recordings[0])
        at = [self._drawn_at(item) for item in recordings] if joints is None else k * [self._drawn_at(joints)]
        keys, places = [each[0] for each in at], [each[1] for each in at]
        fitted = np.ones(n, bool) if fitted is None else fitted
        squares, counts = np.zeros((2, k, n, 2))
        spreads = np.array([each[2] for each in at])
        names = [name for name in places[0] if _position(recordings[0], name) is not None]
        if names:
            seen = np.array([[_position(item, name) for name in names] for item in recordings])
            same = fitted.tobytes(), bytes((near,))
            keys = [b"".join((key, own.tobytes(), *same)) for key, own in zip(keys, seen, strict=True)]
            # readings of orientations leave positions as they are
            if new := {key: index for index, key in enumerate(keys) if key not in self._placed}:
                rows = list(new.values())
                drawn = np.array([[places[row][name] for name in names] for row in rows])
                found = positions_left(drawn, seen[rows], near, fitted, self.reach)
                self._placed.update(zip(new, found, strict=True))
            left = np.array([self._placed[key] for key in keys])
            known = np.isfinite(seen).any(axis=3)
            size = np.minimum(np.nan_to_num(left, nan=np.inf), 1e3 * self.reach) ** 2
            squares[..., 0], counts[..., 0] = np.where(known, size, 0.0).sum(axis=1), known.sum(axis=1)
            # a unit so small that all positions are one point is near to whatever can be one
            told, total = np.isfinite(seen), np.nan_to_num(seen).sum(axis=2, keepdims=True)
            off = np.where(told, seen - total / np.maximum(told.sum(axis=2, keepdims=True), 1), 0.0)
            spreads[:, 0] = np.minimum(spreads[:, 0], np.sqrt((off**2).sum(axis=(2, 3)) / n).max(axis=1))
        for name in places[0]:
            vectors = [item.marker_rotations.get(name) if name else item.rotation for item in recordings]
            if vectors[0] is None:  # a log has orientations however they are read
                continue
            seen, drawn = np.array(vectors), np.array([each[name][:, :3, :3] for each in places])
            known = np.isfinite(seen).all(axis=2)
            own = orientations_left(drawn, rotation_exp(np.nan_to_num(seen)), known & fitted, near)
            squares[..., 1] += np.where(known, np.nan_to_num(own, nan=np.pi), 0.0) ** 2
            counts[..., 1] += known
        with np.errstate(invalid="ignore"):
            apart = np.where(counts > 0, squares / counts, np.nan)
        return [_Misfit(*each) for each in zip(apart, spreads, strict=True)]

    def least_apart(self, recording: Recording, joints: Recording) -> float:
        """Return how far positions are from drawn ones at least, in any unit, axes and frames [m]; joints as there."""
        squares, count = 0.0, 0
        for name, at in self.places(joints).items():
            if (seen := _position(recording, name)) is not None:
                known = np.isfinite(seen).any(axis=1)
                squares += _least_squares(at[known], seen[known], 1e3 * self.reach)
                count += int(known.sum())
        return float(np.sqrt(squares / max(count, 1)))

    def ways(self, taken: Reading, asked: tuple[bool, bool]) -> list[tuple[Reading, Recording]]:
        """Return other readings of positions and orientations, where asked, beside those taken; joints as written."""
        if (taken, asked) not in self._ways:
            read, ways = read_as(self.recording, taken, self.drawn), []
            groups = [name for name, far in zip(("positions", "orientations"), asked, strict=True) if far]
            for reading in (each for some in readings(read, Columns(), *groups) for each in some):
                with suppress(PrupPinError):
                    ways.append((reading, read_as(read, reading, self.drawn)))
            self._ways[taken, asked] = ways
        return self._ways[taken, asked]

    def _spread(self, recording: Recording, places: dict[str, Array]) -> Array:
        """Return how far the drawn postures are apart: positions [m] and orientations [rad], root mean squares (2,).

        Of positions, in the components that were measured.
        """
        placed = {name: at[np.isfinite(at[:, 0, 0])] for name, at in places.items()}
        placed = {name: at for name, at in placed.items() if len(at)}
        if not placed:
            return np.zeros(2)
        ways = []
        for name, at in placed.items():
            seen = _position(recording, name)
            told = np.ones(3, bool) if seen is None else np.isfinite(seen).any(axis=0)
            ways.append(np.sqrt(((at[:, :3, 3] - at[:, :3, 3].mean(axis=0))[:, told] ** 2).sum(axis=1).mean()))
        turns = [turn_between(nearest_turns(at[:, :3, :3].sum(axis=0)), at[:, :3, :3]) for at in placed.values()]
        return np.array([max(ways), max(np.sqrt((turn**2).sum(axis=1).mean()) for turn in turns)])

    def fine(self, misfit: _Misfit) -> np.ndarray:
        """Return whether positions and orientations are as near to the drawing as a convention can tell (2,)."""
        return misfit.sizes <= 10 * self.floor

    def better(self, first: _Misfit, other: _Misfit, steps: int = 1) -> bool:
        """Return whether one of both leaves a third, for each step, and the other no more than before."""
        ratio = self._shares(other) / self._shares(first)
        return bool((ratio < FAR_LESS**steps).any() and (ratio < 1.3).all())

    def cost(self, misfit: _Misfit, words: int = 0) -> float:
        """Return the logarithm of what is left; each of so many words must leave far less."""
        return float(np.log(self._shares(misfit)).sum()) - words * float(np.log(FAR_LESS))

    def _shares(self, misfit: _Misfit) -> Array:
        """Return what is left as shares of the drawn motion, as small as a convention can tell: units shrink both."""
        return np.maximum(misfit.sizes, self.floor) / np.maximum(misfit.spread, self.floor)


def _position(recording: Recording, name: str) -> Array | None:
    """Return where a marker, or the tool (''), was measured."""
    return recording.markers.get(name) if name else recording.position


def _quietest(recording: Recording, mechanism: Mechanism, few: int) -> np.ndarray:
    """Return rows of different postures with a measured pose, each as little loaded as it was there; in order."""
    measured = np.zeros(len(recording), bool)
    for values in (recording.position, *recording.markers.values()):
        if values is not None:
            measured |= np.isfinite(values).any(axis=1)
    for values in (recording.rotation, *recording.marker_rotations.values()):
        if values is not None:
            measured |= np.isfinite(values).all(axis=1)
    known = [recording.positions[name] for name in mechanism.actuated if name in recording.positions]
    measured &= np.isfinite(np.column_stack(known)).all(axis=1) if known else False
    rows = np.flatnonzero(measured)
    load = np.nan_to_num(np.abs(recording.wrench[rows] @ np.diag([1, 1, 1, 5, 5, 5])).sum(axis=1), nan=np.inf)
    blocks = recording.blocks()[rows]
    order = np.lexsort((load, blocks))
    first = rows[order[np.r_[True, np.diff(blocks[order]) != 0]]] if len(rows) else rows
    return np.sort(first[evenly_spaced(len(first), few)]) if len(first) else first


def _least_squares(drawn: Array, seen: Array, far: float) -> float:
    """Return what any affine map of positions (n, 3) leaves of drawn ones, beside a target anywhere on its body.

    Units, axes and the sensor's frame are such maps. far: of where the robot cannot be.
    """
    there = np.isfinite(drawn[:, 0, 0])
    lost = float((~there).sum()) * far**2
    if not there.any() or not np.isfinite(seen).all():
        return lost
    linear = np.kron(np.column_stack((seen[there], np.ones(there.sum()))), np.eye(3))
    by = np.column_stack((linear, drawn[there, :3, :3].reshape(-1, 3)))
    aim = drawn[there, :3, 3].ravel()
    return lost + float(((aim - by @ np.linalg.lstsq(by, aim)[0]) ** 2).sum())


def conventions_of_poses(robot: Robot, recording: Recording, anywhere: bool) -> Evidence | None:
    """Return other ways in which positions, orientations and joints seem to be written; None where none does better.

    anywhere: the tolerances say that the sensor stands wherever it does.
    """
    postures = _Postures(robot, recording)
    written = postures.recording
    if not len(written):
        return None
    near, far = (postures.misfit(written, item) for item in (True, False))
    if postures.fine(near).all():
        return None
    best: Found[_Misfit] | None = None
    elsewhere, anyhow = far, _forward(postures, written, False)
    joints = tuple(item for item in anyhow.conventions if item.group == "q")
    # joints in other units hang on no sensor; where other axes or orders are told, one that stands elsewhere is as good
    sure = bool(joints and postures.fine(anyhow.score).all() and not postures.fine(far).all())
    sure = sure and not anyhow.others and not any(item.argument for item in anyhow.conventions)
    if sure:
        elsewhere = anyhow.score
    for by in (False,) if anywhere else (True, False):
        start, found = near if by else far, anyhow
        if by and sure:
            found = _of_measured(postures, read_as(written, joints, postures.drawn), True)
            found = found._replace(conventions=(*found.conventions, *joints))
        elif by:
            found = _forward(postures, written, True)
        found = _with_quarter_turns(postures, written, found, by)
        # what a unit makes small enough is near everything
        sense = found.score.sizes < FAR_LESS * found.score.spread
        if not found.conventions or not sense[_most_changed(postures, start, found.score)]:
            continue
        # a tracker that stands elsewhere is as good a reason, unless what is read so stands nearly as drawn
        reached = np.maximum(found.score.sizes, postures.floor)
        if by and (reached > 1.5 * np.maximum(elsewhere.sizes, postures.floor)).any():
            continue
        best = found
        break
    if best is None:
        return None
    conventions, read, misfit, others = best
    start = near if by else far
    column = _most_changed(postures, start, misfit)
    half = np.arange(len(written)) % 2 == 0
    held = [postures.misfit(item, by, half).squares[~half, column] for item in (written, read)]
    sums = [float(np.nansum(item)) for item in held]
    if not sums[1] < FAR_LESS * sums[0]:
        return None
    return Evidence(
        conventions,
        ("positions", "orientations")[column],
        ("m", "rad")[column],
        None if postures.beyond(written) and not postures.beyond(read) else float(start.sizes[column]),
        float(misfit.sizes[column]),
        1 - sums[1] / sums[0],
        others,
    )


def _most_changed(postures: _Postures, before: _Misfit, after: _Misfit) -> int:
    """Return which of positions (0) and orientations (1) is so many times nearer than before."""
    sizes = (np.maximum(item.sizes, postures.floor) for item in (before, after))
    return int(np.argmax(np.divide(*sizes)))


def _forward(postures: _Postures, written: Recording, near: bool) -> Found[_Misfit]:
    """Return conventions that each leave far less than before.

    Nobody measures in a mirror: joints that were exchanged or turned round, which show the same, are told before.
    """
    found = _of_all(postures, written, near)
    if not any(_is_mirror(item) for item in found.conventions):
        return found
    plain = _of_all(postures, written, near, mirrors=False)
    costs = [postures.cost(each.score, len(each.conventions)) for each in (plain, found)]
    if costs[0] > costs[1] + np.log(AS_GOOD):
        return found
    return plain._replace(others=(*plain.others, found.conventions))


def _of_all(postures: _Postures, written: Recording, near: bool, mirrors: bool = True) -> Found[_Misfit]:
    """Return conventions that each leave far less than before, left-handed axes among them or not.

    Where the tool is drawn to be hangs on the joints alone, and positions and orientations are each compared with that.
    So joints are read in one way after the other, each beside the readings of both that suit it best: whichever of the
    three are written otherwise together, they are found.
    """
    columns, as_good = _columns(postures, written), float(np.log(AS_GOOD))

    def cost(found: _Read, joints: Reading = ()) -> float:
        return postures.cost(found.score, len(found.conventions) + len(joints))

    def tries(
        read: Recording, now: _Read, taken: Reading, first: Tried[_Read] | None, only: Reading
    ) -> list[Tried[_Read]]:
        tried: list[Tried[_Read]] = []
        begin, ahead, measured = (read, (), ()) if first is None else (first.read, first.reading, first.beside)
        second = bool(first or taken)
        for some in [[only]] if only else readings(written, columns, "joints", *["zeros"] * second, second=second):
            if any(
                postures.fine(each).all() for each in (now.score, *(item.score.score for item in tried if item.wins))
            ):
                break  # rarer ways do no better
            ways: list[tuple[Reading, Recording]] = []
            for reading in some:
                with suppress(PrupPinError):
                    ways.append((reading, read_as(begin, reading, postures.drawn)))
            misfits = postures.misfits([read_as(other, measured, postures.drawn) for _, other in ways], near)
            asked = list(zip(ways, misfits, strict=True))
            if first:
                asked = sorted(asked, key=lambda way: postures.cost(way[1]))[:FEW_ROUNDS]
            for (reading, other), misfit in asked:
                found = _of_measured(postures, other, near, mirrors, None if measured else misfit)
                whole = (*ahead, *reading)
                wins = postures.better(now.score, found.score, 1 + bool(ahead)) and cost(found) < cost(now)
                tried.append(Tried(cost(found, (*taken, *whole)), whole, other, found, found.conventions, wins))
        return tried

    joints = likeliest(written, _of_measured(postures, written, near, mirrors), tries, as_good, FEW_ROUNDS)
    seen = joints.score
    others = (*joints.others, *((*other, *joints.conventions) for other in seen.others))
    return Found((*seen.conventions, *joints.conventions), seen.read, seen.score, others)


def _columns(postures: _Postures, written: Recording) -> Columns:
    names = [name for name in written.positions if name in postures.mechanism.actuated]
    return Columns.of(postures.mechanism, written, names)


def _is_mirror(convention: Convention) -> bool:
    """Return whether positions or orientations are told in left-handed axes."""
    of_axes = convention.word == "axes" and convention.group in ("p", "r")
    return of_axes and not is_right_handed([str(axis) for axis in convention.argument])


def _of_measured(
    postures: _Postures, joints: Recording, near: bool, mirrors: bool = True, written: _Misfit | None = None
) -> Found[_Misfit]:
    """Return readings of positions and orientations that each leave far less than before; the joints as they are.

    written: the misfit of the log as it is written, where it is known.
    """

    def tries(
        read: Recording, now: _Misfit, taken: Reading, first: Tried[_Misfit] | None, only: Reading
    ) -> list[Tried[_Misfit]]:
        far = ~postures.fine(now)
        if far[0]:
            far[0] = postures.least_apart(read, joints) < FAR_LESS * now.sizes[0]
        ahead = first.reading if first else ()
        ways = [
            way
            for way in postures.ways((*taken, *ahead), (bool(far[0]), bool(far[1])))
            if (mirrors or not _is_mirror(*way[0])) and (not only or way[0] == only)
        ]
        misfits = postures.misfits([other for _, other in ways], near, joints=joints)
        return [
            Tried(postures.cost(misfit), (*ahead, *reading), other, misfit, wins=postures.better(now, misfit))
            for (reading, other), misfit in zip(ways, misfits, strict=True)
        ]

    written = postures.misfit(joints, near) if written is None else written
    found = likeliest(joints, written, tries, float(np.log(AS_GOOD)))
    return found._replace(read=read_as(joints, found.conventions, postures.drawn))


def _with_quarter_turns(postures: _Postures, written: Recording, found: Found[_Misfit], near: bool) -> Found[_Misfit]:
    """Return what was found, or joints that count from elsewhere in its place, where they leave far less.

    What is so near to the drawing counts from where that does.
    """
    if (found.score.sizes <= FAR_LESS * found.score.spread).all():
        return found
    measured = tuple(item for item in found.conventions if item.group != "q")
    begin = read_as(written, measured, postures.drawn)
    few, columns = begin.select(evenly_spaced(len(written), _POSTURES)), _columns(postures, written)

    def tries(read: Recording, now: _Misfit, *_: object) -> list[Tried[_Misfit]]:
        ways = [each for some in readings(written, columns, "zeros") for each in some]
        others = [read_as(read, way, postures.drawn) for way in ways]
        tried = []
        for way, other, misfit in zip(ways, others, postures.misfits(others, near), strict=True):
            cost = postures.cost(misfit) - len(way) * float(np.log(MOSTLY))
            tried.append(Tried(cost, way, other, misfit, wins=cost < postures.cost(now)))
        return tried

    turns = likeliest(few, postures.misfit(few, near), tries, 0.0).conventions
    read = read_as(begin, turns, postures.drawn)
    misfit = postures.misfit(read, near)
    if not postures.better(found.score, misfit):
        return found
    return Found((*measured, *merged(turns, columns.q, ())), read, misfit)
