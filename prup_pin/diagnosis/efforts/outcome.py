"""What was fitted to efforts, and which of it is a law by name: what imitates something else is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...dynamics import Motion
from ...laws import Effect, Law, Place
from ...laws.efforts import Body
from ...recordings import Recording
from ...robot import Robot
from ...spatial import Array
from ..chances import hotelling_sf, student_ppf, student_sf
from ..criteria import EFFORT_GAIN, EFFORT_IMITATED, EFFORT_MATTERS, EFFORT_PLAINLY, EFFORT_SURE, FALSE_ALARM
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .combinations import Combinations
from .consistent import consistent_fit
from .gains import Gains
from .gather import Efforts
from .noise import EffortNoise
from .normal import Normal
from .relief import squared_strain
from .search import held_out, surely, worth
from .stretches import Stretch

__all__ = ["Outcome"]


class Changed(NamedTuple):
    """Combinations of parameters, by how much each is another than drawn, reach of its 95 % interval, and the chance
    that any of as many would differ so (c,)."""

    told: Combinations
    change: Array
    reach: Array
    chance: Array


class Outcome:
    """A fit, and what everything that is told of it is read from.

    `named`: what the corrected model holds, with its coefficients `x_named` and their normal matrix; `laws`: those of
    its terms that are told by name; `impossible`: links whose parameters no body has; `free`: curves of no law; `scale`
    (k,): of each effort in its recording's unit; `noise`: of a sample of each, as recorded; `held` (B,): squares left
    of held-out blocks; `strained`: the squared strain of what is within tolerance.
    """

    def __init__(
        self,
        robot: Robot,
        recording: Recording,
        efforts: Efforts,
        noise: Mapping[str, EffortNoise],
        given: Gathered,
        chosen: Chosen,
        free: Sequence[EffortCandidate],
        imitating: Sequence[EffortCandidate],
        gains: Gains | None = None,
        stretches: Sequence[Stretch] = (),
        doubts: Sequence[str] = (),
    ):
        self.gains, self.stretches, self.doubts = gains, stretches, doubts
        # reported per true effort: all figures are in the recording's own unit
        self.scale = np.ones(len(efforts.at.driven)) if gains is None else gains.gains
        self.robot, self.recording, self.efforts, self.noise = robot, recording, efforts, noise
        self.given, self.chosen, self.free = given, chosen, list(free)
        self.mechanism, self.at = robot.mechanism, efforts.at
        self.motion: Motion = efforts.at.motion
        # what the corrected model holds: another recording has its own time
        self.named = chosen.of(term for term in chosen.terms if not term.is_of_time)
        kept = [term for term in surely(given, self.named).terms if not term.law.is_curve]
        self.laws = [term for term in kept if not any(term is other for other in imitating)]
        self.x_named, self._apart, self.matrix_named = self._coefficients()
        self.laws = self._that_matter(self.laws)
        self.held = held_out(given, self.named)
        self.impossible = self._no_bodies(fit(given, self.named)[0])
        self.laws = [term for term in self.laws if not self._stands_for_one(term)]
        self.strained = squared_strain(given, self.named)

    def _coefficients(self) -> tuple[Array, Array, Array]:
        """Return the coefficients (p,) that predict, of bodies that can exist, how much they hang on how joints and
        frequencies are weighed (p,), and their normal matrix.

        Whitened, unless plain weights leave less of the efforts in their own units on held-out blocks: where what
        is left is what laws and curves lack, it is no noise. Two weights would tell the same of a model that lacks
        nothing, but for noise (Hausman 1978): what they tell apart is what it lacks, and no block's scatter shows it.
        """
        efforts, bodies = self.efforts, self.efforts.bodies_within_tolerance
        x, matrix = consistent_fit(self.given, self.named, bodies)
        if not len(x) or efforts.at.motion.standing:
            return x, np.zeros_like(x), matrix
        plain = efforts.in_plain_units(self.given, self.named)
        other = consistent_fit(*plain, bodies)[0]
        apart = other - x
        if worth(efforts.held_out_plainly(self.given, self.named), held_out(*plain))[0] > EFFORT_PLAINLY:
            x = other
        return x, apart, matrix

    def _no_bodies(self, x: Array) -> list[EffortCandidate]:
        """Return links whose parameters no body has, by a free fit (p,): they imitate what else is there.

        Where bodies that can be leave as little, parameters beyond any body are no more than the free fit's own error.
        """
        bodies = [term for term in self.laws if term.law.body]
        if not bodies:
            return []
        _, covariance, _ = self.scatter
        reach = EFFORT_SURE * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        own = [self.named.own(term) for term in bodies]
        beyond = [
            term
            for term, at in zip(bodies, own, strict=True)
            if term.law.impossible(term.place, x[at], reach[at], self.mechanism)
        ]
        if not beyond:
            return []
        possible = consistent_fit(self.given, self.named, self.efforts.bodies_within_tolerance)[0]
        free, bound = (
            float((self.given.columns.residual(self.named.where, each) ** 2).sum()) for each in (x, possible)
        )
        return beyond if bound - free > EFFORT_GAIN * bound else []

    def _stands_for_one(self, term: EffortCandidate) -> bool:
        """Return whether a law is no body, or needs one beside it at its joint: it imitates what that imitates."""
        if any(term is other for other in self.impossible):
            return True
        beside = [other for other in self.impossible if self.carries(other.place.name) == term.place.name]
        return any(self.saves(other) > EFFORT_IMITATED * self.saves(term) for other in beside)

    @cached_property
    def scatter(self) -> tuple[Array, Array, int]:
        """The coefficients' covariance by white noise of the whitened size alone, by the scatter of whole blocks and
        what other weights would tell beside that, and the degrees of freedom of the scatter."""
        columns, where = self.given.columns, self.named.where
        pulls = columns.pulls(columns.residual(where, self.x_named), where)
        middle = pulls.T @ pulls
        white = Normal.of(self.matrix_named, least=1e-12).solve(np.eye(len(self.matrix_named)))
        count = self.given.columns.count
        degrees = max(count - 1, 1)
        return white, white @ middle @ white * count / degrees + white + np.outer(self._apart, self._apart), degrees

    def _that_matter(self, laws: Sequence[EffortCandidate]) -> list[EffortCandidate]:
        """Return laws that add to the effort of some joint what one sample could show, or more, where that is known.

        Gears yield, filters have other shapes: thousands of samples tell of a rigid robot that it is none. What cannot
        be negative may be nothing in the end, and what every drive has is told where it surely is.
        """
        columns, least = self.efforts.columns_of(self.given, self.named), np.nan_to_num(self.noise_sizes)
        found = []
        for term in laws:
            own = self.named.own(term)
            if self.named.stays(term):
                matters = bool(self.x_named[own].any()) and self.may_be_nothing(term) <= FALSE_ALARM
            else:
                added = np.sqrt(np.mean((columns[:, :, own] @ self.x_named[own]) ** 2, axis=0))
                matters = bool((added > EFFORT_MATTERS * least).any())
            if matters:
                found.append(term)
        return found

    @property
    def noise_sizes(self) -> Array:
        """The noise of a sample in N or N m, (k,); NaN of a joint of which nothing tells it."""
        return np.array([self.noise[name].size for name in self.at.driven]) / self.scale

    def may_be_nothing(self, term: EffortCandidate) -> float:
        """Return the chance of coefficients as large as a law's where it does not act."""
        _, covariance, degrees = self.scatter
        if term.law.body is Body.ALL_LINKS:
            return float(self.combinations(term).chance.min(initial=1.0))
        own = self.named.own(term)
        return hotelling_sf(self.x_named[own], covariance[own, own], degrees)

    def combinations(self, term: EffortCandidate) -> Changed:
        """Return the combinations of all links' parameters that the motion tells, and by how much each differs."""
        told = self.efforts.combinations(term.law)
        _, covariance, degrees = self.scatter
        own = self.named.own(term)
        change = told.matrix @ self.x_named[own]
        deviation = np.sqrt(np.maximum(np.diag(told.matrix @ covariance[own, own] @ told.matrix.T), 0.0))
        sure = np.abs(change) / np.maximum(deviation, np.finfo(float).tiny)
        # one of so many that may differ by chance
        chance = 2 * max(len(change), 1) * np.array([student_sf(size, degrees) for size in sure])
        return Changed(told, change, student_ppf(0.975, degrees) * deviation, chance)

    @property
    def needless(self) -> EffortCandidate | None:
        """The law, told by name, that is likeliest to be nothing by its own uncertainty; None where each is something.

        Held-out blocks ask for a law; what other weights would tell of it, and with the other sign, is not the law.
        """
        chances = [(self.may_be_nothing(term), term) for term in self.laws if not self.named.stays(term)]
        chance, least = max(chances, key=lambda item: item[0], default=(0.0, None))
        return least if chance > FALSE_ALARM else None

    def saves(self, term: EffortCandidate) -> float:
        """Return the held-out squares that a term saves beside all others."""
        return float((held_out(self.given, self.named.without(term)) - self.held).sum())

    def carries(self, link: str) -> str:
        """Return the joint that carries a link."""
        return str(self.mechanism.model.names[self.mechanism.frame(link).joint])

    def effect(self, law: Law, place: Place, values: Mapping[str, float]) -> Effect:
        """Return a law at a place with its parameters' values, of those given, as a simulation takes it."""
        return Effect(law, place, {q.name: float(values[q.name]) for q in law.quantities_at(place, self.mechanism)})
