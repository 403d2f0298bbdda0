"""What is a little off on a concealed device, and how large an effect is beside it.

A machine names its parameters and the key of each one's tolerance; every parameter is drawn for itself, Gaussian with
its tolerance as standard deviation. An effect is as large as what is left of it after the best fit of all parameters
with their tolerances as priors, by finite differences of the machine itself: of what ordinary scatter can imitate, only
the rest counts, and by how many tolerances the imitation is strained.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .rotations import matrix, vector

#: One standard deviation of each kind of parameter, as a good workshop leaves a robot. Relative, m or rad.
ORDINARY: dict[str, float] = {
    "stiffness": 0.1,
    "bending": 0.03,
    "mass": 0.1,
    "position": 5e-5,
    "direction": 2e-4,
    "encoder_slope": 1e-4,
    "encoder_offset": 5e-5,
    "frame_position": 3e-4,
    "frame_rotation": 1e-3,
    "target_position": 3e-4,
    "target_rotation": 1e-3,
    "wrench_gain": 0.01,
    "wrench_rotation": 0.005,
}
#: Differences are taken over this share of a tolerance.
_STEP = 0.2
#: From so many tolerances on a parameter is no longer within tolerance.
BEYOND = 3.0
#: A parameter beyond three tolerances was drawn with one of its own: so many of them count as one.
TOLERANCES_TO_ONE = 2.0


def draw_scatter(rng, parameters: Mapping[str, str], tolerances: Mapping[str, float]) -> dict[str, float]:
    """Return by how much each parameter is off, in the unit of its tolerance; none where no tolerance is given.

    What would be beyond three tolerances is drawn again: that is no scatter but something to be found.
    """
    drawn = {name: float(rng.normal()) for name in parameters}
    for name in drawn:
        while abs(drawn[name]) > BEYOND:
            drawn[name] = float(rng.normal())
    return {name: tolerances[kind] * drawn[name] for name, kind in parameters.items() if kind in tolerances}


class Yardstick:
    """Sizes of effects in one bench test of a machine whose parameters have tolerances.

    `machine(effects, scatter=...)` makes one; `always` are effects that act on every one and that everybody knows of.
    `measure(machine, run)` returns what the bench records without noise: q, w, p, r.
    """

    def __init__(
        self,
        machine: Callable[..., Any],
        measure: Callable[..., dict[str, np.ndarray]],
        run: Any,
        parameters: Mapping[str, str],
        tolerances: Mapping[str, float],
        noise: Mapping[str, float],
        always: Any = (),
    ):
        self.machine, self.measure, self.run, self.always = machine, measure, run, tuple(always)
        self.noise = np.array([noise["position"]] * 3 + [noise["rotation"]] * 3)
        self.known = machine(self.always)
        self.nominal = self.known.simulate(run.q, run.w, run.temperature, run.time)
        self.names = [name for name, kind in parameters.items() if tolerances.get(kind)]
        columns = []
        for name in self.names:
            step = _STEP * tolerances[parameters[name]]
            moved = self.beyond(machine(self.always, scatter={name: step}))
            columns.append(moved.ravel() / _STEP)
        #: What each parameter changes by one tolerance, (samples x 6, parameters), in multiples of the noise.
        self.by_tolerance = np.stack(columns, -1) if columns else np.zeros((6 * len(run.q), 0))
        self._normal = self.by_tolerance.T @ self.by_tolerance + np.eye(len(self.names))

    def beyond(self, device: Any) -> np.ndarray:
        """Return measured less expected poses (N, 6), in multiples of the noise, without noise."""
        seen, run = self.measure(device, self.run), self.run
        told = [seen["q"], seen["w"]]
        expected = self.nominal
        if not ((told[0] == run.q).all() and (told[1] == run.w).all()):
            expected = self.known.simulate(*told, run.temperature, run.time)
        turned = vector(matrix(seen["r"]) @ matrix(expected.r).swapaxes(-1, -2))
        return np.hstack([seen["p"] - expected.p, turned]) / self.noise

    def left(self, effects: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what the best fit of all parameters leaves of the effects (N, 6), and the fit, in tolerances."""
        whole = self.beyond(self.machine((*self.always, *effects)))
        fitted = np.linalg.solve(self._normal, self.by_tolerance.T @ whole.ravel())
        return whole - (self.by_tolerance @ fitted).reshape(whole.shape), fitted

    def strength(self, effects: Any) -> np.ndarray:
        """Return the size of effects (7,): RMS of what is left by channel, and how far the tolerances are strained.

        The first six in multiples of the noise. The last is the length of the fit in tolerances, halved: a parameter
        is beyond tolerance from three on, and may itself be one off to either side.
        """
        left, fitted = self.left(effects)
        return np.append(np.sqrt((left**2).mean(0)), np.linalg.norm(fitted) / TOLERANCES_TO_ONE)
