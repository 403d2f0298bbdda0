"""What the efforts of a robot in motion say that the rigid simulation left out: findings, shares, curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...dynamics import INERTIAL, Motion
from ...dynamics.smoothing import pieces
from ...laws import Effect, Place
from ...laws.efforts.all_links import AllLinks
from ...laws.efforts.effort_sensor import EffortUnit
from ...laws.efforts.free_curve import VARIABLES, FreeCurve, variable_of
from ...laws.efforts.inertial_parameters import InertialParameters, is_impossible
from ...mechanism.assumed import masses_in_doubt
from ...numbers import number
from ...recordings import Recording
from ...robot import Robot
from ...spatial import Array
from ..chances import chi2_isf, student_isf, student_ppf
from ..criteria import (
    EFFORT_ALIKE,
    EFFORT_ALONE,
    EFFORT_AS_LITTLE,
    EFFORT_CLASS,
    EFFORT_IMITATED,
    EFFORT_LIKELIER,
    EFFORT_LOUD,
    EFFORT_SURE,
    EFFORT_UNLIKELY,
    EFFORT_UNTOLD,
    FALSE_ALARM,
    FEWEST_EFFORT_BLOCKS,
    MOST_COMBINATIONS,
    beyond_tolerance,
)
from ..diagnosis import Detectable, Finding, FittedParameter
from .beside import Beside
from .chosen import Chosen, fit, saved
from .columns import EffortCandidate, Gathered
from .diagnosis import AGAINST, EffortCurve, EffortDiagnosis
from .gains import Gains
from .gather import Efforts
from .likelier import is_body, odds
from .normal import Normal
from .relief import strain
from .search import held_out, scores, threshold, uncertainty
from .stretches import Stretch

__all__ = ["Verdict"]


#: Candidates beside a finding that are looked at as its rivals.
_RIVALS = 24
#: Share of the most that one body takes away, from which another is as good.
_AS_GOOD = 0.99
#: Kept samples at an end of a piece by which nothing is judged: somewhat more than a period of the cut-off.
_END = 3
#: Means that a curve is drawn through.
_BINS = 24


class Verdict:
    """A fit, asked for everything that is told of it."""

    def __init__(
        self,
        robot: Robot,
        recording: Recording,
        efforts: Efforts,
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
        self.robot, self.recording, self.efforts = robot, recording, efforts
        self.given, self.chosen, self.free = given, chosen, list(free)
        self.mechanism, self.at = robot.mechanism, efforts.at
        self.motion: Motion = efforts.at.motion
        # what the corrected model holds: another recording has its own time
        self.named = Chosen(chosen.base, tuple(term for term in chosen.terms if not is_of_time(term)))
        kept = [term for term in self.named.terms if not isinstance(term.law, FreeCurve)]
        self.laws = [term for term in kept if not any(term is other for other in imitating)]
        self.x_named, self.matrix_named = fit(given, self.named)
        self.held = held_out(given, self.named)
        self.impossible = self._no_bodies()
        self.laws = [term for term in self.laws if not self._stands_for_one(term)]
        self.strained = _squared(strain(self.named, self.x_named))

    def whole(self) -> EffortDiagnosis:
        """Return the diagnosis."""
        efforts, motion = self.efforts, self.motion
        added = efforts.added(self.named, self.x_named)
        every = efforts.every
        measured, rigid = efforts.measured[every] * self.scale, efforts.rigid[every]
        predicted = (rigid + efforts.filter(added)[every]) * self.scale
        noise, declared = self._noise(added)
        before, after, by_joint = self._residuals(added, noise)
        findings = [
            *self._of_gains(),
            *(self._finding(term) for term in self.laws),
        ]
        unknown = [*(self._unknown(term) for term in self.free), *map(self._of_no_body, self.impossible)]
        beyond = list(self._beyond())
        remarks = self._remarks()
        if unknown and beyond:
            # what no law explains drives them: they are no findings of their own
            names = ", ".join(name for finding in beyond for name in finding.parameters)
            remarks.append(f"{names} would lie beyond tolerance, but may only stand for what is unknown")
        else:
            findings += beyond
        findings.sort(key=lambda finding: -finding.heldout_gain)
        if not unknown and declared and after["fit"] > EFFORT_LOUD:
            worst = max(by_joint, key=lambda name: by_joint[name]["after"])
            unknown = [
                _plain_unknown(
                    worst,
                    f"what is left at {worst} is {number(by_joint[worst]['after'], 3)} times the declared "
                    "noise; no law of "
                    "the library takes it away, and it follows neither speed, position, load nor time",
                )
            ]
        shares = self._shares(predicted)
        if self.given.columns.count < FEWEST_EFFORT_BLOCKS:
            unknown = [
                _plain_unknown("robot", f"{len(every)} samples of efforts are too few to judge anything by others")
            ]
        elif not unknown and shares["all"]["heldout"] > EFFORT_UNTOLD and not declared:
            worst = max(
                self.at.driven, key=lambda name: shares[name]["heldout"] * rms_of(measured[:, self._column(name)])
            )
            text = (
                f"{number(100 * shares['all']['heldout'], 3)} % of the efforts are left, most of it at "
                f"{worst}, and no law of "
                "the library takes it away; no noise was declared that it could be"
            )
            unknown = [_plain_unknown(worst, text)]
        doubtful = self._doubtful(unknown)
        remarks += [
            f"what {name} needs by its position is held beyond the travel that was seen: no law for it was found that "
            "explains all"
            for name in dict.fromkeys(term.place.name for term in doubtful)
        ]
        advice = self._advice(findings, unknown)
        unknown += [stretch.finding() for stretch in self.stretches]
        verdict = "unexplained" if unknown else "explained" if findings else "nothing_missing"
        return EffortDiagnosis(
            joints=self.at.driven,
            units=tuple("N" if self.mechanism.joint(name).slides else "N m" for name in self.at.driven),
            time=motion.time[every],
            measured=measured,
            rigid=rigid,
            predicted=predicted,
            speed=np.column_stack([self.at.speed(name)[every] for name in self.at.driven]),
            position=np.column_stack([self.at.position(name)[every] for name in self.at.driven]),
            good=efforts.good,
            cutoff=motion.low_pass.cutoff,
            noise=noise * self.scale,
            declared=declared,
            before=before,
            after=after,
            by_joint=by_joint,
            shares=shares,
            findings=(*findings, *unknown),
            effects=tuple(self._effects(doubtful)),
            curves=tuple(self._curves()),
            verdict=verdict,
            not_detectable=tuple(self._not_detectable()),
            advice=advice,
            remarks=(*self.doubts, *remarks),
            rows=motion.rows[every],
            standing=motion.standing,
        )

    def _column(self, joint: str) -> int:
        return self.at.driven.index(joint)

    # -- residuals -------------------------------------------------------------------------------------------------

    def _noise(self, added: Array) -> tuple[Array, bool]:
        """Return the noise of each effort (k,) and whether it was declared; else what no curve takes away."""
        declared = self.recording.noise.effort
        if declared:
            return np.full(len(self.at.driven), declared) / self.scale, True
        x, _ = fit(self.given, self.chosen)
        rest = (self.motion.efforts - self.at.rigid - self.efforts.added(self.chosen, x))[self.efforts.every]
        sizes = [rms_of(rest[self.efforts.good[:, k], k]) for k in range(rest.shape[1])]
        return np.maximum(np.nan_to_num(sizes), np.finfo(float).tiny), False

    def _residuals(
        self, added: Array, noise: Array
    ) -> tuple[dict[str, float], dict[str, float], dict[str, dict[str, float]]]:
        """Return the residual in multiples of the noise before and after, of all and by joint."""
        every, good = self.efforts.every, self._settled()
        raw = (self.motion.efforts - self.at.rigid)[every]
        told = (self.motion.efforts - self.at.rigid / self.scale)[every]
        first, last = told / noise, (raw - added[every]) / noise
        ratio = self._held_ratio()
        before = rms_of(first[good])
        after = rms_of(last[good])
        by_joint = {
            name: {"before": rms_of(first[good[:, k], k]), "after": rms_of(last[good[:, k], k])}
            for k, name in enumerate(self.at.driven)
        }
        return {"fit": before, "heldout": before}, {"fit": after, "heldout": after * ratio}, by_joint

    def _settled(self) -> np.ndarray:
        """Return the samples that count (n, k) but for those at ends of pieces, where filters and rates have no other
        side, and nobody knows what a signal that comes late was before."""
        good = self.efforts.good
        if self.motion.standing:
            return good
        inside = good.copy()
        for where in pieces(self.efforts.piece):
            inside[where.start : where.start + _END] = inside[max(where.stop - _END, where.start) : where.stop] = False
        return np.where(inside.any(axis=0), inside, good)

    def _held_ratio(self) -> float:
        """Return how much larger held-out blocks' residual is than the fitted one, root mean square."""
        fitted = float(saved(self.given, self.named, self.x_named).sum())
        return float(np.sqrt(max(self.held.sum() / max(fitted, np.finfo(float).tiny), 1.0)))

    def _shares(self, predicted: Array) -> dict[str, dict[str, float]]:
        """Return what is left of each joint's effort below the cut-off, as a share of it, and of all together."""
        efforts = self.efforts
        measured, rigid = efforts.measured[efforts.every] * self.scale, efforts.rigid[efforts.every]
        held = measured - efforts.held_out_residual(self.given, self.named) * self.scale
        out: dict[str, dict[str, float]] = {}
        columns = {name: [k] for k, name in enumerate(self.at.driven)}
        for name, where in {**columns, "all": list(range(measured.shape[1]))}.items():
            good = efforts.good[:, where]
            size = max(rms_of(measured[:, where][good]), np.finfo(float).tiny)
            out[name] = {
                key: rms_of((measured - values)[:, where][good]) / size
                for key, values in (("rigid", rigid), ("fit", predicted), ("heldout", held))
            }
        return out

    # -- findings --------------------------------------------------------------------------------------------------

    @cached_property
    def _scatter(self) -> tuple[Array, Array, int]:
        """The coefficients' covariance by white noise of the whitened size alone, by the scatter of whole blocks beside
        that, and the latter's degrees of freedom."""
        where = self.named.where
        gram = self.given.columns.gram[:, where][:, :, where]
        pulls = self.given.columns.moment[:, where] - gram @ self.x_named
        middle = pulls.T @ pulls
        white = Normal.of(self.matrix_named, least=1e-12).solve(np.eye(len(self.matrix_named)))
        count = self.given.columns.count
        degrees = max(count - 1, 1)
        return white, white @ middle @ white * count / degrees + white, degrees

    def _finding(self, term: EffortCandidate) -> Finding:
        if isinstance(term.law, AllLinks):
            return self._of_all_links(term, term.law)
        values = term.law.fitted(term.place, self.x_named[self.named.own(term)], term.values)
        effect = self._effect(term, values)
        rest = self.named.without(term)
        without = held_out(self.given, rest)
        left, before = float(self.held.sum()) + self.strained, float(without.sum()) + self._strain(rest)
        gain = float(np.clip(1 - left / max(before, np.finfo(float).tiny), 0.0, 1.0))
        places, laws = self._rivals(term, without)
        parameters, statement = self._parameters(term, values), effect.statement(self.mechanism)
        if isinstance(term.law, InertialParameters):
            low, high = parameters["mass"].interval
            if low <= 0 <= high:
                statement = (
                    f"{term.place.name} has another centre or inertia than in the robot file; of its mass this motion "
                    "tells nothing"
                )
        return Finding(
            physics=term.law.physics,
            location=term.place.name,
            candidates=tuple(dict.fromkeys((term.place.name, *places))),
            parameters=parameters,
            heldout_gain=gain,
            statement=statement,
            effect=effect,
            alternatives=tuple(dict.fromkeys(laws)),
        )

    def _of_gains(self) -> Iterator[Finding]:
        """Yield that the drives report in units of their own."""
        if self.gains is None:
            return
        gains, factor = self.gains.gains, np.exp(1.96 * self.gains.deviation)
        unit = {name: "N" if self.mechanism.joint(name).slides else "N m" for name in self.at.driven}
        parameters = {
            f"{name}.gain": FittedParameter(float(g - 1), "", (float(g / f - 1), float(g * f - 1)))
            for name, g, f in zip(self.at.driven, gains, factor, strict=True)
        }
        told = ", ".join(
            f"{name} {number(float(g), 3)} per {unit[name]}" for name, g in zip(self.at.driven, gains, strict=True)
        )
        yield Finding(
            physics="effort_gain",
            location="robot",
            candidates=("robot", *self.at.driven),
            parameters=parameters,
            heldout_gain=self._saved_by_gains(),
            statement=(
                f"the drives report in units of their own: {told}; all gains together and all masses together are one "
                "unknown, which the robot file's masses decide"
            ),
        )

    def _saved_by_gains(self) -> float:
        """Return the share that gains and all that is found take away of what the efforts leave as they are told."""
        measured, rigid = (values[self.efforts.every] for values in (self.efforts.measured, self.efforts.rigid))
        told = ((measured - rigid / self.scale)[self.efforts.good] ** 2).sum()
        left = (self.efforts.held_out_residual(self.given, self.named)[self.efforts.good] ** 2).sum()
        return float(np.clip(1 - left / max(told, np.finfo(float).tiny), 0.0, 1.0))

    def _of_all_links(self, term: EffortCandidate, law: AllLinks) -> Finding:
        """Return what the motion tells of all links' masses: the combinations that are not those of the robot file."""
        told = self.efforts.combinations(law)
        _, covariance, degrees = self._scatter
        own = self.named.own(term)
        change = told.matrix @ self.x_named[own]
        deviation = np.sqrt(np.maximum(np.diag(told.matrix @ covariance[own, own] @ told.matrix.T), 0.0))
        model = self.mechanism.model
        bodies = [self.mechanism.frame(link.name).joint for link in law.links]
        drawn = told.matrix @ np.concatenate([model.inertias[body].toDynamicParameters() for body in bodies])
        sure = np.abs(change) / np.maximum(deviation, np.finfo(float).tiny)
        # one of so many that may differ by chance
        differ = np.flatnonzero(sure > student_isf(FALSE_ALARM / (2 * max(len(change), 1)), degrees))
        reach = student_ppf(0.975, degrees) * deviation
        without = held_out(self.given, self.named.without(term))
        units = dict(zip(INERTIAL, ("kg", *3 * ("kg m",), *6 * ("kg m^2",)), strict=True))
        parameters = {
            told.names[i]: FittedParameter(
                float(drawn[i] + change[i]),
                units[law.linear[told.leads[i]].rpartition(".")[2]],
                (float(drawn[i] + change[i] - reach[i]), float(drawn[i] + change[i] + reach[i])),
            )
            for i in differ[np.argsort(-sure[differ], kind="stable")][:MOST_COMBINATIONS]
        }
        return Finding(
            physics=law.physics,
            location="robot",
            candidates=("robot", *(link.name for link in law.links)),
            parameters=parameters,
            heldout_gain=float(np.clip(1 - self.held.sum() / max(without.sum(), np.finfo(float).tiny), 0.0, 1.0)),
            statement=(
                f"the links' masses, centres and inertias are not those of the robot file: of {len(change)} "
                f"combinations that this motion tells, {len(differ)} are surely others"
                f"{self._alone_of_all(term, without)}"
            ),
        )

    def _alone_of_all(self, term: EffortCandidate, without: Array) -> str:
        """Return what one body alone would take away of what all links do, in words, where that is most of it."""
        rest, gain = self.named.without(term), float((without - self.held).sum())
        single = [other for other in self.given.candidates if is_body(other) and other is not term]
        single = [other for other in single if not isinstance(other.law, AllLinks)]
        if not single:
            return ""
        saved_by = (without - Beside(self.given, rest).with_each(single)).sum(axis=1)
        # the tool's load comes before the link that would be as good
        best = min(
            (one for one, own in zip(single, saved_by, strict=True) if own > _AS_GOOD * saved_by.max()),
            key=lambda one: one.where.start,
        )
        with_it = rest.with_term(best)
        x, _ = fit(self.given, with_it)
        values = best.law.fitted(best.place, x[with_it.own(best)], best.values)
        share = float(saved_by.max()) / max(gain, np.finfo(float).tiny)
        drawn = sum(float(inertia.mass) for inertia in self.mechanism.model.inertias)
        own = abs(values.get("mass", 0.0))
        if share < EFFORT_ALONE or own > drawn or not best.law.plausible(best.place, values, self.mechanism):
            return ""  # a robot file without masses lacks more than one body
        told = best.law.statement(best.place, values, self.mechanism)
        return f"; {100 * min(share, 1.0):.0f} % of that would be taken away by one body alone: {told}"

    def _effect(self, term: EffortCandidate, values: Mapping[str, float]) -> Effect:
        kept = {q.name: float(values[q.name]) for q in term.law.quantities_at(term.place, self.mechanism)}
        return Effect(term.law, term.place, kept)

    def _parameters(self, term: EffortCandidate, values: Mapping[str, float]) -> dict[str, FittedParameter]:
        white, covariance, degrees = self._scatter
        own = self.named.own(term)
        x = self.x_named[own]
        deviation = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0))
        reach = student_ppf(0.975, degrees)
        out = {}
        quantities = {q.name: q for q in term.law.quantities_at(term.place, self.mechanism)}
        # by the coefficients' own scatter, followed into what they stand for
        spread = dict.fromkeys(quantities, 0.0)
        for index, size in enumerate(deviation):
            moved = x.copy()
            moved[index] += reach * size
            other = term.law.fitted(term.place, moved, term.values)
            for name in quantities:
                spread[name] = float(np.hypot(spread[name], other[name] - values[name]))
        settled: Mapping[str, tuple[float, float]] = {}
        if term.law.settled:
            # as much more than white noise would scatter them
            rise = reach**2 * float(np.median(deviation**2 / np.diag(white)[own]))
            settled = self.efforts.told_between(self.given, self.named, term, rise)
        for name, quantity in quantities.items():
            low, high = settled.get(name, (values[name] - spread[name], values[name] + spread[name]))
            out[name] = FittedParameter(values[name], quantity.unit, (float(low), float(high)))
        return out

    def _strain(self, chosen: Chosen) -> float:
        """Return the squared strain of what is within tolerance, in tolerances: it counts beside squares left over."""
        return _squared(strain(chosen, fit(self.given, chosen)[0]))

    def _rivals(self, term: EffortCandidate, without: Array) -> tuple[list[str], list[str]]:
        """Return other places and other laws that explain as well as a term what it explains."""
        rest = self.named.without(term)
        places = list(term.law.same_places(term.place, self.mechanism))
        laws: list[str] = []
        ranked, _ = scores(self.given.without_curves(), rest)
        gain = float((without - self.held).sum()) + self._strain(rest) - self.strained
        ranked.sort(key=lambda item: -item.gain)
        near = [score.candidate for score in ranked[:_RIVALS] if score.possible and score.candidate.size <= term.size]
        # bodies are weighed by what bodies there are
        others = [other for other in near if not (is_body(other) and is_body(term))]
        others = [other for other in others if other.law is not term.law or other.place != term.place]
        unlikely = EFFORT_UNLIKELY if is_body(term) else EFFORT_LIKELIER
        likely = [other for other, log_odds, _ in odds(self.given, self.named, term) if log_odds > -unlikely]

        def alike(after: Array, strained: float) -> bool:
            apart = after - self.held
            worse = float(apart.sum()) + strained - self.strained
            little = min(EFFORT_CLASS * gain, EFFORT_AS_LITTLE * float(self.held.sum()))
            return worse <= min(max(EFFORT_ALIKE * uncertainty(apart), little), 0.2 * gain)

        for other, after in zip(others, Beside(self.given, rest).with_each(others), strict=True):
            taken = rest.with_term(other)
            if not alike(after, self._strain(taken)):
                if other.law.family != term.law.family or not (other.law.family and other.law.settled):
                    continue
                # the same thing by another shape: with its own values free
                size = self.given.columns.size
                given, taken = self.efforts.settled(self.given, taken, [len(taken.terms) - 1])
                good = alike(held_out(given, taken), _squared(strain(taken, fit(given, taken)[0])))
                self.given.columns.cut(size)
                if not good:
                    continue
            likely.append(other)
        for other in likely:
            if other.law.physics == term.law.physics:
                places += [other.place.name, *other.law.same_places(other.place, self.mechanism)]
            else:
                laws.append(f"{other.law.physics} at {other.place.name}")
                places.append(other.place.name)
        return places, laws

    def _beyond(self) -> Iterator[Finding]:
        """Yield parameters that lie beyond their tolerances."""
        _, covariance, degrees = self._scatter
        limit = beyond_tolerance(len(self.efforts.bases))
        for index in self.named.base:
            base, amount = self.efforts.bases[index], float(self.x_named[index])
            if abs(amount) <= limit:
                continue
            value = base.nominal + amount * base.tolerance
            reach = student_ppf(0.975, degrees) * float(np.sqrt(covariance[index, index])) * base.tolerance
            yield Finding(
                physics=base.physics,
                location=base.place,
                candidates=(base.place,),
                parameters={base.name: FittedParameter(value, base.unit, (value - reach, value + reach))},
                heldout_gain=float(amount**2 / (amount**2 + self.held.sum())),
                statement=(
                    f"{base.name} lies {number(abs(amount), 3)} tolerances beside the robot file: "
                    f"{number(value, 6)} {base.unit} "
                    f"instead of {number(base.nominal, 6)}"
                ),
            )

    def _unknown(self, term: EffortCandidate) -> Finding:
        law = term.law
        assert isinstance(law, FreeCurve)
        without = held_out(self.given, self.chosen.without(term))
        whole = held_out(self.given, self.chosen)
        share = float(np.clip(1 - whole.sum() / max(without.sum(), np.finfo(float).tiny), 0.0, 1.0))
        return _plain_unknown(
            term.place.name,
            f"structure is left over at {term.place.name} that no law of the library takes away; "
            f"{'friction' if law.friction else 'an effort'} that follows the joint's {law.variable} by a curve of its "
            f"own would take away {100 * share:.0f} % of what is left"
            + ("" if is_of_time(term) else ", and the corrected model follows it"),
            share,
        )

    def _no_bodies(self) -> list[EffortCandidate]:
        """Return links whose parameters no body has: what is told there is something else, which they imitate."""
        bodies = [term for term in self.laws if isinstance(term.law, InertialParameters)]
        if not bodies:
            return []
        _, covariance, _ = self._scatter
        reach = EFFORT_SURE * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        own = [self.named.own(term) for term in bodies]
        return [
            term
            for term, at in zip(bodies, own, strict=True)
            if is_impossible(term.place.name, self.x_named[at], reach[at], self.mechanism)
        ]

    def _carries(self, link: str) -> str:
        """Return the joint that carries a link."""
        return str(self.mechanism.model.names[self.mechanism.frame(link).joint])

    def _saves(self, term: EffortCandidate) -> float:
        """Return the held-out squares that a term saves beside all others."""
        return float((held_out(self.given, self.named.without(term)) - self.held).sum())

    def _stands_for_one(self, term: EffortCandidate) -> bool:
        """Return whether a law is no body, or needs one beside it at its joint: it imitates what that imitates."""
        if any(term is other for other in self.impossible):
            return True
        beside = [other for other in self.impossible if self._carries(other.place.name) == term.place.name]
        return any(self._saves(other) > EFFORT_IMITATED * self._saves(term) for other in beside)

    def _of_no_body(self, term: EffortCandidate) -> Finding:
        joint, link = self._carries(term.place.name), term.place.name
        saved = self._saves(term)
        share = float(np.clip(saved / max(saved + float(self.held.sum()), np.finfo(float).tiny), 0.0, 1.0))
        text = (
            f"structure is left over at {joint} that no law of the library takes away; masses of {link} that no body "
            f"has would take away {100 * share:.0f} % of what is left, and the corrected model follows them"
        )
        return replace(_plain_unknown(joint, text, share), candidates=(joint, link))

    def _doubtful(self, unknown: Sequence[Finding]) -> list[EffortCandidate]:
        """Return laws by a joint's position beside which structure is left: beyond its travel they say nothing."""
        places = {finding.location for finding in unknown} & set(self.at.driven)
        return [term for term in self.named.terms if term.law.family == "counterbalance" and term.place.name in places]

    def _as_seen(self, term: EffortCandidate, efforts: Array) -> Effect:
        """Return efforts (N, k) that follow a joint's position as a curve through knots, which ends where it does."""
        law = FreeCurve("position")
        place = Place(term.place.name, law.variant)
        knots = law.scanned(place, self.at)[0]
        columns = law.efforts_per(place, knots, self.at)[:, :, : law.count]
        heights = np.zeros(len(law.linear))
        heights[: law.count] = np.linalg.lstsq(columns.reshape(-1, law.count), efforts.ravel(), rcond=None)[0]
        return Effect(law, place, dict(law.fitted(place, heights, knots)))

    def _effects(self, doubtful: Sequence[EffortCandidate]) -> Iterator[Effect]:
        """Yield everything that the corrected model holds: what was found, and what lies within tolerance."""
        yield from self.efforts.within_tolerance(self.x_named[: len(self.named.base)])
        for term in self.named.terms:
            own = self.x_named[self.named.own(term)]
            if isinstance(term.law, AllLinks):
                for link, change in zip(term.law.links, own.reshape(-1, len(INERTIAL)), strict=True):
                    yield Effect(InertialParameters(), link, dict(zip(INERTIAL, map(float, change), strict=True)))
                continue
            if any(term is other for other in doubtful):
                yield self._as_seen(term, term.law.efforts_per(term.place, term.values, self.at) @ own)
                continue
            yield self._effect(term, term.law.fitted(term.place, own, term.values))
        if self.gains is not None:
            law = EffortUnit()
            for name, gain in zip(self.at.driven, self.gains.gains, strict=True):
                yield Effect(law, Place(name, law.variant), {"gain": float(gain - 1)})

    # -- pictures and advice ---------------------------------------------------------------------------------------

    def _curves(self) -> Iterator[EffortCurve]:
        """Yield, for each finding that one variable drives, what the efforts ask for against it."""
        efforts = self.efforts
        every = efforts.every
        full = efforts.filter(efforts.added(self.named, self.x_named))[every]
        left = (efforts.measured[every] - efforts.rigid[every] - full) * self.scale
        for term in (*self.laws, *self.free):
            joint, curve = term.place.name, isinstance(term.law, FreeCurve)
            variable = term.law.variable if isinstance(term.law, FreeCurve) else AGAINST.get(term.law.physics)
            if variable is None or joint not in self.at.driven:
                continue
            column = self.at.driven.index(joint)
            good = efforts.good[:, column]
            same = [] if is_of_time(term) else [term]
            if not curve:
                same = [
                    other
                    for other in self.laws
                    if other.place.name == joint and AGAINST.get(other.law.physics) == variable
                ]
                if same[0] is not term:
                    continue  # drawn once, together
            own = np.zeros(len(left))
            for other in same:
                own = own + self._alone(other)[:, column] * self.scale[column]
            x = variable_of(self.at, joint, variable)[every]
            drawn = _means(x[good], (left[:, column] + own)[good], None if curve or not own.any() else own[good])
            slides = self.mechanism.joint(joint).slides
            yield EffortCurve(
                joint, variable, *drawn, VARIABLES[variable][1 if slides else 0], "N" if slides else "N m"
            )

    def _alone(self, term: EffortCandidate) -> Array:
        efforts = self.efforts
        x = np.zeros_like(self.x_named)
        x[self.named.own(term)] = self.x_named[self.named.own(term)]
        return efforts.filter(efforts.added(self.named, x))[efforts.every]

    def _not_detectable(self) -> Iterator[Detectable]:
        """Yield laws of one parameter that would have stayed below chance even at a strong size, and joints at rest."""
        given = self.given.without_curves()
        pull_scores, best = scores(given, self.named)
        limit = threshold(best)
        at_rest = [name for name in self.at.driven if not self.at.moves(name)]
        for name in at_rest:
            reason = f"{name} stood still"
            for physics, parameter in (("coulomb_friction", "limit"), ("viscous_friction", "damping")):
                yield Detectable(physics, name, parameter, None, "", reason)
        seen: set[tuple[str, str]] = set()
        rest = self.efforts.free_size(given, self.named)
        for score in pull_scores:
            candidate = score.candidate
            if candidate.size != 1 or candidate.name in seen or score.log_chance < limit:
                continue
            seen.add(candidate.name)
            size, scatter = rest[candidate.where.start]
            if not size > 0:
                continue
            need = float(np.sqrt(chi2_isf(np.exp(max(limit, -700.0)), 1)) * scatter / size)
            quantity = candidate.law.quantities_at(candidate.place, self.mechanism)[0]
            strong = float(quantity.default or 1.0)  # type: ignore[arg-type]
            if need > abs(strong):
                yield Detectable(
                    *candidate.name, candidate.law.linear[0], need, quantity.unit, "smaller ones drown in what is left"
                )

    def _advice(self, findings: Sequence[Finding], unknown: Sequence[Finding]) -> str:
        slow = [
            name
            for name in self.at.driven
            if not self.at.moves(name) or self.motion.still[:, self.motion.names.index(name)].mean() > 0.5
            if name in self.motion.names
        ]
        if slow:
            return f"record again with {', '.join(slow)} in motion, at several speeds and both ways"
        if unknown:
            where = unknown[0].location
            return (
                f"move {where} alone, slowly and fast, over its whole travel and both ways, with the others in several "
                "postures: that tells apart what depends on its speed, its position and its load"
            )
        doubtful = [finding.location for finding in findings if finding.alternatives]
        moving = [name for name in doubtful if name in self.at.driven]
        if moving:
            return f"move {moving[0]} at several constant speeds, both ways, and accelerate it hard in between"
        return ""

    def _remarks(self) -> list[str]:
        motion, efforts = self.motion, self.efforts
        remarks = list(motion.remarks)
        for column, name in enumerate(self.at.driven):
            left_out = 1 - efforts.good[:, column].mean()
            if left_out > 0.02:
                remarks.append(
                    f"{name} stands still in {number(100 * left_out, 2)} % of the samples: friction takes any "
                    "value there, "
                    "and they were left out for it"
                )
        remarks += masses_in_doubt(self.mechanism)
        rank, count = efforts.inertial_rank()
        if count:
            remarks.append(
                f"this motion tells {rank} combinations of the {count} inertial parameters of the moving links; "
                "the others stay as drawn"
            )
        for term in self.laws:
            if isinstance(term.law, AllLinks):
                told = efforts.combinations(term.law)
                remarks.append(f"this motion tells nothing of {_by_link(told.silent)}: they stay as drawn")
        silent = [name for name in self.mechanism.actuated if name not in self.motion.names]
        if silent:
            remarks.append(f"no position was recorded of {', '.join(silent)}: taken to stand at home")
        return remarks


def is_of_time(term: EffortCandidate) -> bool:
    return isinstance(term.law, FreeCurve) and term.law.variable == "time"


def _plain_unknown(where: str, statement: str, share: float = 0.0) -> Finding:
    return Finding(
        physics="unknown",
        location=where,
        candidates=(where,),
        parameters={},
        heldout_gain=share,
        statement=statement,
    )


def _by_link(names: Sequence[str]) -> str:
    """Return parameters, link by link."""
    links: dict[str, list[str]] = {}
    for name in names:
        link, _, what = name.rpartition(".")
        links.setdefault(link, []).append(what)
    return "; ".join(f"{link}: {', '.join(what)}" for link, what in links.items())


def _squared(values: Array) -> float:
    return float((values**2).sum())


def rms_of(values: Array) -> float:
    """Return the root mean square of values; NaN where there is none."""
    return float(np.sqrt(np.mean(values**2))) if np.size(values) else float("nan")


def _means(x: Array, y: Array, law: Array | None) -> tuple[Array, Array, Array, Array | None]:
    """Return means of neighbours, sorted by x, as many in each: x, y, its standard error, the law's."""
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, _BINS) if len(part) > 1]
    mean = np.array([x[part].mean() for part in parts])
    values = np.array([y[part].mean() for part in parts])
    error = np.array([y[part].std(ddof=1) / np.sqrt(len(part)) for part in parts])
    return mean, values, error, None if law is None else np.array([law[part].mean() for part in parts])
