"""From a motion to a problem: filtered and decimated efforts, columns of all laws, tolerances, whitening."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ...dynamics import Explained, InMotion
from ...dynamics.smoothing import Band
from ...laws import Place
from ...laws.efforts import CURVES, EFFORT_LAWS, ROUGH_CURVES, EffortLaw
from ...laws.efforts.deviations import EffortDeviation, effort_deviations, name_of_body
from ...laws.efforts.effort_law import usual_way
from ...spatial import Array
from ..criteria import AR_ORDER, EFFORT_TOLD, LITTLE, MOST_SAMPLES, UNSEEN
from ..normal_equations import NormalEquations
from .gains import precision_of_gains
from .inertial import BaseParameters
from .nuisance import learned_precisions, usual_precisions
from .outliers import OutlierInterval, outlier_intervals
from .problem import (
    DesignMatrix,
    EffortCandidate,
    EffortModel,
    EffortProblem,
    SparseColumns,
    Whitening,
    autoregression,
    column_blocks,
    fit,
    kept_samples,
    usable,
)

#: A law at a place, its nonlinear parameters, and its columns.
LawColumns = tuple[EffortLaw, Place, Mapping[str, float], SparseColumns]


class PreparedEfforts:
    """The efforts of a robot in one motion, of which problems are made: whitened columns of all that competes.

    `kept` (n,): the samples that remain after decimation, `good` (n, k): those of them that count; `measured`, `rigid`
    (N, k): filtered; `target` (n, k): their difference at kept samples; `deviations`: toleranced parameters;
    `outliers`: intervals of time that no law describes.
    """

    def __init__(
        self,
        at: InMotion,
        tolerances: Mapping[str, float],
        below: float | None = None,
        of_all_gains: float | None = None,
    ):
        """below: frequency [Hz] below which the residual is judged; None: the whole band. of_all_gains: the standard
        deviation of what drives' gains have in common, beside which each is within its tolerance; None: each is within
        that by itself.
        """
        self.at, self.tolerances, self.below, self.of_all_gains = at, tolerances, below, of_all_gains
        motion = at.motion
        self.filter = lambda values: motion.band(values, motion.piece)
        most = np.inf if below is None else below
        self.judged = Band(tuple(min(most, cutoff) for cutoff in motion.band.cutoffs), motion.band.rate)
        self.kept = kept_samples(at)
        self.piece = motion.piece[self.kept]
        self.blocks = column_blocks(self.kept, postures=len(np.unique(self.piece)) if motion.separate else 0)
        self.measured = self.filter(motion.efforts)
        self.rigid = self.filter(at.rigid)
        self.target = (self.measured - self.rigid)[self.kept]
        self.good = np.isfinite(self.measured[self.kept]) & motion.compared[self.kept]
        self.good = self.settled(motion.band)
        self.deviations = self._deviations(at)
        competing = self._shown(law for law in EFFORT_LAWS if law.competes)
        self._moving = [(law, place) for law, place in competing if law.of_what_is_known or law.of_what_is_left]
        self._fixed = list(self.scanned_columns([own for own in competing if own not in self._moving], at))
        self.outliers: list[OutlierInterval] = []
        self._learned_priors: Mapping[tuple[str, str], Array] = {}
        self._body_factor = 1.0
        self.whitening, self._plain = self._whitened()

    def _deviations(self, at: InMotion) -> list[EffortDeviation]:
        """Return the toleranced parameters that a motion shows, gains of drives last."""
        return sorted(effort_deviations(at, self.tolerances), key=lambda item: item.law.of_gain)

    def _shown(self, laws: Iterable[EffortLaw]) -> list[tuple[EffortLaw, Place]]:
        """Return laws at all places where this motion could show them."""
        at = self.at
        here = ((law, place) for law in laws if law.is_told_by(at.motion) for place in law.places(at.mechanism))
        return [(law, place) for law, place in here if law.acts(place, at)]

    def scanned_columns(self, laws: Iterable[tuple[EffortLaw, Place]], at: InMotion) -> Iterator[LawColumns]:
        """Yield laws at places with all their scanned values, and their columns in a motion."""
        for law, place in laws:
            yield from (self.columns_at(law, place, values, at) for values in law.scanned(place, at))

    def columns_at(self, law: EffortLaw, place: Place, values: Mapping[str, float], at: InMotion) -> LawColumns:
        """Return a law at a place with values of its nonlinear parameters, and its columns in a motion."""
        return law, place, values, self.as_columns(law.efforts_per(place, values, at))

    def at_kept(self, values: Array) -> Array:
        """Return efforts (N, k, ...) filtered, at the kept samples (n, k, ...)."""
        return self.filter(values)[self.kept]

    def as_columns(self, efforts: Array) -> SparseColumns:
        """Return columns of efforts (N, k, p): filtered, at the kept samples."""
        return SparseColumns.of(self.at_kept(efforts))

    def whitened(self, efforts: Array) -> SparseColumns:
        """Return columns of efforts (N, k, p): filtered, at the kept samples, whitened."""
        return self.whitening(self.as_columns(efforts))

    def settled(self, band: Band) -> np.ndarray:
        """Return the samples (n, k) that count where a band's filters have settled; else all of a joint."""
        settled = self.good & band.settled(self.at.motion.piece)[self.kept]
        return np.where(settled.any(axis=0), settled, self.good)

    def _whitened(self) -> tuple[Whitening, Whitening]:
        """Return the whitening of what all laws fitted together leave, and one by each joint's size alone."""
        spread = np.nanstd(np.where(self.good, self.target, np.nan), axis=0)
        flat = 1 / np.where(spread > 0, spread, 1.0)[:, None]
        plain = Whitening(flat, usable(self.good, self.piece, 0))
        problem = self._whole_problem(plain)
        columns = problem.columns
        problem, _ = self.extended(problem, self._told_before_laws(), plain)
        problem = self.with_curves(EffortModel(problem, ()), plain, ROUGH_CURVES)[0].problem
        # a pinch of shrinkage: columns that are nearly alike must not blow up
        prior = problem.prior + 1e-6 * np.diag(problem.total)
        problem = self.with_candidates(columns, problem.candidates, prior)
        everything = EffortModel(problem, tuple(range(len(prior))))
        x, _ = fit(everything)
        if not self.at.motion.separate:
            self.outliers = outlier_intervals(problem, x, plain.good, self.at, self.kept)
        residual = columns.residual(everything.where, x) / flat[:, 0]
        orders = (0 if self.at.motion.separate else AR_ORDER, 0)
        white, plain = (
            Whitening(autoregression(residual, self.good, self.piece, order), usable(self.good, self.piece, order))
            for order in orders
        )
        return white, plain

    def _told_before_laws(self) -> Iterator[LawColumns]:
        """Yield what late encoders and a tilted base may add before any law is known: with bodies alone, and what is of
        one driven joint with its dry friction too.
        """
        passive = set(self.at.motion.names) - set(self.at.driven)
        for law, place in self._moving:
            if not law.told_from_noise or place.name in passive:
                continue
            ways = [np.zeros_like(self.at.rigid)]
            if place.name in self.at.driven:
                ways.append(self.at.along(place.name, self.at.dragged(place.name, usual_way(self.at, place.name))))
            for known in ways:
                explained = Explained(self.at)
                explained.add(known)
                yield self.columns_at(law, place, law.scanned(place, explained.known)[0], explained.known)

    def columns_of(self, model: EffortModel) -> Array:
        """Return what each coefficient of a model adds (n, k, p) to the efforts at the kept samples."""
        parts = [np.zeros((len(self.kept), len(self.at.driven), 0))]
        if model.toleranced:
            parts.append(self.at_kept(np.stack([self.deviations[i].efforts for i in model.toleranced], axis=-1)))
        at, others = self.at, model.with_terms(term for term in model.terms if not term.law.of_what_is_known)
        if others.terms != model.terms:
            at = self.knowing(others, fit(model)[0][np.isin(model.where, others.where)])
        for term in model.terms:
            known = at if term.law.of_what_is_known else self.at
            parts.append(self.at_kept(term.law.efforts_per(term.place, term.values, known)))
        return np.concatenate(parts, axis=2)

    def sizes(self, model: EffortModel, x: Array) -> Array:
        """Return by how much each term of a model changes each effort at the kept samples, (terms, k): RMS."""
        columns = self.columns_of(model)
        parts = [columns[:, :, model.slice_of(term)] @ x[model.slice_of(term)] for term in model.terms]
        return np.array([np.sqrt(np.mean(part**2, axis=0)) for part in parts]).reshape(-1, len(self.at.driven))

    def held_out_residual(self, model: EffortModel, columns: Array | None = None) -> Array:
        """Return the residual of the filtered efforts (n, k) where each block was not fitted; columns: `columns_of`."""
        columns, left = self.columns_of(model) if columns is None else columns, self.target.copy()
        for part in model.problem.columns.folds:
            x, _ = fit(model, part)
            for block in part:
                rows = model.problem.columns.parts[block]
                left[rows] -= columns[rows] @ x
        return left

    def held_out_squares_at(self, joint: str, model: EffortModel) -> float:
        """Return the held-out squares of a joint's effort, as it was measured and not whitened."""
        column = self.at.driven.index(joint)
        return float((self.held_out_residual(model)[self.good[:, column], column] ** 2).sum())

    def unwhitened(self, model: EffortModel, whitened: float = 1.0) -> EffortModel:
        """Return the same model of its own columns alone, each joint weighed by its size and not whitened.

        So is a prediction judged. The prior counts as much beside what is left as it does beside white noise, or beside
        a whitened residual of that mean square.
        """
        left = float(self.held_out_unwhitened(model).sum()) / max(int(self._plain.good.sum()), 1)
        return self._alone(model, self._plain, left / whitened)

    def whitened_by(self, model: EffortModel) -> PreparedEfforts:
        """Return the efforts whitened by what a model leaves: what was taken for noise may be what it explains."""
        other, residual = copy(self), self.target - self.columns_of(model) @ fit(model)[0]
        order = self.whitening.filters.shape[1] - 1
        other.whitening = Whitening(autoregression(residual, self.good, self.piece, order), self.whitening.good)
        return other

    def alone(self, model: EffortModel) -> EffortModel:
        """Return the same model of its own columns alone, as these efforts are whitened."""
        return self._alone(model, self.whitening)

    def _alone(self, model: EffortModel, whitening: Whitening, left: float = 1.0) -> EffortModel:
        """Return a model of its own columns alone, whitened; left: the mean square that a prior counts beside."""
        columns = DesignMatrix(whitening.target(np.nan_to_num(self.target)), self.blocks)
        columns.add([whitening(SparseColumns.of(self.columns_of(model)))])
        return model.alone_in(columns, left)

    def held_out_unwhitened(self, model: EffortModel) -> Array:
        """Return the held-out squares of all blocks (B,), each joint weighed by its size and not whitened."""
        left = np.where(self.good, self.held_out_residual(model) * self._plain.filters[:, 0], 0.0)
        return np.array([float((left[part] ** 2).sum()) for part in model.problem.columns.parts])

    def with_curves(
        self, model: EffortModel, whitening: Whitening | None = None, tried: Sequence[EffortLaw] = CURVES
    ) -> tuple[EffortModel, list[EffortCandidate]]:
        """Return the model with curves of no law among the candidates of its problem, and these."""
        problem = model.problem
        there = [candidate for candidate in problem.candidates if candidate.law.is_curve]
        if there:
            return model, there
        curves = self.scanned_columns(self._shown(tried), self.at)
        problem, new = self.extended(problem, curves, whitening)
        # where a block has a stretch of the way for itself, its knots are told by no other: they stay near nothing
        sizes, prior = np.sqrt(np.nanmean(np.where(self.good, self.target, np.nan) ** 2, axis=0)), problem.prior.copy()
        for curve in new:
            own = max(sizes[self.at.driven.index(curve.place.name)], np.finfo(float).tiny)
            prior[curve.where] = 1 / own**2
        return model.in_problem(replace(problem, prior=prior)), new

    def extended(
        self, problem: EffortProblem, laws: Iterable[LawColumns], whitening: Whitening | None = None
    ) -> tuple[EffortProblem, list[EffortCandidate]]:
        """Return the problem with columns of laws appended to its own, and these laws, further candidates in it.

        A problem that extends it already is none any more.
        """
        entered: list[tuple[EffortLaw, Place, Mapping[str, float]]] = []

        def whitened() -> Iterator[SparseColumns]:
            for law, place, values, columns in laws:
                entered.append((law, place, values))
                yield (whitening or self.whitening)(columns)

        places = problem.columns.add(whitened(), after=len(problem.prior))
        new = [EffortCandidate(*law, where) for law, where in zip(entered, places, strict=True)]
        prior = np.concatenate((problem.prior, *(self.prior_of(law, place) for law, place, _ in entered)))
        return self.with_candidates(problem.columns, (*problem.candidates, *new), prior), new

    def modelled(self, model: EffortModel, x: Array, at: InMotion | None = None) -> tuple[Array, Array]:
        """Return the efforts (N, k) of a model beyond the rigid robot's, not filtered, and of these those of bodies.

        at: another motion of the same robot, in which they are; None: this one.
        """
        explained = self._explained(model, x, at)
        return explained.efforts, explained.bodies

    def _explained(self, model: EffortModel, x: Array, at: InMotion | None = None) -> Explained:
        deviations, at = (self.deviations, self.at) if at is None else (self._deviations(at), at)
        explained, within = Explained(at), self.bodies_within_tolerance
        for index in model.toleranced:
            body = within[index]
            inertial = {} if body is None else {body[0]: x[index] * body[1]}
            explained.add(x[index] * deviations[index].efforts, body is not None, inertial)
        for term in model.terms:
            known, own = explained.known if term.law.of_what_is_known else at, x[model.slice_of(term)]
            inertial = {joint: per @ own for joint, per in term.law.of_body(term.place, at.mechanism).items()}
            explained.add(term.law.efforts_per(term.place, term.values, known) @ own, term.law.of_bodies, inertial)
        return explained

    def knowing(self, model: EffortModel, x: Array) -> InMotion:
        """Return the motion with the efforts that a model explains known: laws that follow from them act on these."""
        return self._explained(model, x).known

    def inertial_rank(self) -> tuple[int, int]:
        """Return the number of identifiable combinations of inertial parameters, and the number of parameters."""
        regressor, names = self.at.regressor, self.at.motion.names
        size = regressor.shape[2] * 10
        count = size
        if self.at.trajectory.spread is None:
            count = 10 * len({self.at.mechanism.joint(name).id for name in names})
        gram = np.zeros((size, size))
        for part in np.array_split(self.kept, len(self.kept) // MOST_SAMPLES + 1):
            table = regressor[part].reshape(-1, size)
            gram += table.T @ table
        sizes = np.sqrt(np.diag(gram))
        there = sizes > 1e-9 * sizes.max(initial=0.0)
        values = np.linalg.eigvalsh(gram[np.ix_(there, there)] / np.outer(sizes[there], sizes[there]))
        return int((values > EFFORT_TOLD * values.max(initial=0.0)).sum()), count

    @property
    def tolerance_of_gains(self) -> float:
        """The tolerance of drives' gains, of which their coefficients are multiples."""
        return next((item.tolerance for item in self.deviations if item.law.of_gain), 0.0)

    def with_given_gains(self, model: EffortModel) -> EffortModel:
        """Return the model with drives' gains as the efforts are divided by: they leave no room beside masses."""
        first = next((index for index, item in enumerate(self.deviations) if item.law.of_gain), None)
        if self.of_all_gains is None or first is None or first not in model.problem.blocks:
            return model
        block = model.problem.blocks[first] / UNSEEN**2
        return model.in_problem(replace(model.problem, blocks={**model.problem.blocks, first: block}))

    def gains_among(self, model: EffortModel) -> tuple[list[int], list[int]]:
        """Return the drives whose gains are free within a tolerance, and which coefficients of a model these are."""
        own = [(self.deviations[index], place) for place, index in enumerate(model.toleranced)]
        drives = [(self.at.driven.index(item.place), place) for item, place in own if item.law.of_gain]
        return [drive for drive, _ in drives], [place for _, place in drives]

    @property
    def bodies_within_tolerance(self) -> list[tuple[int, Array] | None]:
        """The joint and the body's parameters (10,) per tolerance of each toleranced parameter; None if of no body."""
        mechanism = self.at.mechanism
        joints = {name_of_body(mechanism, joint.id): joint.id for joint in mechanism.joints}
        return [None if item.inertial is None else (joints[item.place], item.inertial) for item in self.deviations]

    def base_parameters(self, law: EffortLaw) -> BaseParameters:
        """Return the base parameters of a law of all links' inertial parameters."""
        regressor = law.efforts_per(Place(""), {}, self.at)[self.kept]
        return BaseParameters.of(regressor.reshape(-1, len(law.linear)), law.linear)

    def _whole_problem(self, whitening: Whitening) -> EffortProblem:
        """Return the problem of all but laws that follow from what is known."""
        columns = DesignMatrix(whitening.target(np.nan_to_num(self.target)), self.blocks)
        if self.deviations:
            columns.add(whitening(self.as_columns(item.efforts[..., None])) for item in self.deviations)
        problem = self.with_candidates(columns, (), np.ones(len(self.deviations)))
        problem, candidates = self.extended(problem, self._fixed, whitening)
        for law in EFFORT_LAWS:
            single = [candidate for candidate in candidates if candidate.law is law]
            every = law.together([candidate.place for candidate in single])
            if every is not None and (len(single) > 1 or self._tells_more(problem, candidates, single)):
                where = slice(single[0].where.start, single[-1].where.stop)
                candidates.append(EffortCandidate(every, every.places(self.at.mechanism)[0], {}, where))
        self._own_size = columns.size
        return self.with_candidates(columns, candidates, problem.prior)

    def _tells_more(
        self, problem: EffortProblem, candidates: Iterable[EffortCandidate], single: Iterable[EffortCandidate]
    ) -> bool:
        """Return whether laws at one place tell anything that those which every drive has do not: a slide's mass is all
        that a rotor is.
        """
        common = [c for c in candidates if c.law.everywhere]
        own, others = ([i for c in some for i in range(c.where.start, c.where.stop)] for some in (single, common))
        total = problem.total
        left = total[np.ix_(own, own)] - total[np.ix_(own, others)] @ NormalEquations.of(
            total[np.ix_(others, others)]
        ).solve(total[np.ix_(others, own)])
        return bool((np.diag(left) > LITTLE**2 * np.diag(total)[own]).any())

    def with_candidates(
        self, columns: DesignMatrix, candidates: Sequence[EffortCandidate], prior: Array
    ) -> EffortProblem:
        """Return the problem of these columns, candidates and inverse variances of the coefficients (P,)."""
        own = ((c, c.law.covariance_inverse(c.place, self.at.mechanism)) for c in candidates)
        blocks = {
            c.where.start: block * (self._body_factor if c.law.body else 1.0) for c, block in own if block is not None
        }
        count = sum(item.law.of_gain for item in self.deviations)
        if self.of_all_gains is not None and count:
            of_all = self.of_all_gains / self.tolerance_of_gains
            blocks[len(self.deviations) - count] = precision_of_gains(1.0, of_all, count)
        return EffortProblem(self.at.mechanism, columns, tuple(candidates), prior, blocks)

    def with_learned_variances(self, model: EffortModel) -> tuple[PreparedEfforts, EffortModel]:
        """Return efforts and model with priors of nuisances and bodies as wide as is likeliest of each kind."""
        problem = model.problem
        kinds, usual = usual_precisions(model)
        factors = learned_precisions(model, kinds)
        bodies = {term.law.physics for term in model.terms if term.law.body}
        other = copy(self)
        other._body_factor = next((factors[kind] for kind in kinds if kind in bodies), 1.0)
        other._learned_priors = {name: factors[name[0]] * own for name, own in usual.items()}
        prior = problem.prior.copy()
        for candidate in problem.candidates:
            if candidate.name in usual:
                prior[candidate.where] = other.prior_of(candidate.law, candidate.place)
        return other, model.in_problem(other.with_candidates(problem.columns, problem.candidates, prior))

    def prior_of(self, law: EffortLaw, place: Place) -> Array:
        """Return inverse variances (p,) of a law's coefficients, in the unit of the whitened noise."""
        learned = self._learned_priors.get((law.physics, place.name)) if law.everywhere else None
        return law.prior(place, self.at.mechanism) if learned is None else learned

    def refreshed(self, model: EffortModel) -> EffortModel:
        """Return the model in a problem with new columns of laws that follow from what is known; its terms stay."""
        problem, columns = model.problem, model.problem.columns
        size, terms = self._own_size, []
        picked = list(range(size))
        for term in model.terms:
            if term.where.start >= self._own_size:
                picked += range(term.where.start, term.where.stop)
                term, size = replace(term, where=slice(size, size + term.size)), size + term.size
            terms.append(term)
        model = model.with_terms(terms)
        columns.pick(picked)
        fixed = [c for c in problem.candidates if c.where.start < self._own_size]
        kept = [term for term in terms if term.where.start >= self._own_size]
        problem = self.with_candidates(columns, (*fixed, *kept), problem.prior[picked])
        problem, _ = self.extended(problem, self._moving_columns(model.in_problem(problem)))
        return model.in_problem(problem)

    def _moving_columns(self, model: EffortModel) -> Iterator[LawColumns]:
        """Yield laws that follow from what is known by a model, and their columns: each of what is left without the
        plainer forms of it, whose place it would take.
        """
        x = fit(model)[0]
        at = self.knowing(model, x)
        for law, place in self._moving:
            plainer = [
                term for term in model.terms if term.law.family == law.family != "" and term.place.name == place.name
            ]
            rest = model.without(*plainer)
            own = np.isin(model.where, rest.where)
            yield from self.scanned_columns([(law, place)], self.knowing(rest, x[own]) if plainer else at)

    def start(self) -> EffortModel:
        """Return the model before any law: toleranced parameters."""
        problem = self.refreshed(EffortModel(self._whole_problem(self.whitening), ())).problem
        return EffortModel(problem, tuple(range(len(self.deviations))))

    def start_with_nuisances(self) -> EffortModel:
        """Return the same with what every drive has as nuisances, links' masses too where none is toleranced.

        All masses and all gains together are one unknown: where the gains' part of it is free, masses are as drawn.
        """
        start = self.start()
        weighed = any(item.inertial is not None for item in self.deviations)
        weighed = weighed or (self.of_all_gains or 0.0) > UNSEEN
        common = [c for c in start.problem.candidates if c.law.everywhere and not (c.law.body and weighed)]
        return replace(start, terms=tuple(common), keeps_nuisances=True)
