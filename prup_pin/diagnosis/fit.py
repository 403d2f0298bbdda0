"""Fitting laws: quickly, through first-order influences; finally, through the whole simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..laws import Effect
from ..simulation import Run, Simulator
from ..spatial import Array
from .candidates import Candidate
from .influence import Influence
from .residual import Measured, Noise, whitening

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
    """A simulation with fitted terms: its run, influences, whitened residual (n, 6) and chi squared."""

    terms: tuple[Term, ...]
    run: Run
    influence: Influence
    residual: Array
    chi2: float

    @property
    def samples(self) -> np.ndarray:
        return self.run.samples


class Problem:
    """A recording's pose channel against a simulator."""

    def __init__(self, simulator: Simulator, measured: Measured, noise: Noise):
        self.simulator, self.measured, self.noise = simulator, measured, noise
        self._whitening: tuple[np.ndarray, Array] | None = None
        self._solved: np.ndarray | None = None

    # -- residuals -----------------------------------------------------------------------------------------------------

    def whiteners(self, influence: Influence) -> Array:
        """Return W (n, 6, 6) of an influence's samples; computed once, at the first one."""
        samples = influence.run.samples
        if self._whitening is None or len(self._whitening[0]) != len(samples):
            exists = self.measured.exists[samples] & influence.run.solved[samples, None]
            self._whitening = samples, whitening(self.noise, influence.compliance, exists)
        return self._whitening[1]

    def reach(self, influence: Influence, module: str) -> Array:
        """Return the whitened pose changes that a module's deformations can make, (n, 6, k).

        Orthonormal columns at every sample, zero where a deformation does not reach the tool.
        """

        def compute() -> Array:
            directions = self.whiteners(influence) @ influence.signature(module)
            basis, sizes, _ = np.linalg.svd(directions, full_matrices=False)
            return basis * (sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300))[:, None, :]

        return influence.first.once(("reach", module), compute)

    def freed(self, influence: Influence, module: str) -> Problem:
        """Return the same problem with a module deforming at every sample as it likes.

        What its deformations do to the pose is projected out of all residuals and changes.
        """
        white, basis = self.whiteners(influence), self.reach(influence, module)
        other = Problem(self.simulator, self.measured, self.noise)
        other._whitening = influence.run.samples, white - basis @ (basis.mT @ white)
        other._solved = self._solved
        return other

    def fit_at(self, terms: Sequence[Term], start: Run | None = None) -> Fit:
        """Return the simulation with these terms, without fitting."""
        run = self.simulator.run([term.effect for term in terms], start)
        influence = Influence(self.simulator, run)
        residual = self.residual(run, influence)
        chi2 = float((residual**2).sum())
        if self._solved is None:
            self._solved = run.solved.copy()
        elif (self._solved & ~run.solved).any():
            chi2 = np.inf  # samples that these values leave without an answer must not count as a good fit
        return Fit(tuple(terms), run, influence, residual, chi2)

    def residual(self, run: Run, influence: Influence) -> Array:
        """Return the whitened residual of a run's samples, (n, 6)."""
        raw = self.measured.residual(run.position, run.rotation)[run.samples]
        return (self.whiteners(influence) @ raw[..., None])[..., 0]

    def change(self, fit: Fit, effects: Sequence[Effect]) -> Array:
        """Return the whitened change of the pose (n, 6) from a fit to other effects, to first order."""
        setup = self.simulator.setup(effects)
        moved = fit.influence.change(setup)
        return (self.whiteners(fit.influence) @ moved[..., None])[..., 0]

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
        """Return (chi squared, fitted term, change (n, 6)) of a candidate on top of `kept`, to first order about `fit`.

        `beside` (6 n, p): orthonormal changes by the kept terms, which are so fitted together with the candidate; the
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
        """Return orthonormal changes (6 n, p) by some of a fit's terms, given by their places; None for none."""
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
        """Return d(whitened pose)/d(coordinates of all terms), (6 n, p), by differences of first-order changes."""
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


def without(values: Array, beside: Array | None) -> Array:
    """Return values (m,) less their part in the span of orthonormal columns (m, p)."""
    return values if beside is None else values - beside @ (beside.T @ values)


def _least_step(jacobian: Array, residual: Array) -> Array:
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.linalg.lstsq(jacobian / scale, residual, rcond=1e-8)[0] / scale
