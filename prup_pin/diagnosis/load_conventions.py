"""Is the wrench of a log written as it says? Other ways compete before any physics does.

What changes while the actuators stand still, against the drawn compliance with each module as soft as suits best, which
no bench knows better. A convention is told where it leaves a third of what the log leaves as it is written, on blocks
that were held out too; and clearly less than that where one place, the base or a module, yields besides in proportion
to its load: what lies in series with all else does what another unit of forces does. Where no convention does, the same
is asked beside a play in one place, unless that explains most of the log as it is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear, nnls

from ..laws import LAWS, Effect, Inputs
from ..loaded import FirstOrder
from ..recordings import Convention, Drawn, Recording, read_as
from ..recordings.conventions import Evidence, may_be_read
from ..robot import Robot
from ..simulation import Simulator
from ..spatial import Array, base_wrench_from_point, cross, rotation_exp, turn_between
from .chances import chi2_median
from .criteria import (
    ANYHOW,
    AS_GOOD,
    CHANCE_DEVIATIONS,
    COARSE,
    FAR_LESS,
    FEW_ROUNDS,
    FEWEST_IN_BLOCK,
    GAIN,
    LEVER,
    LITTLE,
    MOST,
    MUCH,
    NOTHING,
    ROUNDING,
    ROUNDS,
    SURE,
    UNSEEN,
    trusted,
)
from .gross_errors import far_off
from .readings import Columns, Reading, Tried, likeliest, readings
from .rigid_fit import rigid_fit
from .thinning import evenly_spaced

#: Blocks and samples by which loads are judged; of which one block in so many shows what no reading leaves.
_BLOCKS, _SAMPLES, _BOUNDED = 24, 400, 4


@dataclass(frozen=True, eq=False)
class _Loaded:
    """Samples (n) of a loaded tool: what moves it, by module, and how it moved (n, 6) while the actuators stood still.

    parts (m, n, 6, 6): compliance of each module; places: what carries a load on the tool to each module (k, n, 6), and
    to the base; seen (n, 6, 6): how the sensor shows what moves the tool; free: takes away what stands still, or what
    frames could do; noise: squares of what is moved that declared noise makes; at_rest: simulates what each place
    carries beside the wrench (k, n); resting: that, where places may have play as well.
    """

    parts: Array
    places: tuple[Array, ...]
    seen: Array
    moved: Array
    wrench: Array
    tool: Array
    blocks: np.ndarray
    free: Callable[[Array], Array]
    noise: float
    at_rest: Callable[[], tuple[Array, ...]]
    resting: tuple[Array, ...] = ()

    @property
    def shown(self) -> float:
        """Squares beyond the noise below which nothing shows: by chance, or where no noise is declared."""
        if self.noise:
            return CHANCE_DEVIATIONS * float(np.sqrt(2 / self.moved.size)) * self.noise
        return GAIN**2 * float((self.free(self.moved) ** 2).sum())

    @property
    def by_chance(self) -> float:
        """Squares beyond the noise that may be no more than chance."""
        return SURE / CHANCE_DEVIATIONS * self.shown if self.noise else self.shown

    def select(self, rows: np.ndarray) -> _Loaded:
        return replace(
            self, parts=self.parts[:, rows], places=tuple(each[:, rows] for each in self.places),
            resting=tuple(each[:, rows] for each in self.resting), seen=self.seen[rows],
            moved=self.moved[rows], wrench=self.wrench[rows], tool=self.tool[rows],
            blocks=self.blocks[rows], free=_freed(self.blocks[rows]),
            noise=self.noise * len(self.wrench[rows]) / len(self.wrench),
            at_rest=lambda: tuple(each[:, rows] for each in self.at_rest()),
        )  # fmt: skip

    def leaves(self, wrench: Array, least: float) -> bool:
        """Return whether a wrench leaves such squares, however soft all modules are, and a place by any number."""
        basis = np.linalg.qr(self.by_module(wrench))[0]
        rest = _beside(basis, self.free(self.moved).ravel())
        for place in range(len(self.places)):
            own = np.linalg.qr(_beside(basis, self.by_place(wrench, place)))[0]
            if float((_beside(own, rest) ** 2).sum()) < least:
                return False
        return True

    def by_module(self, wrench: Array) -> Array:
        """Return how far each module moves the tool (6 n, m) under wrenches (n, 6)."""
        moved = self.free((self.parts @ wrench[None, :, :, None])[..., 0].transpose(1, 2, 0))
        return moved.reshape(-1, len(self.parts))

    def motions(self, wrench: Array, place: int | None) -> Array:
        """Return how far each module, and a place, move the tool (6 n, m + k) under wrenches (n, 6)."""
        modules = self.by_module(wrench)
        return modules if place is None else np.concatenate((modules, self.by_place(wrench, place)), axis=1)

    def by_channel(self, wrench: Array, softness: Array) -> Array:
        """Return how a share of each force in each, and of each moment, moves the tool (6 n, 18), modules as soft."""
        whole = np.tensordot(softness, self.parts, 1)
        pairs = [(i, j) for half in (0, 3) for i in range(half, half + 3) for j in range(half, half + 3)]
        moved = self.free(np.stack([whole[:, :, i] * wrench[:, j, None] for i, j in pairs], axis=-1))
        return moved.reshape(-1, len(pairs))

    def by_place(self, wrench: Array, place: int) -> Array:
        """Return how a place moves the tool that yields along each of its loads (6 n, k), by a play too or not."""
        carried = self.places[place]
        loads = (carried * wrench).sum(axis=2)
        laws = [loads, *(np.sign(loads + each) for each in self.resting[place : place + 1])]
        deformed = np.concatenate([along[..., None] * carried for along in laws])
        moved = (self.seen @ deformed[..., None])[..., 0]
        if place < len(self.parts):  # coupled as it is drawn
            moved = np.concatenate((moved, (self.parts[place] @ wrench[..., None])[None, ..., 0]))
        return self.free(moved.transpose(1, 2, 0)).reshape(-1, len(moved))


def conventions_of_loads(robot: Robot, recording: Recording) -> Evidence | None:
    """Return other ways in which the wrench seems to be written; None where none does far better.

    recording: whose other columns are in the format's own conventions.
    """
    loaded = _loaded(robot, recording)
    if loaded is None or not loaded.free(loaded.moved).any():
        return None
    found = _better_read(loaded, recording)
    if found is not None or _left(loaded, loaded.wrench).yielding < loaded.shown:
        return found
    return _better_read(replace(loaded, resting=loaded.at_rest()), recording)


def _better_read(loaded: _Loaded, recording: Recording) -> Evidence | None:
    """Return other ways in which the wrench seems to be written, a place yielding besides, by a play too or not."""
    drawn = Drawn(tool=lambda _: loaded.tool)
    begin = Recording(time=np.arange(len(loaded.wrench), dtype=float), wrench=loaded.wrench)
    as_written = _left(loaded, loaded.wrench)
    if as_written.yielding < loaded.shown:
        return None
    alike = loaded.by_chance
    labels = np.unique(loaded.blocks, return_inverse=True)[1]
    rows = labels % _BOUNDED == 0
    few = loaded.select(rows)  # which leave no more than all
    firsts = 0 if loaded.resting else FEW_ROUNDS

    def tries(
        now: Recording, least: _Left, taken: Reading, first: Tried[_Left] | None, only: Reading
    ) -> list[Tried[_Left]]:
        """What is nearly as good as the best is told by the commonest word; a point is no other way to say another."""
        tried: list[Tried[_Left]] = []
        steps = 1 + (first is not None)
        enough = least.beaten_by(steps) + loaded.noise
        ways = chain(
            readings(recording, Columns(), "wrench", second=first is not None),
            [] if first else [_of_wrench_point(loaded, now.wrench, recording)],
        )
        for some in [[only]] if only else ways:
            for reading in some:
                other = read_as(first.read if first else now, reading, drawn)
                if (first or not firsts) and few.leaves(other.wrench[rows], enough):
                    continue  # nor is it one of the nearest, beside which another is asked
                whole = (*first.reading, *reading) if first else reading
                left = _left(loaded, other.wrench)
                tried.append(Tried(left.yielding, whole, other, left, wins=left.tells_against(least, steps)))
            best = min((item.score for item in tried), key=lambda left: left.yielding, default=least)
            if best.yielding < alike and best.tells_against(least, steps):
                break  # a commoner word does
        near = max(AS_GOOD * best.yielding, alike)
        told = next((item for item in tried if item.wins and item.score.yielding <= near), None)
        if told is None:
            return [item._replace(wins=False) for item in tried]
        # of units that are as good that by which most modules are as soft as drawn: kgf and daN are 2 % apart
        same = [item for item in tried if item.wins and item.score.yielding <= near and _of_unit(item, told)]
        told = min(same, key=lambda item: round(item.score.off, 2), default=told)
        near = max(AS_GOOD**2 * told.score.yielding, alike)
        others = (item for item in tried if item.score.yielding <= near and not item.reading[0].argument)
        return [told._replace(cost=0.0), *(item._replace(cost=1.0, wins=True) for item in others if item is not told)]

    found = likeliest(begin, as_written, tries, 2.0, firsts)
    if not found.conventions:
        return None
    half = np.unique(loaded.blocks, return_inverse=True)[1] % 2 == 0
    if half.all() or (~half).sum() < FEWEST_IN_BLOCK or half.sum() < FEWEST_IN_BLOCK:
        half = np.arange(len(half)) % 2 == 0
    written, read = (_left(loaded, item, half) for item in (loaded.wrench, found.read.wrench))
    judged = loaded.select(~half)
    if not (read.tells_against(written) or read.yielding < judged.by_chance < judged.shown < written.yielding):
        return None
    size = float((loaded.free(loaded.moved) ** 2).sum())
    before, after = (float(np.sqrt(item.yielding / size)) for item in (as_written, found.score))
    saved = 1 - read.yielding / written.yielding
    return Evidence(found.conventions, "what loads move", "", before, after, saved, found.others)


def _of_unit(item: Tried[_Left], told: Tried[_Left]) -> bool:
    """Return whether two readings are of units of the same columns."""
    both = [[each for each in one.reading if each.meaning.factor] for one in (item, told)]
    return all(both) and [each.columns for each in both[0]] == [each.columns for each in both[1]]


def _loaded(robot: Robot, recording: Recording) -> _Loaded | None:
    mechanism = robot.mechanism
    if mechanism.tool is None or not mechanism.modules or not recording.has_wrench:
        return None
    actuators = recording.actuator_positions(mechanism.actuated)
    good = np.isfinite(actuators).all(axis=1) & np.isfinite(recording.wrench).all(axis=1)
    position = np.full((len(recording), 3), np.nan) if recording.position is None else recording.position
    vector = np.full((len(recording), 3), np.nan) if recording.rotation is None else recording.rotation
    seen = np.isfinite(np.column_stack((position, vector)))
    seen[:, 3:] = seen[:, 3:].all(axis=1, keepdims=True)  # one component tells nothing of a turn
    good &= seen.any(axis=1)
    blocks = recording.blocks()
    sizes = np.bincount(blocks)
    good &= sizes[blocks] > 2  # what stands still is told from what loads move
    if good.sum() < FEWEST_IN_BLOCK:
        return None
    several = np.unique(blocks[good])
    most = max(_BLOCKS, int(_SAMPLES * len(several) / good.sum()))
    chosen = several[evenly_spaced(len(several), most)]
    rows = np.flatnonzero(good & np.isin(blocks, chosen))
    rows = rows[:: max(1, len(rows) // _SAMPLES)]
    inputs = Inputs(recording.time[rows], actuators[rows], recording.wrench[rows], blocks[rows])
    simulator = Simulator(robot, inputs)
    geometry = simulator.geometry({})
    there = np.flatnonzero(geometry.reachable)
    if len(there) < FEWEST_IN_BLOCK:
        return None
    run = simulator.run(())
    rows, at = rows[there], geometry.rows[there]
    used, which = np.unique(at, return_inverse=True)
    each = [robot.compliance(geometry.poses[pose]) for pose in used]
    names = [name for name in each[0].parts if any(np.abs(item.parts[name]).max() > 0 for item in each)]
    if not names:
        return None
    parts = np.array([[item.parts[name] for item in each] for name in names])[:, which]
    places = [np.array([item.wrench_jacobians[name] for item in each])[which].swapaxes(0, 1) for name in names]
    tool = np.array([geometry.poses[pose].base_from_tool for pose in used])[which]
    wrench = recording.wrench[rows]

    def at_rest() -> tuple[Array, ...]:
        idle = FirstOrder(Simulator(robot, replace(inputs, wrench=0 * inputs.wrench)).run(_weight(robot)).equilibria)
        return (*(np.nan_to_num(idle.loads(name).T) for name in names), np.zeros(places[-1].shape[:2]))

    exists = seen[rows]
    weight = np.where(exists, 1 / np.array(COARSE), 0.0)
    bent = _moved(tool, run.position[there], run.rotation[there]) - (parts.sum(axis=0) @ wrench[..., None])[..., 0]
    # along the sensor's axes, of whose positions not every component may have been measured
    turn, shift = _stands(tool, position[rows])
    along = np.kron(np.eye(2), turn)
    parts, bent = along @ parts, bent @ along.T
    turned = turn_between(tool[:, :3, :3], turn.T @ rotation_exp(np.nan_to_num(vector[rows]))) @ turn.T
    moved = np.concatenate((position[rows] - shift - tool[:, :3, 3] @ turn.T, turned), axis=1)
    places.append(base_wrench_from_point(tool[:, :3, 3]).swapaxes(0, 1))
    parts = parts * weight[None, :, :, None]
    noise = _noise_of(recording, parts.sum(axis=0), weight, exists) * (1 - len(np.unique(blocks[rows])) / len(rows))
    moved, bent = (np.where(exists, values, 0.0) * weight for values in (moved, np.nan_to_num(bent)))
    loaded = _Loaded(
        parts, tuple(places), weight[:, :, None] * along, moved, wrench, tool, blocks[rows], _freed(blocks[rows]),
        noise, at_rest,
    )  # fmt: skip
    kept = _borne_out(loaded)
    loaded, bent, wrench = loaded.select(kept), bent[kept], wrench[kept]
    # what large deflections add to C w is much the same however the wrench is read, unless it is read far too large:
    # then it is more than all that moved
    if (loaded.free(bent) ** 2).sum() > MOST * (loaded.free(loaded.moved) ** 2).sum():
        return loaded
    other = replace(loaded, moved=loaded.moved - bent)
    return min(loaded, other, key=lambda item: _left(item, wrench).yielding)


def _borne_out(loaded: _Loaded) -> np.ndarray:
    """Return which samples are no gross errors, (n,): whatever yields to its loads, others bear them out.

    The farthest in a posture is left out first, since the mean of that posture's samples has a part of it.
    """
    kept = np.ones(len(loaded.wrench), bool)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(kept)
        here = loaded.select(rows)
        squares = _squares_of_any_softness(here)
        if squares is None:
            break
        far = np.zeros(len(rows), bool)
        for unit in squares.T:
            worst = np.zeros(here.blocks.max() + 1)
            np.maximum.at(worst, here.blocks, unit)
            far |= far_off(unit)[0] & (unit == worst[here.blocks])
        kept[rows[far]] = False
        if not far.any():
            break
    return kept if (~kept).sum() <= LITTLE * len(kept) else np.ones(len(kept), bool)


def _squares_of_any_softness(loaded: _Loaded) -> Array | None:
    """Return what is left of each sample's shift and turn, squared (n, 2), whatever place yields to any of its loads.

    What is far off weighs little. None where the samples are too few to say.
    """
    ways = [loaded.by_module(loaded.wrench)]
    ways += [loaded.by_place(loaded.wrench, place) for place in range(len(loaded.places))]
    columns, target = np.concatenate(ways, axis=1), loaded.free(loaded.moved).ravel()
    if len(target) < 2 * columns.shape[1]:
        return None
    weights = np.ones((len(loaded.wrench), 2))
    for _ in range(FEW_ROUNDS):
        white = np.repeat(np.sqrt(weights), 3, axis=1).ravel()
        found = np.linalg.lstsq(columns * white[:, None], target * white, rcond=ROUNDING)[0]
        squares = ((target - columns @ found).reshape(-1, 2, 3) ** 2).sum(axis=2)
        weights = trusted(squares * chi2_median(3) / np.maximum(np.median(squares, axis=0), NOTHING**2))
    return squares


def _weight(robot: Robot) -> list[Effect]:
    """Return what weighs on a robot beside any wrench: its own links, where they have masses."""
    weights = ((law, place) for law in LAWS if law.weighs for place in law.places(robot.mechanism))
    return [Effect(law, place, law.starts(place, robot.mechanism)[0]) for law, place in islice(weights, 1)]


def _stands(tool: Array, position: Array) -> tuple[Array, Array]:
    """Return the turn (3, 3) and shift (3,) of a sensor that sees positions (n, 3): it may stand beside the base.

    Loads move what a turned sensor sees along other axes than their own. tool (n, 4, 4): the drawn poses. A component
    that was not measured is where the others put it.
    """
    here = np.eye(3), np.zeros(3)
    told = np.isfinite(position)
    rows = told.any(axis=1)
    own, turns, seen = tool[rows, :3, 3], tool[rows, :3, :3], position[rows]
    told = told[rows]
    turn, shift = here
    for _ in range(1 if told.all() else ROUNDS):
        full = np.where(told, seen, own @ turn.T + shift)
        plain, beside = (rigid_fit([(own, turns, full)], aside) for aside in (False, True))
        if plain is None or beside is None:
            return here
        fit = beside if beside.after < FAR_LESS * plain.after else plain
        if not fit.after < MOST * fit.before:
            return here
        turn, shift = fit.turn, fit.shift
    return turn, shift


def _moved(tool: Array, position: Array, rotation: Array) -> Array:
    """Return how far poses (n, 3), (n, 3, 3) lie from the drawn ones (n, 4, 4), positions and turns (n, 6)."""
    return np.concatenate((position - tool[:, :3, 3], turn_between(tool[:, :3, :3], rotation)), axis=1)


def _noise_of(recording: Recording, whole: Array, weight: Array, exists: np.ndarray) -> float:
    """Return the squares that declared noise of poses and wrench gives weighted motions (n, 6); 0: undeclared."""
    noise = recording.noise
    if not (noise.position and noise.rotation):
        return 0.0
    poses = weight**2 * np.where(exists, np.repeat([noise.position, noise.rotation], 3) ** 2, 0.0)
    loads = whole**2 @ np.repeat([noise.force or 0.0, noise.moment or 0.0], 3) ** 2
    return float((poses + loads).sum())


def _freed(blocks: np.ndarray) -> Callable[[Array], Array]:
    """Return what takes away the mean of each block of values (n, ...)."""
    labels = np.unique(blocks, return_inverse=True)[1].ravel()
    mean = (labels == np.arange(labels.max(initial=0) + 1)[:, None]).astype(float)
    mean /= mean.sum(axis=1, keepdims=True)

    def free(values: Array) -> Array:
        return values - (mean @ values.reshape(len(values), -1))[labels].reshape(values.shape)

    return free


class _Left(NamedTuple):
    """Squares beyond noise that a wrench leaves: modules as soft as suits, and one place yielding besides, by a play or
    in proportion alone. off: how far the logarithm of the modules' softness lies from nothing, in the median."""

    softened: float
    yielding: float
    play: bool
    off: float = 0.0

    def tells_against(self, other: _Left, steps: int = 1) -> bool:
        """Return whether another wrench leaves drastically more than this, and is not as good where a place yields.

        steps: how many were taken, each of which must leave so much less.
        """
        return self.yielding < other.beaten_by(steps)

    def beaten_by(self, steps: int = 1) -> float:
        """Return the squares below which what another wrench leaves tells against this one, as in `tells_against`.

        A play that explains nearly all of a log as it is written is what it is: what it leaves tells of no reading.
        """
        if self.play and not LITTLE * self.softened < self.yielding:
            return 0.0
        worse = self.yielding if self.play else self.softened
        return min(FAR_LESS ** (2 * steps) * worse, self.yielding / AS_GOOD**steps)


def _left(loaded: _Loaded, wrench: Array, fitted: np.ndarray | None = None) -> _Left:
    """Return what a wrench leaves. fitted (n,): samples by which softness is found, of all but which that is left."""
    fit, judged = (loaded, loaded) if fitted is None else (loaded.select(fitted), loaded.select(~fitted))
    load, other = (wrench, wrench) if fitted is None else (wrench[fitted], wrench[~fitted])
    target = judged.free(judged.moved).ravel()
    both = _likeliest(fit, load)
    rests = [target - judged.motions(other, suits.place) @ suits.softness for suits in both]
    # a sensor whose channels are off a little, and talk across, imitates a point of its moments
    table = fit.by_channel(load, both[0].softness)
    normal, least = table.T @ table, GAIN * float(both[0].left @ both[0].left) / LITTLE**2
    least += ROUNDING * float(np.trace(normal)) + np.finfo(float).tiny  # channels that no load asks, of exact data
    shares = np.linalg.solve(normal + least * np.eye(len(normal)), table.T @ both[0].left)
    rests.append(rests[0] - judged.by_channel(other, both[0].softness) @ shares)
    squares = [max(float(rest @ rest) - judged.noise, 0.0) for rest in rests]
    off = abs(float(np.log(np.median(both[0].softness[: len(loaded.parts)]))))
    return _Left(squares[0], min(squares), bool(loaded.resting), off)


@dataclass(frozen=True, eq=False)
class _Suits:
    """What suits a wrench best: softness (m + k,) of modules and of a place, and about which point (c,) moments are.

    left: what is left of what moved (6 n,). trust: how much what is known of each module's softness weighs (m,).
    """

    place: int | None
    softness: Array
    point: Array
    left: Array
    trust: Array


def _likeliest(loaded: _Loaded, wrench: Array, levers: Array | None = None) -> tuple[_Suits, _Suits]:
    """Return what suits a wrench best: each module softer or stiffer; and the place that takes most yielding besides.

    A unit of all forces is imitated by what lies in series with everything: a drive, the base. levers (c, n, 6): what
    a wrench changes per unit of the place of the point about which moments are told [m].
    """
    levers = np.zeros((0, *wrench.shape)) if levers is None else levers
    plain = _suiting(loaded, wrench, levers, None)
    read = wrench + np.tensordot(plain.point, levers, 1)
    modules = np.concatenate((loaded.motions(read, None), np.diag(plain.trust)))
    base = np.linalg.qr(modules)[0]
    known = plain.trust * (1 - plain.softness)
    rest = _beside(base, np.append(plain.left, known))
    left = []
    for place in range(len(loaded.places)):
        whole = loaded.by_place(read, place)
        columns = _beside(base, np.concatenate((whole, np.zeros((len(known), whole.shape[1])))))
        small = np.asarray(np.linalg.qr(np.column_stack((columns, rest)), mode="r"))
        scale = _scale(small[:, :-1], float(np.linalg.norm(whole, axis=0).max(initial=0.0)))
        left.append(nnls(small[:, :-1] / scale, small[:, -1])[1])
    return plain, _suiting(loaded, wrench, levers, int(np.argmin(left)))


def _beside(basis: Array, values: Array) -> Array:
    return values - basis @ (basis.T @ values)


def _scale(columns: Array, largest: float) -> Array:
    """Return what makes columns (n, k) unit ones; infinite where one is rounding, beside the largest, and is none."""
    size = np.linalg.norm(columns, axis=0)
    return np.where(size > ROUNDING * largest, size, np.inf)


def _suiting(loaded: _Loaded, wrench: Array, levers: Array, place: int | None) -> _Suits:
    """Return what suits best where one place yields, or none does."""
    whole = np.stack([loaded.motions(each, place) for each in (wrench, *levers)], axis=-1)
    full, target = whole[..., 0], loaded.free(loaded.moved).ravel()
    small = np.asarray(np.linalg.qr(np.column_stack((whole.reshape(len(target), -1), target)), mode="r"))
    columns = small[:, :-1].reshape(len(small), *whole.shape[1:])
    modules, count, points = len(loaded.parts), whole.shape[1], len(levers)
    goal, now = small[:, -1], columns[..., 0]
    scale = _scale(now, float(np.linalg.norm(now, axis=0).max(initial=0.0)))
    scale[:modules] = 1.0
    columns = columns / scale[:, None]
    bounds = (
        np.concatenate((np.full(modules, 1 / MUCH), np.zeros(count - modules), np.full(points, -np.inf))),
        np.concatenate((np.full(modules, MUCH), np.full(count - modules + points, np.inf))),
    )
    softness, point = np.concatenate((np.ones(modules), np.zeros(count - modules))), np.zeros(points)
    start = np.concatenate((softness, point))
    trust = np.zeros(count + points)
    for _ in range(ROUNDS):
        now = columns[..., 0] + columns[..., 1:] @ point
        slopes = np.einsum("nmk,m->nk", columns[..., 1:], softness)
        noise2 = max(float(((goal - now @ softness) ** 2).sum()) / len(target), 1e-6)
        trust[:modules] = np.sqrt(noise2 * trusted(((softness[:modules] - 1) / ANYHOW) ** 2)) / ANYHOW
        trust[count:] = np.sqrt(noise2) / LEVER
        table = np.concatenate((np.concatenate((now, slopes), axis=1), np.diag(trust)))
        found = lsq_linear(table, np.append(goal + slopes @ point, trust * start), bounds, method="bvls").x
        softness, point, before = found[:count], found[count:], np.append(softness, point)
        if np.abs(found - before).max() < UNSEEN:
            break
    left = target - (full + whole[..., 1:] @ point) @ (softness / scale)
    return _Suits(place, softness / scale, point, left, trust[:modules])


def _of_wrench_point(loaded: _Loaded, wrench: Array, recording: Recording) -> Iterator[Reading]:
    """Yield that moments are about the point that fits best, in the tool's axes from the tool point [m]."""
    levers = np.zeros((3, *wrench.shape))
    for lever, axis in zip(levers, np.eye(3), strict=True):
        lever[:, 3:] = cross(loaded.tool[:, :3, :3] @ axis, wrench[:, :3])
    if any(loaded.by_module(lever).any() for lever in levers):
        point = _likeliest(loaded, wrench, levers)[1].point
        reading = (Convention("wrench", "about", tuple(float(round(value, 5)) for value in point)),)
        yield from [reading] if may_be_read(recording, reading) else []
