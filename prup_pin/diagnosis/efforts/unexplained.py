"""What does no law explain? Structure that curves of no law or impossible bodies take away, and residuals that are no
noise.

A residual may follow the motion by another amount from one block of time to the next: friction that comes and goes. No
law and no curve of one shape takes it away, and where no noise was declared it would pass for noise. But noise knows
nothing of the motion: the residual, whitened and shifted in time against it, must follow it block by block as well as
it does where it stands. A joint may follow its own motion, or that of any other: a cable drags both along.

The residual of anything real follows the motion somehow: friction turns round a little otherwise than its law, and
speeds have noise. So it counts only where it is a part of the effort that matters to who uses it, and more than noise,
and as much of the residual as a curve of no law must be: a trace below it is what gears that yield leave.

What stands at one place, such as a rail that pinches, is a small part of an effort's root mean square and most of it
there. It comes back whenever the joint passes, which noise does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics import InMotion
from ...laws.efforts.effort_law import joint_unit, usual_way
from ...laws.efforts.variables import VARIABLES, variable_of
from ...numbers import number, quantity
from ...spatial import Array
from ..criteria import (
    AS_GOOD,
    FALSE_ALARM,
    FAR_LESS,
    FEWEST_BLOCKS,
    FEWEST_NUMBERS,
    FLIPS,
    LITTLE,
    MOST,
    MUCH,
    NO_MATTER,
    ROUNDING,
    SURE,
)
from ..diagnosis import Finding, heldout_gain
from ..findings import too_little, unknown_at
from .belongs import CHECK_ROBOT
from .evidence import relative_gain
from .final_state import FinalState, shows
from .prepare import PreparedEfforts
from .problem import Whitening, autoregression, usable
from .residuals import EffortResiduals, rms_of

#: What a block may follow of its own joint's motion, and of another joint's.
_OWN = ("direction", "speed", "position", "load")
_OTHERS = ("speed", "acceleration", "position")
#: Bins of a joint's travel where its residual may come back: wide places, and narrow ones.
_BINS = (25, 100)


def structure_left(final: FinalState) -> list[Finding]:
    """Return the findings of what curves of no law, or bodies that cannot exist, take away."""
    found = []
    for term in final.curves:
        joint, models = term.place.name, (final.with_time, final.with_time.without(term))
        share = heldout_gain(*(final.efforts.held_out_squares_at(joint, model) for model in models))
        text = (
            f"a systematic residual at {joint} is explained by no law of the library: {term.law.summary} by "
            f"a curve of its own would take away {100 * share:.0f} % of the residual's square"
            + ("" if term.is_of_time else ", and the corrected model follows it")
        )
        found.append(unknown_at(joint, text, share))
    for term in final.impossible:
        joint, link, saved = final.joint_of(term.place.name), term.place.name, final.held_out_saving(term)
        share = float(np.clip(saved / max(saved + float(final.held_out.sum()), np.finfo(float).tiny), 0.0, 1.0))
        text = (
            f"a systematic part of the residual at {joint} is explained by no law of the library; masses of {link} "
            f"that no body has would take away {100 * share:.0f} % of its square; the corrected model keeps to a body "
            "that can be"
        )
        found.append(replace(unknown_at(joint, text, share), candidates=(joint, link)))
    return found


def unexplained(final: FinalState, residuals: EffortResiduals, structure: list[Finding]) -> list[Finding]:
    """Return the findings of what no law explains: the structure that is left, or a residual that is no noise."""
    few = too_little(
        f"{len(final.efforts.kept)} samples of efforts",
        f"record at least {FEWEST_NUMBERS} postures, or some seconds of motion with every joint both ways",
    )
    if final.problem.columns.count < FEWEST_BLOCKS:
        return [few]
    found = list(structure)
    if not found and final.recording.noise.effort:
        unmoved = {finding.location: finding for finding in _unmoved(final, residuals)}
        found = [unmoved.get(finding.location, finding) for finding in _beyond_declared(residuals)]
        found = found or list(_repeating(final))
    elif not found:
        found = list(_unmoved(final, residuals)) or list(_varying(final)) or list(_repeating(final))
        found = found or list(_no_noise(final, residuals))
    if not found and _is_foreign(residuals.shares["all"]):
        found = [_foreign(residuals.shares["all"])]
    if found and len(final.efforts.kept) < FEWEST_NUMBERS:
        return [few]  # what no law explains, and what none could
    named = {finding.location for finding in found}
    found += [item for item in _worse(final, residuals) if item.location not in named]
    return [_with_more(final, finding) if finding.location in final.at.driven else finding for finding in found]


def _with_more(final: FinalState, finding: Finding) -> Finding:
    """Return a finding at a joint, with what else its effort shows there: that it is clipped, or drifts."""
    name, told, advice = finding.location, finding.statement, finding.advice
    column, kept = final.at.driven.index(name), final.efforts.kept
    good, clipped = final.efforts.good[:, column], final.motion.saturated[kept, column]
    if clipped.any():
        told += (
            f"; the effort is clipped where the drive is at its limit, and {number(100 * clipped.mean(), 2)} % of the "
            "samples were left out for it: what is beside them may have the same cause"
        )
        advice = advice or f"record again with less load or speed, so that {name} stays below its limit"
    time, left = final.motion.time[kept][good], (final.efforts.target - final.explained)[good, column]
    slope, start = np.polyfit(time, left, 1)
    if np.sum((left - slope * time - start) ** 2) < (1 - MOST) * np.sum(left**2):
        by = quantity(abs(slope) * float(np.ptp(time)) * final.scale[column], final.units[column])
        told += f"; most of it is a drift, {by} from the first to the last sample"
        advice = advice or f"find what changes slowly at {name}: a sensor that drifts, a drive that warms up"
    return replace(finding, statement=told, advice=advice)


def _is_foreign(share: Mapping[str, float]) -> bool:
    """Return whether the drawing predicts less than nothing of the efforts, and no correction most of them.

    A correction that takes the drawn efforts away leaves the noise, which speaks for no robot at all.
    """
    return share["rigid"] > MUCH and share["heldout"] > LITTLE


def _foreign(share: Mapping[str, float]) -> Finding:
    """Return the finding of a log that is hardly one of this robot."""
    return unknown_at(
        "robot",
        f"the residual of the robot file is {number(share['rigid'], 3)} times the efforts themselves, and with all "
        f"corrections still {number(100 * share['heldout'], 3)} % of them: this is hardly a log of this robot. "
        f"{CHECK_ROBOT[0].upper()}{CHECK_ROBOT[1:]}",
    )


def beyond_declared(residuals: EffortResiduals) -> dict[str, float]:
    """Return the joints that leave clearly more than the declared noise, in multiples of it, the worst first."""
    left = {name: own["after"] for name, own in residuals.by_joint.items() if own["after"] > AS_GOOD}
    return dict(sorted(left.items(), key=lambda item: -item[1]))


def _beyond_declared(residuals: EffortResiduals) -> Iterator[Finding]:
    for name, times in beyond_declared(residuals).items():
        yield unknown_at(
            name,
            f"the residual at {name} is {number(times, 3)} times the declared noise; no law of the library explains "
            "it, and no one curve of speed, position, load or time takes most of it",
        )


def _no_noise(final: FinalState, residuals: EffortResiduals) -> Iterator[Finding]:
    """Yield the joint where most is left, if that is more than the noise that the recording alone shows."""
    shares, by_joint = residuals.shares, residuals.by_joint
    loud = {
        name: shares[name]["heldout"] * rms_of(residuals.measured[final.efforts.good[:, column], column])
        for column, name in enumerate(final.at.driven)
        if shares[name]["heldout"] > LITTLE and not by_joint[name]["after"] <= MUCH
    }
    if loud:
        worst = max(loud, key=lambda name: loud[name])
        multiple, here, all_left = by_joint[worst]["after"], shares[worst]["heldout"], shares["all"]["heldout"]
        times = (
            f"{number(multiple, 3)} times the scatter of a single sample"
            if np.isfinite(multiple)
            else "and the scatter of a single sample is not known"
        )
        yield unknown_at(
            worst,
            f"the residual at {worst} is {number(100 * here, 3)} % of its effort, {times} "
            f"({number(100 * all_left, 3)} % of all efforts); no law of the library explains it, and no noise was "
            "declared that could account for it",
        )


def _unmoved(final: FinalState, residuals: EffortResiduals) -> Iterator[Finding]:
    """Yield joints whose effort changes though their position never does: by more than noise and what friction holds.

    Friction at rest may hold any part of what the load on the joint changes by, and no more.
    """
    scatter = MUCH * final.noise_sizes * final.scale
    for column, name in enumerate(final.at.driven):
        good = final.efforts.good[:, column]
        if final.at.moves(name) or final.motion.separate or not good.any():
            continue
        measured, predicted, rigid = (
            values[good, column] for values in (residuals.measured, residuals.predicted, residuals.rigid)
        )
        size, left = rms_of(measured), float(np.std(measured - predicted))
        if left > max(NO_MATTER * size, float(np.hypot(np.std(rigid), scatter[column]))):
            multiple = number(residuals.by_joint[name]["after"], 3)
            yield unknown_at(
                name,
                f"the position of {name} never changes, while its effort does: by {multiple} times the scatter of a "
                f"single sample, {number(100 * (left / size), 3)} % of it and more than the load on it changes",
                advice=f"check the column q.{name}: if {name} moved, this is not its position; if it stood still, find "
                "what else loaded it",
            )


def _worse(final: FinalState, residuals: EffortResiduals) -> Iterator[Finding]:
    """Yield joints of which the corrected model predicts the effort surely worse than the drawing, by what matters.

    Less than one sample could show does not: where a joint bears next to nothing, that is any share of its effort.
    """
    for column, name in enumerate(final.at.driven):
        drawn, left = residuals.shares[name]["rigid"], residuals.shares[name]["heldout"]
        if not (left > NO_MATTER and left > (1 + NO_MATTER) * drawn):
            continue
        counts, blocks = final.efforts.good[:, column], final.problem.columns.parts
        more = np.sqrt(left**2 - drawn**2) * rms_of(residuals.measured[counts, column])
        if not shows(more, final.noise_sizes[column] * final.scale[column]):
            continue
        squares = (
            np.where(counts, (residuals.measured - values)[:, column], 0.0) ** 2
            for values in (residuals.held_out, residuals.rigid)
        )
        _, sure = relative_gain(*(np.array([float(own[part].sum()) for part in blocks]) for own in squares))
        if sure > SURE:
            yield unknown_at(
                name,
                f"with these findings the residual of {name} is {number(100 * left, 3)} % of its effort on held-out "
                f"blocks of time, with the robot file alone {number(100 * drawn, 3)} %: what happens there is none of "
                "the laws that were found",
            )


def _repeating(final: FinalState) -> Iterator[Finding]:
    """Yield joints whose residual comes back wherever they pass one place, and is much there."""
    efforts, motion, judged = final.efforts, final.motion, final.efforts.judged
    if motion.separate:
        return
    measured, left = (
        judged(values, motion.piece)[efforts.kept] * final.scale
        for values in (motion.efforts, motion.efforts - final.at.rigid - final.added)
    )
    good = efforts.settled(judged) & np.isfinite(left)
    for column, name in enumerate(final.at.driven):
        here = good[:, column]
        if not (final.at.moves(name) and here.any()):
            continue
        position, way = final.at.position(name), final.at.dragged(name, usual_way(final.at, name))
        along = position[efforts.kept][here], way[efforts.kept][here] > 0
        found = _repeated(left[here, column], *along, rms_of(measured[here, column]))
        if found is not None:
            at, height, share = found
            where = quantity(at, joint_unit(VARIABLES["position"], name, final.mechanism))
            yield unknown_at(
                name,
                f"the residual at {name} comes back wherever it passes {where}, up to "
                f"{quantity(height, final.units[column])} there: what its other passes leave takes away "
                f"{number(100 * share, 2)} % of its square, and no law of the library explains it",
                share,
                advice=f"look at {name} where it stands at {where}, and record more there",
            )


def _varying(final: FinalState) -> Iterator[Finding]:
    """Yield that the residual follows some motion by amounts that change, in the band where it is judged."""
    efforts, motion, judged = final.efforts, final.motion, final.efforts.judged
    measured, left = (
        judged(values, motion.piece)[efforts.kept] * final.scale
        for values in (motion.efforts, motion.efforts - final.at.rigid - final.added)
    )
    noise = [final.noise[name].below(cutoff) for name, cutoff in zip(final.at.driven, judged.cutoffs, strict=True)]
    found = time_varying(efforts, left, measured, np.nan_to_num(noise))
    if found is not None:
        followed = f"its {found.variable}" if found.of == found.joint else f"the {found.variable} of {found.of}"
        yield unknown_at(
            found.joint,
            f"the residual at {found.joint} follows {followed} by an amount that changes with time, which would take "
            f"away {number(100 * found.share, 2)} % of its square beyond chance and is {number(100 * found.size, 2)} % "
            "of the joint's effort (root mean square): it is no noise, and no law of the library explains it",
            found.share,
        )


# -- what comes back at one place --------------------------------------------------------------------------------------


def _repeated(left: Array, position: Array, forth: np.ndarray, size: float) -> tuple[float, float, float] | None:
    """Return where a residual (n,) comes back, how much at most, and the share of it that does; or None.

    position, forth (n,): of the joint, and on the way forth. Each pass of a narrow bin is foretold by the mean of the
    others, by way. That counts as a curve of no law does, beyond what the shifted residual gives anywhere, and where it
    is more than a little of the effort (RMS `size`).
    """
    bins = [np.searchsorted(np.linspace(position.min(), position.max(), count + 1)[1:-1], position) for count in _BINS]
    passes = [(2 * own + forth, np.cumsum(np.diff(own, prepend=own[0]) != 0)) for own in bins]

    def taken(values: Array, told: Array) -> float:
        return float(values @ values - np.sum((values - told) ** 2))

    foretold = [_by_others(left, *own) for own in passes]
    told = max(foretold, key=lambda each: taken(left, each))
    saved, most = taken(left, told), int(np.argmax(np.abs(told)))
    if not (saved > FAR_LESS * float(left @ left) and abs(told[most]) > LITTLE * size):
        return None
    for lag in (np.linspace(LITTLE, 1 - LITTLE, FLIPS) * len(left)).astype(int):
        shifted = np.roll(left, lag)
        if any(taken(shifted, _by_others(shifted, *own)) >= saved for own in passes):
            return None
    return float(position[most]), float(abs(told[most])), saved / float(left @ left)


def _by_others(left: Array, bins: np.ndarray, passes: np.ndarray) -> Array:
    """Return what other passes (n,) leave of a residual (n,) in the same bin (n,), nearer to nothing where few do."""
    sums, counts = np.bincount(bins, left), np.bincount(bins)
    own, inverse, many = np.unique(bins * (passes.max() + 1) + passes, return_inverse=True, return_counts=True)
    others = sums[bins] - np.bincount(inverse, left, len(own))[inverse]
    return others / (counts[bins] - many[inverse] + many.mean())


# -- what follows a motion by amounts that change ----------------------------------------------------------------------


@dataclass(frozen=True)
class TimeVarying:
    """A joint whose residual follows a `variable` of the motion `of` a joint, by another amount in each block of time.

    share: of the residual's squares, beyond chance, over those that chance would not take; size: root mean square of it
    over that of the joint's effort.
    """

    joint: str
    variable: str
    of: str
    share: float
    size: float


def time_varying(efforts: PreparedEfforts, left: Array, measured: Array, noise: Array) -> TimeVarying | None:
    """Return what the residual (n, k) at the kept samples follows by amounts that change, or None.

    measured (n, k): the efforts; noise (k,): of them; all in the band where they are judged. The test is the largest of
    all joints and motions in the recording against each shifted one, in standard deviations of the shifted ones.
    """
    if efforts.at.motion.separate:
        return None
    good = efforts.settled(efforts.judged) & np.isfinite(left)
    left = np.where(good, left, 0.0)
    white = Whitening(autoregression(left, good, efforts.piece), usable(good, efforts.piece))
    lags = np.concatenate(([0.0], np.linspace(LITTLE, 1 - LITTLE, FLIPS)))
    found, own, others = [], [], []
    for column, joint in enumerate(efforts.at.driven):
        here = good[:, column]
        size = float((measured[here, column] ** 2).sum())
        # what is left in all is no matter, nor is what follows anything
        least = max(NO_MATTER**2 * size, noise[column] ** 2 * here.sum())
        plain = left[:, column]
        if not float(plain @ plain) > least:
            continue
        rest = white.of_joint(column, plain)
        motions = list(_motions(efforts.at, joint))
        table = np.column_stack([_compared(efforts, column, values) for _, _, values in motions])
        saved = _saved(rest, white.of_joint(column, table), efforts.blocks, white.good[:, column], lags)
        mean, spread = saved[1:].mean(axis=0), np.maximum(saved[1:].std(axis=0), np.finfo(float).tiny)
        own += ((saved[0] - mean) / spread).tolist()
        others.append(((saved[1:] - mean) / spread).max(axis=1))
        plainly = _saved(plain, table, efforts.blocks, here, lags)
        chance = plainly[1:].mean(axis=0)
        follows = np.maximum(plainly[0] - chance, 0.0)
        # amounts for each block take a part of anything away: of the rest
        shares = follows / np.maximum(float(plain @ plain) - chance, np.finfo(float).tiny)
        for (of, variable, _), squares, share in zip(motions, follows, shares, strict=True):
            part = np.sqrt(squares / size) if squares > least else 0.0
            found.append(TimeVarying(joint, variable, of, float(share), float(part)))
    if not found:
        return None
    by_chance = (np.max(others, axis=0)[:, None] >= np.array(own)).mean(axis=0)
    sure = [each for each, chance in zip(found, by_chance, strict=True) if chance < FALSE_ALARM and each.size > 0]
    most = max(sure, key=lambda each: each.share, default=None)
    return most if most is not None and most.share > FAR_LESS else None


def _motions(at: InMotion, joint: str) -> Iterator[tuple[str, str, Array]]:
    """Yield what a joint's effort may follow: a joint, a variable of its motion, and the values of that (N,)."""
    for of in (joint, *(other for other in at.motion.names if other != joint)):
        for variable in (_OWN if of == joint else _OTHERS) if at.moves(of) else ():
            if variable == "direction":
                yield of, variable, at.dragged(of, usual_way(at, of))
            elif variable == "acceleration":
                yield of, variable, at.acceleration(of)
            else:
                yield of, variable, variable_of(at, of, variable)


def _compared(efforts: PreparedEfforts, column: int, values: Array) -> Array:
    """Return a variable (n,) filtered as the efforts of a joint, at the kept samples."""
    return efforts.judged.of_joint(column)(values - values.mean(), efforts.at.motion.piece)[efforts.kept]


def _saved(left: Array, columns: Array, blocks: np.ndarray, good: np.ndarray, lags: Array) -> Array:
    """Return the squares (s, m) of a residual (n,), shifted by shares (s,) of it, that columns (n, m) take away.

    Each column by one amount for each block (n,). What counts, `good` (n,), is shifted among itself: where a joint
    stands there is no residual, and most often no motion, so that any motion would be followed best where it stands.
    """
    left, columns, blocks = left[good], columns[good], blocks[good]
    count, out = len(left), np.zeros((len(lags), columns.shape[1]))
    if not count:
        return out
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    shifts = (lags * count).astype(int)[:, None]
    sizes = np.add.reduceat(columns**2, starts)
    told = sizes > ROUNDING * sizes.max(axis=0, initial=0.0)
    for start, end, size, tells in zip(starts, [*starts[1:], count], sizes, told, strict=True):
        shifted = left[(np.arange(start, end) - shifts) % count]
        out[:, tells] += (shifted @ columns[start:end, tells]) ** 2 / size[tells]
    return out
