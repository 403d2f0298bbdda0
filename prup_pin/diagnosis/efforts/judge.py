"""Does another recording confirm a formula that was proposed from one? By its values then, not by what fits now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...laws import Place
from ...laws.efforts import EFFORT_LAWS
from ...laws.formulas import JointFormula
from ...numbers import number
from ..chances import WITHIN_95, student_95
from ..criteria import LITTLE, SURE
from ..diagnosis import Finding
from ..proposal import Judged
from .evidence import held_out, relative_gain
from .final_state import FinalState, shows
from .propose import beside, with_columns

__all__ = ["judged"]


def judged(final: FinalState, findings: Sequence[Finding]) -> Iterator[Judged]:
    """Yield what this recording says of each proposed formula that was brought along: confirmed, refuted or neither."""
    for law in EFFORT_LAWS:
        if not isinstance(law, JointFormula):
            continue
        place = next(iter(law.places(final.mechanism)), None)
        if place is None:
            yield Judged(law.physics, "neither", f"this robot has no driven joint {law.joint}")
            continue
        word, why = _judged(final, law, place, findings)
        yield Judged(law.physics, word, "; ".join((why, *law.left_range(final.at))))


def _judged(final: FinalState, law: JointFormula, place: Place, findings: Sequence[Finding]) -> tuple[str, str]:
    if final.motion.standing or not law.acts(place, final.at):
        return "neither", "what it follows does not move in this recording"
    values = law.starts(place, final.mechanism)[0]
    whole = law.at_values(values)
    added = final.efforts.at_kept(whole.efforts_per(place, {}, final.at)[..., 0])
    size = np.sqrt(np.mean(added**2, axis=0))
    if not shows(size, final.noise_sizes):
        return "neither", "in this motion it would be less than the noise of a sample"
    own = [term for term in final.model.terms if term.law is law]
    curves = [term for term in final.model.terms if term.law.is_curve and term.place.name == law.joint]
    base = beside(final.model.without(*own, *curves), law.joint)
    model = with_columns(final.efforts, base, place, [(whole, {})])
    model = model.with_term(model.problem.candidates[-1])
    saved, sure = relative_gain(held_out(base), held_out(model))
    if not (sure > SURE and saved > 0):
        return "refuted", "without it no more is left of the efforts"
    state = final.with_model(model)
    where = state.model.slice_of(state.model.terms[-1])
    _, covariance, degrees = state.covariances
    share, deviation = float(state.x[where][0]), float(np.sqrt(covariance[where, where][0, 0]))
    reach = np.hypot(SURE * deviation, SURE / WITHIN_95 * _known(law, values))
    interval = student_95(degrees) * deviation
    told = f"of it {number(100 * share, 3)} ± {number(100 * interval, 2)} % is there (95 %)"
    if abs(share - 1) > max(LITTLE, reach):
        return "refuted", told
    events = {interval.finding().statement for interval in final.outliers}  # of this recording alone
    left = [item for item in findings if item.physics == "unknown" and item.location == law.joint]
    left = [item for item in left if item.statement not in events]
    if left:
        return "refuted", f"{told}, but beside it more is left: {left[0].statement}"
    return "confirmed", told


def _known(law: JointFormula, values: Mapping[str, float]) -> float:
    """Return by which share its largest coefficient is known, as half of the 95 % interval."""
    first = max(law.linear, key=lambda name: abs(values[name]))
    low, high = law.found.get(first, (values[first], values[first]))
    return 0.5 * abs(high - low) / max(abs(values[first]), np.finfo(float).tiny)
