"""A module whose equation is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..modules import ModuleGeometry
from ..modules.as_published import BeamAsPublished
from ..modules.beam import Beam
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed, ExtraStrain, Strain
from .law import Law, Place
from .modules_at import lengths_of
from .setup import Setup


class ModelEquationError(Law):
    """The coupling of deflection along y and rotation about x has the wrong sign in a beam's equation.

    Statics gives the moment about x of a tip force the arm (z + d); Eq. (90) of the source paper prints (z - d). The
    law adds `share` times the difference; 1 corrects it.
    """

    physics = "model_equation_error"
    summary = "the rods' bending about x is modelled wrongly"
    remedy = "take the correct sign of Eq. (90), the variant '3prup' and not '3prup_as_published'"
    source = "Rezaei & Akbarzadeh (2018), Eq. (90)"
    quantities = (Quantity("share", "1", "of the correction that the data ask for", 1.0, lower=-5.0, upper=5.0),)
    neutral: ClassVar = {"share": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        printed = [module for module in mechanism.modules if isinstance(module.kind, BeamAsPublished)]
        return [Place("robot", printed[0].name.rpartition("/")[2])] if printed else []

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [module.name for module in mechanism.modules if isinstance(module.kind, BeamAsPublished)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for module in setup.mechanism.modules:
            if not isinstance(module.kind, BeamAsPublished):
                continue
            given = {name: np.array([value]) for name, value in module.values.items()}
            lengths = lengths_of(setup, module)
            wrong, right = (_compliances(kind, given, lengths) for kind in (module.kind, Beam()))
            yield ExtraStrain(module.name, Strain(_missing, (values["share"] * (right - wrong),)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return "the rods' bending about x is modelled with the sign that Eq. (90) of the source paper prints"


def _compliances(kind, values, lengths: Array) -> Array:
    ends = np.array([True])
    at = ModuleGeometry(lengths[:, None], np.zeros((len(lengths), 1)), ends, ends)
    return kind.compliance(values, at, None)[:, 0]


def _missing(load: Array, difference: Array) -> tuple[Array, Array]:
    return (difference @ load[..., None])[..., 0], difference
