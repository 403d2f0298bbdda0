"""A pose under load: where the tool went, how stiff it is, what its modules carry, how far it is from buckling.

The load is dead: force and moment keep their components in base axes while the tool moves and turns. A moment that
keeps its axes does work that depends on the way the tool turns, so under one the tangent compliance is not symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, NotConvergedError
from ..kernel import NEGLIGIBLE, NEGLIGIBLE_ENERGY
from ..kinematics import ClosedPose
from ..mechanism import Mechanism
from ..modules import CompliantModule, DriveModule
from ..numbers import number
from ..spatial import Array, as_wrench, motion_between
from ..statics.compliance import _Named, no_stiffness
from .border import inverted, no_border
from .chain import Chain
from .derivative import frame_columns, load_columns
from .equilibrium import Equilibria, find_equilibria
from .first_order import FirstOrder
from .state import Conditions

#: Where nothing gives way up to this factor, `buckling_margin` returns infinity.
LIMIT = 1e4
#: A load that changes the derivative by no more than this share of itself is not followed from zero.
_SAFE = 0.3
#: A load that moves nothing farther than this is not either [m, rad].
_LITTLE_MOTION = 0.2
#: Share of a load that linear theory sees.
_LITTLE = 1e-4
#: A step of a load path moves nothing farther than this [m, rad].
_LONGEST_STEP = 0.5
#: Each step of a load path may be this much longer than the one before.
_GROWTH = 1.5
#: A load step that fails is halved until it is this share of the load.
_SMALLEST_STEP = 1e-4
_MOST_STEPS = 200
#: Relative accuracy of a critical load, and what is accepted where its neighbourhood cannot be entered.
_SHARP, _BLUNT = 1e-9, 1e-5
#: A load step may not change the derivative by more, or critical loads could hide in it.
_MUCH = 1.0
#: Eigenvalues this close to the real axis are real but for rounding.
_REAL = 1e-6
#: Smallest motion that tells one equilibrium from another [m, rad].
_APART = 1e-8
#: Gauss points of a load step.
_GAUSS = 4


@dataclass(frozen=True)
class Energy:
    """Energies of a load path from zero [J].

    `stored` in all modules, `work` of the tool's wrench and of the weight, `dissipated` by what resists in the joints.
    """

    stored: float
    work: float
    dissipated: float

    @property
    def balance(self) -> float:
        """What is left over, work - stored - dissipated [J]: zero but for rounding and the quadrature of the path."""
        return self.work - self.stored - self.dissipated


@dataclass(frozen=True, eq=False, repr=False)
class LoadedPose:
    """The equilibrium of a robot at a pose under a dead wrench on the tool. SI units, base axes."""

    pose: ClosedPose
    wrench: Array
    _equilibria: Equilibria
    _scaling: Array

    # -- where the tool went ---------------------------------------------------------------------------------------

    @cached_property
    def base_from_tool(self) -> Array:
        """Placement of the tool under load, (4, 4)."""
        return _frozen(self._equilibria.tool[0])

    @cached_property
    def displacement(self) -> Array:
        """Translation of the tool and rotation vector of its turn since the rigid pose, (6,) [m, rad], base axes."""
        return _frozen(motion_between(self.pose.base_from_tool, self._equilibria.tool[0]))

    @property
    def placements(self) -> Array:
        """base_from_joint of every joint under load, (joints, 4, 4), in the order of Pinocchio's model."""
        return _frozen(self._equilibria.evaluation.placements[0])

    @cached_property
    def first_order(self) -> FirstOrder:
        """What a small change of the robot does to the tool here, to first order."""
        return FirstOrder(self._equilibria)

    def placement(self, frame: str) -> Array:
        """Return base_from_frame (4, 4) of a named frame under load. Raises UnknownNameError."""
        return self.pose.mechanism.frame(frame).at(self.placements)

    # -- how stiff it is there -------------------------------------------------------------------------------------

    @cached_property
    def C(self) -> Array:  # noqa: N802 - the field's symbol
        """Tangent compliance at the load, (6, 6): more translation and turn of the tool per more wrench.

        Both in base axes; the turn is the small rotation that follows the one so far, not a change of its vector.
        """
        return _frozen(self._equilibria.tangent_compliance()[0])

    @cached_property
    def K(self) -> Array:  # noqa: N802 - the field's symbol
        """Tangent stiffness, the inverse of C, (6, 6). Raises NoStiffnessError where some directions are rigid."""
        left, values, right = np.linalg.svd(self.C * self._scaling)
        rigid = values <= NEGLIGIBLE_ENERGY * values.max()
        if rigid.any():
            directions = right[rigid] * self._scaling[:1]
            raise no_stiffness(directions / np.abs(directions).max(axis=1, keepdims=True))
        return _frozen((right.T / values) @ left.T * self._scaling)

    # -- what the modules carry ------------------------------------------------------------------------------------

    @cached_property
    def loads(self) -> Mapping[str, Array]:
        """Load of each module by its name: wrenches (6,) in the module's deformed axes, of drives (1,) [N, N m].

        A beam's acts on its tip, in the tip's axes; where the beam's root is the outer end, on the joint's inner side.
        """
        return self._by_name(self._equilibria.evaluation.loads[0], self._drive_modules[0])

    @cached_property
    def strains(self) -> Mapping[str, Array]:
        """Deformation of each module by its name: translation and rotation vector (6,), of drives (1,) [m, rad]."""
        return self._by_name(self._equilibria.state.strain[0], self._drive_modules[1])

    def _by_name(self, wrench: Array, drive: Array) -> Mapping[str, Array]:
        each = [_frozen(value) for value in (*wrench, *drive)]
        return _Named(self._equilibria.chain.structure.layout.index, each.__getitem__)

    @cached_property
    def _drive_modules(self) -> tuple[Array, Array]:
        """Loads and extents of drive modules, (d, 1) both."""
        equilibria = self._equilibria
        structure, values = equilibria.chain.structure, equilibria.chain.values
        loads = equilibria.evaluation.drive_loads[0, structure.layout.drive_rows, None] * values.drive_ratios[:, 0]
        extents = np.zeros_like(loads)
        geometries = equilibria.rigid.take([0]).geometries[len(values.wrench_groups) :]
        for group, at in zip(values.drive_groups, geometries, strict=True):
            extents[group.slots] = group.kind.deformation(group.values, at, loads[None, group.slots])[0]
        return loads, extents

    # -- energy ----------------------------------------------------------------------------------------------------

    def energy(self, steps: int = 4) -> Energy:
        """Return the energies of the load path: the weight, if it acts, is raised from zero, then the wrench.

        `steps` steps of the wrench with four Gauss points each. The work of the wrench follows from the tangent
        compliance along the path, what is stored from the modules' laws at its end: they agree where both are right.
        Raises NotConvergedError where the path cannot be followed, InputError for a weight spread along the beams.
        """
        end = self._equilibria
        if end.conditions.gravity is not None and end.conditions.spread_weight:
            raise InputError(
                "the work of a weight that is spread along bent beams is not computed; expected a pose that was "
                "loaded with spread_weight=False"
            )
        path = _LoadPath(end.chain, self.pose, end.conditions)
        at, work, resisted = path.start, 0.0, 0.0
        points, weights = np.polynomial.legendre.leggauss(_GAUSS)
        points, weights = (points + 1) / 2, weights / 2
        if end.conditions.gravity is not None:
            # int G' dc = G c - int c dG, with all weights raised in proportion
            for point, weight in zip(points, weights, strict=True):
                at = path.follow(at, 0.0, float(point))
                work -= weight * path.fall(at)
            work += path.fall(_Point(end, 1.0, 1.0))
        for step in range(steps):
            for point, weight in zip(points, weights, strict=True):
                share = float(step + point) / steps
                at = path.follow(at, share, 1.0)
                work += weight / steps * share * float(self.wrench @ path.rate(at))
                resisted -= weight / steps * path.resisted(at)
        resisted += path.resisted(_Point(end, 1.0, 1.0))
        return Energy(self._stored, float(work), float(resisted))

    @cached_property
    def _stored(self) -> float:
        """Energy of all modules [J]."""
        end = self._equilibria
        total = 0.0
        for group, at in zip(end.chain.values.groups, end.rigid.take([0]).geometries, strict=True):
            if group.kind.spans_frames and group.kind.bends_exactly:
                rod, _ = end.evaluation.modules.rods[group.slots.start]
                total += float(rod.energy[0].sum())
            else:
                loads = self._drive_modules[0] if isinstance(group.kind, DriveModule) else end.evaluation.loads[0]
                total += float(_stored_in(group.kind, group.values, at, loads[None, group.slots]).sum())
        return total

    # -- stability -------------------------------------------------------------------------------------------------

    def buckling_margin(self, limit: float = LIMIT) -> float:
        """Return the factor on the wrench at which the robot gives way: its equilibrium is singular, then unstable.

        The wrench grows in proportion from zero; the weight, if it acts, acts in full. Above 1 for what `equilibrium`
        returns; infinite where nothing gives way up to the factor `limit`. Raises NotConvergedError where the path is
        lost before.
        """
        end = self._equilibria
        return _follow_until(_LoadPath(end.chain, self.pose, end.conditions), limit)[0]

    def __repr__(self) -> str:
        size = np.linalg.norm(self.displacement[:3])
        return f"<LoadedPose of {self.pose.mechanism.name}: tool moved {number(size, 4)} m>"


def find_loaded_pose(
    chain: Chain, pose: ClosedPose, wrench, scaling: Array, gravity: ArrayLike = False, spread_weight: bool = False
) -> LoadedPose:
    """Return the equilibrium of `pose` under a dead wrench (6,) on the tool, base axes [N, N m].

    `gravity`: the robot's weight acts as well, that of a link at its centre, under the robot file's gravity or that
    given, (3,) [m/s^2]; `spread_weight`: that of beams along their
    length. `scaling` (6, 6) makes C dimensionless. Raises NotConvergedError where no equilibrium is found, and where
    the robot gives way under a smaller load: what lies beyond is not where a robot stands.
    """
    chain.check([pose])
    w = _frozen(as_wrench(wrench))
    conditions = Conditions(w[None], gravity=_gravity(gravity, chain.mechanism), spread_weight=spread_weight)
    found = find_equilibria(chain, [pose], np.zeros(1, int), conditions, by_steps=False)
    path = _LoadPath(chain, pose, conditions)
    if not (found.converged[0] and path.is_plain(found)):
        margin, end = _follow_until(path, 1.0)
        if margin < 1.0:
            raise path.lost(margin)
        found = end.equilibria
    return LoadedPose(pose, w, found, scaling)


def _gravity(given: ArrayLike, mechanism: Mechanism) -> Array | None:
    """Return the acceleration of free fall (3,), or None where no weight acts."""
    if np.ndim(given) == 0:
        return mechanism.gravity if given else None
    try:
        vector = _frozen(np.asarray(given, float))
    except (OverflowError, TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"gravity = {given!r}: expected True, False or three numbers [m/s^2], base axes")
    return vector


def _frozen(values: Array) -> Array:
    values = np.array(values)
    values.setflags(write=False)
    return values


# --------------------------------------------------------------------------------------------- energy of one module

_PANELS = 24
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _stored_in(kind: CompliantModule, values, at, load: Array) -> Array:
    """Return the energy of modules of one kind under `load` (..., n, k), (..., n) [J].

    e . load - int e(t load) . load dt: a law's complementary energy does not depend on the way to the load.
    """
    stored = (load * kind.deformation(values, at, load)).sum(-1)
    if not kind.nonlinear:
        return 0.5 * stored
    for panel in range(_PANELS):
        for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
            root = (panel + (point + 1) / 2) / _PANELS
            # t = root^2: laws bend most near rest
            partly = kind.deformation(values, at, root**2 * load)
            stored = stored - weight / _PANELS * root * (partly * load).sum(-1)
    return stored


# ------------------------------------------------------------------------------------------------------- load path


@dataclass(frozen=True)
class _Point:
    """A point of a load path: the equilibrium under shares of the wrench and of the weight."""

    equilibria: Equilibria
    share: float
    weight: float

    @cached_property
    def fresh(self) -> Equilibria:
        """The equilibrium with its own derivative, to start a search from."""
        found = self.equilibria
        return replace(found, inverses=(found.own_inverses(), np.zeros(1, int)))


class _LoadPath:
    """Equilibria of one sample under growing shares of what acts on it, each followed from the one before."""

    def __init__(self, chain: Chain, pose: ClosedPose, conditions: Conditions):
        self.chain, self.pose, self.conditions = chain, pose, conditions

    def _conditions(self, share: float, weight: float) -> Conditions:
        given = self.conditions
        return replace(
            given,
            wrench=share * given.wrench,
            gravity=None if given.gravity is None else weight * given.gravity,
            torques=None if given.torques is None else share * given.torques,
        )

    @cached_property
    def start(self) -> _Point:
        """The robot at rest, without weight."""
        none = self._conditions(0.0, 0.0)
        found = find_equilibria(self.chain, [self.pose], np.zeros(1, int), none)
        if not found.converged[0]:
            raise self.lost(0.0)
        return _Point(found, 0.0, 0.0)

    @cached_property
    def foot(self) -> _Point:
        """The robot under its weight, if that acts, without the wrench."""
        return self.start if self.conditions.gravity is None else self.follow(self.start, 0.0, 1.0)

    def step(self, start: _Point, share: float, weight: float = 1.0) -> _Point | None:
        """Return the equilibrium under other shares by one step from `start`; None where it is not found near."""
        conditions = self._conditions(share, weight)
        expected = self.expected(start, conditions)
        if not expected <= _LONGEST_STEP:
            return None
        found = find_equilibria(self.chain, [], np.zeros(1, int), conditions, start.fresh, by_steps=False)
        # Up to a limit point the path moves by twice what its tangent says; farther off lies another equilibrium.
        near = found.converged[0] and _moved(start, found) <= 4 * expected + _APART
        return _Point(found, share, weight) if near else None

    def expected(self, start: _Point, conditions: Conditions) -> float:
        """Return how far anything moves to new conditions, to first order [m, rad]."""
        old = start.fresh
        residual = self.chain.evaluate(old.rigid, old.state, conditions).residual[0]
        change = old.inverses[0][0] @ residual  # type: ignore[index]
        return float(np.abs(change[: len(change) - self.chain.structure.closure_count]).max(initial=0.0))

    def is_plain(self, found: Equilibria) -> bool:
        """Return True for an equilibrium so near to rest, and so far from critical loads, that it needs no path."""
        expected = self.expected(self.foot, found.conditions)
        return expected < _LITTLE_MOTION and _moved(self.foot, found) < 2 * expected and self.sensitivity < _SAFE

    def follow(self, start: _Point, share: float, weight: float) -> _Point:
        """Return the equilibrium under other shares, in smaller steps where one does not converge."""
        first, done, size = start, 0.0, 1.0
        while done < 1.0:
            reach = min(1.0, done + size)
            found = self.step(
                start,
                first.share + reach * (share - first.share),
                first.weight + reach * (weight - first.weight),
            )
            if found is not None:
                start, done = found, reach
                continue
            size /= 2
            if size < _SMALLEST_STEP:
                raise self.lost(start.share)
        return start

    def lost(self, reached: float) -> NotConvergedError:
        wrench = self.conditions.wrench[0]
        turned = self._turned_idle()
        if turned:
            return NotConvergedError(
                f"no equilibrium near {self.pose!r}: what acts on the robot moves {turned}, which moves neither tool "
                "nor actuators and which nothing holds. Expected a load that leaves it alone; drive or lock the joint, "
                "or balance what hangs on it",
                self.pose,
                wrench,
                reached,
            )
        return NotConvergedError(
            f"no equilibrium found at {self.pose!r} under the wrench {wrench.tolist()} [N, N m]: raised in proportion "
            f"from zero, it could be followed to {number(reached, 6)} of it. Expected a load that the robot can bear; "
            "buckling_margin() of a smaller one says where it gives way",
            self.pose,
            wrench,
            reached,
        )

    def _turned_idle(self) -> str:
        """Return the name of the idle joint that the load moves most at the rigid pose; '' where it moves none."""
        idle, chain = self.pose.balance.idle, self.chain
        if not idle.shape[1]:
            return ""
        row = np.zeros(1, int)
        at = chain.evaluate(chain.rigid_samples([self.pose], row), chain.rigid_state([self.pose], row), self.conditions)
        work = idle.T @ at.residual[0, : len(idle)]
        if not np.abs(work).max() > NEGLIGIBLE * np.abs(at.carried).max():
            return ""
        motion = np.abs(idle @ work)
        return f"'{chain.mechanism.dof_names[chain.structure.free[int(np.argmax(motion))]]}'"

    def fall(self, at: _Point) -> float:
        """Return the full weights times the way of their centres since the rigid pose [J]."""
        placements, bodies = at.equilibria.evaluation.placements[0], self.chain.structure
        lever = np.append(bodies.levers, np.ones((bodies.count, 1)), axis=1)[..., None]
        ways = ((placements - self.pose.placements) @ lever)[:, :3, 0]
        return float((bodies.masses[:, None] * ways * self.conditions.gravity).sum())

    def rate(self, at: _Point) -> Array:
        """Return the translation and spin of the tool per growing share of wrench and resistance, (6,)."""
        found, chain = at.equilibria, self.chain
        inverse = found.own_inverses()[0]
        more = load_columns(chain.structure, found.evaluation)[0] @ self.conditions.wrench[0]
        if self.conditions.torques is not None:
            resisting = chain.by_torque(found.evaluation)[0] * self.conditions.torques[0]
            more[: len(resisting)] += resisting
        return -frame_columns(chain.structure, found.evaluation, chain.tool)[0] @ (inverse @ more)

    def resisted(self, at: _Point) -> float:
        """Return what resists in the joints times their travel [J]."""
        if self.conditions.torques is None:
            return 0.0
        return float(self.conditions.torques[0] @ at.equilibria.state.travel[0, self.chain.moving])

    # -- stability -------------------------------------------------------------------------------------------------

    @cached_property
    def _reference(self) -> Array:
        """The inverse of the bordered derivative at rest."""
        bordered = self.start.equilibria.bordered()
        return inverted(bordered, no_border(1, bordered.shape[-1]))[0]

    def relative(self, at: _Point) -> Array:
        """Return the derivative relative to that at rest: singular where the equilibrium is."""
        return self._reference @ at.equilibria.bordered()[0]

    def ratios(self, low: tuple[_Point, Array], after: Array) -> np.ndarray:
        """Return the eigenvalues of before^-1 after, for a point with its derivative `before`: all 1 if they are equal.

        Of derivatives that differ little, one is negative where a derivative between them is singular. Raises
        NotConvergedError where `before` is singular itself.
        """
        at, before = low
        try:
            return np.linalg.eigvals(np.linalg.solve(before, after))
        except np.linalg.LinAlgError:
            raise self.lost(at.share) from None

    @cached_property
    def sensitivity(self) -> float:
        """By how much the derivative changes with the wrench, relative to itself, from how little of it changes it."""
        if not np.any(self.conditions.wrench):
            return 0.0
        before, little = self.relative(self.foot), _LITTLE
        while True:
            found = self.step(self.foot, little)
            change = np.inf
            if found is not None:
                change = np.abs(self.ratios((self.foot, before), self.relative(found)) - 1).max(initial=0.0)
            if change < 1 / 30 or little < _SHARP:
                return float(change / little)
            little /= 100


def _moved(start: _Point, found: Equilibria) -> float:
    old, new = start.equilibria.state, found.state
    ways = (new.travel - old.travel, new.strain - old.strain)
    return max(float(np.abs(way).max(initial=0.0)) for way in ways)


def _real(values: np.ndarray) -> Array:
    """Return those of some eigenvalues that are real but for rounding."""
    return values.real[np.abs(values.imag) < _REAL * np.maximum(np.abs(values), 1e-3)]


def _first_singular(ratios: np.ndarray) -> float:
    """Return the least t > 0 at which before + t (after - before) is singular; infinite where none is."""
    least = _real(ratios).min(initial=1.0)
    return float(1 / (1 - least)) if least < 1 - 1e-12 else np.inf


def _follow_until(path: _LoadPath, limit: float) -> tuple[float, _Point]:
    """Return the factor on the wrench at which the equilibrium is first singular, and the last point before it.

    Infinite, and the point at `limit`, where it is not singular up to there.
    """
    low = path.foot
    matrix = path.relative(low)
    if _first_singular(path.ratios((path.start, path.relative(path.start)), matrix)) <= 1:
        return 0.0, low
    if not np.any(path.conditions.wrench):
        return np.inf, low
    first = size = min(0.5 / max(path.sensitivity, 0.5 / limit), limit)
    before = edge = np.inf
    failed = False
    for _ in range(_MOST_STEPS):
        found = path.step(low, min(low.share + size, limit))
        if found is not None:
            after = path.relative(found)
            ratios = path.ratios((low, matrix), after)
            least = float(_real(ratios).min(initial=1.0))
            if least <= 0:
                share = _crossing(path, (low, matrix), (found, after))
                if share is not None:
                    return share, low
            if least <= 0 or np.abs(ratios - 1).max() > _MUCH:
                found = None
        if found is None:
            size, failed = size / 2, True
        else:
            # Where a path turns back, the least eigenvalue falls as the root of the way that is left.
            way = found.share - low.share
            before, edge = edge, found.share + way * least**2 / (1 - least**2) if least < 1 else np.inf
            if found.share >= limit:
                return np.inf, found
            low, matrix, size = found, after, _GROWTH * size
            if failed and edge <= limit and abs(edge - before) < 10 * _SHARP * edge:
                return edge, low
        if failed:
            size = min(size, 0.85 * (edge - low.share))
        if size <= _SHARP * max(low.share, first):
            break
    if failed and edge <= limit and edge - low.share < _BLUNT * edge:
        return edge, low
    raise path.lost(low.share)


def _crossing(path: _LoadPath, low: tuple[_Point, Array], high: tuple[_Point, Array]) -> float | None:
    """Return the share between two points, with their derivatives, at which one is singular; None where none is."""
    last = np.inf
    for _ in range(_MOST_STEPS):
        (before, _), (after, second) = low, high
        part = _first_singular(path.ratios(low, second))
        if part > 1:
            return None
        share = before.share + part * (after.share - before.share)
        if abs(share - last) <= _SHARP * share:
            return share
        found = path.step(before, share) or path.step(after, share)
        if found is None:
            # At the singular point itself Newton's method may fail; beside it it need not.
            if after.share - before.share < _BLUNT * share:
                return share
            found = path.step(before, (before.share + after.share) / 2)
            if found is None:
                return None
        last, middle = share, (found, path.relative(found))
        if _first_singular(path.ratios(low, middle[1])) <= 1:
            high = middle
        else:
            low = middle
    return last
