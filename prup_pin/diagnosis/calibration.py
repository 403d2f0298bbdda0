"""`calibrated`: from a robot and a recording to the likeliest value of everything that is a little off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from ..channels import Noise
from ..errors import InputError, limits_heard, postures_beyond
from ..laws import Effect
from ..recordings import Convention, Recording
from ..robot import Robot
from .calibrate import CalibratedParameter, calibrated_parameters, twins
from .conventions import read_logs
from .criteria import clean_bound
from .prepare import prepare


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """What a recording says of every parameter that may be off.

    nominal, calibrated: residual of the drawing, and within its tolerances, in multiples of the noise. `effects` are
    the calibrated values, and weight where it acts; `parameters` the best known first; `twins` are told only together.
    `conventions`: how all recordings are written, as declared or found; () where they differ.
    """

    noise: Noise
    nominal: float
    calibrated: float
    parameters: tuple[CalibratedParameter, ...]
    twins: tuple[tuple[str, ...], ...]
    effects: tuple[Effect, ...]
    samples: int
    remarks: tuple[str, ...]
    conventions: tuple[Convention, ...] = ()

    @property
    def is_explained(self) -> bool:
        """True where what is left within the tolerances may be noise."""
        return self.calibrated <= clean_bound(6 * self.samples)

    def __repr__(self) -> str:
        return (
            f"<Calibration of {len(self.parameters)} parameters on {self.samples} samples: "
            f"residual {self.nominal:.3g} -> {self.calibrated:.3g} times the noise>"
        )


def calibrated(
    robot: Robot,
    recording: Recording | Sequence[Recording],
    *,
    tell: Callable[[str, float], None] = lambda stage, share: None,
) -> Calibration:
    """Return the posterior of all toleranced parameters; no physics is looked for beside them.

    Raises InputError where nothing has a tolerance or nothing can be compared, and as `diagnose` does.
    """
    with threadpool_limits(1, user_api="blas"), limits_heard() as heard:
        declared = [recording] if isinstance(recording, Recording) else list(recording)
        logs = read_logs(robot, declared)
        every = {(*item.conventions, *own) for item, own in zip(declared, logs.conventions, strict=True)}
        prepared = prepare(robot, logs.recordings, tell)
        if not len(prepared.toleranced):
            raise InputError(
                "nothing may be off: neither the recording nor the robot file declares a tolerance. Declare some "
                "(docs/tolerances.md), or give --tolerances typical"
            )
        count = prepared.problem.count(prepared.problem.first)
        if not count:
            raise InputError("no sample with a measured pose could be simulated: there is nothing to calibrate by")
        tell("calibration within tolerances", 0.2)
        problem = prepared.within_tolerances(prepared.problem)
        assert problem.tolerances is not None
        first = problem.first
        return Calibration(
            noise=problem.noise,
            nominal=float(np.sqrt(problem.drawn.chi2 / count)),
            calibrated=float(np.sqrt(first.chi2 / count)),
            parameters=tuple(calibrated_parameters(problem, first)),
            twins=twins(problem, first),
            effects=(*problem.tolerances.at(first.x), *prepared.placed.every),
            samples=len(first.samples),
            conventions=every.pop() if len(every) == 1 else (),
            remarks=tuple(dict.fromkeys((*logs.statements, *prepared.remarks, *postures_beyond(heard)))),
        )
