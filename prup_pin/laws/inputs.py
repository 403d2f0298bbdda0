"""What a recording tells the laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics import BodyMotion, body_motion
from ..mechanism import REFERENCE_TEMPERATURE, Mechanism
from ..spatial import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, CubicSpline

#: Samples without which a run shows no motion, and the share of a sample's step by which its neighbours may miss it: a
#: motion that is sampled finely enough is told by its neighbours to a hundredth, postures one after another are not.
_FEWEST, _RESOLVED = 8, 0.1


#: A change of temperature that is smaller hides in the noise of a thermometer [K].
LEAST_WARMING = 0.2


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where actuators were at any time of a recorded motion: a cubic spline of their positions for each run."""

    runs: Mapping[int, CubicSpline]

    @classmethod
    def of(cls, time: Array, actuators: Array, runs: np.ndarray) -> Trajectory | None:
        """Return the motion through positions (N, a) at times (N,) [s], runs (N,); None where samples are postures.

        A motion is one whose samples are foretold by their neighbours, as far as they lie between these: rows of a
        posture that is held tell nothing of the way to the next.
        """
        from scipy.interpolate import CubicSpline  # heavy: only motions need it

        found, missed, moved = {}, 0.0, 0.0
        for run in np.unique(runs):
            t, q = time[runs == run], actuators[runs == run]
            if len(t) < _FEWEST or not (np.diff(t) > 0).all() or not np.isfinite(q).all():
                return None
            others = CubicSpline(t[::2], q[::2])(t[1:-1:2])
            missed += float(((others - q[1:-1:2]) ** 2).sum())
            steps = (np.diff(q, axis=0) ** 2).sum(axis=1)[: 2 * ((len(t) - 1) // 2)]
            moved += 4 * float(steps.reshape(-1, 2).min(axis=1).sum())
            found[int(run)] = CubicSpline(t, q)
        return cls(found) if found and missed < _RESOLVED**2 * moved else None

    def later(self, time: Array, runs: np.ndarray, actuator: int, delay: float) -> Array:
        """Return how far an actuator moves (N,) [m or rad] from times (N,) [s] of runs (N,) in `delay` [s]."""
        out = np.zeros(len(time))
        for run, spline in self.runs.items():
            here = runs == run
            if here.any():
                ahead = np.clip(time[here] + delay, spline.x[0], spline.x[-1])
                # beyond the first and last sample it goes on as there
                beyond = time[here] + delay - ahead
                there = spline(ahead)[:, actuator] + beyond * spline(ahead, 1)[:, actuator]
                out[here] = there - spline(time[here])[:, actuator]
        return out

    def rates(self, time: Array, runs: np.ndarray, later: Array) -> tuple[Array, Array]:
        """Return speeds and accelerations (N, a) `later` (N, a) [s] than times (N,) of runs (N,) [s].

        Of smoothed positions: an encoder's noise, twice differentiated, would pass for acceleration.
        """
        out = np.zeros((2, *later.shape))
        for run, splines in self._smoothed.items():
            here = runs == run
            first, last = self.runs[run].x[[0, -1]]
            for column, spline in enumerate(splines):
                there = np.clip(time[here] + later[here, column], first, last)
                out[:, here, column] = 0.0 if spline is None else (spline(there, 1), spline(there, 2))
        return out[0], out[1]

    @cached_property
    def _smoothed(self) -> dict[int, list[BSpline | None]]:
        """Smoothing splines of each run's actuators, by generalised cross validation; None of one that stands."""
        from scipy.interpolate import make_smoothing_spline  # heavy: only motions need it

        found: dict[int, list[BSpline | None]] = {}
        for run, spline in self.runs.items():
            columns = spline(spline.x).T
            found[run] = [make_smoothing_spline(spline.x, q) if np.ptp(q) > 0 else None for q in columns]
        return found


@dataclass(frozen=True)
class Inputs:
    """What a recording says about every sample, as far as laws need it.

    time (N,) [s]; actuators (N, a) and their speeds (N, a) or None; wrench (N, 6); temperature (N,) [deg C] or None;
    blocks (N,) labels of samples between two moves of the actuators; runs (N,) labels of samples recorded one after
    another, one run where they are None; gravity (N, 3), acceleration of free fall in the base frame [m/s^2], or None
    where it is the robot file's; sources (N,), which of several recordings a sample is from, or None for one.
    began (N,), when the recording of each sample began [s], or None: with the first one here.
    weight_alone: no wrench was recorded, so that nothing but the robot's weight acts.
    motion: where the actuators were between the samples, or None where these are postures.
    """

    time: Array
    actuators: Array
    wrench: Array
    blocks: np.ndarray
    temperature: Array | None = None
    speeds: Array | None = None
    runs: np.ndarray | None = None
    gravity: Array | None = None
    sources: np.ndarray | None = None
    weight_alone: bool = False
    began: Array | None = None
    motion: Trajectory | None = None

    @classmethod
    def empty(cls, actuators: int) -> Inputs:
        """Return a recording without samples that has every column."""
        none, positions = np.zeros(0), np.zeros((0, actuators))
        return cls(none, positions, np.zeros((0, 6)), np.zeros(0, int), temperature=none, speeds=positions)

    def __len__(self) -> int:
        return len(self.time)

    def run_labels(self) -> np.ndarray:
        """Return the runs (N,)."""
        return np.zeros(len(self), int) if self.runs is None else self.runs

    def from_sources(self, places: Sequence[int]) -> np.ndarray:
        """Return which samples are from the recordings with these places, (N,); none where there is one alone."""
        return np.zeros(len(self), bool) if self.sources is None else np.isin(self.sources, list(places))

    @property
    def moves(self) -> bool:
        """Whether it is known how the actuators moved."""
        fast = self.speeds is not None and np.nanmax(np.abs(self.speeds), initial=0.0) > 0
        return self.motion is not None or bool(fast)

    def later(self, actuator: int, delay: float) -> Array | None:
        """Return how far an actuator moves from each sample in `delay` [s], (N,) [m or rad]; None: nobody knows."""
        if self.motion is not None:
            return self.motion.later(self.time, self.run_labels(), actuator, delay)
        return None if self.speeds is None else delay * self.speeds[:, actuator]

    def bodies(
        self, mechanism: Mechanism, samples: np.ndarray, travel: Array | float = 0.0, later: Array | float = 0.0
    ) -> BodyMotion | None:
        """Return how a tree's bodies move at samples (n,); None where nobody knows, and of a robot with loops.

        travel (n, a) is added to the reported positions, and speeds and accelerations are those `later` [s], (n, a).
        """
        if self.motion is None or mechanism.loops:
            return None
        position = self.actuators[samples] + travel
        later = np.broadcast_to(later, position.shape)
        rates = self.motion.rates(self.time[samples], self.run_labels()[samples], later)
        return body_motion(mechanism, position, *rates)

    @property
    def elapsed(self) -> Array:
        """Time since the beginning of a sample's recording [s], (N,)."""
        return self.time - (self.time[:1] if self.began is None else self.began)

    @property
    def warming(self) -> Array:
        """Temperature above the reference [K], (N,); zero where it was not measured."""
        if self.temperature is None:
            return np.zeros(len(self))
        return np.nan_to_num(self.temperature - REFERENCE_TEMPERATURE)
