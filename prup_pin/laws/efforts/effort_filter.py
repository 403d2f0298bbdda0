"""Efforts that have passed a low-pass filter nobody logged: of the current's sensor, or of the controller that logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...dynamics.smoothing import pieces
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .delay import Lagging, of_all_drives
from .effort_law import DrivenEffortLaw


def low_passed(values: Array, time_constant: float, step: float) -> Array:
    """Return values (n, ...) at even steps [s] behind T dy/dt + y = u, settled at the first of them.

    u is the cubic spline through the samples, of which the filter's answer over a step is known exactly: a straight
    line between samples would lag by itself, by as much as tells a filter from a delay.
    """
    from scipy.interpolate import CubicSpline  # heavy; not needed to load a robot
    from scipy.signal import lfilter

    if len(values) < 2 or not time_constant > 0:
        return np.array(values, float)
    kept = float(np.exp(-step / time_constant))
    # of s^k over a step: w_k = int_0^h exp(-(h - s) / T) s^k ds / T = h^k - k T w_(k-1)
    weights = [-float(np.expm1(-step / time_constant))]
    for power in range(1, 4):
        weights.append(step**power - power * time_constant * weights[-1])
    cubic = CubicSpline(step * np.arange(len(values)), values, axis=0)
    entering = np.tensordot(np.array(weights[::-1]), cubic.c, axes=1)
    state = kept * np.asarray(values[:1], float)
    answer = lfilter([1.0], [1.0, -kept], entering, axis=0, zi=state)[0]
    return np.concatenate((values[:1], answer))


class Filter(Lagging):
    """tau_reported = y, T dy/dt + y = tau: slow efforts come late by T, fast ones weaker too, above 1 / (2 pi T).

    One of those that nobody logs: it stands before the recording. Below its corner it is a delay's twin.
    """

    physics = "effort_filter"
    called = "bandwidth, smoothing"
    remedy = "undo this filter in the log, or record efforts before it"
    source = "Oppenheim and Willsky, Signals and Systems, ch. 6"
    linear = ("time_constant",)
    quantities = (Quantity("time_constant", "s", "of the filter: 1 / (2 pi corner frequency)", 1e-3, upper=0.2),)

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # noisy accelerations are smaller filtered, whatever is late: it is named where it shows beside a delay
        return [("effort_delay", place.name)]


def _behind(at: InMotion, values: Array, time_constant: float) -> Array:
    """Return by how much values (N, ...) behind the filter differ from those before it, each piece for itself."""
    out = np.zeros_like(values)
    if at.motion.separate:
        return out
    for where in pieces(at.motion.piece):
        out[where] = low_passed(values[where], time_constant, 1 / at.motion.rate) - values[where]
    return out


def _told(time_constant: float) -> str:
    corner = number(1 / (2 * np.pi * time_constant), 3) if time_constant > 0 else "any"
    return f"a low-pass filter of {number(1e3 * time_constant, 3)} ms (corner {corner} Hz)"


class EffortFilter(Filter, DrivenEffortLaw):
    """The reported effort of one drive is filtered."""

    summary = "a low-pass filter before the reported effort"

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        own = at.effort_of(place.name, at.predicted)
        return at.along(place.name, _behind(at, own, values["time_constant"]))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort of {place.name} has passed {_told(values['time_constant'])}"


class EffortsFilter(Filter):
    """All reported efforts are filtered alike."""

    summary = "a low-pass filter before all reported efforts"
    least_gain = 0.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return of_all_drives(mechanism, self.variant)

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return _behind(at, at.predicted, values["time_constant"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"all efforts have passed {_told(values['time_constant'])}"
