"""A drive that loses its load for a moment whenever the motion turns round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import MovingEffortLaw, columns_along, joint_unit

#: Shares of a joint's travel among which the gap is looked for.
_SHARES = (5e-4, 2e-3, 8e-3, 3e-2)


class LostLoad(MovingEffortLaw):
    """tau = -s tau_bodies on the way through a gap: the motor turns alone until the other flank bears.

    Position is the motor's. The blow at the end of the gap is not modelled; s = 1 loses all that bodies ask for.
    """

    physics = "backlash"
    summary = "a gap in which the drive loses its load"
    remedy = "take out the play at {place}: check its preload first, then the gear for wear"
    of_motion = True
    of_history = True
    of_what_is_known = True
    linear = ("share",)
    one_sided = True
    quantities = (
        Quantity("share", "", "of the load that is lost in the gap", 1.0, positive=False, upper=1.5),
        Quantity("gap", "rad", "from flank to flank", 1e-3, upper=10.0),
    )

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        travel = float(np.ptp(at.position(place.name)))
        return [{"gap": share * travel} for share in _SHARES]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"gap": values["gap"] * factor} for factor in (0.6, 0.8, 1.0, 1.25, 1.6)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        lost = at.loose(place.name, values["gap"]) * at.effort_of(place.name, at.borne)
        return -columns_along(at, place.name, lost)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        gap = quantity(values["gap"], joint_unit("rad", place.name, mechanism))
        return (
            f"{place.name} has {gap} of backlash, in which the drive loses "
            f"{number(100 * values['share'], 3)} % of its load"
        )
