"""A pose sensor that stands elsewhere than believed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import rotation_exp
from .deeds import Deed, Moved, PoseReport, Wandering
from .law import Law, Place
from .setup import Setup


class PoseSensorMisalignment(Law):
    """The measuring frame is turned and shifted: it reports M p + t and M R."""

    physics = "pose_sensor_misalignment"
    summary = "a pose sensor whose frame is turned or shifted"
    remedy = (
        "measure the tracker's frame anew, or declare that it just stands there (tolerances "
        "frame_position and frame_rotation)"
    )
    quantities = (
        *(Quantity(name, "rad", f"turn about {name[1]}", 1e-3, lower=-3.2, upper=3.2) for name in ("rx", "ry", "rz")),
        *(
            Quantity(name, "m", f"shift along {name[1]}", 1e-4, lower=-100.0, upper=100.0)
            for name in ("tx", "ty", "tz")
        ),
    )
    neutral: ClassVar = {quantity.name: 0.0 for quantity in quantities}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("pose_sensor")]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        turn = rotation_exp(np.array([values["rx"], values["ry"], values["rz"]]))
        shift = np.array([values["tx"], values["ty"], values["tz"]])
        yield PoseReport(Moved.from_frame(turn, shift))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        turn, shift = (float(np.linalg.norm([values[kind + axis] for axis in "xyz"])) for kind in "rt")
        return f"the pose sensor's frame is turned by {quantity(turn, 'rad')} and shifted by {quantity(shift, 'm')}"


class PoseSensorDrift(Law):
    """The measuring frame wanders while it measures: it reports p + v t, t since the recording began.

    A tripod that settles, a tracker that warms up. Where the recording began is `pose_sensor_misalignment`'s to say.
    """

    physics = "pose_sensor_drift"
    summary = "a pose sensor whose frame wanders in time"
    remedy = "let the tracker warm up on a firm stand, and look at a fixed target before and after"
    quantities = tuple(
        Quantity(f"v{axis}", "m/s", f"shift along {axis} per time", 1e-7, lower=-1e-2, upper=1e-2) for axis in "xyz"
    )
    neutral: ClassVar = {quantity.name: 0.0 for quantity in quantities}
    lasts = False

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("pose_sensor", "drift")]

    def is_named(self, place: Place) -> bool:
        return place.aspect.startswith("drift")

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        speed = np.array([values[f"v{axis}"] for axis in "xyz"])
        yield PoseReport(Wandering(setup.inputs.elapsed[:, None] * speed))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        by = quantity(60 * float(np.linalg.norm(list(values.values()))), "m")
        return f"the pose sensor's frame wanders by {by} a minute"
