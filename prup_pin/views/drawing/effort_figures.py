"""Pictures of efforts: over time, what is left against the speed, a law's curve, spectra. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...diagnosis import Finding
from ...diagnosis.efforts import EffortCurve, EffortDiagnosis
from ...numbers import number, readable_unit
from ...spatial import Array
from ..scene.colours import FOUND
from ..text.diagnosis_words import finding_text
from .plotting import Figure, plain_axes, plain_words, sheet

_BEFORE, _AFTER, _MEASURED = "#9AA3AD", "#0B6AA8", "#23272E"
#: Joints that a page shows, those whose effort the findings change most, and the time that it shows of them [s].
_MOST_JOINTS, _SECONDS = 6, 12.0
#: Lines of a spectrum: label and style by what is drawn. Frequencies of each, and longest stretch [s] of its windows.
_SPECTRA = {
    "measured": ("measured effort", {"color": _MEASURED, "lw": 1.8, "zorder": 5}),
    "predicted": ("predicted: rigid robot, logged motion", {"color": "#7FB5E0", "lw": 4.0, "zorder": 3}),
    "of the motion": (
        "part of the prediction that is noise and vibration of the motion",
        {"color": "#6B7480", "lw": 1.5, "ls": (0, (4, 2)), "zorder": 4},
    ),
    "left": ("left: measured less predicted", {"color": "#C2571A", "lw": 1.6, "zorder": 4}),
}
_POINTS, _LONGEST = 160, 8.0


@plain_words
def effort_figure(efforts: EffortDiagnosis, *, narrow: bool = False) -> Figure:
    """Return measured and predicted efforts over time, and what is left of them against the speed, joint by joint.

    `narrow`: for a phone, without the latter.
    """
    gain = [efforts.by_joint[name]["before"] - efforts.by_joint[name]["after"] for name in efforts.joints]
    chosen = sorted(np.argsort(gain)[::-1][:_MOST_JOINTS].tolist())
    rows = len(chosen)
    height = (0.9 if narrow else 0.7) + 2.1 * rows
    figure = sheet(5.2 if narrow else 11, height)
    grid = figure.add_gridspec(
        rows,
        1 if narrow else 2,
        width_ratios=(1,) if narrow else (2.3, 1),
        left=0.14 if narrow else 0.09,
        right=0.985,
        top=1 - (0.82 if narrow else 0.62) / height,
        bottom=0.55 / height,
        hspace=0.65 if narrow else 0.55,
    )
    shown = _window(efforts)
    for row, column in enumerate(chosen):
        _draw_time(figure.add_subplot(grid[row, 0]), efforts, column, shown, row == rows - 1, narrow)
        if not narrow:
            _draw_left(figure.add_subplot(grid[row, 1]), efforts, column, row == rows - 1)
    for x, colour, label in (
        (0.02 if narrow else 0.09, _MEASURED, "measured"),
        (0.26 if narrow else 0.2, _BEFORE, "rigid, as drawn"),
        (0.62 if narrow else 0.38, _AFTER, "with the findings"),
    ):
        figure.text(
            x, 1 - 0.2 / height, f"— {label}", color=colour, fontsize=9 if narrow else 11, va="center", weight="bold"
        )
    return figure


def _window(efforts: EffortDiagnosis) -> np.ndarray:
    """Return the samples of the stretch of time that is drawn: where the efforts change most."""
    time = efforts.time
    if time[-1] - time[0] <= _SECONDS:
        return np.arange(len(time))
    change = np.abs(efforts.predicted - efforts.rigid).sum(axis=1)
    starts = np.arange(time[0], time[-1] - _SECONDS + 1e-9, _SECONDS / 2)
    sums = [change[(time >= start) & (time < start + _SECONDS)].sum() for start in starts]
    start = starts[int(np.argmax(sums))]
    return np.flatnonzero((time >= start) & (time < start + _SECONDS))


def _draw_time(axes, efforts: EffortDiagnosis, column: int, shown: np.ndarray, last: bool, narrow: bool) -> None:
    name, unit = efforts.joints[column], efforts.units[column]
    time = efforts.time[shown]
    # pieces apart in time are no line
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > 5 * np.median(steps)) + 1 if len(time) > 2 else np.zeros(0, int)
    axes.axhline(0, color="#C3C9D0", lw=0.8, zorder=1)
    for values, colour, width, order in (
        (efforts.rigid, _BEFORE, 1.2, 2),
        (efforts.measured, _MEASURED, 1.6, 3),
        (efforts.predicted, _AFTER, 1.1, 4),
    ):
        own = np.insert(values[shown, column], gaps, np.nan)
        axes.plot(np.insert(time, gaps, np.nan), own, color=colour, lw=width, zorder=order)
    share = efforts.shares[name]
    drawn, found = (number(100 * share[of], 3) for of in ("rigid", "heldout"))
    text = f"{drawn} % of it unexplained as drawn, {found} % with the findings"
    axes.set_title(f"{name}\n{text}" if narrow else f"{name}: {text}", fontsize=8.5 if narrow else 9.5, loc="left")
    axes.set_ylabel(f"effort [{unit}]", fontsize=9)
    if last:
        axes.set_xlabel("time [s]", fontsize=9)
    plain_axes(axes, 8.5)


def _draw_left(axes, efforts: EffortDiagnosis, column: int, last: bool) -> None:
    good = efforts.good[:, column]
    speed = efforts.speed[good, column]
    axes.axhline(0, color="#C3C9D0", lw=0.8, zorder=1)
    for values, colour, order in ((efforts.rigid, _BEFORE, 2), (efforts.predicted, _AFTER, 3)):
        left = (efforts.measured - values)[good, column]
        axes.scatter(speed, left, s=3, color=colour, linewidths=0, alpha=0.5, zorder=order, rasterized=True)
    axes.set_ylabel(f"left [{efforts.units[column]}]", fontsize=9)
    if last:
        axes.set_xlabel(f"speed [{'m/s' if efforts.joints[column] in efforts.sliding else 'rad/s'}]", fontsize=9)
    plain_axes(axes, 8.5)


@plain_words
def effort_curve_figure(finding: Finding, curve: EffortCurve, *, narrow: bool = False) -> Figure:
    """Return what the efforts ask for at a joint against what drives it, before any law, and the law.

    `narrow`: for a phone.
    """
    figure = sheet(*((5.2, 4.9) if narrow else (9.5, 4.2)))
    axes = figure.add_axes((0.15, 0.26, 0.81, 0.62) if narrow else (0.1, 0.14, 0.87, 0.73))
    unit, factor = readable_unit(float(np.abs(curve.x).max(initial=0.0)), curve.x_unit)
    x = factor * curve.x
    axes.axhline(0, color="#C3C9D0", lw=0.8, zorder=1)
    if x.min() < 0 < x.max():
        axes.axvline(0, color="#C3C9D0", lw=0.8, zorder=1)
    axes.errorbar(
        x, curve.y, 1.96 * curve.deviation, fmt="o", ms=5, color=_AFTER, lw=1.2, zorder=3,
        label="what the efforts ask for, means of neighbours, 95 %",
    )  # fmt: skip
    if curve.law is not None:
        axes.plot(x, curve.law, color=FOUND, lw=2.2, zorder=4, label=f"the law: {finding.physics.replace('_', ' ')}")
    axes.set_xlabel(f"{curve.against} of {curve.joint} [{unit}]", fontsize=10)
    axes.set_ylabel(f"effort beyond the rest of the model [{curve.y_unit}]", fontsize=10)
    if narrow:  # no place beside a curve is wide enough
        axes.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0, -0.17))
    else:
        axes.legend(frameon=False, fontsize=9.5, loc="best")
    plain_axes(axes, 8.5)
    figure.text(
        0.04 if narrow else 0.1,
        0.94,
        finding_text(finding),
        fontsize=11.5 if narrow else 13,
        weight="bold",
        va="center",
    )
    return figure


@plain_words
def effort_spectra_figure(
    joint: str, rate: float, efforts: Mapping[str, Array], cutoff: float, highest: float, unit: str = "N m"
) -> Figure:
    """Return spectra of a joint's efforts, and the frequency up to which they are compared.

    efforts: by 'measured', 'predicted', 'of the motion' and 'left', each (N,) at `rate` [Hz]: what was measured, what a
    rigid robot says by the logged motion, how much of that is the motion's own noise and vibration, and what it leaves
    of the measured effort. cutoff [Hz]: `EffortDiagnosis.band`; highest [Hz]: the last frequency drawn. Welch's method,
    averaged over a sixth of an octave.
    """
    from scipy.signal import welch  # heavy; not needed to draw anything else

    figure = sheet(9.5, 5.0)
    axes = figure.add_axes((0.085, 0.115, 0.895, 0.73))
    largest, least = 0.0, np.inf
    for key, (label, style) in _SPECTRA.items():
        values = efforts[key]
        length = min(len(values), round(_LONGEST * rate))
        frequency, power = welch(values, rate, nperseg=length, detrend="linear")
        lines = np.searchsorted(frequency, np.geomspace(frequency[2], highest, _POINTS))
        at = frequency[np.unique(np.minimum(lines, len(frequency) - 1))]
        size = np.sqrt(_averaged(frequency, power, at))
        largest, least = max(largest, size.max()), min(least, size.min())
        axes.loglog(at, size, label=label, **style)
    axes.axvline(cutoff, color=FOUND, lw=1.6, zorder=2)
    axes.axvspan(cutoff, highest, color="#F3F4F6", zorder=0)
    axes.set_xlim(at[0], min(highest, at[-1]))
    axes.set_ylim(0.5 * least, 2.5 * largest)
    axes.annotate(
        f"compared up to {number(cutoff, 3)} Hz", (cutoff, 2.0 * largest), (-6, 0), textcoords="offset points",
        ha="right", va="top", fontsize=10, color=FOUND, weight="bold",
    )  # fmt: skip
    axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    axes.set_xlabel("frequency [Hz]", fontsize=10)
    axes.set_ylabel(f"amplitude density of the effort [{unit}/√Hz]", fontsize=10)
    figure.legend(
        *axes.get_legend_handles_labels(), frameon=False, fontsize=10, loc="upper left", bbox_to_anchor=(0.075, 0.935),
        ncols=2, handlelength=1.8, columnspacing=2.2, borderpad=0.0,
    )  # fmt: skip
    figure.text(0.085, 0.965, f"Spectra of the effort of {joint}", fontsize=12.5, weight="bold", va="center")
    plain_axes(axes, 8.5)
    return figure


def _averaged(frequency: Array, power: Array, at: Array) -> Array:
    """Return a power density (f,) averaged over a sixth of an octave about each of some frequencies."""
    total = np.concatenate(([0.0], np.cumsum(power)))
    low = np.searchsorted(frequency, at * 2 ** (-1 / 12))
    high = np.maximum(np.searchsorted(frequency, at * 2 ** (1 / 12), side="right"), low + 1)
    return (total[high] - total[low]) / (high - low)
