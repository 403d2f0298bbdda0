"""A link that bends, which the robot file has rigid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..modules import WrenchModule
from ..numbers import number
from ..parameters import Quantity
from ..spatial import axis_as_z
from .deeds import Deed, YieldingJoint
from .follows import Followed
from .law import Law, Place
from .setup import Setup

#: Of the robot's longest link: shorter ones tilt rather than bend.
_SHORT = 0.2


class LinkBending(Law):
    """A link bends as a cantilever from its own joint, or from the base, to the one joint that it carries.

    delta = F l^3 / (3 EI) + M l^2 / (2 EI), theta = F l^2 / (2 EI) + M l / EI, alike across the straight line between
    the two joints as the robot file has them, under all that acts beyond the link. Its own weight, what it gives way by
    shear, along itself and by twist are left out. Not where the robot file describes a body that yields, such as
    a beam: whoever drew that drew what bends.
    """

    physics = "link_bending"
    summary = "a link bends that the robot file has rigid"
    called = "flexible link, column, pedestal, boom, beam"
    remedy = "give the link before {place} a beam of this stiffness in the robot file; if it should be stiff, brace it"
    source = "Gere and Timoshenko, Mechanics of Materials, app. G"
    variant = "link before"
    quantities = (Quantity("flexibility", "1/(N m^2)", "1 / EI of the link's sections", 1e-5, upper=1.0),)
    neutral: ClassVar = {"flexibility": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in _links(mechanism)]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"flexibility": value} for value in (1e-5, 1e-4, 1e-6)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield YieldingJoint(place.name, "bending", (values["flexibility"],))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        link = "before" if mechanism.model.parents[mechanism.joint(place.name).id] else "from the base to"
        stiffness = number(1 / values["flexibility"], 3) if values["flexibility"] else "inf"
        return f"the link {link} {place.name} bends, with EI = {stiffness} N m^2"


@lru_cache(maxsize=32)  # asked for at every candidate
def _links(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the joints at the ends of links that may bend."""
    if any(isinstance(module.kind, WrenchModule) and module.kind.is_body for module in mechanism.modules):
        return ()
    parents = mechanism.model.parents.tolist()
    closing = {frame.joint for loop in mechanism.loops for frame in (loop.first, loop.second)}
    links = {joint.name: mechanism.link_before(joint.name) for joint in mechanism.joints}
    lengths = {name: float(np.linalg.norm(link)) for name, link in links.items()}
    followed, found = Followed(mechanism), []
    for joint in mechanism.joints:
        parent = parents[joint.id]
        if parent in closing or parents[1:].count(parent) > 1 or joint.nv != 1:
            continue
        if lengths[joint.name] > _SHORT * max(lengths.values()):
            across = np.asarray(np.kron(np.eye(2), axis_as_z(links[joint.name])[:, :2]), float)
            if followed.seat(joint, across):
                found.append(joint.name)
    return tuple(found)
