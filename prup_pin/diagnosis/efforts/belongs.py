"""Does a log of efforts belong to this robot at all?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...dynamics import InMotion, Motion
from ...errors import InputError
from ...numbers import number
from ...recordings.columns import LARGEST_NUMBER
from ...spatial import Array
from ..criteria import FAR_LESS, FEWEST_NUMBERS, MOST_LISTED, MUCH
from .shares import gains_apart, gains_of_efforts, rms, sampled, shares_of_efforts, tool_load_would_do

#: What to do about a log that hardly fits its robot.
CHECK_ROBOT = (
    "check --robot, which joint each column belongs to and which way that counts, and whether the log holds efforts "
    "without weight"
)


class Doubt(NamedTuple):
    """A suspicion of how a log is meant, in words; of_robot: whether it is another robot's, before all else."""

    text: str
    of_robot: bool = False


def check_efforts(at: InMotion, known: Array | None = None) -> list[Doubt]:
    """Return suspicions. Raises InputError where joints cannot be where they are said to be.

    known (k,): gains of the efforts, where those are in units of their own.
    """
    _check_places(at)
    rows, motion, efforts = sampled(at)
    if len(rows) < FEWEST_NUMBERS or not np.isfinite(efforts).all() or not efforts.any():
        return []
    rigid = at.rigid[rows]
    scale = np.ones(len(at.driven)) if known is None else known
    in_units = not bool((scale == 1).all())
    shares = shares_of_efforts(motion, efforts / scale, rigid)
    first = rms(shares)
    if first > FAR_LESS:
        _check_limits(at, motion, first)
    gains = {name: gain for name, gain in gains_of_efforts(motion, efforts, rigid).items() if gain > 0}
    if not in_units and gains_apart(gains) and not tool_load_would_do(at, gains):
        told = ", ".join(f"tau.{name} {number(gain, 3)}" for name, gain in list(gains.items())[:MOST_LISTED])
        text = (
            "the efforts follow the rigid robot's, but are other multiples of them at each joint "
            f"({told}): are they in per cent or A? Expected N m or N; where gains are not known, declare "
            '"tolerances": {"effort_gain": 1} in the JSON file beside the log'
        )
        return [Doubt(text)]
    # no robot at all would leave less, and of most drives: a few report next to nothing, or are counterbalanced
    if first > 1.0 and 2 * np.sum(shares < 1) < np.isfinite(shares).sum():
        text = (
            f"this log hardly fits this robot: the residual of the robot file is {number(100 * first, 3)} % of the "
            "recorded efforts, more than the efforts themselves, and no other way that was tried to read them makes "
            f"sense of them. Is it another robot's log? First {CHECK_ROBOT}."
        )
        return [Doubt(text, of_robot=True)]
    return []


def _check_places(at: InMotion) -> None:
    """Raise InputError where an effort was recorded of a joint whose place is neither recorded nor told by loops."""
    unseen = [name for name in at.driven if name not in at.motion.names]
    if unseen and not at.mechanism.loops:
        raise InputError(
            "\n".join(
                f"tau.{name} was recorded, but no q.{name}: where {name} stood is not known. Add the column, constant "
                f"where the joint is held, or leave tau.{name} out"
                for name in unseen
            )
        )


def _check_limits(at: InMotion, motion: Motion, first: float) -> None:
    """Raise InputError where joints go far beyond their limits in the robot file."""
    model = at.mechanism.model
    for column, name in enumerate(motion.names):
        joint = at.mechanism.joint(name)
        low, high = (float(limit[joint.first_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit))
        reached = float(np.abs(motion.position[:, column]).max())
        most = max(abs(low), abs(high))
        if joint.nq == 1 and 0 < most < LARGEST_NUMBER and reached > MUCH * most:
            unit, word = ("rad", "deg") if joint.turns else ("m", "mm")
            other = (
                f"where all are in {word}: --convention q={word}; before a gear of 100: --convention q.{name}=gear:100"
            )
            allowed = f"{number(low)} to {number(high)} {unit}"
            share = f"{number(100 * first, 3)} %" if first < 10 else "more than 1000 %"
            raise InputError(
                f"column q.{name} reaches {number(reached)}, but the robot file allows {allowed}, and {share} of the "
                "efforts are unexplained: are these positions of the motor before its gear, or in another unit? "
                f"Expected the joint's, in {unit}; {other}"
            )
