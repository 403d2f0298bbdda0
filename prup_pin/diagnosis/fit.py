"""Fitting laws: quickly, through first-order influences; finally, through the whole simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from ..channels import Noise, Stack
from ..laws import Effect
from ..simulation import Run, Simulator
from ..spatial import Array
from .candidates import Candidate
from .influence import Influence

__all__ = ["Fit", "Problem", "Term", "without"]


@dataclass(frozen=True)
class Term:
    """A candidate with fitted coordinates (p,)."""

    candidate: Candidate
    coordinates: Array

    @property
    def effect(self) -> Effect:
        return self.candidate.effect(self.coordinates)


@dataclass(frozen=True)
class Fit:
    """A simulation with fitted terms: its run, influences, whitened residual (n, K) and chi squared."""

    terms: tuple[Term, ...]
    run: Run
    influence: Influence
    residual: Array
    chi2: float

    @property
    def samples(self) -> np.ndarray:
        return self.run.samples


@dataclass(frozen=True, eq=False)
class Problem:
    """What a recording measured against a simulator: N samples of K columns.

    The metric is that of noise alone, taken at the robot as its file has it, so that all laws are compared alike.
    `freed_module` deforms at every sample as it likes: what that does to the columns is projected out of all residuals
    and changes.
    """

    simulator: Simulator
    stack: Stack
    noise: Noise
    nominal: Influence
    freed_module: str | None = None
    freed_at: Influence | None = None

    @classmethod
    def of(cls, simulator: Simulator, stack: Stack, noise: Noise, nominal: Run | None = None) -> Problem:
        """Return the problem; `nominal` is the run without any law where one is known."""
        return cls(simulator, stack, noise, Influence(simulator, simulator.run((), nominal), stack))

    def freed(self, influence: Influence, module: str) -> Problem:
        """Return the same problem with a module deforming at every sample as it likes, by its reach at an influence."""
        return replace(self, freed_module=module, freed_at=influence)

    @cached_property
    def first(self) -> Fit:
        """The fit of the robot as its file has it."""
        return self._fit((), self.nominal)

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
        exists = self.stack.exists[run.samples] & run.solved[run.samples, None]
        white = self.stack.whiteners(self.noise, influence.first, exists)
        if self.freed_module is None or freed_at is None:
            return white
        basis = _basis(white @ freed_at.signature(self.freed_module))
        return white - basis @ (basis.mT @ white)

    def reach(self, influence: Influence, module: str) -> Array:
        """Return the whitened changes that a module's deformations can make, (n, K, k).

        Orthonormal columns at every sample, zero where a deformation does not reach what is measured.
        """
        return influence.first.once(
            ("reach", self, module), lambda: _basis(self.whiteners(influence) @ influence.signature(module))
        )

    def fit_at(self, terms: Sequence[Term], start: Run | None = None) -> Fit:
        """Return the simulation with these terms, without fitting."""
        run = self.simulator.run([term.effect for term in terms], start)
        return self._fit(terms, Influence(self.simulator, run, self.stack))

    def _fit(self, terms: Sequence[Term], influence: Influence) -> Fit:
        run = influence.run
        residual = self.whitened(influence, self.stack.residual(run)[run.samples])
        chi2 = float((residual**2).sum())
        if (self.nominal.run.solved & ~run.solved).any():
            chi2 = np.inf  # samples that these values leave without an answer must not count as a good fit
        return Fit(tuple(terms), run, influence, residual, chi2)

    def whitened(self, influence: Influence, values: Array) -> Array:
        """Return values (n, K) of the columns in multiples of the noise."""
        return (self.whiteners(influence) @ values[..., None])[..., 0]

    def change(self, fit: Fit, effects: Sequence[Effect]) -> Array:
        """Return the whitened change of the columns (n, K) from a fit to other effects, to first order."""
        return self.whitened(fit.influence, fit.influence.change(self.simulator.setup(effects)))

    def module_of(self, candidate: Candidate) -> str | None:
        """Return the module through whose deformation alone a candidate acts, or None where it acts otherwise too."""
        return candidate.only_module

    # -- fits ----------------------------------------------------------------------------------------------------------

    def quick(
        self,
        fit: Fit,
        kept: Sequence[Term],
        candidate: Candidate,
        starts: Sequence[Array] | None = None,
        limit: int = 25,
        beside: Array | None = None,
    ) -> tuple[float, Term, Array]:
        """Return (chi squared, fitted term, change (n, K)) of a candidate on top of `kept`, to first order about `fit`.

        `beside` (K n, p): orthonormal changes by the kept terms, which are so fitted together with the candidate; the
        change returned is what they cannot do.
        """
        effects = [term.effect for term in kept]
        target = fit.residual
        low, high = candidate.bounds

        def left(coordinates: Array) -> Array:
            changed = self.change(fit, [*effects, candidate.effect(coordinates)])
            with np.errstate(invalid="ignore"):
                return without(np.nan_to_num((target - changed).ravel(), nan=1e6, posinf=1e6, neginf=-1e6), beside)

        steps = 1e-4 * candidate.scales()

        def slope(coordinates: Array) -> Array:
            # steps of a fixed size: those in proportion to a coordinate vanish with it
            here, columns = left(coordinates), []
            for place, step in enumerate(np.where(coordinates + steps > high, -steps, steps)):
                moved = coordinates.copy()
                moved[place] += step
                columns.append((left(moved) - here) / step)
            return np.array(columns).T

        begins = [np.clip(start, low, high) for start in (starts if starts is not None else candidate.scan())]
        if len(begins) > 1:
            begins.sort(key=lambda start: float((left(start) ** 2).sum()))
        found = least_squares(
            left,
            begins[0],
            slope,
            bounds=(low - 1e-12 * np.abs(low) - 1e-300, high + 1e-12 * np.abs(high) + 1e-300),
            x_scale=candidate.scales(),
            max_nfev=limit,
            ftol=1e-6,
            xtol=1e-6,
            gtol=1e-10,
        )
        term = Term(candidate, found.x)
        change = self.change(fit, [*effects, term.effect])
        return 2 * float(found.cost), term, without(change.ravel(), beside).reshape(change.shape)

    def beside(self, fit: Fit, kept: Sequence[int]) -> Array | None:
        """Return orthonormal changes (K n, p) by some of a fit's terms, given by their places; None for none."""
        sizes = np.cumsum([0, *(term.candidate.size for term in fit.terms)])
        columns = [column for place in kept for column in range(sizes[place], sizes[place + 1])]
        if not columns:
            return None
        jacobian = self.jacobian(fit)[:, columns]
        left, size, _ = np.linalg.svd(
            jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300), full_matrices=False
        )
        return left[:, size > 1e-6]

    def refine(self, terms: Sequence[Term], start: Fit, rounds: int = 6) -> Fit:
        """Return the fit of all terms together through the whole simulation (Gauss-Newton, steps halved)."""
        fit = self.fit_at(terms, start.run)
        for _ in range(rounds):
            if not fit.terms or not np.isfinite(fit.chi2):
                return fit
            jacobian = self.jacobian(fit)
            step = _least_step(jacobian, fit.residual.ravel())
            share, better = 1.0, None
            sizes = [term.candidate.size for term in fit.terms]
            while share > 0.1:
                trial, place = [], 0
                for term, size in zip(fit.terms, sizes, strict=True):
                    low, high = term.candidate.bounds
                    moved = share * step[place : place + size]
                    moved = np.clip(moved, -2.0 * term.candidate.scales(), 2.0 * term.candidate.scales() + 0)
                    if not term.candidate.logarithmic.all():
                        moved = np.where(term.candidate.logarithmic, moved, share * step[place : place + size])
                    trial.append(Term(term.candidate, np.clip(term.coordinates + moved, low, high)))
                    place += size
                attempt = self.fit_at(trial, fit.run)
                if attempt.chi2 < fit.chi2:
                    better = attempt
                    break
                share /= 3
            if better is None:
                return fit
            gained = fit.chi2 - better.chi2
            fit = better
            if gained < max(0.02, 1e-5 * fit.chi2):
                return fit
        return fit

    def jacobian(self, fit: Fit) -> Array:
        """Return d(whitened columns)/d(coordinates of all terms), (K n, p), by differences of first-order changes."""
        effects = [term.effect for term in fit.terms]
        columns = []
        for index, term in enumerate(fit.terms):
            for place in range(term.candidate.size):
                step = 1e-3 * term.candidate.scales()[place]
                ends = []
                for sign in (1.0, -1.0):
                    moved = term.coordinates.copy()
                    moved[place] += sign * step
                    changed = list(effects)
                    changed[index] = term.candidate.effect(moved)
                    ends.append(self.change(fit, changed))
                columns.append(((ends[0] - ends[1]) / (2 * step)).ravel())
        return np.array(columns).T if columns else np.zeros((fit.residual.size, 0))


def _basis(directions: Array) -> Array:
    """Return orthonormal columns (n, K, k) that span directions (n, K, k), zero where these are none."""
    basis, sizes, _ = np.linalg.svd(directions, full_matrices=False)
    return basis * (sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300))[:, None, :]


def without(values: Array, beside: Array | None) -> Array:
    """Return values (m,) less their part in the span of orthonormal columns (m, p)."""
    return values if beside is None else values - beside @ (beside.T @ values)


def _least_step(jacobian: Array, residual: Array) -> Array:
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.linalg.lstsq(jacobian / scale, residual, rcond=1e-8)[0] / scale
