"""What the efforts of a robot in motion say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...laws import Effect
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...spatial import Array
from ..diagnosis import Detectable, Finding, named_in

__all__ = ["EffortCurve", "EffortDiagnosis", "effort_curve_of"]


@dataclass(frozen=True, eq=False)
class EffortCurve:
    """What a joint's effort asks for beyond all that is known but a finding, against what drives it.

    x (m,) and y (m,) with its standard error (m,); law (m,): what the finding gives there, or None.
    """

    joint: str
    against: str
    x: Array
    y: Array
    deviation: Array
    law: Array | None
    x_unit: str
    y_unit: str


@dataclass(frozen=True, eq=False, repr=False)
class EffortDiagnosis:
    """What the efforts say.

    joints (k) with `units`, AS_LOGGED of drives that report in units of their own, and which of them are `sliding`;
    time (n,), measured, rigid and predicted (n, k) efforts below `band` [Hz] by joint, with speed, position (n, k) and
    which of them count (n, k). `shares`: what is left of each joint's effort, as a share of it: 'rigid', 'fit' and
    'heldout'; under 'all' of all joints. `noise` (k,) of a recorded sample in these units, NaN where nothing tells it,
    and `how` (k) it was told: 'declared', or 'innovations', 'rest', 'repeats', 'quantisation' of the column itself;
    before, after: of the residual in multiples of it, each {'fit', 'heldout'}. curves: by the place of a finding.
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
    sliding: tuple[str, ...] = ()

    @property
    def declared(self) -> bool:
        """Whether the noise was declared."""
        return "declared" in self.how

    def __repr__(self) -> str:
        found = f"{len(self.joints)} joints, {len(self.time)} samples: {named_in(self.findings)}"
        return f"<EffortDiagnosis {self.verdict} of {found}>"


def effort_curve_of(finding: Finding, efforts: EffortDiagnosis | None) -> EffortCurve | None:
    """Return what the efforts ask for at a finding's joint, against what drives it; None where nothing was drawn."""
    if efforts is None or (finding.effect is not None and not isinstance(finding.effect.law, EffortLaw)):
        return None
    against = {law.against for law in EFFORT_LAWS if law.physics == finding.physics and law.against}
    unknown = finding.physics == "unknown"
    if not against and not unknown:
        return None
    # beside what no law gives, a joint may have a law of its own, whose curve is another finding's
    here = [curve for curve in efforts.curves if curve.joint == finding.location and (curve.law is None) == unknown]
    return next((curve for curve in here if not against or curve.against in against), None)
