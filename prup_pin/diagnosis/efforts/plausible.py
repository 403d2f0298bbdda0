"""Whether efforts and positions can be those of this robot at all: joints without a place, far beyond their limits."""

from __future__ import annotations

import numpy as np

from ...dynamics import InMotion, Motion
from ...errors import InputError
from ...numbers import number
from ...recordings.columns import LARGEST_NUMBER
from ...spatial import Array
from ..criteria import EFFORT_FEWEST, EFFORT_STRANGE, FAR_BEYOND
from .conventions import gains_apart, gains_of_efforts, left_of_efforts, sampled, shares_of_efforts

__all__ = ["CHECK_ROBOT", "check_efforts"]

#: What to do about a log that hardly fits its robot.
CHECK_ROBOT = "Check --robot, which joint each column belongs to, and whether the log holds efforts without weight"

#: Numbers that a sentence shows.
_SHOWN = 8


def check_efforts(at: InMotion, known: Array | None = None) -> list[str]:
    """Return suspicions. Raises InputError where joints cannot be where they are said to be.

    known (k,): gains of the efforts, where those are in units of their own.
    """
    _check_places(at)
    rows, motion, efforts = sampled(at)
    if len(rows) < EFFORT_FEWEST or not np.isfinite(efforts).all() or not efforts.any():
        return []
    rigid = at.rigid[rows]
    scale = np.ones(len(at.driven)) if known is None else known
    in_units = not bool((scale == 1).all())
    first = left_of_efforts(motion, efforts / scale, rigid)
    if first > EFFORT_STRANGE:
        _check_limits(at, motion, first)
    gains = {name: gain for name, gain in gains_of_efforts(motion, efforts, rigid).items() if gain > 0}
    if not in_units and gains_apart(gains):
        told = ", ".join(f"tau.{name} {number(gain, 3)}" for name, gain in list(gains.items())[:_SHOWN])
        return [
            "the efforts follow the rigid robot's, but are other multiples of them at each joint "
            f"({told}): are they in per cent or A? Expected N m or N"
        ]
    shares = shares_of_efforts(motion, efforts / scale, rigid)
    # no robot at all would leave less, and of most drives: a few report next to nothing, or are counterbalanced
    if first > 1.0 and 2 * np.sum(shares < 1) < np.isfinite(shares).sum():
        return [
            f"this log hardly fits this robot at all: the robot file leaves {number(100 * first, 3)} % of the recorded "
            "efforts, more than they are, and no other way to read the columns makes sense of them. Is it another "
            f"robot's log? {CHECK_ROBOT}"
        ]
    return []


def _check_places(at: InMotion) -> None:
    """Raise InputError where an effort was recorded of a joint whose place is neither recorded nor told by loops."""
    unseen = [name for name in at.driven if name not in at.motion.names]
    if unseen and not at.mechanism.loops:
        name = unseen[0]
        raise InputError(
            f"tau.{name} was recorded, but no q.{name}: where {name} stood is not known. Add the column, constant "
            f"where the joint is held, or leave tau.{name} out"
        )


def _check_limits(at: InMotion, motion: Motion, first: float) -> None:
    """Raise InputError where joints go far beyond their limits in the robot file."""
    model = at.mechanism.model
    for column, name in enumerate(motion.names):
        joint = at.mechanism.joint(name)
        low, high = (float(limit[joint.first_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit))
        reached = float(np.abs(motion.position[:, column]).max())
        most = max(abs(low), abs(high))
        if joint.nq == 1 and 0 < most < LARGEST_NUMBER and reached > FAR_BEYOND * most:
            unit = "rad" if joint.turns else "m"
            allowed = f"{number(low)} to {number(high)} {unit}"
            share = f"{number(100 * first, 3)} %" if first < 10 else "more than 1000 %"
            raise InputError(
                f"column q.{name} reaches {number(reached)}, but the robot file allows {allowed}, and {share} of the "
                "efforts are unexplained: are these positions of the motor before its gear, or in another unit? "
                f"Expected the joint's, in {unit}"
            )
