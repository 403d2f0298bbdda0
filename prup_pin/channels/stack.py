"""All that was measured, side by side: residuals, first-order changes and noise of a stack of channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..laws import Setup
from ..laws.deeds import Solved
from ..mechanism import Frame, Mechanism
from ..recordings import Recording
from ..simulation import Run
from ..spatial import Array, rotation_exp
from .channel import Channel, Columns
from .linear import Linear
from .noise import Noise
from .pose import PoseChannel
from .stations import Placing, Stations, motions_of_stations


def channels_of(recording: Recording, mechanism: Mechanism) -> tuple[Channel, ...]:
    """Return what a recording measured of a robot: the tool's pose, and the markers that are its frames."""
    found: list[Channel] = [PoseChannel.of_tool(recording, mechanism.need_tool())]
    names = [name for name in recording.marker_names if name in mechanism.frame_names]
    found += [PoseChannel.of_marker(recording, mechanism.frame(name)) for name in names]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Stack:
    """Channels side by side: N samples of K columns.

    stations: from which the pose sensor saw the samples, where it was set up anew between them.
    """

    channels: tuple[Channel, ...]
    stations: Stations | None = None

    @cached_property
    def exists(self) -> np.ndarray:
        """Which numbers were measured, (N, K)."""
        return np.concatenate([channel.exists for channel in self.channels], axis=1)

    def of_those(self, exists: np.ndarray) -> Stack:
        """Return the same where only some numbers were measured, exists (N, K)."""
        parts = np.split(exists, np.cumsum([channel.size for channel in self.channels])[:-1], axis=1)
        channels = tuple(
            replace(channel, exists=own) if isinstance(channel, PoseChannel) else channel
            for channel, own in zip(self.channels, parts, strict=True)
        )
        return replace(self, channels=channels)

    @property
    def poses(self) -> tuple[PoseChannel, ...]:
        """The tool's pose and those of markers."""
        return tuple(channel for channel in self.channels if isinstance(channel, PoseChannel))

    @property
    def size(self) -> int:
        """Number of columns, K."""
        return int(self.exists.shape[1])

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """The frames that first-order changes must watch; each channel's stand together."""
        return tuple(frame for channel in self.channels for frame in channel.frames)

    def _parts(self, watched: Array) -> list[Array]:
        """Return rows (n, 6 frames, …) of each channel's frames."""
        ends = np.cumsum([6 * len(channel.frames) for channel in self.channels])[:-1]
        return np.split(watched, ends, axis=1)

    def residual(self, run: Run) -> Array:
        """Return measured less simulated, (N, K); zero where nothing was measured or simulated.

        Less what may be the stations' own: the best motion of each is found by turns as large as they are.
        """
        left = _joined([channel.residual(run) for channel in self.channels])
        placing = self.placing(run, np.flatnonzero(run.solved))
        if placing is None:
            return left
        stack, motion = self, np.zeros((int(run.solved.sum()), 6))
        for _ in range(_PLACED):
            step = placing.best(left[run.solved])
            stack, motion = stack.moved(step, run.solved), motion + step
            left = _joined([channel.residual(run) for channel in stack.channels])
        left[run.solved] = placing.without(placing.moved(left[run.solved], motion))
        return left

    def residual_of_start(self, linear: Linear) -> Array:
        """Return the same against the simulation that a user starts from, with stations where they were registered."""
        return _joined([channel.residual_of_start(linear) for channel in self.channels])

    def placing(self, run: Run, samples: np.ndarray) -> Placing | None:
        """Return what motions of the stations do at samples (n,) of a run; None where the sensor stood in one place."""
        if self.stations is None:
            return None
        return self.stations.placing(samples, self.by_station(run, samples), self.angles)

    def by_station(self, run: Run, samples: np.ndarray) -> Array:
        """Return the change of the columns at samples (n,) per turn and shift of their station, (n, K, 6)."""
        parts = [
            motions_of_stations(run.pose_of(channel.frame)[0][samples])
            if isinstance(channel, PoseChannel)
            else np.zeros((len(samples), channel.size, 6))
            for channel in self.channels
        ]
        return _joined(parts) * self.exists[samples][..., None]

    @cached_property
    def angles(self) -> np.ndarray:
        """Which columns are angles, (K,)."""
        angles = np.zeros(self.size, bool)
        for group in self.groups():
            angles[group.where] = group.unit == "rad"
        return angles

    def moved(self, motion: Array, rows: np.ndarray) -> Stack:
        """Return what was measured at samples `rows` (N,) as seen from stations turned and shifted back by (n, 6)."""
        turn = rotation_exp(motion[:, :3]).mT

        def seen(channel: Channel) -> Channel:
            if not isinstance(channel, PoseChannel):
                return channel
            position, rotation = channel.position.copy(), channel.rotation.copy()
            position[rows] = (turn @ (position[rows] - motion[:, 3:])[..., None])[..., 0]
            rotation[rows] = turn @ rotation[rows]
            return replace(channel, position=position, rotation=rotation)

        return replace(self, channels=tuple(seen(channel) for channel in self.channels))

    def seen(self, watched: Array) -> Array:
        """Return what all columns see of small motions of `frames` (n, 6 frames, …): (n, K, …)."""
        parts = self._parts(watched) if len(self.channels) > 1 else [watched]
        return _joined([channel.seen(part) for channel, part in zip(self.channels, parts, strict=True)])

    def change(self, setup: Setup, at: Solved, moved: Array) -> Array:
        """Return the change of what is reported (n, K) from a solved setup to another one; see `Channel.change`."""
        parts = self._parts(moved) if len(self.channels) > 1 else [moved]
        return _joined([channel.change(setup, at, part) for channel, part in zip(self.channels, parts, strict=True)])

    def deviation(self, noise: Noise) -> Array:
        """Return the standard deviation of each column, (K,)."""
        return np.concatenate([channel.deviation(noise) for channel in self.channels])

    def whiteners(self, noise: Noise, by_wrench: Array, exists: np.ndarray, samples: np.ndarray | None = None) -> Array:
        """Return W (n, K, K) with cov(W r) = 1 for residuals of noise alone: the sensors', and the wrench sensor's.

        by_wrench (n, K, 6): how the columns change with the wrench. samples (n,): which ones these are, where noise
        differs between recordings.
        """
        white = np.empty((*exists.shape, exists.shape[1]))
        for part, rows in noise.parts(samples):
            white[rows] = whitening(self.deviation(part), part.wrench, by_wrench[rows], exists[rows])
        return white

    def groups(self) -> tuple[Columns, ...]:
        """Return all columns in groups of one unit: 'position', 'rotation', 'marker elbow position', …."""
        found, start = [], 0
        for channel in self.channels:
            for name, unit, where in channel.columns:
                full = name if channel is self.channels[0] else f"{channel.name} {name}"
                found.append(Columns(full, unit, slice(start + where.start, start + where.stop)))
            start += channel.size
        return tuple(found)


#: Steps in which stations are placed: each leaves the square of the turn that the last one found.
_PLACED = 3


def _joined(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def whitening(deviation: Array, wrench: Array, by_wrench: Array, exists: np.ndarray) -> Array:
    """Return W (n, K, K) with cov(W r) = 1 for residuals r of noise alone; rows of what is missing are zero.

    deviation (K,) of the columns; wrench (6,) of the wrench sensor's components, which reach the columns by
    by_wrench (n, K, 6): S = S_columns + G S_wrench G^T; exists (n, K).
    """
    covariance = np.diag(deviation**2) + (by_wrench * wrench**2) @ by_wrench.mT
    missing = ~exists
    # A missing column is decoupled before factoring, and weighs nothing afterwards.
    covariance = np.where(missing[:, :, None] | missing[:, None, :], 0.0, covariance)
    index = np.arange(len(deviation))
    covariance[:, index, index] += missing * 1.0
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    return np.where(missing[:, :, None], 0.0, inverse)
