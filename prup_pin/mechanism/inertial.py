"""The <inertial> of a URDF's link: whole or refused, for Pinocchio's reader drops half of one with a line on stderr."""

from __future__ import annotations

import numpy as np
from lxml import etree

from ..numbers import number
from .xml_file import MAX_NUMBER, Document

__all__ = ["read_inertial"]

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
#: Moments below zero by less, and sums that are too small by less, are dummies or rounded drawings [kg m^2, share].
_SMALL, _ROUNDED = 1e-5, 0.05


def read_inertial(document: Document, link: etree._Element, name: str) -> str | None:
    """Report what is wrong with a link's <inertial>; return in words what no body has, where it can be computed with.

    A body's principal moments of inertia are not negative, and none is larger than the sum of the two others.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return None
    parts = ("origin", "mass", "inertia")
    document.known_children(inertial, parts, f"inertial of link '{name}'", parts)
    origin, mass, inertia = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    if origin is not None:
        document.origin(origin, f"inertial of link '{name}'")
        document.only(origin, ("xyz", "rpy"), f"inertial of link '{name}', <origin>")
    if mass is None:
        document.problem(
            inertial, f'inertial of link \'{name}\': <mass value="…"/> is missing; without mass: value="0"'
        )
    else:
        document.only(mass, ("value",), f"mass of link '{name}'")
        value = document.numbers(mass, "value", 1, f"mass of link '{name}'", largest=MAX_NUMBER)
        if value and value[0] < 0:
            document.problem(mass, f"mass of link '{name}' is {value[0]:g} kg; expected >= 0")
    return _moments(document, inertial, inertia, name)


def _moments(document: Document, inertial: etree._Element, inertia: etree._Element | None, name: str) -> str | None:
    what = f"inertia of link '{name}'"
    missing = [key for key in _MOMENTS if inertia is None or key not in inertia.attrib]
    zeros = " ".join(f'{key}="0"' for key in missing)
    if inertia is None:
        document.problem(inertial, f"{what}: <inertia …/> is missing; where it does not matter: <inertia {zeros}/>")
    elif missing:
        lost = "readers then drop all six moments"
        document.problem(inertia, f"{what}: {', '.join(missing)} missing; {lost}. Write {zeros} if that is meant")
    if inertia is None:
        return None
    document.only(inertia, _MOMENTS, what)
    given = [document.numbers(inertia, key, 1, what, largest=MAX_NUMBER) for key in _MOMENTS if key in inertia.attrib]
    if missing or None in given:
        return None
    xx, xy, xz, yy, yz, zz = (value[0] for value in given if value)
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    lacking = max(-moments[0], moments[2] - moments[1] - moments[0])
    if lacking <= max(_SMALL, _ROUNDED * abs(moments).max()):
        return None
    return f"'{name}' (line {inertia.sourceline}: {', '.join(number(moment, 3) for moment in moments)})"
