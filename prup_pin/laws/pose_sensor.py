"""A pose sensor that stands elsewhere than believed, or measures lengths by another scale."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from ..spatial import Array, rotation_exp, rotation_log
from .deeds import Deed, Moved, PoseReport, Wandering
from .in_recording import InRecording
from .law import Effect, Law, Place, Sharing
from .setup import Setup


class PoseSensorMisalignment(Law):
    """The measuring frame is turned and shifted: it reports M p + t and M R."""

    physics = "pose_sensor_misalignment"
    summary = "a pose sensor whose frame is turned or shifted"
    called = "tracker, camera"
    sensor = "pose_sensor"
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


def stands_elsewhere(turn: Array, shift: Array, group: Sharing | None, mechanism: Mechanism) -> Effect:
    """Return the effect of a pose sensor whose frame is turned (3, 3) and shifted (3,) [m]; group: in which recordings.

    Its parameters are the rotation vector [rad] and the shift, in this order.
    """
    law = PoseSensorMisalignment() if group is None else InRecording(PoseSensorMisalignment(), group)
    numbers = map(float, (*rotation_log(turn[None])[0], *shift))
    values = dict(zip((quantity.name for quantity in law.quantities), numbers, strict=True))
    return Effect(law, law.places(mechanism)[0], values)


class PoseSensorDrift(Law):
    """The measuring frame wanders while it measures: it reports p + v t, t since the recording began.

    A tripod that settles, a tracker that warms up. Where the recording began is `pose_sensor_misalignment`'s to say.
    """

    physics = "pose_sensor_drift"
    summary = "a pose sensor whose frame wanders in time"
    sensor = "pose_sensor"
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

    def meanwhile(self, values: Mapping[str, float], mechanism: Mechanism, elapsed: float) -> Effect | None:
        shift = elapsed * np.array([values[f"v{axis}"] for axis in "xyz"])
        return stands_elsewhere(np.eye(3), shift, None, mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        by = quantity(60 * float(np.linalg.norm(list(values.values()))), "m")
        return f"the pose sensor's frame wanders by {by} a minute"


class PoseSensorScale(Law):
    """The pose sensor has all positions too large by one share: it reports (1 + e) p and R.

    From the origin of its frame, and of all that it sees alike. A tracker whose wavelength is that of other air, a
    camera with another focal length or distance, a scale bar that is not as long as believed.
    """

    physics = "pose_sensor_scale"
    summary = "a pose sensor that reports all lengths too long or too short"
    called = "tracker, camera, scale bar, ppm, magnification"
    source = "ASME B89.4.19, laser trackers"
    sensor = "pose_sensor"
    remedy = "calibrate the pose sensor on a known length, or divide all its positions by 1 + this error"
    quantities = (Quantity("error", "1", "share by which all lengths are too long", 1e-4, lower=-0.1, upper=0.1),)
    neutral: ClassVar = {"error": 0.0}
    unremarkable: ClassVar = {"error": 5e-6}  # no sensor is certified for less than some micrometres a metre

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("pose_sensor")]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield PoseReport(Moved.scaled(1.0 + values["error"]))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        way = "long" if values["error"] > 0 else "short"
        return f"the pose sensor reports all lengths {number(100 * abs(values['error']), 3)} % too {way}"
