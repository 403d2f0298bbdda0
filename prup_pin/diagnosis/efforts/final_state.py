"""What was fitted to efforts, and which of it is a law by name: what imitates something else is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from ...laws import Effect, Law, Place
from ...laws.efforts import Body
from ...laws.efforts.deviations import EffortDeviation
from ...recordings import Recording
from ...recordings.columns import AS_LOGGED
from ...robot import Robot
from ...spatial import Array
from ..chances import hotelling_sf, student_95, student_sf
from ..criteria import FALSE_ALARM, GAIN, LITTLE, MOST, NO_MATTER, ROUNDING, SURE
from ..normal_equations import NormalEquations, column_scales
from .belongs import Doubt
from .evidence import CrossValidation, held_out, relative_gain
from .gains import Gains, scale_of
from .inertial import BaseParameters, consistent_fit
from .noise import EffortNoise, true_sizes
from .outliers import OutlierInterval
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, block_squares, fit
from .search import squared_strain, without_needless_nuisances
from .shares import gains_apart, in_another_unit


def shows(sizes: Array | float, noise: Array | float) -> bool:
    """Return whether what is added to efforts (k,), RMS, is as much in one as a sample could show, where that is known.

    noise (k,): of a sample of each; NaN where nothing tells it.
    """
    return bool(np.any(sizes > MOST * np.nan_to_num(noise)))


class ChangedParameters(NamedTuple):
    """Base parameters (b,): their change from the drawing, half the 95 % interval of that, and the probability that
    chance alone would change any of them so much.
    """

    base: BaseParameters
    change: Array
    reach: Array
    chance: Array


class FinalState:
    """The final fit, and which of its terms are laws by name; findings, figures and the verdict are read from it.

    `model`: what the corrected model holds, with coefficients `x` (p,) and their `normal` matrix (p, p); `with_time`:
    the same with curves over time; `laws`: terms that are findings by name; `impossible`: links whose parameters no
    body has; `curves`: curves of no law; `scale` (k,): reported per true effort; `in_own_units`: whether no drive
    reports in N or N m, which is how the log is written; `noise`: of a recorded sample of each effort; `held_out` (B,):
    squared residuals of blocks that were not fitted; `squared_strain`: of toleranced parameters.
    """

    def __init__(
        self,
        robot: Robot,
        recording: Recording,
        efforts: PreparedEfforts,
        noise: Mapping[str, EffortNoise],
        model: EffortModel,
        curves: Sequence[EffortCandidate],
        imitating: Sequence[EffortCandidate],
        gains: Gains | None = None,
        outliers: Sequence[OutlierInterval] = (),
        doubts: Sequence[Doubt] = (),
    ):
        self.robot, self.imitating = robot, imitating
        self.gains, self.outliers, self.doubts = gains, outliers, doubts
        # all figures are in the recording's own unit
        self.scale = scale_of(gains, len(efforts.at.driven))
        self.in_own_units = gains_apart(dict(zip(efforts.at.driven, map(float, self.scale), strict=True)))
        self.recording, self.efforts, self.noise = recording, efforts, noise
        self.problem, self.with_time, self.curves = model.problem, model, list(curves)
        self.mechanism, self.at, self.motion = robot.mechanism, efforts.at, efforts.at.motion
        # another recording has its own time
        self.model = model.with_terms(term for term in model.terms if not term.is_of_time)
        sure = without_needless_nuisances(self.model).terms
        self.laws = [term for term in sure if not term.law.is_curve and term not in imitating]
        self.x, self._apart, self.normal = self._coefficients()
        self.laws = self._material(self.laws)
        self.held_out = self._validation.squares
        self.impossible = self._impossible_bodies(fit(self.model)[0])
        self.laws = [term for term in self.laws if not self._imitates_impossible(term)]
        self.squared_strain = squared_strain(self.model)

    def with_model(self, model: EffortModel, efforts: PreparedEfforts | None = None) -> FinalState:
        """Return the final state of another model, whose curves are findings no more, of the same efforts.

        efforts: these as they are whitened there, if otherwise.
        """
        same = self.robot, self.recording, efforts or self.efforts, self.noise
        curves = [curve for curve in self.curves if curve in model.terms]
        return FinalState(*same, model, curves, self.imitating, self.gains, self.outliers, self.doubts)

    def _coefficients(self) -> tuple[Array, Array, Array]:
        """Return the coefficients (p,) of the prediction, of bodies that can exist; how much they depend on the weights
        of joints and frequencies (p,); and their normal matrix. Drives' gains are those by which efforts are divided,
        friction and all: only their uncertainty is free.

        Whitened, unless plain weights leave less of the efforts in their own units on held-out blocks: where what
        is left is what laws and curves lack, it is no noise. Two weights would tell the same of a model that lacks
        nothing, but for noise (Hausman 1978): what they tell apart is what it lacks, and no block's scatter shows it.
        The prior weighs as much in either of the two that are compared: what it holds back in one alone is not lacking.
        """
        efforts, bodies = self.efforts, self.efforts.bodies_within_tolerance
        model, matrix = efforts.with_given_gains(self.model), fit(self.model)[1]
        x, _ = consistent_fit(model, bodies)
        if not len(x) or efforts.at.motion.separate:
            return x, np.zeros_like(x), matrix
        plain = efforts.unwhitened(model)
        other = consistent_fit(plain, bodies)[0]
        left = float(held_out(model).sum()) / max(int(efforts.whitening.good.sum()), 1)
        apart = consistent_fit(efforts.unwhitened(model, left), bodies)[0] - x if left > 1 else other - x
        if relative_gain(efforts.held_out_unwhitened(self.model), held_out(plain))[0] > LITTLE:
            x = other
        return x, apart, matrix

    def _impossible_bodies(self, x: Array) -> list[EffortCandidate]:
        """Return links whose parameters no body has, by a free fit x (p,): they imitate something else.

        Where bodies that can exist leave as little, or take away all but a little of what these do, parameters beyond
        any body are the free fit's own error.
        """
        bodies = [term for term in self.laws if term.law.body]
        if not bodies:
            return []
        _, covariance, _ = self.covariances
        reach = SURE * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        beyond = []
        for term in bodies:
            own = self.model.slice_of(term)
            if term.law.impossible(term.place, x[own], reach[own], self.mechanism):
                beyond.append(term)
        if not beyond:
            return []
        possible, _ = consistent_fit(self.model, self.efforts.bodies_within_tolerance)
        without = self.model.without(*beyond)
        fits = ((self.model, x), (self.model, possible), (without, fit(without)[0]))
        free, bound, drawn = (float(block_squares(model, at).sum()) for model, at in fits)
        return beyond if bound - free > max(GAIN * bound, NO_MATTER * (drawn - bound)) else []

    def _imitates_impossible(self, term: EffortCandidate) -> bool:
        """Return whether a law is an impossible body, or hardly saves anything without one at its joint."""
        if term in self.impossible:
            return True
        beside = [other for other in self.impossible if self.joint_of(other.place.name) == term.place.name]
        return any(self.held_out_saving(other) > NO_MATTER * self.held_out_saving(term) for other in beside)

    @property
    def read_scale(self) -> Array:
        """The gains (k,) with which the log is read before the robot file is held against it: none of single drives."""
        return self.scale if self.in_own_units else np.ones_like(self.scale)

    @property
    def units(self) -> tuple[str, ...]:
        """The units of the recorded efforts (k): of a drive whose gain makes them others, as they are logged."""
        joints = zip(map(self.mechanism.joint, self.at.driven), map(float, self.scale), strict=True)
        return tuple(AS_LOGGED if in_another_unit(gain) else joint.effort_unit for joint, gain in joints)

    @cached_property
    def covariances(self) -> tuple[Array, Array, int]:
        """The coefficients' covariance by white noise alone; by the scatter of whole blocks and what depends on the
        weights beside that; and the degrees of freedom of the scatter.

        A fit follows each block that it is fitted to, and hides a part of how these scatter: they are taken where they
        were not fitted (MacKinnon and White, J. Econometrics 29, 1985). Where every drive's gain is free, what all
        gains and all masses are together is given: no data tell it, and it is told on its own.
        """
        gradients = self.problem.columns.gradients(self._validation.residual, self.model.where)
        middle = gradients.T @ gradients
        white = NormalEquations.of(self.normal, least=1e-12).solve(np.eye(len(self.normal)))
        count = self.problem.columns.count
        degrees = max(count - 1, 1)
        whole = white @ middle @ white * count / degrees + white + np.outer(self._apart, self._apart)
        if self.gains is not None:
            common = np.zeros(len(white))
            common[self.efforts.gains_among(self.model)[1]] = 1.0
            white, whole = (_where_given(of, common) for of in (white, whole))
        return white, whole, degrees

    @cached_property
    def reported(self) -> Array:
        """What is reported per true effort of each joint (k,)."""
        out = self.scale.copy()
        if self.gains is not None:
            drives, own = self.efforts.gains_among(self.model)
            out[drives] *= 1 + self.efforts.tolerance_of_gains * self.x[own]
        return out

    @cached_property
    def gain_deviations(self) -> Array:
        """The standard deviation of the logarithm of each drive's gain (k,), that of all gains together included."""
        if self.gains is None:
            return np.zeros(len(self.scale))
        drives, own = self.efforts.gains_among(self.model)
        out = self.gains.deviations
        here = np.sqrt(np.maximum(np.diag(self.covariances[1])[own], 0.0))
        out[drives] = np.maximum(out[drives], self.efforts.tolerance_of_gains * here)
        return np.hypot(out, self.gains.common)

    @cached_property
    def gains_within(self) -> dict[str, float]:
        """By how much the effort of a drive may be another than is reported, a share, where its gain is in the model.

        By joint: what the gain is off by and what is not known of that, root mean square.
        """
        _, covariance, _ = self.covariances
        shares = {item.place: np.zeros(len(self.x)) for _, item in self._toleranced_gains}
        for place, item in self._toleranced_gains:
            shares[item.place][place] = item.tolerance
        for term in self.model.terms:
            if term.law.of_gain:
                shares.setdefault(term.place.name, np.zeros(len(self.x)))[self.model.slice_of(term)] = 1.0
        return {
            name: float(np.sqrt((own @ self.x) ** 2 + max(float(own @ covariance @ own), 0.0)))
            for name, own in shares.items()
        }

    @property
    def gains_off(self) -> dict[str, tuple[float, float]]:
        """What drives' gains that have a tolerance surely are off by, and the half of the 95 % interval, shares."""
        _, covariance, degrees = self.covariances
        out = {}
        for place, item in self._toleranced_gains:
            reach = student_95(degrees) * float(np.sqrt(max(covariance[place, place], 0.0)))
            told = any(term.law.of_gain and term.place.name == item.place for term in self.model.terms)
            if abs(self.x[place]) > reach and not told:
                out[item.place] = item.tolerance * float(self.x[place]), item.tolerance * reach
        return out

    @property
    def _toleranced_gains(self) -> list[tuple[int, EffortDeviation]]:
        """The gains that have a tolerance, each with the place of its coefficient in the model."""
        items = [(place, self.efforts.deviations[index]) for place, index in enumerate(self.model.toleranced)]
        return [(place, item) for place, item in items if item.law.of_gain]

    def _material(self, laws: Sequence[EffortCandidate]) -> list[EffortCandidate]:
        """Return the laws that add to some joint's effort as much as one sample could show, where that is known.

        Gears yield, filters have other shapes: thousands of samples tell of a rigid robot that it is none. What every
        drive has is a finding where it surely is not zero.
        """
        sizes = dict(zip(self.model.terms, self.efforts.sizes(self.model, self.x), strict=True))
        found = []
        for term in laws:
            if self.model.is_nuisance(term):
                here = self.x[self.model.slice_of(term)]
                matters = bool(here.any()) and self.p_value(term) <= FALSE_ALARM
            else:
                matters = shows(sizes[term], self.noise_sizes)
            if matters:
                found.append(term)
        return found

    @cached_property
    def added(self) -> Array:
        """The efforts (N, k) of the corrected model beyond the rigid robot's, not filtered."""
        return self.efforts.modelled(self.model, self.x)[0]

    @cached_property
    def explained(self) -> Array:
        """The same filtered, at the kept samples (n, k)."""
        return self.efforts.at_kept(self.added)

    @property
    def noise_sizes(self) -> Array:
        """The noise of a sample in N or N m, (k,); NaN of a joint of which nothing tells it."""
        return true_sizes(self.noise, self.at.driven, self.scale)

    def p_value(self, term: EffortCandidate) -> float:
        """Return the probability of coefficients as large as a law's where it does not act."""
        _, covariance, degrees = self.covariances
        if term.law.body is Body.ALL_LINKS:
            return float(self.changed_parameters(term).chance.min(initial=1.0))
        own = self.model.slice_of(term)
        told = self._told_combinations(own) if term.law.body else np.eye(own.stop - own.start)
        return hotelling_sf(told @ self.x[own], told @ covariance[own, own] @ told.T, degrees)

    def _told_combinations(self, own: slice) -> Array:
        """Return combinations (r, p) of some coefficients of which the motion tells more than the prior does.

        Of the ten numbers of a body that turns about one axis it tells three: the others are where the prior has them,
        and say nothing of whether there is a body.
        """
        unit = column_scales(np.diag(self.normal)[own])
        whole, prior = (
            matrix[own, own] * unit[:, None] * unit
            for matrix in (self.normal, self.problem.precision(self.model.where))
        )
        whole = whole + ROUNDING * np.eye(len(unit))  # of what neither tells
        share, ways = eigh(whole - prior, whole)
        return np.asarray((ways[:, share > MOST].T @ whole) / unit)

    def changed_parameters(self, term: EffortCandidate) -> ChangedParameters:
        """Return the base parameters of all links, and by how much each differs from the drawing."""
        base = self.efforts.base_parameters(term.law)
        _, covariance, degrees = self.covariances
        own = self.model.slice_of(term)
        change = base.matrix @ self.x[own]
        deviation = np.sqrt(np.maximum(np.diag(base.matrix @ covariance[own, own] @ base.matrix.T), 0.0))
        sure = np.abs(change) / np.maximum(deviation, np.finfo(float).tiny)
        # one of so many that may differ by chance
        chance = 2 * max(len(change), 1) * np.array([student_sf(size, degrees) for size in sure])
        return ChangedParameters(base, change, student_95(degrees) * deviation, chance)

    def heaviness_of(self, term: EffortCandidate) -> tuple[float, float]:
        """Return how many times the drawing's efforts all links take in this motion, and half the 95 % interval."""
        _, covariance, degrees = self.covariances
        own, kept = self.model.slice_of(term), self.efforts.kept
        drawn = self.efforts.rigid[kept]
        columns = np.tensordot(drawn, term.law.efforts_per(term.place, term.values, self.at)[kept], 2)
        per = columns / max(float(np.sum(drawn**2)), np.finfo(float).tiny)
        variance = max(float(per @ covariance[own, own] @ per), 0.0)
        return 1 + float(per @ self.x[own]), student_95(degrees) * float(np.sqrt(variance))

    @property
    def needless(self) -> EffortCandidate | None:
        """The law by name of the largest p-value, if chance alone could make it so large; else None.

        Held-out blocks ask for a law; what other weights would tell of it, and with the other sign, is not the law.
        """
        chances = [(self.p_value(term), term) for term in self.laws if not self.model.is_nuisance(term)]
        chance, least = max(chances, key=lambda item: item[0], default=(0.0, None))
        return least if chance > FALSE_ALARM else None

    @property
    def cost(self) -> float:
        """The held-out squares and the squared strain of the final model."""
        return float(self.held_out.sum()) + self.squared_strain

    def held_out_saving(self, term: EffortCandidate) -> float:
        """Return the held-out squares that a term saves beside all others."""
        return float((held_out(self.model.without(term)) - self.held_out).sum())

    def times_without(self, place: str, *terms: EffortCandidate) -> float:
        """Return how many times as large the held-out residual (RMS) would be without some terms, as tables tell it.

        Of the joint `place`, or of all joints in which they act: each in multiples of what is left there, so that none
        of N and none of large efforts hides another.
        """
        rest = self.model.without(*terms)
        kept = self._columns[:, :, np.isin(self.model.where, rest.where)]
        touched = [self.problem.columns.joints_of(term) for term in terms]
        joints = [self.at.driven.index(place)] if place in self.at.driven else sorted(set().union(*touched))
        without, left = (
            np.sum(np.where(self.efforts.good, values, 0.0)[:, joints] ** 2, axis=0)
            for values in (self.efforts.held_out_residual(rest, kept), self._left)
        )
        return float(np.sqrt(np.mean(without / np.maximum(left, np.finfo(float).tiny))))

    @cached_property
    def _validation(self) -> CrossValidation:
        return CrossValidation(self.model)

    @cached_property
    def _columns(self) -> Array:
        return self.efforts.columns_of(self.model)

    @cached_property
    def _left(self) -> Array:
        return self.efforts.held_out_residual(self.model, self._columns)

    def joint_of(self, link: str) -> str:
        """Return the joint that carries a link."""
        return str(self.mechanism.model.names[self.mechanism.frame(link).joint])

    def effect(self, law: Law, place: Place, values: Mapping[str, float]) -> Effect:
        """Return a law at a place with its own parameters among some values, for a simulation."""
        return Effect(law, place, {q.name: float(values[q.name]) for q in law.quantities_at(place, self.mechanism)})


def _where_given(covariance: Array, direction: Array) -> Array:
    """Return a covariance (c, c) where what lies along a direction (c,) is given: of one number alone none is left."""
    along = covariance @ direction
    rest = np.eye(len(direction)) - np.outer(along, direction) / (direction @ along)
    return np.asarray(rest @ covariance @ rest.T, float)
