"""What the efforts of a robot in motion say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...laws import Effect
from ...laws.efforts import EffortLaw
from ...spatial import Array
from ..diagnosis import Detectable, Finding, Seen, named_in
from ..proposal import Judged, Proposal


@dataclass(frozen=True, eq=False)
class EffortCurve:
    """A joint's effort less the prediction of all but one finding, against the variable that drives this.

    Means x (m,) and y (m,), the standard error of y (m,); law (m,): the finding's own effort there, or None.
    """

    joint: str
    against: str
    x: Array
    y: Array
    deviation: Array
    law: Array | None
    x_unit: str
    y_unit: str
    physics: str = ""  # of the finding; of what no law gives ''


@dataclass(frozen=True, eq=False, repr=False)
class EffortDiagnosis:
    """The diagnosis of the efforts of a recording.

    joints (k) with `units`, AS_LOGGED of drives that report in units of their own, and which of them are `sliding`;
    time (n,), measured, rigid and predicted (n, k) efforts below `band` [Hz] by joint, with speed, position (n, k) and
    the samples that count, `good` (n, k). `shares`: residual of each joint's effort, as a share of it: 'rigid', 'fit'
    and 'heldout'; under 'all' of all joints. `noise` (k,) of a recorded sample in these units, NaN where it is unknown,
    and `how` (k) it is known: 'declared', or 'innovations', 'rest', 'repeats', 'quantisation' of the column itself;
    before, after: the residual in multiples of it, each {'fit', 'heldout'}.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    measured: Array
    rigid: Array
    predicted: Array
    speed: Array
    position: Array
    good: np.ndarray
    band: Mapping[str, float]
    noise: Array
    how: tuple[str, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]
    by_joint: Mapping[str, Mapping[str, float]]
    shares: Mapping[str, Mapping[str, float]]
    findings: tuple[Finding, ...]
    effects: tuple[Effect, ...]
    curves: tuple[EffortCurve, ...]
    verdict: str
    not_detectable: tuple[Detectable, ...]
    advice: str
    remarks: tuple[str, ...]
    rows: np.ndarray
    standing: bool = False
    separate: bool = False
    sliding: tuple[str, ...] = ()
    premises: tuple[str, ...] = ()
    proposals: tuple[Proposal, ...] = ()  # formulas for what is unknown, where they were asked for
    seen: tuple[Seen, ...] = ()  # what would have been seen, where nothing was found
    judged: tuple[Judged, ...] = ()  # what this recording says of formulas that were proposed from another one

    @property
    def declared(self) -> bool:
        """Whether the noise was declared."""
        return "declared" in self.how

    def __repr__(self) -> str:
        found = f"{len(self.joints)} joints, {len(self.time)} samples: {named_in(self.findings)}"
        return f"<EffortDiagnosis {self.verdict} of {found}>"


def effort_curve_of(finding: Finding, efforts: EffortDiagnosis | None) -> EffortCurve | None:
    """Return the curve of a finding at its joint; None where it has none."""
    if efforts is None or (finding.effect is not None and not isinstance(finding.effect.law, EffortLaw)):
        return None
    physics = "" if finding.physics == "unknown" else finding.physics
    here = (curve for curve in efforts.curves if (curve.joint, curve.physics) == (finding.location, physics))
    return next(here, None)
