"""The picture of a joint's spectra on docs/efforts.md; pictures.py draws it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from prup_pin.numbers import number
from prup_pin.spatial import Array
from prup_pin.views.drawing.plotting import Figure, plain_axes, plain_words, sheet
from prup_pin.views.scene.colours import FOUND

_MEASURED = "#23272E"
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
