"""From a recording to columns: a motion, the library of laws on it, tolerances, whitening."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...dynamics import INERTIAL, InMotion
from ...laws import Effect, Place
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...laws.efforts.effort_sensor import EffortGain, EffortOffset
from ...laws.efforts.encoder import OffsetEncoder
from ...laws.efforts.free_curve import VARIABLES, FreeCurve
from ...laws.efforts.inertial_parameters import InertialParameters
from ...spatial import Array
from ..criteria import AR_ORDER, EFFORT_FOLDS
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
from .search import Chosen, fit, held_out, pulls

__all__ = ["Base", "Efforts"]

#: A law at a place, what is scanned, and its columns.
_Seen = tuple[EffortLaw, Place, Mapping[str, float], ByJoint]
#: Samples whose regressors are multiplied at a time.
_AT_ONCE = 4096


@dataclass(frozen=True, eq=False)
class Base:
    """A parameter within a tolerance: what one of its tolerances adds, (N, k)."""

    name: str
    kind: str
    physics: str
    place: str
    nominal: float
    tolerance: float
    unit: str
    efforts: Array
    inertial: Array | None = None  # (10,) of its body, per tolerance


class Efforts:
    """The efforts of a robot in one motion, ready to be asked which laws they want."""

    def __init__(self, at: InMotion, tolerances: Mapping[str, float], noise: float | None):
        self.at = at
        self.noise = noise
        motion = at.motion
        self.filter = lambda values: motion.low_pass(values, motion.piece)
        self.every = kept_samples(at)
        self.piece = motion.piece[self.every]
        self.blocks = column_blocks(self.every)
        self.measured = self.filter(motion.efforts)
        self.rigid = self.filter(at.rigid)
        self.good = self._good()
        self.bases = _bases(at, tolerances)
        self._fixed: list[_Seen] = []
        self._moving: list[tuple[EffortLaw, Place]] = []
        for law in EFFORT_LAWS:
            for place in law.places(at.mechanism):
                if (law.of_motion and motion.standing) or not law.acts(place, at):
                    continue
                if law.of_what_is_known:
                    self._moving.append((law, place))
                    continue
                for values in law.scanned(place, at):
                    self._fixed.append((law, place, values, self.seen(law.efforts_per(place, values, at))))
        self.whitening = self._whitened()

    def seen(self, efforts: Array) -> ByJoint:
        """Return columns of efforts (N, k, p) as they are compared: filtered, where samples are kept."""
        return ByJoint.of(self.filter(efforts)[self.every])

    def _good(self) -> np.ndarray:
        """Return the kept samples that count (n, k): a joint at rest rubs by what it likes, up to its limit."""
        motion = self.at.motion
        good = np.isfinite(self.measured[self.every])
        for column, name in enumerate(self.at.driven):
            if name not in motion.names:
                continue
            still = motion.still[self.every, motion.names.index(name)]
            if still.mean() < 0.8:
                good[:, column] &= ~still
        return good

    def _whitened(self) -> Whitening:
        """Return the whitening for what all laws fitted together leave, which is noise."""
        flat = np.zeros((self.measured.shape[1], 1))
        spread = np.nanstd(np.where(self.good, (self.measured - self.rigid)[self.every], np.nan), axis=0)
        flat[:, 0] = 1 / np.where(spread > 0, spread, 1.0)
        plain = Whitening(flat, usable(self.good, self.piece, 0))
        given = self._gathered(plain, Chosen(()), False)
        everything = Chosen(tuple(range(given.columns.size)))
        # a pinch of shrinkage: columns that are nearly alike must not blow up
        scale = np.diag(given.columns.gram.sum(axis=0))
        eased = Gathered(self.at.mechanism, given.columns, given.candidates, given.prior + 1e-6 * scale)
        x, _ = fit(eased, everything)
        residual = given.columns.residual(everything.where, x) / flat[:, 0]
        order = 0 if self.at.motion.standing else AR_ORDER
        filters = autoregression(residual, self.good, self.piece, order)
        return Whitening(filters, usable(self.good, self.piece, order))

    def gathered(self) -> Gathered:
        """Return the columns of all that competes."""
        return self._gathered(self.whitening, Chosen(()), True)

    def with_curves(self, given: Gathered) -> tuple[Gathered, list[EffortCandidate]]:
        """Return the columns with those of curves of no law beside them, and these."""
        there = [candidate for candidate in given.candidates if isinstance(candidate.law, FreeCurve)]
        if there:
            return given, there
        curves: Iterable[_Seen] = (
            (law, place, {}, self.seen(law.efforts_per(place, {}, self.at)))
            for law in map(FreeCurve, VARIABLES)
            for place in law.places(self.at.mechanism)
            if law.acts(place, self.at) and not (law.variable in ("speed", "time") and self.at.motion.standing)
        )
        new, _ = self._beside(given.columns, self.whitening, curves)
        prior = np.concatenate((given.prior, np.zeros(given.columns.size - len(given.prior))))
        return Gathered(self.at.mechanism, given.columns, (*given.candidates, *new), prior), new

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
        priors = [law.prior(place, self.at.mechanism) for law, place, _ in laws if not isinstance(law, FreeCurve)]
        return candidates, [value for prior in priors for value in prior]

    def added(self, chosen: Chosen, x: Array) -> Array:
        """Return the efforts (N, k) beyond the rigid robot's, not filtered."""
        out = np.zeros_like(self.at.rigid)
        for index in chosen.base:
            out += x[index] * self.bases[index].efforts
        for term in chosen.terms:
            own = x[chosen.own(term)]
            at = self.at.knowing(out.copy(), self.at.motion.efforts - self.at.rigid - out)
            out += term.law.efforts_per(term.place, term.values, at) @ own
        return out

    def folds(self, count: int) -> list[np.ndarray]:
        """Return the blocks that are held out together, in turn."""
        return np.array_split(np.arange(count), min(EFFORT_FOLDS, count))

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
        return int((values > 1e-8 * values.max(initial=0.0)).sum()), count

    def within_tolerance(self, amounts: Array) -> list[Effect]:
        """Return the parameters within tolerance as effects of a corrected model, by amounts in tolerances."""
        inertial: dict[str, Array] = {}
        out: list[Effect] = []
        for base, amount in zip(self.bases, amounts, strict=True):
            if base.inertial is not None:
                inertial[base.place] = inertial.get(base.place, np.zeros(10)) + amount * base.inertial
                continue
            law, name = _OF_KIND[base.kind]
            out.append(Effect(law, Place(base.place, law.variant), {name: float(amount * base.tolerance)}))
        law = InertialParameters()
        for link, change in inertial.items():
            out.append(Effect(law, Place(link, law.variant), dict(zip(INERTIAL, map(float, change), strict=True))))
        return out

    def _gathered(self, whitening: Whitening, chosen: Chosen, moving: bool) -> Gathered:
        target = np.nan_to_num(self.measured - self.rigid)[self.every]
        target = np.column_stack([whitening.of_joint(k, target[:, k]) for k in range(target.shape[1])])
        columns = Columns(target, self.blocks)
        prior = [1.0] * len(self.bases)
        if self.bases:
            columns.add(whitening(self.seen(base.efforts[..., None])) for base in self.bases)
        candidates, more = self._beside(columns, whitening, self._fixed)
        prior += more
        self._own_size = columns.size
        given = Gathered(self.at.mechanism, columns, tuple(candidates), np.array(prior))
        return self.renewed(given, chosen) if moving else given

    def renewed(self, given: Gathered, chosen: Chosen) -> Gathered:
        """Return the columns with those that depend on what is known made anew; chosen ones stay as they are."""
        columns = given.columns
        keep = [term for term in chosen.terms if term.where.start >= self._own_size]
        size = max([self._own_size, *(term.where.stop for term in keep)])
        columns.cut(size)
        fixed = [c for c in given.candidates if c.where.start < self._own_size]
        prior = list(given.prior[:size])
        kept = [c for c in given.candidates if self._own_size <= c.where.start < size]
        x, _ = fit(Gathered(self.at.mechanism, columns, (), np.array(prior)), chosen)
        known = self.added(chosen, x)
        at = self.at.knowing(known, self.at.motion.efforts - self.at.rigid - known)
        moving = (
            (law, place, values, self.seen(law.efforts_per(place, values, at)))
            for law, place in self._moving
            for values in law.scanned(place, at)
        )
        new, more = self._beside(columns, self.whitening, moving)
        prior += more
        return Gathered(self.at.mechanism, columns, (*fixed, *kept, *new), np.array(prior))

    def closer(self, given: Gathered, chosen: Chosen) -> tuple[Gathered, Chosen]:
        """Return what is chosen with scanned values where the blocks ask for them, and the columns that this takes.

        One term after the other, the last chosen first, twice around.
        """
        columns, best = given.columns, chosen
        least = float(held_out(given, best).sum())
        for place in [*range(len(chosen.terms) - 1, -1, -1)] * 2:
            term = best.terms[place]
            x, _ = fit(given, best)
            values = term.law.fitted(term.place, x[best.own(term)], term.values)
            others = term.law.closer(term.place, values, self.at)
            if not others:
                continue
            before = Chosen(best.base, best.terms[:place])
            known = self.added(before, fit(given, before)[0])
            at = self.at.knowing(known, self.at.motion.efforts - self.at.rigid - known)
            size, prior = columns.size, list(given.prior)
            places = columns.add(
                self.whitening(self.seen(term.law.efforts_per(term.place, other, at))) for other in others
            )
            for own, other in zip(places, others, strict=True):
                prior += list(term.law.prior(term.place, self.at.mechanism))
                candidate = EffortCandidate(term.law, term.place, other, own)
                tried = best.replaced(place, candidate)
                wider = Gathered(self.at.mechanism, columns, (*given.candidates, candidate), np.array(prior))
                left = float(held_out(wider, tried).sum())
                if left < least:
                    least, best, given = left, tried, wider
            # only what was taken stays
            end = max([size, *(each.where.stop for each in best.terms)])
            columns.cut(end)
            given = Gathered(self.at.mechanism, columns, given.candidates, given.prior[:end])
            if len(given.prior) < end:
                given = Gathered(self.at.mechanism, columns, given.candidates, np.array(prior)[:end])
        return given, best

    def start(self) -> Chosen:
        """Return what is there before any law: parameters within their tolerances."""
        return Chosen(tuple(range(len(self.bases))))


#: The law and parameter that stand for a tolerance of a kind.
_OF_KIND: Mapping[str, tuple[EffortLaw, str]] = {
    "effort_bias": (EffortOffset(), "offset"),
    "effort_gain": (EffortGain(), "gain"),
    "encoder_offset": (OffsetEncoder(), "offset"),
}


def _bases(at: InMotion, tolerances: Mapping[str, float]) -> list[Base]:
    """Return the parameters that tolerances let be a little off, each with what one tolerance adds."""
    mechanism, out = at.mechanism, []
    for joint in mechanism.joints:
        inertia = mechanism.model.inertias[joint.id]
        link = mechanism.bodies.get(joint.id, joint.name)
        if not inertia.mass > 0:
            continue
        drawn = inertia.toDynamicParameters()
        central = np.zeros(10)
        c, m = np.array(inertia.lever), float(inertia.mass)
        moved = m * (c @ c * np.eye(3) - np.outer(c, c))
        central[4:] = drawn[4:] - np.array([moved[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))])
        body = at.regressor[:, :, joint.id - 1]
        if size := tolerances.get("mass", 0.0):
            efforts = body @ (drawn - central)
            out.append(
                Base(
                    f"{link}.mass",
                    "mass",
                    "inertial_parameters",
                    link,
                    m,
                    size * m,
                    "kg",
                    size * efforts,
                    size * (drawn - central),
                )
            )
        if size := tolerances.get("inertia", 0.0):
            for index, name in enumerate(INERTIAL[4:], start=4):
                if abs(central[index]) > 0:
                    spread = size * abs(central[index])
                    efforts = body[:, :, index] * spread
                    own = np.zeros(10)
                    own[index] = spread
                    label, unit = f"{link}.{name}", "kg m^2"
                    physics = "inertial_parameters"
                    out.append(Base(label, "inertia", physics, link, central[index], spread, unit, efforts, own))
    for column, name in enumerate(at.driven):
        unit = "N" if mechanism.joint(name).slides else "N m"
        if size := tolerances.get("effort_bias", 0.0):
            own = np.zeros_like(at.rigid)
            own[:, column] = size
            out.append(Base(f"{name}.effort_bias", "effort_bias", "effort_offset", name, 0.0, size, unit, own))
        if size := tolerances.get("effort_gain", 0.0):
            own = np.zeros_like(at.rigid)
            own[:, column] = size * at.rigid[:, column]
            out.append(Base(f"{name}.effort_gain", "effort_gain", "effort_gain", name, 0.0, size, "", own))
        if (size := tolerances.get("encoder_offset", 0.0)) and name in at.motion.names:
            unit = "m" if mechanism.joint(name).slides else "rad"
            own = size * at.displaced(name)
            out.append(Base(f"{name}.encoder_offset", "encoder_offset", "encoder_offset", name, 0.0, size, unit, own))
    return [base for base in out if np.abs(base.efforts).max(initial=0.0) > 0]
