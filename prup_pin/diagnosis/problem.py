"""The problem: what was measured less what is simulated, whitened, and its Jacobians by every change of the simulation.

A `Problem` is a recording against a simulator. A `Fit` is one simulation with fitted laws and parameters: its residual,
its Jacobian by the laws' coordinates and by the toleranced parameters. Laws compete by what they do to first order
about a fit, at the cost of a few small products; only what wins is fitted through the whole simulation, by Gauss-Newton
steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from operator import is_
from typing import Any

import numpy as np

from ..channels import Noise, Stack
from ..laws import Effect, Setup
from ..simulation import Run, Simulator
from ..spatial import Array
from .candidates import Term
from .criteria import CALIBRATION_STEP, GAIN, LITTLE, MOST, NOTHING, SETTLED, UNSEEN, WIDEST_STEP
from .influence import Influence
from .nuisance import Nuisance, least_step, without
from .toleranced import Toleranced, changes_per_tolerance


@dataclass(frozen=True)
class Fit:
    """A simulation with fitted laws (`terms`) and parameters: its run, whitened residual (n, K) and chi squared.

    x (p,): toleranced parameters in multiples of their tolerances; p = 0 where the robot file is taken at its word.
    chi2: squares of the residual, of x, and of coordinates with a prior about zero (`Candidate.known`). changes
    (n, K, p): what the columns change per tolerance, taken at this fit or at one near by, which bends the next step of
    a parameter a little and no residual; per_tolerance (K n, p): the same whitened. begin: the setup that the laws
    come after.
    """

    terms: tuple[Term, ...]
    run: Run
    influence: Influence
    residual: Array
    chi2: float
    x: Array
    changes: Array
    per_tolerance: Array
    begin: Setup
    _made: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def samples(self) -> np.ndarray:
        return self.run.samples

    @property
    def effects(self) -> list[Effect]:
        return [term.effect for term in self.terms]

    @property
    def names(self) -> set[str]:
        """The names of all laws that are in it."""
        return {term.candidate.name for term in self.terms}

    def others(self, *index: int) -> tuple[list[int], list[Term]]:
        """Return the places of all terms but some, and these terms."""
        places = [place for place in range(len(self.terms)) if place not in index]
        return places, [self.terms[place] for place in places]

    def coordinates_of(self, index: int) -> slice:
        """Return where the coordinates of a term are among those of all terms."""
        begin = sum(term.candidate.size for term in self.terms[:index])
        return slice(begin, begin + self.terms[index].candidate.size)

    def near(self, other: Fit) -> Fit:
        """Return the fit with what another one near by changes per tolerance."""
        return replace(self, changes=other.changes, per_tolerance=other.per_tolerance)

    def once(self, what: Any, make: Callable[[], Any]) -> Any:
        """Return what its problem makes of this fit, made once: its Jacobian, what may be fitted beside a law."""
        if what not in self._made:
            self._made[what] = make()
        return self._made[what]


@dataclass(frozen=True, eq=False)
class TolerancePrior:
    """Parameters with a prior, and `effects`, the weight, that act beside any law.

    reach: by how many tolerances one may be off while laws are looked for, for all or (p,). start: the calibration at
    which all fits begin, None at the robot file; freed: the same where they may be off by any amount, if that is known.
    """

    toleranced: Toleranced
    effects: tuple[Effect, ...] = ()
    reach: float | Array = np.inf
    start: Fit | None = None
    freed: Fit | None = None

    def at(self, x: Array, changed: Sequence[Effect] = ()) -> list[Effect]:
        """Return what acts before any law, the parameters at x (p,); changed: effects found before, as they are."""
        return [*([self.toleranced.effect(x, changed)] if len(self.toleranced) else []), *self.effects]


@dataclass(frozen=True, eq=False)
class Problem:
    """A recording against a simulator: N samples of K columns, the noise, and the nominal run.

    Residuals are whitened by the noise alone, at the robot as its file has it, so that all laws are compared alike.
    `freed_module`: one that deforms at every sample as it likes, at the loads of `freed_at`; what that does to the
    columns is projected out of all residuals and changes. `tolerances`: parameters that are fitted within a prior.
    `by_wrench` (n, K, 6): how the noise of the wrench reaches the columns of the nominal run's samples, where that was
    told by what has been found: at the edge of a gap much farther than through the robot of the file.
    """

    simulator: Simulator
    stack: Stack
    noise: Noise
    nominal: Influence
    freed_module: str | None = None
    freed_at: Influence | None = None
    tolerances: TolerancePrior | None = None
    by_wrench: Array | None = None

    @classmethod
    def of(cls, simulator: Simulator, stack: Stack, noise: Noise, nominal: Run | None = None) -> Problem:
        """Return the problem; `nominal` is the run without any law where one is known."""
        return cls(simulator, stack, noise, Influence(simulator, simulator.run((), nominal), stack))

    def freed(self, influence: Influence, module: str) -> Problem:
        """Return the same problem with a module deforming at every sample as it likes, by its reach at an influence."""
        return replace(self, freed_module=module, freed_at=influence)

    @cached_property
    def first(self) -> Fit:
        """The fit of the robot as its file has it, within its tolerances."""
        if self.tolerances is None:
            none = np.zeros((len(self.nominal.run.samples), self.stack.size, 0))
            return self._fit((), self.nominal, np.zeros(0), none, self.nominal.run.setup)
        start = self.tolerances.start
        if start is None:
            return self.relinearised(self.off())
        return self._fit((), start.influence, start.x, start.changes, start.begin)

    def off(self, x: Array | None = None) -> Fit:
        """Return the fit without laws with toleranced parameters at x (p,), or at the robot file; not linearised."""
        x = np.zeros(len(self.prior.toleranced)) if x is None else x
        setup = self.setup((), x)
        influence = Influence(self.simulator, self.simulator.run_setup(setup), self.stack)
        return self._fit((), influence, x, np.zeros((len(influence), self.stack.size, len(x))), setup)

    def whitened_changes(self, influence: Influence, changes: Array) -> Array:
        """Return changes (n, K, p) of the columns in multiples of the noise, (K n, p)."""
        n, columns, p = changes.shape
        return (self.whiteners(influence) @ changes).reshape(n * columns, p)

    @property
    def drawn(self) -> Fit:
        """The fit of the robot as its file has it, nothing off."""
        return replace(self, tolerances=None).first

    @property
    def prior(self) -> TolerancePrior:
        """What may be off, and what acts beside any law."""
        return TolerancePrior(Toleranced.of((), {})) if self.tolerances is None else self.tolerances

    @property
    def acting(self) -> tuple[Effect, ...]:
        """What the calibration found to act whatever else does: weight."""
        return self.prior.effects

    def within(self, toleranced: Toleranced, effects: Sequence[Effect] = (), reach: float | Array = np.inf) -> Problem:
        """Return the same problem with parameters that may be off; effects act whatever else does.

        Parameters that leave the robot no equilibrium are left out.
        """
        return replace(self, tolerances=TolerancePrior(toleranced.possible(self.nominal), tuple(effects), reach))

    def as_open_as(self, other: Problem) -> Problem:
        """Return the same problem with what may be off in another one, and acts there; nothing is calibrated yet."""
        return replace(self, tolerances=replace(other.prior, start=None, freed=None))

    def beside(self, effects: Sequence[Effect]) -> Problem:
        """Return the same problem with other effects that act whatever else does."""
        return replace(self, tolerances=replace(self.prior, effects=tuple(effects)))

    def reaching(self, reach: float | Array) -> Problem:
        """Return the same problem with parameters that may be off by as many tolerances."""
        return replace(self, tolerances=replace(self.prior, reach=reach))

    def beginning(self, start: Fit, freed: Fit | None = None) -> Problem:
        """Return the same problem with fits that begin at a calibration; freed: as the prior says."""
        return replace(self, tolerances=replace(self.prior, start=start, freed=freed))

    # -- residuals -----------------------------------------------------------------------------------------------------

    def whiteners(self, influence: Influence) -> Array:
        """Return W (n, K, K) of an influence's samples: that of the robot file where these are its samples."""
        alike = np.array_equal(influence.run.samples, self.nominal.run.samples)
        return self._white if alike else self._white_at(influence, influence)

    def whiteners_at(self, influence: Influence) -> Array:
        """Return W (n, K, K) at the equilibria of an influence, nothing freed."""
        return self._white_at(influence, None)

    @cached_property
    def _white(self) -> Array:
        return self._white_at(self.nominal, self.freed_at)

    def _white_at(self, influence: Influence, freed_at: Influence | None) -> Array:
        run = influence.run
        by_wrench = self._by_wrench_at(influence)
        white = self.stack.whiteners(self.noise, by_wrench, self.compared(run), run.samples)
        if self.freed_module is None or freed_at is None:
            return white
        basis = _basis(white @ freed_at.signature(self.freed_module))
        return white - basis @ (basis.mT @ white)

    def _by_wrench_at(self, influence: Influence) -> Array:
        """Return how the noise of the wrench reaches the columns of an influence's samples, (n, K, 6)."""
        known, samples = self.nominal.run.samples, influence.run.samples
        if self.by_wrench is None or not np.isin(samples, known).all():
            return self.stack.seen(influence.first.by_wrench)
        return self.by_wrench[np.searchsorted(known, samples)]

    def reach(self, fit: Fit, module: str, resisted: bool = False) -> Array:
        """Return the whitened changes that a module's deformations can make, (n, K, k).

        Orthonormal columns at every sample, zero where a deformation does not reach what is measured. resisted: with
        whatever torques of joints that resist them.
        """
        influence = fit.influence

        def made() -> Array:
            moved = [influence.signature(module), *([influence.by_resistances] if resisted else [])]
            alike = [each / max(float(np.abs(each).max(initial=0.0)), 1e-300) for each in moved]  # m beside N m
            return _basis(self.whiteners(influence) @ np.concatenate(alike, axis=-1))

        return fit.once(("reach", module, resisted), made)

    def fit_at(self, terms: Sequence[Term], like: Fit, x: Array | None = None, near: bool = False) -> Fit:
        """Return the simulation with these terms, without fitting, toleranced parameters as in the fit `like`.

        x (p,): toleranced parameters elsewhere; near: no farther from that fit's equilibria than Newton's method finds.
        """
        x = like.x if x is None else x
        begin = self.setup((), x)
        setup = self.setup([term.effect for term in terms], x, begin)
        run = self.simulator.run_setup(setup, like.run, near=near)
        return self._fit(terms, Influence(self.simulator, run, self.stack), x, like.changes, begin)

    def relinearised(self, fit: Fit) -> Fit:
        """Return a fit with the change per tolerance taken at it."""
        if self.tolerances is None:
            return fit
        effects = [*self.tolerances.effects, *fit.effects]
        changes = changes_per_tolerance(self.simulator, fit.influence, self.tolerances.toleranced, fit.x, effects)
        return replace(fit, changes=changes, per_tolerance=self.whitened_changes(fit.influence, changes))

    def setup(self, effects: Sequence[Effect], x: Array, begin: Setup | None = None) -> Setup:
        """Return the simulation with these effects, toleranced parameters at x (p,); begin: the same without any.

        An effect that was found before and has changed enters in its own place, all others after what acts.
        """
        changed = [effect for effect in effects if effect.law.instead_of is not None]
        if begin is None or changed:
            begin = self.simulator.setup([] if self.tolerances is None else self.tolerances.at(x, changed))
        return self.simulator.setup([effect for effect in effects if effect.law.instead_of is None], begin)

    def setup_at(self, fit: Fit, effects: Sequence[Effect]) -> Setup:
        """Return the simulation with these effects, toleranced parameters as in a fit."""
        changed = [effect for effect in effects if effect.law.instead_of is not None]
        own = fit.effects
        if not changed or not all(effect in own for effect in changed):
            return self.setup(effects, fit.x, fit.begin)
        key = ("begin", *(own.index(effect) for effect in changed))
        begin = fit.once(key, lambda: self.setup(changed, fit.x))
        return self.simulator.setup([effect for effect in effects if effect.law.instead_of is None], begin)

    def _fit(self, terms: Sequence[Term], influence: Influence, x: Array, changes: Array, begin: Setup) -> Fit:
        run = influence.run
        residual = self.whitened(influence, self.stack.residual(run)[run.samples])
        chi2 = float((residual**2).sum() + x @ x + sum(term.off @ term.off for term in terms))
        if (self.nominal.run.solved & ~run.solved).any():
            chi2 = np.inf  # samples that these values leave without an answer must not count as a good fit
        held = self.whitened_changes(influence, changes)
        return Fit(tuple(terms), run, influence, residual, chi2, x, changes, held, begin)

    def compared(self, run: Run) -> np.ndarray:
        """Return which numbers of a run's samples were both measured and simulated, (n, K)."""
        return self.stack.exists[run.samples] & run.solved[run.samples, None]

    def count(self, fit: Fit) -> int:
        """Return how many numbers of a fit's residual were both measured and simulated."""
        return int(self.compared(fit.run).sum())

    def target(self, fit: Fit, nuisance: Nuisance | None = None) -> Array:
        """Return the whitened residual (n, K) of a fit with what its toleranced parameters do put back, first order.

        And what the terms of a nuisance do by which they are off what is known of them.
        """
        target = fit.residual
        if self.tolerances is not None:
            target = target + (fit.per_tolerance @ fit.x).reshape(target.shape)
        if nuisance is not None and nuisance.offset is not None:
            target = target + nuisance.offset.reshape(target.shape)
        return target

    def whitened(self, influence: Influence, values: Array) -> Array:
        """Return values (n, K) of the columns in multiples of the noise."""
        return (self.whiteners(influence) @ values[..., None])[..., 0]

    def change(self, fit: Fit, effects: Sequence[Effect]) -> Array:
        """Return the whitened change of the columns (n, K) from a fit to other effects, to first order."""
        return self.whitened(fit.influence, fit.influence.change(self.setup_at(fit, effects)))

    def without_tolerances(self, fit: Fit, values: Array) -> Array:
        """Return whitened values (K n, ...) less what the toleranced parameters of a fit may take of them."""
        return without(values, self.nuisance(fit, ()))

    def deviations(self, fit: Fit) -> Array:
        """Return the standard deviations (p,) of the coordinates of all terms, widened where more than noise is left.

        Infinite where the data do not depend on one. Combinations that they do not tell are known as what is usual.
        """
        candidates = [term.candidate for term in fit.terms]
        firm = np.diag(np.concatenate([np.zeros(0), *(each.known for each in candidates)]))
        jacobian = np.vstack((self.without_tolerances(fit, self.jacobian(fit)), firm))
        scale = np.linalg.norm(jacobian, axis=0)
        unseen = scale < UNSEEN
        scale = np.where(unseen, 1.0, scale)
        usual = np.concatenate([np.zeros(0), *(each.usual_spread for each in candidates)])
        _, sizes, axes = np.linalg.svd(np.vstack((jacobian, np.diag(1 / usual))) / scale, full_matrices=False)
        variances = ((axes / sizes[:, None]) ** 2).sum(axis=0) / scale**2
        left = max(1.0, fit.chi2 / max(self.count(fit), 1))
        return np.where(unseen, np.inf, np.sqrt(variances * left))

    # -- fits ----------------------------------------------------------------------------------------------------------

    def nuisance(self, fit: Fit, kept: Sequence[int]) -> Nuisance | None:
        """Return what some of a fit's terms, given by their places, and the toleranced parameters may do together."""
        return fit.once(("nuisance", *kept), lambda: self._nuisance(fit, kept))

    def _nuisance(self, fit: Fit, kept: Sequence[int]) -> Nuisance | None:
        sizes = np.cumsum([0, *(term.candidate.size for term in fit.terms)])
        columns = [column for place in kept for column in range(sizes[place], sizes[place + 1])]
        free = self.jacobian(fit)[:, columns] if columns else np.zeros((fit.residual.size, 0))
        known = np.concatenate([np.zeros(0), *(fit.terms[place].candidate.known for place in kept)])
        firm, offset = known > 0, None
        held, free = free[:, firm] / known[firm], free[:, ~firm]
        if firm.any():
            offset = held @ np.concatenate([fit.terms[place].off for place in kept])[firm]
        if self.tolerances is not None:
            return Nuisance.within(free, np.concatenate((held, fit.per_tolerance), axis=1), offset)
        if firm.any():
            return Nuisance.within(free, held, offset)
        return Nuisance.free(free) if columns else None

    @property
    def farthest(self) -> float:
        """By how many tolerances a parameter may be off while laws are looked for."""
        return float(np.max(self.prior.reach))

    def is_held_back(self, fit: Fit) -> bool:
        """Return True where a parameter would go farther than laws are looked for."""
        return bool(np.abs(fit.x).max(initial=0.0) > (1 - UNSEEN) * self.farthest)

    def refine(self, terms: Sequence[Term], start: Fit, reach: float | None = None) -> Fit:
        """Return the fit of all terms and toleranced parameters together through the whole simulation.

        Parameters within `reach` tolerances, by default the problem's.
        """
        reach = self.farthest if reach is None else reach
        return min((self._descended(begun, reach) for begun in self._begun(terms, start)), key=_objective)

    def _descended(self, fit: Fit, reach: float) -> Fit:
        """Return where Gauss-Newton steps lead from a fit, shortened where they do not help.

        The change per tolerance is taken anew where a step with it gained less than it promised.
        """
        fresh = False
        for _ in range(_MOST_STEPS):
            if not (fit.terms or len(fit.x)) or not np.isfinite(fit.chi2):
                return fit
            step, enough = self._step(fit, reach), max(SETTLED, 1e-5 * fit.chi2)
            promised = self._promised(fit, step)
            if promised < enough:
                return fit
            better = next((each for each in self._tries(fit, reach, step) if _objective(each) < _objective(fit)), fit)
            gained, stands = _objective(fit) - _objective(better), better is fit
            if gained < enough and (fresh or not stands):
                return better
            fit, fresh = better, False
            if gained < (1 - LITTLE) * promised:
                fit, fresh = self.relinearised(fit), True
        return fit

    def _promised(self, fit: Fit, step: Array) -> float:
        """Return the chi squared that a step gains to first order."""
        jacobian, residual, held = self._with_priors(fit)
        count = jacobian.shape[1]
        left, x = residual - jacobian @ step[:count] - held @ step[count:], fit.x + step[count:]
        return float(residual @ residual + fit.x @ fit.x - left @ left - x @ x)

    def _tries(self, fit: Fit, reach: float, step: Array) -> Iterator[Fit]:
        """Yield fits a step further: the whole step, shorter ones, and those that leave what data hardly tell.

        Where samples near all of these equilibria too slowly, the whole step and shorter ones by a longer search.
        """
        steps = [share * step for share in shortened(LITTLE)]
        damped = (self._step(fit, reach, damping) for damping in (UNSEEN, GAIN, MOST)) if fit.terms else ()
        stands = False
        for each in chain(steps, damped):
            moved = self._moved(fit, each)
            stands |= bool(np.isfinite(moved.chi2))
            yield moved
        if not stands:
            yield from (self._moved(fit, each, near=False) for each in steps)

    def _begun(self, terms: Sequence[Term], start: Fit) -> Iterator[Fit]:
        """Yield fits from which terms are fitted: as they stand, or new ones at a share of what they do.

        First order may ask for a law at which the robot could not be: it does less where no equilibrium is near. Where
        a law joins others whose gaps have closed, these begin open, too.
        """
        if len(terms) == len(start.terms) and all(map(is_, terms, start.terms)):
            yield start
            return
        known = start.names
        joins = not all(term.candidate.name in known for term in terms)
        opened = self._opened(terms, start) if joins else terms
        for each in (terms,) if opened is terms else (terms, opened):
            fit = start
            for share in shortened(LITTLE):
                less = [term if term.candidate.name in known else term.lessened(share) for term in each]
                fit = self.fit_at(less, start, near=True)
                if np.isfinite(fit.chi2):
                    break
            else:  # some that near their equilibria slowly are given up there
                fit = self.fit_at(each, start)
            yield self.relinearised(fit)

    def _opened(self, terms: Sequence[Term], start: Fit) -> Sequence[Term]:
        """Return terms whose gaps that a fit has close within as large loads as what was measured nearly allows.

        No step leads a sample over a gap that closes within less than the step moves its load.
        """
        own, asked = list(start.terms), [term.candidate.name for term in terms]
        most = float((start.residual**2).sum()) / LITTLE
        opened = {}
        for index, term in enumerate(own):
            for wider in term.wider() if term.candidate.name in asked else ():
                other = [*own[:index], wider, *own[index + 1 :]]
                left = start.residual - self.change(start, [each.effect for each in other])
                if float((left**2).sum()) <= most:
                    own[index] = opened[term.candidate.name] = wider
                    break
        return [opened.get(name, term) for name, term in zip(asked, terms, strict=True)] if opened else terms

    def _moved(self, fit: Fit, step: Array, near: bool = True) -> Fit:
        """Return a fit whose terms and toleranced parameters have moved by a step, (p,), within their bounds.

        near: as in `fit_at`.
        """
        moved, place = [], 0
        for term in fit.terms:
            candidate = term.candidate
            widest = np.where(candidate.logarithmic, WIDEST_STEP, np.inf)
            own = np.clip(step[place : place + candidate.size], -widest, widest)
            moved.append(Term(candidate, np.clip(term.coordinates + own, *candidate.bounds)))
            place += candidate.size
        return self.fit_at(moved, fit, fit.x + step[place:], near=near)

    def _step(self, fit: Fit, reach: float, damping: float = 0.0) -> Array:
        """Return the Gauss-Newton step of a fit's coordinates and of its toleranced parameters.

        damping: Levenberg's, of coordinates, as a share of what each of them does.

        Coordinates that it would take beyond their bounds go to these, and the others do what is best then. A logarithm
        is trusted for less than that.
        """
        jacobian, residual, held = self._with_priors(fit)
        bounds = [(term.coordinates, *term.candidate.bounds, term.candidate.logarithmic) for term in fit.terms]
        if not bounds:
            return least_step(jacobian, residual, held, fit.x, reach)
        here, low, high, logarithmic = (np.concatenate(parts) for parts in zip(*bounds, strict=True))
        step, open_ = np.zeros(len(here)), np.ones(len(here), bool)
        while True:
            left = residual - jacobian[:, ~open_] @ step[~open_]
            found = least_step(jacobian[:, open_], left, held, fit.x, reach, damping)
            step[open_] = found[: open_.sum()]
            within = np.clip(here + step, low, high) - here
            beyond = open_ & ~logarithmic & (np.abs(step - within) > NOTHING * np.abs(within))
            if not beyond.any():
                return np.concatenate((step, found[open_.sum() :]))
            step[beyond] = within[beyond]
            open_ &= ~beyond

    def _with_priors(self, fit: Fit) -> tuple[Array, Array, Array]:
        """Return Jacobian, residual and change per tolerance with a row for the prior of each coordinate of a term."""
        if not fit.terms:
            return self.jacobian(fit), fit.residual.ravel(), fit.per_tolerance
        own = [(term.candidate, term.coordinates) for term in fit.terms]
        rows = np.concatenate([candidate.prior_slopes(here) + candidate.known for candidate, here in own])
        off = np.concatenate([term.candidate.prior_residuals(term.coordinates) + term.off for term in fit.terms])
        jacobian = np.vstack((self.jacobian(fit), np.diag(rows)))
        per_tolerance = np.vstack((fit.per_tolerance, np.zeros((len(rows), len(fit.x)))))
        return jacobian, np.append(fit.residual, -off), per_tolerance

    def jacobian(self, fit: Fit) -> Array:
        """Return d(whitened columns)/d(coordinates of all terms), (K n, p), by differences of first-order changes."""
        return fit.once("jacobian", lambda: self._jacobian(fit))

    def _jacobian(self, fit: Fit) -> Array:
        effects = fit.effects
        columns = []
        for index, term in enumerate(fit.terms):
            for place in range(term.candidate.size):
                step = 1e-3 * term.candidate.scales()[place]
                low, high = (bound[place] for bound in term.candidate.bounds)
                here = term.coordinates[place]
                begin, end = max(here - step, min(low, here)), min(here + step, max(high, here))
                ends = []
                for coordinate in (end, begin):
                    moved = term.coordinates.copy()
                    moved[place] = coordinate
                    changed = list(effects)
                    changed[index] = term.candidate.effect(moved)
                    ends.append(self.change(fit, changed))
                columns.append(((ends[0] - ends[1]) / (end - begin)).ravel())
        return np.array(columns).T if columns else np.zeros((fit.residual.size, 0))


def _objective(fit: Fit) -> float:
    """Return chi squared and what terms cost by values far from what is usual, of those that are no logarithms."""
    return fit.chi2 + sum(float((term.candidate.prior_residuals(term.coordinates) ** 2).sum()) for term in fit.terms)


def shortened(least: float = CALIBRATION_STEP) -> Iterator[float]:
    """Yield shares of a step, each a third of the one before, down to the least."""
    share = 1.0
    while share >= least:
        yield share
        share /= 3


#: Steps through the whole simulation in which nearly all fits have ended.
_MOST_STEPS = 6


def _basis(directions: Array) -> Array:
    """Return orthonormal columns (n, K, k) that span directions (n, K, k), zero where these are none."""
    basis, sizes, _ = np.linalg.svd(directions, full_matrices=False)
    return basis * (sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300))[:, None, :]
