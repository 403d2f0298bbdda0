"""One account of recordings: the robot within its tolerances, laws that recordings ask for, and second thoughts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..channels import Noise
from ..numbers import number, quantity
from ..simulation import Simulator
from .calibrate import calibrated_from
from .candidates import Term
from .criteria import AS_GOOD, FEW_ROUNDS, LITTLE, MOST, MOST_FITS, PARAMETER_COST, beyond_tolerance
from .diagnosis import Finding
from .evidence import (
    count_beyond_tolerance,
    cross_validated,
    fold_labels,
    is_clean,
    minus_2_log_posterior,
    rescaled_tolerances,
    rescaling_remark,
    with_rescaled,
)
from .findings import load_between, load_left, no_noise, too_few
from .locate import yieldings
from .noise import could_show_structure, noise_of_the_rest
from .prepare import AsDrawn, Prepared, Tell
from .problem import Fit, Problem
from .search import Selection, dropped_by_folds, screen, select, with_one_law
from .unrecorded_load import (
    UnrecordedLoad,
    load_between_repeats,
    minus_2_log_likelihood,
    reaches,
    scatters_in_a_module,
    unrecorded_load,
)


@dataclass(frozen=True, eq=False)
class Account:
    """What was prepared, its problem as it was calibrated, the laws that were selected, and a doubt."""

    prepared: Prepared
    problem: Problem
    selection: Selection
    doubt: Finding | None = None

    @property
    def labels(self) -> np.ndarray:
        """Labels (N,) of samples that are held out together."""
        return fold_labels(self.prepared.inputs.blocks)

    @property
    def is_clean(self) -> bool:
        """True where what is left may be noise."""
        return is_clean(self.problem, self.selection.last)

    @property
    def size(self) -> int:
        """How many numbers what is left has."""
        return self.problem.count(self.selection.last)

    @property
    def cost(self) -> float:
        """-2 log of how likely what was measured is with what was found."""
        return minus_2_log_posterior(self.selection.last, len(self.prepared.library))

    @property
    def is_far_from_clean(self) -> bool:
        """True where more is left than noise by so much that noise would be a small part of it."""
        return LITTLE * self.selection.last.chi2 > self.size

    @property
    def lacks_few_laws(self) -> bool:
        """True where one law more, to first order, leaves so little that few may do."""
        others = screen(self.problem, self.selection.last, self.prepared.library)
        return bool(others) and LITTLE * others[0].chi2 <= self.size

    @property
    def noise(self) -> Noise:
        """The noise; where nothing but what is left tells it, what is left beside the laws that were found."""
        noise = self.problem.noise
        if noise.source != "residual":
            return noise
        left = float(np.sqrt(self.selection.last.chi2 / max(self.size, 1)))
        return replace(noise, position=left * noise.position, rotation=left * noise.rotation)

    def by_noise(self, noise: Noise) -> tuple[float, bool]:
        """Return what is left of blocks that are held out in turn, chi squared by a noise, and whether all may be that.

        What two accounts leave is not compared by two noises, nor metres by one and radians by another.
        """
        problem, last = replace(self.problem, noise=noise), self.selection.last
        fit = problem.relinearised(problem.fit_at(last.terms, last))
        return cross_validated(problem, fit, self.labels[fit.samples]), is_clean(problem, fit)


def without_load(drawn: AsDrawn) -> Account | None:
    """Return the account of recordings in which nothing can be compared, for repeats say that loads were not recorded.

    What follows from such samples, a stiffness most of all, is no fault of the robot; nor is their scatter noise.
    """
    problem = drawn.problem
    found = load_between_repeats(problem)
    if found is None:
        return None
    load, size, noise = found
    if problem.noise.source != "declared" and problem.noise.which is None:
        problem = replace(problem, noise=replace(noise, source="estimated"))
    prepared = replace(drawn.prepared(), problem=problem)
    return Account(
        prepared, problem, Selection.nothing(problem.first, prepared.library), load_between(size, noise, load)
    )


def without_laws(prepared: Prepared, tell: Tell) -> Account:
    """Return a problem calibrated within tolerances, before any law."""
    tell("calibration within tolerances", 0.02)
    # What is left out would drive parameters beyond their tolerances, where laws' first order tells nothing any more.
    begun = _calibrated(prepared, prepared.problem)
    if begun.noise.position < MOST * begun.problem.noise.position:
        # what a law does that is missing yet was taken for noise where no kind that can be so far off does it
        return _calibrated(prepared, replace(prepared.problem, noise=begun.noise))
    return begun


def _calibrated(prepared: Prepared, problem: Problem) -> Account:
    problem = _within_tolerances(prepared, problem)
    return Account(prepared, problem, Selection.nothing(problem.first, prepared.library))


def _within_tolerances(prepared: Prepared, problem: Problem) -> Problem:
    """Return a problem calibrated anew within what is declared, no parameter farther off than chance takes one."""
    return prepared.within_tolerances(replace(problem, tolerances=None), beyond_tolerance(len(prepared.toleranced)))


def with_first_law(prepared: Prepared, tell: Tell) -> Account:
    """Return what the first law that recordings ask for leaves."""
    begun = without_laws(prepared, tell)
    if not begun.size:
        return begun
    tell("laws, round 1", 0.05)
    last = with_one_law(begun.problem, prepared.library, begun.labels, begun.problem.first)
    return replace(begun, selection=replace(begun.selection, last=last))


def beside_laws(prepared: Prepared, terms: Sequence[Term], tell: Tell) -> Account:
    """Return what laws leave that are known by and large: parameters are calibrated and weight is asked beside them."""
    problem = prepared.problem
    acting = Simulator(problem.simulator.robot, prepared.inputs, [term.effect for term in terms])
    calibrated = _within_tolerances(prepared, Problem.of(acting, problem.stack, problem.noise))
    if calibrated.tolerances is None:
        return with_first_law(prepared, tell)
    problem = calibrated_from(problem.as_open_as(calibrated), calibrated.first.x)
    first = problem.first
    beside = problem.fit_at(terms, first, calibrated.first.x)
    last = min((problem.refine(terms, begin) for begin in (first, beside)), key=lambda fit: fit.chi2)
    selection = replace(Selection.nothing(first, prepared.library), last=last)
    return Account(prepared, problem, selection)


def searched(begun: Account, tell: Tell, most: int = MOST_FITS) -> Account:
    """Return what recordings say of laws and parameters; no further law is looked for after so many fits.

    begun: a calibration, or what a shorter search of the same led to, from which this one goes on.
    """
    if not begun.size:
        return begun
    now = _selected(begun, begun.problem, tell, most, begun.selection.last)
    now = _by_noise_of_the_rest(_by_noise_of_the_wrench(now, tell, most), tell, most)
    now = _with_weight_or_without(now, tell, most)
    if not _foretells(now):
        return without_laws(begun.prepared, tell)
    if begun.prepared.kinds:
        now = replace(now, selection=dropped_by_folds(now.problem, now.selection, now.labels))
    elif now.doubt is None and now.is_clean:
        now = _within_rescaled(now, tell)
    if begun.prepared.noise_unknown and now.doubt is None and now.is_clean:
        return replace(now, doubt=no_noise(now.problem, now.selection.last, begun.prepared.inputs.blocks))
    return now


def _foretells(now: Account) -> bool:
    """Return whether laws foretell held-out blocks about as well as none, or better: else they explain nothing.

    Where parameters may be off, a law in their place need not foretell better.
    """
    problem, last, first = now.problem, now.selection.last, now.problem.first
    if not last.terms:
        return True
    held = [cross_validated(problem, fit, now.labels[fit.samples]) for fit in (last, first)]
    return held[0] <= AS_GOOD**2 * held[1]


def _selected(now: Account, problem: Problem, tell: Tell, most: int = MOST_FITS, begun: Fit | None = None) -> Account:
    """Return an account with another problem and the laws that are selected for it."""
    begun = problem.first if begun is None else begun
    selection = select(problem, now.prepared.library, now.labels, begun, tell, most)
    return replace(now, problem=problem, selection=selection)


def _by_noise_of_the_wrench(now: Account, tell: Tell, most: int) -> Account:
    """Return an account with the wrench's noise as it comes through what was found, if then noise is left.

    At the edge of a gap it reaches the poses much farther than through the robot of the file. Parameters that were
    driven beyond tolerance, so that each sample stands on the side of the gap on which it was seen, come back by it.
    """
    again, fit = now.problem, now.selection.last
    beyond = count_beyond_tolerance(fit) if now.is_clean else np.inf
    if not again.noise.wrench.any() or not fit.terms or not beyond:
        return now
    for _ in range(FEW_ROUNDS):
        again = replace(again, by_wrench=again.stack.seen(fit.influence.first.by_wrench))
        fit = again.refine(fit.terms, again.fit_at(fit.terms, fit))
        if is_clean(again, fit) and count_beyond_tolerance(fit) < beyond:
            again = _within_tolerances(now.prepared, again)
            begun = again.relinearised(again.fit_at(fit.terms, fit)) if now.is_clean else None
            return _selected(now, again, tell, most, begun)
    return now


def _by_noise_of_the_rest(now: Account, tell: Tell, most: int) -> Account:
    """Return an account with the noise that is left where it is no other than was assumed but in size.

    Where no load was recorded, and forces at the tool leave it likelier, with a doubt instead. Where one module that
    gives way leaves it likelier it is not noise, whether or not it follows anything that was recorded.
    """
    inputs, fit = now.prepared.inputs, now.selection.last
    larger = noise_of_the_rest(now.problem, fit, inputs.blocks[fit.samples])
    if larger is None or not _foretells(now):
        return now  # what laws leave that foretell nothing is no noise
    load = _load_left(now.problem, fit) if inputs.weight_alone else None
    if load is not None:
        return replace(now, doubt=load_left(larger.noise, load))
    if could_show_structure(inputs.blocks[fit.samples]) and _is_of_a_module(now.problem, fit, larger):
        return now
    now.prepared.remarks.append(_larger_noise(now.problem.noise, larger.noise))
    now = _selected(now, _within_tolerances(now.prepared, larger), tell, most)
    return replace(now, doubt=too_few(now.problem, now.selection, inputs.blocks))


def _with_weight_or_without(now: Account, tell: Tell, most: int) -> Account:
    """Return an account without the robot's own weight, where that makes what was found likelier.

    Whether weight acts was asked before any law was there: it may have stood for one, and further laws for it.
    """
    prepared, last = now.prepared, now.selection.last
    if prepared.kinds or not now.problem.acting or len(last.terms) < 2:
        return now
    without = replace(prepared, library=[item for item in prepared.library if not item.law.weighs])
    light = _within_tolerances(without, now.problem)
    # laws that stand for weight do as well without it
    if light.refine(last.terms, light.first).chi2 > last.chi2 + PARAMETER_COST * len(last.terms):
        return now
    other = _selected(now, light, tell, most)
    return other if other.cost < now.cost - PARAMETER_COST else now


def _within_rescaled(now: Account, tell: Tell) -> Account:
    """Return an account within wider tolerances, where these explain better what was found; and tell it."""
    problem, selection, prepared = now.problem, now.selection, now.prepared
    # what laws have taken may be what a kind is off by where nothing asks for them but the tolerances
    wider = rescaled_tolerances(problem, problem.first if is_clean(problem, problem.first) else selection.last)
    if not wider:
        return now
    other = replace(prepared, toleranced=with_rescaled(prepared.toleranced, wider))
    again = _within_tolerances(other, problem)
    found = replace(now, problem=again, selection=Selection.nothing(again.first, prepared.library))
    if selection.last.terms or count_beyond_tolerance(selection.last) or not found.is_clean:
        found = _selected(now, again, tell)
    taken = minus_2_log_posterior(found.selection.last, len(prepared.library), wider) < now.cost
    prepared.remarks.append(rescaling_remark(wider, taken))
    return found if taken else now


def _load_left(problem: Problem, fit: Fit) -> UnrecordedLoad | None:
    """Return the unrecorded load that leaves behind what a fit leaves; None where something else does."""
    white, seen = problem.whiteners(fit.influence), problem.stack.exists[fit.samples]
    by_wrench, *others = (white @ reach for reach in reaches(fit.influence))
    return unrecorded_load(fit.residual, by_wrench, others, seen, seen, problem.stack.angles)


def _is_of_a_module(problem: Problem, fit: Fit, larger: Problem) -> bool:
    """Return True where what a fit leaves lies in one module's directions rather than where a larger noise would."""
    influence, seen = fit.influence, problem.compared(fit.run)
    white, whiter = problem.whiteners(influence), larger.whiteners(influence)
    noise = problem.noise.wrench if problem.noise.wrench.any() else larger.noise.wrench
    by_wrench = white @ (problem.stack.seen(influence.first.by_wrench) * noise)
    travel = [influence.first.by_travel(column) for column in range(len(problem.simulator.robot.mechanism.actuated))]
    by_encoders = white @ problem.stack.seen(np.stack(travel, axis=-1))
    motions = [
        white @ influence.signature(each.module)[:, :, list(each.components)] for each in yieldings(problem, fit)
    ]
    of_poses = minus_2_log_likelihood(
        larger.whitened(influence, problem.stack.residual(fit.run)[fit.samples]), whiter, white, seen
    )
    return scatters_in_a_module(fit.residual, motions, (by_wrench, by_encoders), seen, of_poses)


def _larger_noise(noise: Noise, larger: Noise) -> str:
    wrench = [quantity(value, unit) for value, unit in ((larger.force, "N"), (larger.moment, "N m")) if value]
    through = f", and {' and '.join(wrench)} of the wrench sensor" if wrench and not noise.wrench.any() else ""
    return (
        f"what is left is noise, and larger than {noise.source}: {number(1e6 * larger.position, 3)} µm and "
        f"{number(1e6 * larger.rotation, 3)} µrad{through} were taken for it, where "
        f"{number(1e6 * noise.position, 3)} µm and {number(1e6 * noise.rotation, 3)} µrad were {noise.source}"
    )
