"""The verdict: what a recording says that the simulation left out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..channels import Columns, Noise
from ..errors import imported
from ..laws import LAWS, Effect, Law
from ..laws.efforts import EFFORT_LAWS
from ..recordings import Convention, Together
from ..simulation import Run
from ..spatial import Array
from .calibrate import CalibratedParameter
from .criteria import NEARLY
from .locate import Agreement, LocalCurve, Recovered, Residuals

if TYPE_CHECKING:
    from pandas import DataFrame

    from .efforts import EffortDiagnosis
    from .posterior import JointPosterior
    from .proposal import Judged, Proposal
    from .since import Since


#: What to do about what is no law.
_REMEDIES = {
    "finite_deflection": "predict with robot.equilibrium, as the corrected model does, and not with C times the load",
    "log_convention": "say how the log is written, in its JSON file or by --convention, or write it otherwise",
    "unknown": "look at {place} itself, record more there, and trust the corrected model only near what was recorded",
}

#: What is no fault of a robot and has no law: large deflections are a matter of how one simulates.
_NO_FAULT = ("finite_deflection",)

VERDICTS = ("nothing_missing", "explained", "unexplained")


@dataclass(frozen=True)
class FittedParameter:
    """A fitted value with its unit and 95 % confidence interval.

    drawn: what the robot file has, where it has one; before: what an earlier test found; seen: of a way, the least that
    the recorded positions show; least: the least that its law has; untold: any value that there may be would do as
    well.
    """

    value: float
    unit: str
    interval: tuple[float, float]
    drawn: float | None = None
    before: float | None = None
    seen: float = 0.0
    untold: bool = False
    least: float = 0.0

    @classmethod
    def about(cls, value: float, unit: str, reach: float, drawn: float | None = None) -> FittedParameter:
        """Return a value whose interval reaches so far on both sides."""
        return cls(value, unit, (value - reach, value + reach), drawn)


@dataclass(frozen=True)
class Finding:
    """One thing that the simulation left out.

    `candidates` are the places that these data cannot tell apart, `alternatives` other laws that fit as well;
    `heldout_gain`: by which share the held-out squared residual falls as this finding comes to all the others; `effect`
    is None for `finite_deflection` and for what no law explains; then `curve` is what was recovered, or None where it
    has no place.
    `conventions`: of `log_convention`, how a log is written, and `evidence`: of what the drawing leaves how much as
    written, and as read. `recovered` is what the samples ask for, to be drawn; `law`: what is told of several places
    without one effect; `advice`: what to do about it, where its physics does not say. `approached`: of what is unknown,
    the joint from whose side of approach it follows. `untold`: whether too little was recorded to say anything.
    `times`: of efforts, how many times as large their held-out residual (RMS) would be without it, in their own unit.
    `strained`: of efforts, by how many of its tolerances a value of the robot file would be off without it, where that
    is beyond them, else 0. `one_body`: of the candidates those that are one rigid body with the place, its link first.
    `when`: of what is unknown in one interval of time, 'between t = 3 s and 4 s'; that was left out of everything else.
    """

    physics: str
    location: str
    candidates: tuple[str, ...]
    parameters: Mapping[str, FittedParameter]
    heldout_gain: float
    statement: str
    effect: Effect | None = None
    alternatives: tuple[str, ...] = ()
    curve: LocalCurve | None = field(default=None, repr=False)
    recovered: Recovered | Agreement | None = field(default=None, repr=False)
    conventions: tuple[Convention, ...] = ()
    evidence: Mapping[str, str | float] = field(default_factory=dict)
    law: Law | None = field(default=None, repr=False)
    advice: str = ""
    approached: str = ""
    untold: bool = False
    times: float = float("nan")
    strained: float = 0.0
    one_body: tuple[str, ...] = ()
    when: str = ""

    @property
    def cost(self) -> float:
        """How many times as large the held-out residual (RMS) would be without this finding; infinite without end."""
        if np.isfinite(self.times):
            return self.times
        return float(1 / np.sqrt(1 - self.heldout_gain)) if self.heldout_gain < 1 else float("inf")

    @property
    def remedy(self) -> str:
        """What to do about it, in one short sentence; of what has no effect of its own by its physics."""
        if self.advice:
            return self.advice
        if self.effect is not None and self.physics not in _REMEDIES:
            return self.effect.law.advice(self.effect.place, self.effect.values)
        every = (*LAWS, *EFFORT_LAWS)
        known = {law.physics: law.remedy for law in reversed(every)}
        known |= {law.physics: law.remedy for law in reversed(every) if not law.variant} | _REMEDIES
        said = known.get(self.physics, "") if self.law is None else self.law.remedy
        here = "the robot" if self.location == "robot" else self.location
        return said.format(place="each of these places" if self.at_each else here)

    @property
    def is_fault(self) -> bool:
        """False for what every robot has and a simulation may lack: its weight, equilibrium deformed by its loads."""
        law = self.law if self.effect is None else self.effect.law
        return self.physics not in _NO_FAULT and (law is None or not law.weighs)

    @property
    def rivals(self) -> tuple[str, ...]:
        """The other candidates, without what is one rigid body with the place and places that each have it."""
        return tuple(p for p in self.candidates if p not in (self.location, *self.at_each, *self.one_body))

    @property
    def at_each(self) -> tuple[str, ...]:
        """The places of what is told of several at once, each of which has it; else nothing."""
        if self.location != "robot" or (self.effect is not None and not self.effect.law.for_each):
            return ()
        return tuple(place for place in self.candidates if place != "robot")


#: Why an effect is not seen that shows at no size that its law can have.
NOT_AT_ANY_SIZE = "not visible at any size"


@dataclass(frozen=True)
class Detectable:
    """An effect that these data could not have shown, with the smallest size that they could.

    None where they show no size that the law can have. `below`: the smaller its parameter, the larger the effect.
    `strong`: the value of a strong one, which stays hidden; NaN where the law lacks something else.
    """

    physics: str
    location: str
    parameter: str
    smallest: float | None
    unit: str
    reason: str
    below: bool = False
    strong: float = float("nan")


class Seen(NamedTuple):
    """The smallest value of a law's first parameter that would have been seen.

    At `neutral` the law changes nothing, at `strong` as much as a strong one does.
    """

    physics: str
    location: str
    parameter: str
    unit: str
    smallest: float
    neutral: float
    strong: float


def heldout_gain(after: float, before: float) -> float:
    """Return by which share held-out squares fall from `before` to `after`, between 0 and 1."""
    return float(np.clip(1 - after / max(before, 1e-300), 0.0, 1.0))


def named_in(findings: Iterable[Finding]) -> str:
    """Return 'backlash at leg2/ball_nut, self_weight at robot', or 'nothing'."""
    return ", ".join(f"{finding.physics} at {finding.location}" for finding in findings) or "nothing"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What `diagnose` returns.

    Residuals are RMS values of the whitened residual: `before` and `after`, each {'fit', 'heldout'}; `by_channel` the
    same for position and rotation, with µm and µrad; NaN where nothing could be compared. `residual_before` and
    `residual_after` are the measured poses (n, 6) of `samples` less the simulated ones. `unused_columns`: what the
    recording holds and the diagnosis has no use for. Where tolerances were declared, `within` holds the residual of the
    drawing ('nominal') and of the drawing within its tolerances ('calibrated'), and `calibration` what was learned of
    each parameter, the best known first. `conventions`: of each recording, how it is written where it says otherwise,
    and was read so; () where all are as they say. `recordings`: what each has part in it, and which samples are whose.
    """

    verdict: str
    noise: Noise
    before: Mapping[str, float]
    after: Mapping[str, float]
    within: Mapping[str, float]
    calibration: tuple[CalibratedParameter, ...]
    by_channel: Mapping[str, Mapping[str, float]]
    findings: tuple[Finding, ...]
    not_detectable: tuple[Detectable, ...]
    next_experiment: Mapping[str, Any]
    remarks: tuple[str, ...]
    unused_columns: tuple[str, ...]
    effects: tuple[Effect, ...]
    samples: np.ndarray
    columns: tuple[Columns, ...]
    residual_before: Array
    residual_after: Array
    recordings: tuple[ByRecording, ...] = ()
    residuals: Residuals | None = None  # in multiples of the noise; None where nothing was compared
    final: Run | None = None
    conventions: tuple[tuple[Convention, ...], ...] = ()
    efforts: EffortDiagnosis | None = None  # of drives in motion, where there were any
    posterior: JointPosterior | None = None  # of all values of the effects; None where nothing was compared
    seen: tuple[Seen, ...] = ()  # what would have been seen, where nothing was found
    since: Since | None = None  # what has changed since an earlier test, where that was asked
    own_by_run: tuple[str, ...] = ()  # sensors that were set up anew for each run, declared or found
    premises: tuple[str, ...] = ()  # what was taken for granted where nothing was recorded, and everything rests on it
    proposals: tuple[Proposal, ...] = ()  # formulas for what is unknown, where they were asked for
    judged: tuple[Judged, ...] = ()  # what this recording says of formulas that were proposed from another one
    stand_ins: tuple[Effect, ...] = ()  # those of `effects` that no finding names: they may imitate what is unknown

    @property
    def explained(self) -> bool:
        """True where what is left is noise."""
        return self.verdict != "unexplained"

    @property
    def told(self) -> tuple[Finding, ...]:
        """The findings as people are told them.

        First how the log is read, for all else depends on it; then faults, those first without which most would be
        left, and what is unknown; then what is no fault, the robot's weight; at the end what would leave little more.
        """

        def place(item: Finding) -> tuple[bool, bool, bool, bool, float]:
            unknown = item.physics == "unknown"
            little = not unknown and not item.conventions and item.cost < NEARLY
            return not item.conventions, little, not item.is_fault, unknown, 0.0 if unknown else -item.heldout_gain

        return tuple(sorted(self.findings, key=place))

    def to_dict(self) -> dict[str, Any]:
        """Return what `prup-pin diagnose` writes as diagnosis.json; docs/diagnosis.md explains its keys."""
        from ..views.report.as_json import diagnosis_as_json

        return diagnosis_as_json(self, None if self.final is None else self.final.geometry.robot)

    def to_dataframe(self) -> DataFrame:
        """Return a pandas table with a row for each fitted parameter of each finding (extra: tables).

        Columns: finding (counted from 1), physics, location, parameter, value, unit, low, high (95 % interval),
        heldout_gain. A finding without parameters has one row without them. Raises MissingExtraError.
        """
        rows: list[dict[str, Any]] = []
        for number, finding in enumerate(self.findings, 1):
            same = {"finding": number, "physics": finding.physics, "location": finding.location}
            for name, fitted in finding.parameters.items() or [(None, None)]:
                row = {**same, "parameter": name, "heldout_gain": finding.heldout_gain}
                if fitted is not None:
                    low, high = sorted(fitted.interval)
                    row |= {"value": fitted.value, "unit": fitted.unit, "low": low, "high": high}
                rows.append(row)
        columns = ["finding", "physics", "location", "parameter", "value", "unit", "low", "high", "heldout_gain"]
        return imported("pandas", "tables").DataFrame(rows, columns=columns)

    def __repr__(self) -> str:
        found = named_in(self.findings)
        before, after = self.before["heldout"], self.after["heldout"]
        return f"<Diagnosis {self.verdict}: {found}; residual {before:.3g} -> {after:.3g} times the noise>"

    def __str__(self) -> str:
        from ..views.text.diagnosis_words import diagnosis_text

        return diagnosis_text(self)

    def _repr_html_(self) -> str:
        from ..views.report.cells import diagnosis_html

        return diagnosis_html(self)


@dataclass(frozen=True, eq=False)
class ByRecording:
    """One recording's part in a diagnosis.

    `name` for people; `own` sensors that it does not share; `samples` it holds, of which the rows `rows` (m,), from 0,
    were used: these are the samples `used` (m,) among all of the diagnosis. before, after: their residual in multiples
    of the noise; NaN where nothing was compared.
    """

    name: str
    own: tuple[str, ...]
    noise: Noise
    samples: int
    rows: np.ndarray
    used: np.ndarray
    before: float
    after: float


def by_recording(
    together: Together, noise: Noise, samples: np.ndarray, residuals: tuple[Array, Array, np.ndarray] | None
) -> tuple[ByRecording, ...]:
    """Return each recording's part.

    samples (n,): those that were simulated. residuals: before and after (n, K), whitened, and which of them exist.
    """
    found = []
    for place, source in enumerate(together.sources):
        used = np.flatnonzero(together.which[samples] == place)
        before = after = float("nan")
        if residuals is not None and (count := int(residuals[2][used].sum())):
            before, after = (float(np.sqrt((values[used] ** 2).sum() / count)) for values in residuals[:2])
        own = noise.each[place] if noise.each else noise
        rows = together.rows[samples[used]]
        found.append(ByRecording(source.name, source.own, own, len(source.recording), rows, used, before, after))
    return tuple(found)
