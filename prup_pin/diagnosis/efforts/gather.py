"""From a recording to columns: a motion, the library of laws on it, tolerances, whitening."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from ...dynamics import InMotion
from ...dynamics.smoothing import Band, pieces
from ...laws import Place
from ...laws.efforts import CURVES, EFFORT_LAWS, ROUGH_CURVES, Body, EffortLaw
from ...laws.efforts.deviations import effort_deviations, name_of_body
from ...laws.efforts.effort_law import usual_way
from ...spatial import Array
from ..criteria import AR_ORDER, EFFORT_INDISTINCT, EFFORT_SURE, EFFORT_TOLD
from .beside import Beside
from .chosen import Chosen, fit
from .columns import (
    ByJoint,
    Columns,
    EffortCandidate,
    Gathered,
    Whitening,
    autoregression,
    column_blocks,
    kept_samples,
    usable,
)
from .combinations import Combinations
from .normal import Normal
from .search import pulls, worth
from .stretches import Outlying, outlying
from .width import learned_precisions

__all__ = ["Efforts"]

#: A law at a place, what is scanned, and its columns.
_Seen = tuple[EffortLaw, Place, Mapping[str, float], ByJoint]
#: Farthest that the logarithm of a scanned value is moved at a time, and squares of white noise that settle it.
_FARTHEST, _SETTLED = 2.0, 0.5
#: Logarithm of a scanned value over the best one beyond which data do not end it.
_NEVER = 7.0
#: Periods of the cut-off at an end of a piece by which nothing is judged.
_PERIODS = 1.5
#: Samples whose regressors are multiplied at a time.
_AT_ONCE = 4096


class Efforts:
    """The efforts of a robot in one motion, ready to be asked which laws they want."""

    def __init__(self, at: InMotion, tolerances: Mapping[str, float], noise: Array | None, below: float | None = None):
        """`noise` (k,): declared, of each joint's efforts as they are compared. `below` [Hz]: where what is left is
        judged; None: where it is compared."""
        self.at = at
        self.noise = noise
        motion = at.motion
        self.filter = lambda values: motion.band(values, motion.piece)
        self.below = below
        most = np.inf if below is None else below
        self.judged = Band(tuple(min(most, cutoff) for cutoff in motion.band.cutoffs), motion.band.rate)
        self.every = kept_samples(at)
        self.piece = motion.piece[self.every]
        self.blocks = column_blocks(self.every, postures=len(np.unique(self.piece)) if motion.standing else 0)
        self.measured = self.filter(motion.efforts)
        self.rigid = self.filter(at.rigid)
        self.good = np.isfinite(self.measured[self.every]) & motion.compared[self.every]
        self.bases = effort_deviations(at, tolerances)
        self._fixed: list[_Seen] = []
        self._moving: list[tuple[EffortLaw, Place]] = []
        for law in EFFORT_LAWS:
            for place in law.places(at.mechanism) if law.competes else ():
                if (law.of_motion and motion.standing) or not law.acts(place, at):
                    continue
                if law.of_what_is_known:
                    self._moving.append((law, place))
                    continue
                for values in law.scanned(place, at):
                    self._fixed.append((law, place, values, self.seen(law.efforts_per(place, values, at))))
        self.outlying: list[Outlying] = []
        self._learned: Mapping[tuple[str, str], Array] = {}
        self._narrower = 1.0
        self.whitening, self._plain = self._whitened()

    def seen(self, efforts: Array) -> ByJoint:
        """Return columns of efforts (N, k, p) as they are compared: filtered, where samples are kept."""
        return ByJoint.of(self.kept(efforts))

    def kept(self, values: Array) -> Array:
        """Return efforts (N, k, p) filtered, at the kept samples (n, k, p)."""
        return self.filter(values)[self.every]

    def away_from_ends(self, cutoff: float) -> np.ndarray:
        """Return the kept samples (n, k) by which what is left below a cut-off [Hz] is judged: not those at ends of
        pieces, where filters and rates have no other side, and nobody knows what a late signal was before."""
        motion, good = self.at.motion, self.good
        if motion.standing:
            return good
        step = max(int(np.median(np.diff(self.every))), 1)
        end = int(np.ceil(_PERIODS * motion.rate / (step * cutoff)))
        inside = good.copy()
        for where in pieces(self.piece):
            inside[where.start : where.start + end] = inside[max(where.stop - end, where.start) : where.stop] = False
        return np.where(inside.any(axis=0), inside, good)

    def _whitened(self) -> tuple[Whitening, Whitening]:
        """Return the whitening for what all laws fitted together leave, and each joint's size alone."""
        flat = np.zeros((self.measured.shape[1], 1))
        spread = np.nanstd(np.where(self.good, (self.measured - self.rigid)[self.every], np.nan), axis=0)
        flat[:, 0] = 1 / np.where(spread > 0, spread, 1.0)
        plain = Whitening(flat, usable(self.good, self.piece, 0))
        given = self._gathered(plain)
        _, more = self._beside(given.columns, plain, self._ahead())
        given = self._given(given.columns, given.candidates, np.concatenate((given.prior, more)))
        given, _ = self.with_curves(given, plain, ROUGH_CURVES)
        everything = Chosen(tuple(range(given.columns.size)))
        # a pinch of shrinkage: columns that are nearly alike must not blow up
        scale = np.diag(given.columns.total)
        eased = self._given(given.columns, given.candidates, given.prior + 1e-6 * scale)
        x, _ = fit(eased, everything)
        if not self.at.motion.standing:
            self.outlying = outlying(eased, x, plain.good, self.piece)
        residual = given.columns.residual(everything.where, x) / flat[:, 0]
        orders = (0 if self.at.motion.standing else AR_ORDER, 0)
        white, plain = (
            Whitening(autoregression(residual, self.good, self.piece, order), usable(self.good, self.piece, order))
            for order in orders
        )
        return white, plain

    def _ahead(self) -> Iterator[_Seen]:
        """Yield what late encoders may add before any law is known: with bodies alone, and with dry friction too."""
        nothing = np.zeros_like(self.at.rigid)
        for law, place in self._moving:
            if not (law.told_from_noise and place.name in self.at.driven):
                continue
            dry = self.at.along(place.name, self.at.dragged(place.name, usual_way(self.at, place.name)))
            for known in (nothing, dry):
                at = self._knowing(known, nothing)
                values = law.scanned(place, at)[0]
                yield law, place, values, self.seen(law.efforts_per(place, values, at))

    def columns_of(self, given: Gathered, chosen: Chosen) -> Array:
        """Return what each coefficient of what is chosen adds (n, k, p) to the efforts at the kept samples."""
        parts = [np.zeros((len(self.every), len(self.at.driven), 0))]
        if chosen.base:
            parts.append(self.kept(np.stack([self.bases[index].efforts for index in chosen.base], axis=-1)))
        x, _ = fit(given, chosen)
        at = self.at
        if any(term.law.of_what_is_known for term in chosen.terms):
            others = chosen.of(term for term in chosen.terms if not term.law.of_what_is_known)
            at = self._knowing(
                *self._known(others, np.concatenate([x[: len(chosen.base)], *(x[chosen.own(t)] for t in others.terms)]))
            )
        for term in chosen.terms:
            known = at if term.law.of_what_is_known else self.at
            parts.append(self.kept(term.law.efforts_per(term.place, term.values, known)))
        return np.concatenate(parts, axis=2)

    def held_out_residual(self, given: Gathered, chosen: Chosen) -> Array:
        """Return what is left of the filtered efforts (n, k) where each block was not fitted."""
        columns = self.columns_of(given, chosen)
        left = (self.measured - self.rigid)[self.every]
        for part in given.columns.folds:
            x, _ = fit(given, chosen, part)
            for block in part:
                rows = given.columns.parts[block]
                left[rows] -= columns[rows] @ x
        return left

    def in_plain_units(self, given: Gathered, chosen: Chosen) -> tuple[Gathered, Chosen]:
        """Return what is chosen alone, each joint weighed by its size and nothing whitened: as a prediction is judged.

        What is known beforehand counts as much beside what is left as it does beside white noise.
        """
        target = np.nan_to_num(self.measured - self.rigid)[self.every]
        columns = Columns(
            np.column_stack([self._plain.of_joint(k, own) for k, own in enumerate(target.T)]), self.blocks
        )
        columns.add([self._plain(ByJoint.of(self.columns_of(given, chosen)))])
        new = {old: index for index, old in enumerate(chosen.where)}
        terms = tuple(
            replace(term, where=slice(new[term.where.start], new[term.where.start] + term.size))
            for term in chosen.terms
        )
        left = float(self.held_out_plainly(given, chosen).sum()) / max(int(self._plain.good.sum()), 1)
        bodies = {new[first]: left * block for first, block in given.bodies.items() if first in new}
        alone = Gathered(given.mechanism, columns, terms, left * given.prior[list(chosen.where)], bodies)
        return alone, Chosen(tuple(range(len(chosen.base))), terms)

    def held_out_plainly(self, given: Gathered, chosen: Chosen) -> Array:
        """Return the held-out squares of all blocks (B,), each joint weighed by its size alone."""
        left = np.where(self.good, self.held_out_residual(given, chosen) * self._plain.filters[:, 0], 0.0)
        return np.array([float((left[part] ** 2).sum()) for part in given.columns.parts])

    def gathered(self) -> Gathered:
        """Return the columns of all that competes."""
        given = self._gathered(self.whitening)
        return self.renewed(given, Chosen(()))[0]

    def with_curves(
        self, given: Gathered, whitening: Whitening | None = None, tried: Sequence[EffortLaw] = CURVES
    ) -> tuple[Gathered, list[EffortCandidate]]:
        """Return the columns with those of curves of no law beside them, and these."""
        there = [candidate for candidate in given.candidates if candidate.law.is_curve]
        if there:
            return given, there
        curves: Iterable[_Seen] = (
            (law, place, knots, self.seen(law.efforts_per(place, knots, self.at)))
            for law in tried
            for place in law.places(self.at.mechanism)
            if law.acts(place, self.at) and not (law.of_motion and self.at.motion.standing)
            for knots in law.scanned(place, self.at)
        )
        new, _ = self._beside(given.columns, whitening or self.whitening, curves)
        # where a block has a stretch of the way for itself, its knots are told by no other: they stay near nothing
        prior = np.concatenate((given.prior, np.zeros(given.columns.size - len(given.prior))))
        sizes = np.sqrt(np.nanmean(np.where(self.good, (self.measured - self.rigid)[self.every], np.nan) ** 2, axis=0))
        for curve in new:
            prior[curve.where] = 1 / max(sizes[self.at.driven.index(curve.place.name)], np.finfo(float).tiny) ** 2
        return self._given(given.columns, (*given.candidates, *new), prior), new

    def _beside(
        self,
        columns: Columns,
        whitening: Whitening,
        given: Iterable[_Seen],
    ) -> tuple[list[EffortCandidate], list[float]]:
        """Append columns of laws; return them as candidates, and their inverse variances."""
        laws: list[tuple[EffortLaw, Place, Mapping[str, float]]] = []

        def whitened() -> Iterator[ByJoint]:
            for law, place, values, seen in given:
                laws.append((law, place, values))
                yield whitening(seen)

        places = columns.add(whitened())
        candidates = [EffortCandidate(*law, where) for law, where in zip(laws, places, strict=True)]
        priors = [self._prior(law, place) for law, place, _ in laws if not law.is_curve]
        return candidates, [value for prior in priors for value in prior]

    def added(self, chosen: Chosen, x: Array) -> Array:
        """Return the efforts (N, k) beyond the rigid robot's, not filtered."""
        return self._known(chosen, x)[0]

    def _known(self, chosen: Chosen, x: Array) -> tuple[Array, Array]:
        """Return the efforts (N, k) beyond the rigid robot's, and those of bodies among them."""
        out, bodies = np.zeros_like(self.at.rigid), np.zeros_like(self.at.rigid)
        for index in chosen.base:
            more = x[index] * self.bases[index].efforts
            out += more
            if self.bases[index].inertial is not None:
                bodies += more
        for term in chosen.terms:
            at = self._knowing(out, bodies) if term.law.of_what_is_known else self.at
            more = term.law.efforts_per(term.place, term.values, at) @ x[chosen.own(term)]
            out += more
            if term.law.of_bodies:
                bodies += more
        return out, bodies

    def _knowing(self, known: Array, bodies: Array) -> InMotion:
        return self.at.knowing(known.copy(), self.at.motion.efforts - self.at.rigid - known, bodies.copy())

    def left_by(self, chosen: Chosen, x: Array, gains: Array) -> Array:
        """Return what a fit to other samples of this recording leaves (n, k) here, of efforts over gains (k,)."""
        return (self.measured / gains - self.rigid - self.filter(self.added(chosen, x)))[self.every]

    def free_size(self, given: Gathered, chosen: Chosen) -> Array:
        """Return (P, 2): the size of each column freed of what is chosen, and the scatter of what pulls at it."""
        pull, rest, _ = pulls(given, chosen)
        scatter = np.sqrt((pull**2).sum(axis=0))
        size = np.maximum(np.diag(rest), 0.0)
        return np.column_stack([size, scatter])

    def inertial_rank(self) -> tuple[int, int]:
        """Return how many combinations of inertial parameters the motion tells, and how many there are."""
        regressor = self.at.regressor
        size = regressor.shape[2] * 10
        if self.at.trajectory.spread is None:
            moved = {self.at.mechanism.joint(name).id for name in self.at.motion.names}
            count = 10 * len(moved)
        else:
            count = size
        gram = np.zeros((size, size))
        for part in np.array_split(self.every, len(self.every) // _AT_ONCE + 1):
            table = regressor[part].reshape(-1, size)
            gram += table.T @ table
        sizes = np.sqrt(np.diag(gram))
        there = sizes > 1e-9 * sizes.max(initial=0.0)
        values = np.linalg.eigvalsh(gram[np.ix_(there, there)] / np.outer(sizes[there], sizes[there]))
        return int((values > EFFORT_TOLD * values.max(initial=0.0)).sum()), count

    @property
    def bodies_within_tolerance(self) -> list[tuple[int, Array] | None]:
        """The joint and the parameters (10,) of its body, by one tolerance, of each base; None of those of no body."""
        mechanism = self.at.mechanism
        joints = {name_of_body(mechanism, joint.id): joint.id for joint in mechanism.joints}
        return [None if base.inertial is None else (joints[base.place], base.inertial) for base in self.bases]

    def combinations(self, law: EffortLaw) -> Combinations:
        """Return which combinations of all links' inertial parameters the motion tells."""
        return Combinations.of(
            law.efforts_per(Place(""), {}, self.at)[self.every].reshape(-1, len(law.linear)), law.linear
        )

    def _gathered(self, whitening: Whitening) -> Gathered:
        target = np.nan_to_num(self.measured - self.rigid)[self.every]
        target = np.column_stack([whitening.of_joint(k, target[:, k]) for k in range(target.shape[1])])
        columns = Columns(target, self.blocks)
        prior = [1.0] * len(self.bases)
        if self.bases:
            columns.add(whitening(self.seen(base.efforts[..., None])) for base in self.bases)
        candidates, more = self._beside(columns, whitening, self._fixed)
        prior += more
        for law in EFFORT_LAWS:
            single = [candidate for candidate in candidates if candidate.law is law]
            every = law.together([candidate.place for candidate in single])
            if len(single) > 1 and every is not None:
                where = slice(single[0].where.start, single[-1].where.stop)
                candidates.append(EffortCandidate(every, every.places(self.at.mechanism)[0], {}, where))
        self._own_size = columns.size
        return self._given(columns, tuple(candidates), np.array(prior))

    def _given(self, columns: Columns, candidates: Sequence[EffortCandidate], prior: Array) -> Gathered:
        links = {index: base.place for index, base in enumerate(self.bases) if base.inertial is not None}
        own = ((c.where.start, c.law.covariance_inverse(c.place, self.at.mechanism)) for c in candidates)
        bodies = {first: block * self._narrower for first, block in own if block is not None}
        return Gathered(self.at.mechanism, columns, tuple(candidates), prior, bodies, links)

    def with_learned_widths(self, given: Gathered, chosen: Chosen) -> tuple[Efforts, Gathered]:
        """Return the same where what every drive has, and bodies, are off by as much as is likeliest of all of them.

        What is usual of a drive is an effort of its own as large as what is measured beyond the rigid robot's.
        """
        powers = (given.columns.target**2).sum(axis=0)
        kinds: dict[str, tuple[np.ndarray, Array]] = {}
        usual: dict[tuple[str, str], Array] = {}
        for term in chosen.terms:
            shown = given.columns.touched[term.where].any(axis=0)  # a passive joint's at the drives that move it
            if not (chosen.stays(term) and shown.any()):
                continue
            if term.law.body:
                block = given.precision(range(term.where.start, term.where.stop))
            else:
                power = max(float(powers[shown].sum()), np.finfo(float).tiny)
                usual[term.name] = np.diag(given.columns.total)[term.where] / power
                block = np.diag(usual[term.name])
            own = np.arange(len(chosen.where))[chosen.own(term)]
            before, together = kinds.get(term.law.physics, (np.zeros(0, int), np.zeros((0, 0))))
            kinds[term.law.physics] = np.append(before, own), block_diag(together, block)
        precisions = learned_precisions(given, chosen, kinds)
        weighed = {term.law.physics for term in chosen.terms if term.law.body}
        other = copy(self)
        other._narrower = next((precisions[name] for name in kinds if name in weighed), 1.0)
        other._learned = {name: precisions[name[0]] * own for name, own in usual.items()}
        prior = given.prior.copy()
        for candidate in given.candidates:
            if candidate.name in usual:
                prior[candidate.where] = other._prior(candidate.law, candidate.place)
        return other, other._given(given.columns, given.candidates, prior)

    def _prior(self, law: EffortLaw, place: Place) -> Array:
        """Return inverse variances (p,) of a law's coefficients, in the unit of the whitened noise."""
        learned = self._learned.get((law.physics, place.name)) if law.everywhere else None
        return law.prior(place, self.at.mechanism) if learned is None else learned

    def renewed(self, given: Gathered, chosen: Chosen) -> tuple[Gathered, Chosen]:
        """Return the columns with those that depend on what is known made anew; chosen ones stay, side by side."""
        columns, size, terms = given.columns, self._own_size, []
        picked = list(range(size))
        for term in chosen.terms:
            if term.where.start >= self._own_size:
                picked += range(term.where.start, term.where.stop)
                term, size = replace(term, where=slice(size, size + term.size)), size + term.size
            terms.append(term)
        chosen = chosen.of(terms)
        columns.pick(picked)
        fixed = [c for c in given.candidates if c.where.start < self._own_size]
        kept = [term for term in terms if term.where.start >= self._own_size]
        prior = list(given.prior[picked])
        x, _ = fit(self._given(columns, (), np.array(prior)), chosen)
        at = self._knowing(*self._known(chosen, x))
        moving = (
            (law, place, values, self.seen(law.efforts_per(place, values, at)))
            for law, place in self._moving
            for values in law.scanned(place, at)
        )
        new, more = self._beside(columns, self.whitening, moving)
        prior += more
        return self._given(columns, (*fixed, *kept, *new), np.array(prior)), chosen

    def closer(
        self, given: Gathered, chosen: Chosen, which: Sequence[int], at_last: bool = False
    ) -> tuple[Gathered, Chosen]:
        """Return what is chosen with scanned values where the blocks ask for them, and the columns that this takes.

        `which`: the terms that are looked at, by their places in `chosen`, one after the other. at_last: what is
        nothing so far may come to be something; while laws are missing it would stand for them.
        """
        columns, best = given.columns, chosen
        for place in which:
            term = best.terms[place]
            x, _ = fit(given, best)
            values = term.law.fitted(term.place, x[best.own(term)], term.values)
            # what follows from what is known is looked at again with what is known now
            again = [term.values] if term.law.of_what_is_known else []
            others = list(term.law.closer(term.place, values, self.at)) or again
            size = len(term.law.free(term.values))
            others = [other for other in others if at_last or len(term.law.free(other)) <= size]
            if not others:
                continue
            at = self.at
            if term.law.of_what_is_known:
                before = best.of(best.terms[:place])
                at = self._knowing(*self._known(before, fit(given, before)[0]))
            size, prior = columns.size, list(given.prior)
            places = columns.add(
                self.whitening(self.seen(term.law.efforts_per(term.place, other, at))) for other in others
            )
            prior += len(others) * list(self._prior(term.law, term.place))
            tried = [
                EffortCandidate(term.law, term.place, other, own) for own, other in zip(places, others, strict=True)
            ]
            wider = self._given(columns, (*given.candidates, *tried), np.array(prior))
            left = Beside(wider, best.without(term)).with_each([term, *tried])
            taken = int(np.argmin(left.sum(axis=1)))
            # what is nothing so far must surely be something
            more = taken > 0 and len(term.law.free(tried[taken - 1].values)) > len(term.law.free(term.values))
            if taken == 0 or worth(left[0], left[taken])[1] <= (EFFORT_SURE if more else 0.0):
                columns.cut(size)
                continue
            best = best.replaced(place, tried[taken - 1])
            # only what was taken stays
            end = tried[taken - 1].where.stop
            columns.cut(end)
            given = self._given(columns, given.candidates, np.array(prior)[:end])
        return self.settled(given, best, which)

    def settled(self, given: Gathered, chosen: Chosen, which: Sequence[int]) -> tuple[Gathered, Chosen]:
        """Return what is chosen with scanned values settled where the squares are least, all coefficients free.

        A friction that turns round on a way a little too long looks like a delay, where it is large.
        """
        from scipy.optimize import minimize  # heavy; not needed to load a robot

        columns = given.columns
        for place in which:
            term = chosen.terms[place]
            law, count = term.law, len(term.law.free(term.values))
            if not count:
                continue
            at = self._seen_by(given, chosen, place)
            exactly = self._cost(given, chosen, place, at)

            def cost(step: Array, exactly: Callable[[Array], float] = exactly) -> float:
                return exactly(np.clip(step, -_FARTHEST, _FARTHEST))

            near = law.near(term.values)
            simplex = np.vstack((np.zeros(count), near * np.eye(count)))
            options = {"initial_simplex": simplex, "maxfev": 25 * count, "xatol": 0.02 * near, "fatol": _SETTLED}
            found = minimize(cost, np.zeros(count), method="Nelder-Mead", options=options)
            if not cost(np.zeros(count)) - found.fun > _SETTLED:
                continue
            values = _scaled(term, np.clip(found.x, -_FARTHEST, _FARTHEST))
            size = columns.size
            own = columns.add([self.whitening(self.seen(law.efforts_per(term.place, values, at)))])[0]
            prior = np.concatenate((given.prior, self._prior(law, term.place)))
            other = EffortCandidate(law, term.place, values, own)
            wider = self._given(columns, given.candidates, prior)
            before_it, after_it = Beside(wider, chosen.without(term)).with_each([term, other]).sum(axis=1)
            if after_it < before_it:
                given, chosen = wider, chosen.replaced(place, other)
            else:
                columns.cut(size)
        return given, chosen

    def told_between(
        self, given: Gathered, chosen: Chosen, term: EffortCandidate, rise: float
    ) -> dict[str, tuple[float, float]]:
        """Return by settled parameter the values between which the squares rise by less, all coefficients free.

        Where data do not end it, its bounds do.
        """
        place = next(index for index, other in enumerate(chosen.terms) if other is term)
        cost = self._cost(given, chosen, place, self._seen_by(given, chosen, place))
        law, out, free = term.law, {}, term.law.free(term.values)
        quantities = {q.name: q for q in law.quantities_at(term.place, self.at.mechanism)}
        least = cost(np.zeros(len(free)))
        for name, axis in zip(free, np.eye(len(free)), strict=True):
            down, up = (_edge(cost, way, least + rise, law.near(term.values)) for way in (-axis, axis))
            out[name] = (
                quantities[name].lower if down is None else float(_scaled(term, -down * axis)[name]),
                quantities[name].upper if up is None else float(_scaled(term, up * axis)[name]),
            )
        others = law.closer(term.place, term.values, self.at)
        for name in set(law.settled) - set(free):
            # what is nothing may be as much as the first size of it that the data refuse
            sizes = sorted(values[name] for values in others if values.get(name))
            refused = (size for size in sizes if cost.of({**term.values, name: size}) > least + rise)
            out[name] = (quantities[name].lower, next(refused, quantities[name].upper))
        return out

    def _seen_by(self, given: Gathered, chosen: Chosen, place: int) -> InMotion:
        """Return the motion that a chosen law sees: with what the terms before it say, where it depends on that."""
        if not chosen.terms[place].law.of_what_is_known:
            return self.at
        before = chosen.of(chosen.terms[:place])
        return self._knowing(*self._known(before, fit(given, before)[0]))

    def _cost(self, given: Gathered, chosen: Chosen, place: int, at: InMotion) -> _Cost:
        """Return the squares left, less a constant, by a term's scanned values."""
        term = chosen.terms[place]
        left = _Left(given, chosen.without(term), self._prior(term.law, term.place))
        return _Cost(self, left, term, at)

    def start(self, given: Gathered | None = None) -> Chosen:
        """Return what is there before any law: parameters within tolerance, and the masses of all links of `given`."""
        candidates = () if given is None else given.candidates
        every = [candidate for candidate in candidates if candidate.law.body is Body.ALL_LINKS]
        return Chosen(tuple(range(len(self.bases))), tuple(every))

    def background(self, given: Gathered, start: Chosen) -> Chosen:
        """Return a start with what every drive has, and all links' masses where no tolerance is declared for them."""
        weighed = any(base.inertial is not None for base in self.bases)
        common = [
            candidate
            for candidate in given.candidates
            if candidate.law.everywhere and not (candidate.law.body and (weighed or start.terms))
        ]
        return Chosen(start.base, (*start.terms, *common), background=True)


def _scaled(term: EffortCandidate, step: Array) -> Mapping[str, float]:
    """Return scanned values of which the settled ones are exp(step) times as large."""
    return term.law.scaled(term.values, np.exp(step).tolist())


def _edge(cost: Callable[[Array], float], way: Array, most: float, first: float) -> float | None:
    """Return the size > 0 of a step along `way` (k,) that costs `most`; None where none before `_NEVER` does."""
    from scipy.optimize import brentq  # heavy; not needed to load a robot

    inner, outer = 0.0, first
    while cost(outer * way) < most:
        inner, outer = outer, 2 * outer
        if outer > _NEVER:
            return None
    return float(brentq(lambda size: cost(size * way) - most, inner, outer, xtol=0.02 * outer))


@dataclass(frozen=True, eq=False)
class _Cost:
    """The squares left, less a constant, by scanned values of a term, all coefficients free."""

    efforts: Efforts
    left: _Left
    term: EffortCandidate
    at: InMotion

    def of(self, values: Mapping[str, float]) -> float:
        """Return it for other scanned values."""
        own = self.term.law.efforts_per(self.term.place, values, self.at)
        return -self.left.saved_by(self.efforts.whitening(self.efforts.seen(own)))

    def __call__(self, step: Array) -> float:
        """Return it for the logarithms of free values over what they are."""
        return self.of(_scaled(self.term, step))


class _Left:
    """What a fit leaves of the whitened efforts, and how much of it other columns beside it would save."""

    def __init__(self, given: Gathered, chosen: Chosen, prior: Array):
        x, matrix = fit(given, chosen)
        self._columns, self._prior = given.columns.dense(chosen.where), np.diag(prior)
        self._left, self._normal = given.columns.residual(chosen.where, x), Normal.of(matrix)

    def saved_by(self, own: ByJoint) -> float:
        """Return the squares that columns would save, all coefficients fitted together."""
        matrix, pull = self._prior.copy(), np.zeros(own.size)
        cross = np.zeros((len(self._normal.scale), own.size))
        for joint, (which, values) in enumerate(own.joints):
            matrix[np.ix_(which, which)] += values.T @ values
            cross[:, which] += self._columns[joint].T @ values
            pull[which] += values.T @ self._left[:, joint]
        rest = matrix - cross.T @ self._normal.solve(cross)
        return float(pull @ Normal.of(rest, np.diag(matrix), EFFORT_INDISTINCT).solve(pull))
