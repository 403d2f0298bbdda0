"""A diagnosis in words: what the terminal and the report both say."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...dynamics.smoothing import pieces
from ...laws.efforts import EFFORT
from ...numbers import counted, number, quantity, readable_unit, uncertain
from ...recordings import SENSORS, Convention, Recording
from ...recordings.columns import AS_LOGGED
from .terminal import capital

if TYPE_CHECKING:
    from ...diagnosis import Diagnosis, Finding
    from ...diagnosis.calibrate import CalibratedParameter
    from ...diagnosis.diagnosis import Detectable, FittedParameter, Seen
    from ...diagnosis.locate import LocalCurve
    from ...diagnosis.proposal import Proposal
    from ...diagnosis.since import Changed, Since

#: No gap, offset or friction of a robot is so large, in any SI unit: a test that needs it never shows one.
_ABSURD = 1e9
#: So many times as large is no bound any more.
_MUCH_MORE = 100
#: Findings that a sentence lists one by one.
_IN_A_SENTENCE = 6
#: Laws that fit as well, and parameters of a finding, that are told one by one.
_MOST_RIVALS = 4
MOST_PARAMETERS = 6
#: Parameters of a kind, and all, that are told by how far they were corrected within their tolerances.
_MOST_OF_KIND, _MOST_CORRECTED = 2, 6
#: Multiples of the noise up to which what is left is little more than that.
_LITTLE_MORE = 1.5
_COUNTED = ("No", "One", "Two", "Three", "Four", "Five", "Six")
#: How the noise of an effort was told, in words.
_WAYS = {
    "innovations": "what their past does not foretell",
    "rest": "their scatter at rest",
    "quantisation": "their steps",
    "repeats": "rows that repeat",
}
#: Where the noise of poses comes from, in words.
_SOURCES = {
    "residual": "not declared: the residual with everything free to vary",
    "assumed": "not declared: assumed, as nothing shows it; declare position_noise and rotation_noise",
}
_NO_MOTION = ", and does not depend on the motion to an extent that matters"
_NO_FAULT = "The robot's deflection under load changes how it carries the load; that is no fault."
_UNDETERMINED = "not determined by this recording"
#: Share of the squared residual that is nothing; how many times as much is beyond counting.
_NO_GAIN, _BEYOND_COUNTING = 5e-4, 1000


def verdict_text(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    before, after = diagnosis.before["heldout"], diagnosis.after["heldout"]
    efforts, explained = diagnosis.efforts, diagnosis.verdict == "explained"
    alone = None if diagnosis.columns else efforts  # efforts, where nothing else was compared
    unknown = next((finding for finding in diagnosis.findings if finding.physics == "unknown"), None)
    if diagnosis.since is not None and not math.isnan(before):
        return verdict_since(diagnosis, diagnosis.since)
    if math.isnan(before) and alone is None and unknown is not None:
        return f"{capital(unknown.statement)}."
    shares = [] if efforts is None else [_percent(efforts.shares["all"][key]) for key in ("rigid", "heldout")]
    drawn, left = [f"{share} of the efforts" for share in shares] or ("", "")
    if diagnosis.verdict == "nothing_missing":
        return _nothing_missing(diagnosis, left)
    if alone is not None and not alone.declared and math.isfinite(after):
        takes, drawn, left = _of_efforts(alone.shares["all"], after, explained), "", ""
    else:
        takes = (_not_declared(diagnosis) if explained else "") or _takes(before, after)
    read = [convention for item in diagnosis.findings for convention in item.conventions]
    if read:
        takes = f"{takes} (the log read {_read_so(read)})"
    named = [item for item in diagnosis.told if item.physics != "unknown" and not item.conventions]
    told = _joined([*_all_told(named), *_unnamed(diagnosis)])
    if explained:
        if named and not read and not any(item.is_fault for item in named):
            own = _joined([item.effect.law.summary if item.effect else finding_text(item) for item in named])
            return f"Nothing is missing but {own}: with {'it' if len(named) == 1 else 'them'} {takes}."
        return f"Explained: {f'with {told} ' if named else ''}{takes}{left and f', which leaves {left}'}."
    if unknown is not None and unknown.untold:
        return f"{capital(unknown.statement)}{drawn and f'; the robot file leaves {drawn}'}."
    known = f"the residual is {number(before, 3)} times the noise"
    begins = "no noise is known to compare with" if math.isnan(before) else known
    if intervals := _intervals(diagnosis):  # which nothing else that is told has in it
        stands = f"with {told} {takes}{left and f', {left}'}" if told else f"{begins}{drawn and f', {drawn}'}"
        return (
            f"Unexplained: {stands}, but no law of the library describes what happened {intervals}, which was left out."
        )
    if told:
        stands = f"with {told} {takes}, but no law of the library explains the rest{left and f', {left}'}"
    else:
        stands = f"{begins}{drawn and f', {drawn}'}, and no law of the library explains it"
        if alone is not None and left != drawn:  # by a curve of no law, or what is within its tolerance
            stands += f"; the corrected model leaves {left}"
            stands += f", {number(after, 3)} times the noise" if math.isfinite(after) else ""
    return f"Unexplained: {stands}{_largest_in(unknown)}.{_most_of_it(diagnosis, before, after)}"


def _most_of_it(diagnosis: Diagnosis, before: float, after: float) -> str:
    """Return the laws of the corrected model that are no findings, where they take most of the square with them."""
    named = [
        f"{effect.law.physics.replace('_', ' ')} at {effect.place}"
        for effect in diagnosis.stand_ins
        if not effect.law.of_efforts
    ]
    if not 0 < len(named) <= _IN_A_SENTENCE or not after**2 < before**2 / 2:
        return ""
    return f" What explains most of it, though not all, and may only imitate it: {_joined(named)}."


def _intervals(diagnosis: Diagnosis) -> str:
    """Return 'between t = 3 s and 4 s' of the intervals that no law describes where nothing else is unknown."""
    unknown = [finding for finding in diagnosis.findings if finding.physics == "unknown"]
    return _joined([finding.when for finding in unknown]) if all(finding.when for finding in unknown) else ""


def _largest_in(unknown: Finding | None) -> str:
    """Return '; it is largest in leg2' of what no law explains; nothing where it is everywhere."""
    return "" if unknown is None or unknown.location == "robot" else f"; it is largest in {unknown.location}"


def _read_so(conventions: Sequence[Convention]) -> str:
    """Return how a log is read: with these conventions, or of many how many columns each word is said of."""
    if len(conventions) <= _IN_A_SENTENCE:
        return f"with {', '.join(map(str, conventions))}"
    words = Counter(convention.word for convention in conventions)
    told = [f"'{word}' for {counted(many, 'column')}" for word, many in words.items()]
    return f"with {_joined(told)}"


def _nothing_missing(diagnosis: Diagnosis, left: str) -> str:
    after, efforts = diagnosis.after["heldout"], diagnosis.efforts
    if efforts is not None and not efforts.declared and not diagnosis.columns:
        loud = "" if math.isnan(after) else f", {number(after, 3)} times the scatter of a single sample"
        return f"Nothing is missing: the residual is {left}{loud}{_NO_MOTION}."
    besides = f"; the residual is {left}" if left else ""
    if diagnosis.findings:  # what is no fault: equilibrium in the deformed position
        besides += ". The loads move the robot so far that equilibrium must be taken in its deformed position"
    return f"Nothing is missing: simulation and recording differ by noise only ({number(after, 3)} times it){besides}."


def _takes(before: float, after: float) -> str:
    """Return from where to where the residual falls."""
    if math.isnan(before):
        return "the residual falls"
    if number(before, 3) == number(after, 3):
        return f"the residual is {number(after, 3)} times the noise"
    way = "falls" if after < before else "rises"
    return f"the residual {way} from {number(before, 3)} to {number(after, 3)} times the noise"


def _not_declared(diagnosis: Diagnosis) -> str:
    """Return from where to where what is left falls in millimetres where its end is all that is known of the noise."""
    channels = [diagnosis.by_channel.get(name, {}) for name, unit, _ in diagnosis.columns if unit == "m"]
    sizes = [
        (each["before_um"], each["after_um"]) for each in channels if math.isfinite(each.get("before_um", math.nan))
    ]
    if diagnosis.noise.source != "residual" or diagnosis.efforts is not None or not sizes:
        return ""
    before, after = 1e-6 * np.sqrt(np.mean(np.square(sizes), axis=0))
    after *= diagnosis.after["heldout"] / diagnosis.after["fit"]
    first, last, taken = (quantity(size, "m") for size in (before, after, diagnosis.noise.position))
    return (
        f"the residual of the positions falls from {first} to {last} (root mean square, held out); no noise was "
        f"declared, and {taken}, the residual with everything free to vary, was taken for it"
    )


def _of_efforts(shares: Mapping[str, float], after: float, ends_there: bool) -> str:
    """Return what is left of efforts whose noise nobody declared: as a share, for that noise proves little."""
    rigid, left = (_percent(shares[key]) for key in ("rigid", "heldout"))
    falls = f"the residual of the efforts falls from {rigid} to {left}"
    stands = f"the residual is {left} of the efforts" if rigid == left else falls
    return f"{stands}, {number(after, 3)} times the scatter of a single sample{_NO_MOTION if ends_there else ''}"


def _percent(share: float) -> str:
    return f"{number(100 * share, 3)} %"


def _all_told(named: Sequence[Finding]) -> list[str]:
    """Return findings for a sentence: each for itself, or where there are many of them, each physics once."""
    if len(named) <= _IN_A_SENTENCE:
        return [_or_else(finding_text(finding), finding) for finding in named]
    kinds: dict[str, list[Finding]] = {}
    for finding in named:
        kinds.setdefault(finding.physics, []).append(finding)
    return [f"{finding_text(first)}{f' and {len(others)} more' if others else ''}" for first, *others in kinds.values()]


def _unnamed(diagnosis: Diagnosis) -> list[str]:
    """Return how many laws take something away that no finding names, in words; none where there are none."""
    count = len(diagnosis.stand_ins)
    return [f"{counted(count, 'law')} that {'are no findings' if count > 1 else 'is no finding'}"] if count else []


def _or_else(text: str, finding: Finding) -> str:
    """Return what is told of a finding with the law that fits as well, or how many do."""
    laws = _alternative_laws(finding)
    if len(laws) == 1:
        return f"either {text} or {laws[0]}"
    return f"{text} ({len(laws)} other laws fit as well)" if laws else text


def _alternative_laws(finding: Finding) -> list[str]:
    """Return the laws that fit as well as a finding, in words: 'creep at leg2/motor'."""
    laws = [name.partition(" at ") for name in finding.alternatives]
    # a way of writing the log stands there as it is declared
    return [(law.replace("_", " ") if at else law) + at + place for law, at, place in laws]


def _joined(items: Sequence[str]) -> str:
    """Return items as they stand in a sentence, with semicolons between those that hold alternatives or commas."""
    if len(items) < 2:
        return "".join(items)
    comma, last = ("; ", ";") if any("," in item or item.startswith("either ") for item in items) else (", ", "")
    return f"{comma.join(items[:-1])}{last} and {items[-1]}"


def finding_text(finding: Finding) -> str:
    """Return 'backlash at leg2/ball_nut'."""
    if finding.physics == "finite_deflection":
        return "equilibrium in the deformed position"
    shown = "" if finding.effect is None else finding.effect.place.aspect.removeprefix(EFFORT).strip()
    aspect = f" ({shown})" if shown else ""
    words = finding.physics.replace("_", " ")
    if finding.location == "robot":
        return f"{words}{aspect}"
    return f"{words} at {finding.location}{aspect}"


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """Return the verdict, and a paragraph for each finding."""
    lines = [*diagnosis.premises, verdict_text(diagnosis)]
    for index, finding in enumerate(diagnosis.told, 1):
        lines += ["", f"{index}  {finding_text(finding)}"]
        lines += [f"   {text}" for text in finding_lines(diagnosis, finding, len(finding.parameters))]
        if finding.curve is not None:
            lines.append("   its load [N, N m]: deformation [µm, µrad]")
            lines += [f"{load:>12}: {deformation}" for load, deformation in curve_rows(finding.curve)]
    return "\n".join(lines)


def finding_groups(diagnosis: Diagnosis) -> dict[str, list[tuple[int, Finding]]]:
    """Return the findings with their numbers below what each group is: the log, what was left out, what is no fault.

    A robot's weight that acts is nothing that the robot lacks. Against an earlier test all are what has changed.
    """
    left_out = "Left out" if diagnosis.since is None else "Changed"
    groups: dict[str, list[tuple[int, Finding]]] = {}
    for index, finding in enumerate(diagnosis.told, 1):
        heading = left_out
        if finding.physics == "log_convention":
            heading = "How the log is written"
        elif not finding.is_fault and diagnosis.since is None:
            heading = "How to simulate it"
        groups.setdefault(heading, []).append((index, finding))
    return groups


def finding_lines(diagnosis: Diagnosis, finding: Finding, most: int = MOST_PARAMETERS) -> list[str]:
    """Return what is told of a finding below its name; of more than `most` values, that there are more."""
    places = by_place(finding)
    values = [] if places else _in_lines(parameter_texts(finding.parameters))
    if len(values) > most + 1:
        values[most:] = [f"and {len(values) - most} more, in diagnosis.json"]
    lines = [
        "" if stands_in_verdict(diagnosis, finding) else finding.statement,
        *_place_lines(places, most),
        *values,
        *alternative_text(finding),
        cost_text(finding, () if diagnosis.efforts is None else diagnosis.efforts.joints),
        finding.remedy and f"to do: {finding.remedy}",
    ]
    return [line for line in lines if line]


def _place_lines(places: Mapping[str, Sequence[tuple[str, str, str]]], most: int) -> list[str]:
    """Return a line for each place: its values, with intervals where there are no more than `most` values at all."""
    if sum(map(len, places.values())) <= most:
        return [f"{place}: {', '.join(_in_lines(texts))}" for place, texts in places.items()]
    lines = []
    for place, texts in list(places.items())[:most]:
        told = [f"{name} {value}" for name, value, _ in texts if value != _UNDETERMINED]
        lines.append(f"{place}: {', '.join(told) or _UNDETERMINED}")
    more = f"{counted(len(places) - most, 'more place')} and " if len(places) > most else ""
    return [*lines, f"({more}the 95 % intervals are in diagnosis.json)"]


def corrections(calibrated: Sequence[CalibratedParameter]) -> list[str]:
    """Return which parameters were corrected most within their tolerances, as far as data tell: a few of each kind.

    'leg1/base.radius +210 µm, 2.1 times its tolerance'; the farthest off first.
    """
    kinds: Counter[str] = Counter()
    texts = []
    for item in sorted(calibrated, key=lambda item: -abs(item.x)):
        if abs(item.x) <= 2 * item.share or kinds[item.deviation.kind] == _MOST_OF_KIND:
            continue
        kinds[item.deviation.kind] += 1
        off = item.value - item.nominal
        unit, factor = readable_unit(abs(off), item.deviation.unit)
        moved = f"{number(factor * off, 3, signed=True)} {unit}".strip()
        if item.deviation.relative:
            moved = f"{number(100 * off / item.nominal, 3, signed=True)} %"
        texts.append(f"{item.name} {moved}, {number(abs(item.x), 2)} times its tolerance")
    return texts[:_MOST_CORRECTED]


def _in_lines(texts: Iterable[tuple[str, str, str]]) -> list[str]:
    """Return 'half gap 30.2 µm (95 %: 29.9 to 30.6 µm)' of each of `parameter_texts`."""
    return [f"{name} {value} (95 %: {interval})" for name, value, interval in texts]


def stands_in_verdict(diagnosis: Diagnosis, finding: Finding) -> bool:
    """Return whether the verdict says what a finding does, in the same words."""
    return verdict_text(diagnosis).casefold().startswith(finding.statement.casefold())


def curve_rows(curve: LocalCurve) -> list[tuple[str, str]]:
    """Return rows of a curve that was recovered: load [N, N m], deformation with its uncertainty [µm, µrad]."""
    points = zip(curve.load, 1e6 * curve.deformation, 1e6 * curve.deviation, strict=True)
    return [(number(load, 3), uncertain(moved, deviation)) for load, moved, deviation in points]


def summary_text(diagnosis: Diagnosis) -> str:
    """Return what was measured, what accounts for it and what is left, for who looks after the machine."""
    first, last = _beside(diagnosis)
    if not first:
        return ""
    logs = [finding for finding in diagnosis.findings if finding.conventions]
    every = [item for item in diagnosis.told if item.physics != "unknown" and not item.conventions]
    # large deflections are no fault
    named = [finding for finding in every if finding.physics != "finite_deflection"]
    faults = any(finding.is_fault for finding in named)
    # of many causes only the names are told
    few = len(named) <= 3
    causes = [_or_else(finding.statement, finding) for finding in named] if few else _all_told(named)
    them = "it" if len(causes) == 1 else "them"
    read = [convention for finding in logs for convention in finding.conventions]
    said = [f"{capital(finding.statement)}." for finding in logs]
    if len(read) > _IN_A_SENTENCE:  # which ones, the findings say
        said = [f"The log is read {_read_so(read)}."]
    texts = [*said, f"Read this way: {first}" if logs else first]
    if diagnosis.verdict == "nothing_missing":
        if every:
            texts.append(f"{_NO_FAULT} Simulated in that way, {last}.")
        from ...diagnosis.criteria import NEARLY

        only_noise = every or diagnosis.before.get("fit", math.nan) <= NEARLY
        allowed = "" if only_noise else " and what a drawing may be off by"
        return f"{' '.join(texts)} That is the sensors' own scatter{allowed}: nothing needs repair."
    if causes:
        count = _COUNTED[len(causes)] if len(causes) < len(_COUNTED) else str(len(causes))
        things = "thing accounts" if len(causes) == 1 else "things account"
        much = "it" if diagnosis.verdict == "explained" else "a part of it"
        texts.append(f"{count} {things} for {much}: {'; '.join(causes)}.")
        if len(named) < len(every):
            texts.append(_NO_FAULT)
    unknown = [finding for finding in diagnosis.findings if finding.physics == "unknown"]
    if diagnosis.verdict == "explained":
        times = diagnosis.after.get("heldout", math.nan)
        scatter = ", little more than the sensors' own scatter"
        if not times < _LITTLE_MORE:
            known = f"{number(times, 3)} times" if math.isfinite(times) else "an unknown multiple of"
            scatter = f"; what was left out of the fit lies {known} the sensors' own scatter off"
        texts.append(f"With {them} in the model {last}{scatter}.")
        if named and not logs and not faults:
            return f"{' '.join(texts)} Nothing needs repair: {named[0].remedy}."
    elif untold := [finding.statement for finding in diagnosis.findings if finding.untold]:
        texts.append(f"{capital(untold[0])}.")
    elif intervals := _intervals(diagnosis):
        them = _joined([them, *_unnamed(diagnosis)])
        model = f"With {them} in the model {last}. " if causes else ""
        texts.append(f"{model}No law describes what happened {intervals}, which was left out of all these numbers.")
    else:
        model = f"With {_joined([them, *_unnamed(diagnosis)])} in the model {last}"
        where = _joined([*dict.fromkeys(item.location for item in unknown if item.location != "robot")])
        texts.append(
            f"{model if causes else 'No law of the library explains it'}: something is missing"
            f"{where and f' at {where}'} that no law describes, and the corrected model is valid only near these data."
        )
    # how a log is written is one thing, and what the machine needs another; of that, what is repaired first
    doubted = [finding for finding in unknown if finding.advice or not faults]
    firsts = [next((item for item in items if item.remedy), None) for items in (logs, (*doubted, *named))]
    for word, to_do in zip(("To do first", "Then" if firsts[0] else "To do first"), firsts, strict=True):
        if to_do is not None:
            others = places_text(to_do.rivals)
            also = f", or look at {others}: these data cannot tell them from it" if others else ""
            named_first = "" if few or to_do not in named else f"{to_do.statement}: "
            texts.append(f"{word}: {named_first}{to_do.remedy}{also}.")
    return " ".join(texts)


def _beside(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return how far what was measured is beside the robot file, as a sentence, and what is left at the end."""
    for name, unit, _ in diagnosis.columns:
        values = diagnosis.by_channel.get(name, {})
        if math.isfinite(before := values.get(f"before_u{unit}", math.nan)):
            ends = [quantity(1e-6 * value, unit) for value in (before, values[f"after_u{unit}"])]
            what = "the tool" if name in ("position", "rotation") else name.removesuffix(f" {name.split()[-1]}")
            kind = "position" if unit == "m" else "orientation"
            of = "the simulation of the robot file" if diagnosis.since is None else "what the earlier model says"
            text = f"The measured {kind} of {what} differs by {ends[0]} (root mean square) from {of}."
            return text, f"{ends[1]} remain"
    if diagnosis.efforts is None:
        return "", ""
    ends = [_percent(diagnosis.efforts.shares["all"][key]) for key in ("rigid", "heldout")]
    return (
        f"In motion, the drives' efforts differ by {ends[0]} (root mean square) from those computed from the robot "
        "file.",
        f"{ends[1]} remain",
    )


def cost_text(finding: Finding, joints: Sequence[str] = ()) -> str:
    """Return what leaving a finding out would cost. joints: those whose efforts were measured."""
    if finding.physics == "unknown" or finding.evidence:
        return ""  # their statements say what they are worth, of what is a share or how many times
    if finding.heldout_gain < _NO_GAIN and finding.effect is not None:
        return "other errors could compensate for it" if finding.parameters else "is always present"
    of = "" if math.isnan(finding.times) else " of the efforts"
    if of and finding.effect is not None and finding.effect.place.name == finding.location in joints:
        of = f" of {finding.location}"  # what acts on several is told of all of these
    if finding.cost > _BEYOND_COUNTING:
        size = f"more than {_BEYOND_COUNTING} times as large"
    elif finding.cost < 1 + _NO_GAIN:
        size = "no larger in all"
    elif finding.cost < 2:
        size = f"{number(100 * (finding.cost - 1), 2)} % larger"
    else:
        size = f"{number(finding.cost, 3)} times as large"
    text = f"without it the residual{of if finding.is_fault else ' of a simulation'} would be {size}"
    if finding.strained:  # what makes up for it then
        text += f", and a value of the robot file {number(finding.strained, 2)} of its tolerances off"
    return text


def parameter_texts(parameters: Mapping[str, FittedParameter]) -> list[tuple[str, str, str]]:
    """Return (name, value with unit, 95 % interval) of fitted parameters."""
    largest: dict[tuple[str, str], float] = {}  # of a vector's components: they are told in one unit
    for name, fitted in parameters.items():
        key = _vector(name, fitted)
        largest[key] = max(largest.get(key, 0.0), abs(fitted.value))
    return [
        # a name with a dot is that of a part of the robot
        (name if "." in name else name.replace("_", " "), *_known(fitted, largest[_vector(name, fitted)]))
        for name, fitted in parameters.items()
    ]


def _known(fitted: FittedParameter, largest: float) -> tuple[str, str]:
    """Return what is known of a parameter (a number, a bound, nothing) and its interval, in the unit of `largest`."""
    low, high = sorted(fitted.interval)
    least, most = sorted((abs(low), abs(high)))
    size = abs(fitted.value)
    unit, factor = readable_unit(largest, fitted.unit)
    if size == 0 and factor * most > 0.99 * _ABSURD:
        return _UNDETERMINED, "any size"
    # it is about the least that its law has, and may be far larger
    is_least = 0 < low <= 1.001 * fitted.least and fitted.value < 10 * low
    if is_least and _MUCH_MORE * fitted.value < high < _ABSURD and not fitted.untold:
        bound = quantity(high, fitted.unit, 4)
        return f"below {bound}", f"0 to {bound}"
    # its interval holds values a hundred times as large and a hundredth as large; of zero 100 in any SI unit
    is_open = most >= 100.0 if size == 0 else most > _MUCH_MORE * size and least < size / _MUCH_MORE
    if fitted.untold or is_open:
        value = _UNDETERMINED
        if fitted.untold:
            unit, factor = readable_unit(high, fitted.unit)
    elif max(size, 0.5 * abs(high)) < fitted.seen:
        # it may be nothing: what is known is a bound, no finer than the encoder shows
        bound, seen = (quantity(each, fitted.unit) for each in (max(high, fitted.seen), fitted.seen))
        return f"below {bound}", f"0 to {bound}; the encoder shows no less than {seen}"
    elif 0 < low <= fitted.value and high > _MUCH_MORE * size:
        value = f"above {number(factor * low, 3)} {unit}"
    elif low == 0 < high:  # it may be nothing, and is no more than that
        unit, factor = readable_unit(high, fitted.unit)
        value = f"below {number(factor * high, 3)} {unit}".strip()
    else:
        digits = _digits(low, high)
        value, drawn, before = (
            "" if each is None else number(factor * each, digits)
            for each in (fitted.value, fitted.drawn, fitted.before)
        )
        instead = "" if drawn in ("", value) else f" instead of {drawn}"
        value = f"{f'{value} {unit}'.strip()}{instead}{before and f', before {before}'}"
    ends = " to ".join(_end(factor * each, _digits(low, high)) for each in (low, high))
    return value, f"{ends} {unit}".strip()


def _digits(low: float, high: float) -> int:
    """Return how many significant digits tell the ends of an interval apart, four at least."""
    largest, half = max(abs(low), abs(high)), (high - low) / 2
    if not 0 < half < np.inf:
        return 4
    return min(max(4, 1 + int(np.floor(np.log10(largest)) - np.floor(np.log10(half)))), 9)


def _vector(name: str, fitted: FittedParameter) -> tuple[str, str]:
    """Return what the components of a vector have in common: a name but for x, y or z at its end, and the unit."""
    return name[:-1] if name[-1:] in ("x", "y", "z") else name, fitted.unit


def by_place(finding: Finding) -> dict[str, list[tuple[str, str, str]]]:
    """Return what `parameter_texts` does by place, where a finding has the same parameters at several; else nothing."""
    groups: dict[str, dict[str, FittedParameter]] = {}
    for name, fitted in finding.parameters.items():
        place, _, key = name.rpartition(".")
        groups.setdefault(place, {})[key] = fitted
    keys = {tuple(group) for group in groups.values()}
    if len(groups) < 2 or len(keys) > 1 or not groups.keys() <= {*finding.at_each}:
        return {}
    return {place: parameter_texts(group) for place, group in groups.items()}


def _end(value: float, digits: int) -> str:
    """Return an end of an interval; beyond a million it means that the data set no bound."""
    return number(value, digits) if 1e-9 < abs(value) < 1e9 or value == 0 else f"{value:.1e}"


def no_proposal_text(diagnosis: Diagnosis) -> str:
    """Return why no formula is proposed, where it was asked for, as a sentence."""
    unknown = [item for item in diagnosis.findings if item.physics == "unknown"]
    if few := [item.statement for item in unknown if item.untold]:
        why = few[0]
    elif diagnosis.efforts is not None and diagnosis.efforts.standing:
        why = "the joints stand in every row, and what follows a motion does not show"
    elif unknown:
        why = "what is unknown follows nothing that its place knows better than chance would"
    else:
        why = "nothing is unknown, and none surely does better than the laws that were found"
    return f"No formula is proposed: {why}."


def proposal_lines(proposal: Proposal) -> list[str]:
    """Return what is told of a proposed formula: it, its parameters, what equals it, doubts and what would tell."""
    ranges = [
        f"{name} of {joint} {number(low, 3)} to {number(high, 3)}"
        for (name, joint), (low, high) in proposal.law.recorded.items()
    ]
    curve = f" (the curve of no law: {_percent(proposal.of_curve)})" if proposal.of_curve > 0 else ""
    lines = [
        f"{proposal.law.symbol} = {proposal.text}",
        *_in_lines(parameter_texts(proposal.parameters)),
        f"it takes away {_percent(proposal.share)} of the held-out squares that are left without it{curve}; "
        f"it was seen in: {'; '.join(ranges)}",
        proposal.beside and f"beside it stands what its shape leaves: {proposal.beside.text}",
        proposal.instead,
        *(f"the data do not tell it from {other.text}" for other in proposal.equals),
        *proposal.doubts,
    ]
    return [line for line in lines if line]


def alternative_text(finding: Finding) -> list[str]:
    """Return what these data cannot tell from a finding, as sentences."""
    texts = []
    here = finding.location
    wholes = [place for place in finding.rivals if here.startswith(f"{place}/")]
    parts = [place for place in finding.rivals if place.startswith(f"{here}/")]
    if finding.one_body:
        link = "all that is fixed to it" if here == finding.one_body[0] else finding.one_body[0]
        texts.append(f"{here} is one rigid body with {link}: only the mass, centre and inertia of the whole show")
    if rivals := [place for place in finding.rivals if place not in (*wholes, *parts)]:
        texts.append(f"these data cannot tell {here} from {places_text(rivals)}")
    if wholes:
        texts.append(f"{here} is part of {places_text(wholes)}, which may be meant as a whole")
    if parts:
        alone = "each alone" if len(parts) > 1 else "alone"
        texts.append(f"of {here}, {places_text(parts)} {alone} would explain as much")
    if finding.alternatives:
        laws = _alternative_laws(finding)
        more = len(laws) - _MOST_RIVALS
        laws[_MOST_RIVALS:] = [f"{more} more, in diagnosis.json"] if more > 0 else []
        texts += [f"as good a fit: {laws[0]}", *(f"or {law}" for law in laws[1:])]
    return texts


def channel_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Return (what, before, after, unit) of the residuals: all in multiples of the noise, then by channel of poses."""
    before, after = diagnosis.before, diagnosis.after
    rows = [
        (f"all, {name}", number(before[key], 3), number(after[key], 3), "× noise")
        for key, name in (("fit", "fitted"), ("heldout", "held out"))
    ]
    for name, values in diagnosis.by_channel.items():
        if "left_share" in values:
            continue
        rows.append((name, number(values["before"], 3), number(values["after"], 3), "× noise"))
        rows += [("", *ends_of(values, unit)) for unit in ("m", "rad") if f"before_u{unit}" in values]
    return rows


def ends_of(values: Mapping[str, float], unit: str) -> tuple[str, str, str]:
    """Return (before, after, unit) of a channel's residual, in the unit that suits what is left; none below µm."""
    before, after = (1e-6 * values[f"{key}_u{unit}"] for key in ("before", "after"))
    shown, factor = readable_unit(max(after, 1e-6) if math.isfinite(after) else before, unit)
    return number(factor * before, 3), number(factor * after, 3), shown


#: Columns of `effort_rows`.
EFFORT_COLUMNS = ("joint", ">noise", ">× noise, fitted", ">% of the effort, held out")


def effort_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Return a row for each joint: its name, noise, residual in multiples of it and in percent of its effort."""
    efforts = diagnosis.efforts
    if efforts is None:
        return []
    told = dict(zip(efforts.joints, zip(efforts.noise.tolist(), efforts.units, strict=True), strict=True))
    rows = []
    for name, values in diagnosis.by_channel.items():
        if "left_share" not in values:
            continue
        joint = name.removeprefix("effort").strip()
        noise = quantity(*told[joint]) if joint in told and math.isfinite(told[joint][0]) else "-"
        ends = [number(values[key], 3) for key in ("before", "after")]
        shares = [number(100 * values[key], 3) for key in ("before_share", "left_share")]
        # little more than the noise is left, and it is most of the effort
        is_noise = values["after"] < _LITTLE_MORE and values["left_share"] > 0.5
        rows.append((joint or "all", noise, " → ".join(ends), " → ".join(shares) + ", mostly noise" * is_noise))
    return rows


def length_of(diagnosis: Diagnosis, recording: Recording) -> str:
    """Return how much a recording holds: '8 poses', or '21.8 s of motion'."""
    poses = len(set(recording.blocks().tolist())) if len(recording) else 0
    if diagnosis.efforts is None or 2 * poses <= len(recording):
        return counted(poses, "pose")
    if diagnosis.efforts.separate:
        return counted(len(recording), "state")
    read = (*recording.conventions, *(item for own in diagnosis.conventions for item in own))
    second = math.prod(item.meaning.factor or 1.0 for item in read if item.group == "time")
    lasted = second * sum(float(np.ptp(recording.time[run])) for run in pieces(recording.run))
    return f"{number(lasted, 3)} s of motion"


def used_text(diagnosis: Diagnosis, samples: int) -> str:
    """Return how many of so many samples were used, and why no more."""
    from ...diagnosis.criteria import MOST_SAMPLES

    used, why = len(diagnosis.samples), ""
    if used < samples and diagnosis.efforts is not None and not diagnosis.efforts.separate:
        why = ": filtered, as many as the compared frequencies need"
    elif used < samples > MOST_SAMPLES:
        why = ", evenly chosen: more would tell hardly more"
    return f"{used} used{why}"


def recording_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return name, samples used, residual before and after, and own sensors of each recording."""
    rows = []
    for part in diagnosis.recordings:
        ends = " → ".join(number(value, 3) for value in (part.before, part.after))
        own = f"its own {', '.join(name.replace('_', ' ') for name in part.own)}" if part.own else ""
        texts = (f"{counted(part.samples, 'sample')}, {len(part.used)} used", f"{ends} × noise", own)
        rows.append((part.name, *(text for text in texts if text)))
    return rows


def noise_text(diagnosis: Diagnosis) -> list[str]:
    """Return the noise of each sensor that measured something; what is zero was not declared."""
    noise = diagnosis.noise
    items = {"position": "m", "rotation": "rad", "force": "N", "moment": "N m", "effort": _effort_unit(diagnosis)}
    texts = []
    compared = {unit for name, unit, _ in diagnosis.columns if name in diagnosis.by_channel}
    for name, unit in items.items():
        value = getattr(noise, name)
        if value and unit and (unit not in ("m", "rad") or unit in compared):
            texts.append(f"{name} {quantity(value, unit)}")
    efforts = diagnosis.efforts
    if efforts is None or efforts.declared:
        return [*texts, _SOURCES.get(noise.source, noise.source)]
    ways = _joined([_WAYS.get(way, way) for way in dict.fromkeys(efforts.how) if way])
    return [*texts, f"{noise.source}, of efforts by {ways}" if ways else f"{noise.source}, of efforts unknown"]


def _effort_unit(diagnosis: Diagnosis) -> str:
    """Return the unit of efforts' noise; '' where estimates are in several units: none is all theirs."""
    efforts = diagnosis.efforts
    units = ["N", "N m"] if efforts is None else sorted({*efforts.units})
    if efforts is None or efforts.declared:
        return " or ".join(units)
    return "" if len(units) > 1 or units == [AS_LOGGED] else units[0]


def multiple_text(diagnosis: Diagnosis) -> str:
    """Return what a multiple of the noise is, where one may be asked what less than 1 means; else nothing."""
    if diagnosis.efforts is None or math.isnan(diagnosis.after["heldout"]):
        return ""
    less = "" if diagnosis.efforts.separate else "; the comparison filters samples, so that less than 1 is normal"
    return f"1 × noise is the scatter of a single sample of an effort{less}"


def places_text(names: Iterable[str]) -> str:
    """Return places with their legs folded: 'leg1, leg2: ball_nut, motor; robot'."""
    legs: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        *leg, part = name.split("/", 1)
        legs.setdefault(part, []).extend(leg)
    parts: dict[tuple[str, ...], list[str]] = {}
    for part, found in legs.items():
        parts.setdefault(tuple(sorted(found)), []).append(part)
    texts = []
    for found_in, listed in sorted(parts.items(), key=lambda item: (-len(item[0]), item[0])):
        single = len(found_in) == len(listed) == 1
        texts.append(("/" if single else ": ").join(", ".join(each) for each in (found_in, listed) if each))
    return ("; " if any(": " in text for text in texts) else ", ").join(texts)


#: What would show beyond so many times a strong effect is none that one looks for.
_OUT_OF_REACH = 10.0


def hidden_rows(hidden: Sequence[Detectable]) -> list[tuple[str, str, str]]:
    """Return (physics, where, what it would have taken) of effects that stayed hidden, grouped by physics."""
    groups: dict[tuple[str, str, str, str], list[Detectable]] = {}
    for item in hidden:
        # without a size, the reason tells why
        reason = "" if item.smallest is not None else item.reason
        groups.setdefault((item.physics, item.parameter, item.unit, reason), []).append(item)
    rows = []
    for (physics, parameter, unit, reason), items in groups.items():
        where = places_text(sorted(item.location for item in items if item.location))
        rows.append((physics.replace("_", " "), where, reason or _needed(parameter, unit, items)))
    return sorted(rows, key=lambda row: row[0])


def within_reach(hidden: Sequence[Detectable]) -> tuple[list[Detectable], list[str]]:
    """Return effects that another test may show, and kinds of which only sizes that hardly any part has would show.

    Another test shows what these loads do not reach, what was not recorded, and what shows at up to `_OUT_OF_REACH`
    times a strong one.
    """
    near = [item for item in hidden if not _is_out_of_reach(item)]
    told = {item.physics for item in near}
    return near, sorted({item.physics.replace("_", " ") for item in hidden if item.physics not in told})


def _is_out_of_reach(item: Detectable) -> bool:
    from ...diagnosis.diagnosis import NOT_AT_ANY_SIZE

    if item.smallest is None:
        return item.reason == NOT_AT_ANY_SIZE
    less, more = sorted((abs(item.smallest), abs(item.strong)))
    return more > _OUT_OF_REACH * less  # of what has no strong size False


def _needed(parameter: str, unit: str, items: Sequence[Detectable]) -> str:
    below = items[0].below
    sized = [(item.smallest, item.location) for item in items if item.smallest is not None]
    sized = [each for each in sized if below or each[0] <= _ABSURD]
    if not sized:
        return "never visible in this test"
    ends = [end(sized, key=lambda each: each[0]) for end in ((max, min) if below else (min, max))]
    sizes = _from_to_at([quantity(size, unit, 2) for size, _ in ends], [place for _, place in ends])
    return f"{parameter.replace('_', ' ')} {'below' if below else 'above'} {sizes}"


def _from_to_at(shown: Sequence[str], places: Sequence[str], alike: str = "") -> str:
    """Return '3 µm at motor to 5 µm at nut', the most sensitive place first; one text, and `alike`, of equal ones."""
    if len(dict.fromkeys(shown)) == 1:
        return f"{shown[0]}{alike}"
    return " to ".join(f"{text} at {place}" for text, place in zip(shown, places, strict=True))


# -- what has changed since an earlier test ----------------------------------------------------------------------------


#: Shares from this on are told in per cent, and from that on as multiples.
_SHARE, _MANY = 1e-3, 10.0


def verdict_since(diagnosis: Diagnosis, since: Since) -> str:
    """Return the verdict on what has changed, in a sentence or two."""
    before, after = (number(values["heldout"], 3) for values in (diagnosis.before, diagnosis.after))
    named = [item for item in diagnosis.findings if item.physics != "unknown" and item.parameters]
    if diagnosis.verdict == "nothing_missing":
        seen = "; ".join(_largest_unseen(since))
        return (
            "Nothing has changed since the earlier test beyond what that could know: what its model leaves is noise "
            f"({after} times it).{seen and f' {capital(seen)}.'}"
        )
    told = _joined([_or_else(f"{finding_text(item)}{_from_to(item)}", item) for item in named])
    takes = f"the residual falls from {before} to {after} times the noise" if before != after else f"{after} are left"
    if diagnosis.verdict == "explained":
        sensors = all(item.effect is not None and item.effect.law.sensor in SENSORS for item in named)
        only = " Nothing else has: the robot is as it was." if sensors else ""
        return f"Changed since the earlier test: {told}; with it {takes}.{only}"
    if not since.explained:
        beside = f"; with {told} {takes}" if told else ""
        return (
            "Nothing can be told for certain: the earlier test was left unexplained itself, and its model leaves "
            f"{before} times the noise here{beside}. Whether that has changed or was there before, both recordings "
            "diagnosed together would say."
        )
    at = _largest_in(next((item for item in diagnosis.findings if item.physics == "unknown"), None))
    if told:
        return f"Something has changed that is not understood: with {told} {takes}, and no law explains the rest{at}."
    return (
        f"Something has changed that is not understood: the earlier model leaves {before} times the noise, and no law "
        f"of the library explains it{at}."
    )


def _from_to(finding: Finding) -> str:
    """Return ' (half gap from 12 to 19 µm)' of what was there before."""
    for name, item in finding.parameters.items():
        if item.before is not None:
            unit, factor = readable_unit(item.value, item.unit)
            ends = [number(factor * value, 3) for value in (item.before, item.value)]
            told = f"{name.replace('_', ' ')} from {ends[0]} to {ends[1]} {unit}"
            return f" ({told.strip()})"
    return ""


def _largest_unseen(since: Since) -> Iterator[str]:
    """Yield how large a change would have been seen: of what was found before, and of the first law of the library."""
    firsts: dict[tuple[str, str, str], Changed] = {}
    for item in since.values:
        firsts.setdefault((item.physics, item.location, item.aspect), item)
    first = [item for item in firsts.values() if item.seen is not None]
    for item in first[:2]:
        words, size = item.parameter.replace("_", " "), quantity(item.seen or 0.0, item.unit)
        yield f"a {words} at {item.location} larger or smaller by {size} would have shown"
    for physics, ends in _ends(since.seen)[:1]:
        told = ", ".join(f"by {_off(item)} at {item.location}" for item in ends)
        yield f"so would {physics} {told}" if first else f"{physics} {told} would have shown"


def then_and_now_rows(since: Since) -> list[tuple[str, str, str, str, str]]:
    """Return rows of what was found before: what, then, now, the difference with its interval, what would show."""
    rows = []
    for item in since.values:
        what = f"{item.physics.replace('_', ' ')} at {item.location}: {item.parameter.replace('_', ' ')}"
        unit, factor = readable_unit(item.then.value, item.unit)
        then, now = (number(factor * value.value, 3) for value in (item.then, item.now))
        apart = "as it was"
        if item.has_changed:
            low, high = (number(factor * end, 3) for end in sorted(item.difference.interval))
            apart = f"{number(factor * item.difference.value, 3, signed=True)} ({low} to {high})"
        shown = "none" if item.seen is None else number(factor * item.seen, 2)
        rows.append((f"{what} [{unit}]" if unit else what, then, now, apart, shown))
    return rows


def seen_rows(seen: Sequence[Seen]) -> list[tuple[str, str]]:
    """Return rows of what would have shown beside: physics, and the sizes at the most and the least sensitive place."""
    rows = []
    for physics, ends in _ends(seen):
        places = [item.location for item in ends]
        told = _from_to_at([*map(_off, ends)], places, f" at {places[0] if len(ends) == 1 else 'all places'}")
        rows.append((f"{physics}, {ends[0].parameter.replace('_', ' ')}", told))
    return rows


def visible_rows(seen: Sequence[Seen]) -> list[tuple[str, str]]:
    """Return rows as `seen_rows` of what a strong effect would have shown, that first of which least would have."""
    shown = [item for item in seen if _margin(item) > 1]
    return seen_rows(sorted(shown, key=_margin))


def _margin(item: Seen) -> float:
    """Return how many times a strong effect is what would have been seen."""
    if _is_endless(item):
        return item.smallest / item.strong
    return abs(item.strong - item.neutral) / abs(item.smallest - item.neutral)


def _ends(seen: Sequence[Seen]) -> list[tuple[str, list[Seen]]]:
    """Return, of each physics in words and parameter, the most and the least sensitive place."""
    kinds: dict[tuple[str, str, str], list[Seen]] = {}
    for item in seen:
        kinds.setdefault((item.physics, item.parameter, item.unit), []).append(item)
    found = []
    for (physics, _, _), items in kinds.items():
        items.sort(key=lambda item: 1 / item.smallest if _is_endless(item) else abs(item.smallest - item.neutral))
        found.append((physics.replace("_", " "), [items[0], *items[-1:]] if len(items) > 1 else items))
    return found


def _off(item: Seen) -> str:
    """Return by how much a parameter must be off to show: a factor or a share in per cent."""
    endless = _is_endless(item)
    size = item.smallest if endless else abs(item.smallest - item.neutral)
    if item.unit not in ("", "1"):
        shown = quantity(size, item.unit)
    elif size >= _MANY:
        shown = f"{number(size, 2)} times"
    else:
        shown = f"{number(100 * size, 2)} %" if size >= _SHARE else f"{number(1e6 * size, 2)} ppm"
    return f"{'below ' if endless else ''}{shown}"


def _is_endless(item: Seen) -> bool:
    """Return True for what does nothing where its value is without end, such as a reference load."""
    return abs(item.neutral) > 1e12
