"""A robot file in the making: links, joints and a <prup_pin> element, with comments, one call each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ..errors import InputError
from ..mechanism import Mechanism
from ..mechanism.readers import read_content
from ..robot import Robot
from ..spatial import Array

STEEL_MODULUS, STEEL_DENSITY = 206e9, 7850.0  # Pa, kg/m^3
_POISSON = 0.3
_ORIGIN = (0.0, 0.0, 0.0)
#: No robot of these families has a longer part [m].
_LONGEST = 20.0
#: A turn that nothing stops; URDF asks for limits.
_LIMIT = 3.1


def positive(**values: float) -> None:
    """Raise InputError where one of the named values is not a finite number above zero."""
    for name, value in values.items():
        try:
            fits = 0 < float(value) < np.inf
        except (TypeError, ValueError):
            fits = False
        if not fits:
            raise InputError(f"{name} = {value!r}: expected a number > 0, in SI units")


def in_metres(**lengths: float) -> None:
    """Raise InputError where one of the named lengths is none, or so long that it can only be in millimetres."""
    positive(**lengths)
    for name, value in lengths.items():
        if float(value) > _LONGEST:
            raise _millimetres(name, value, "longer than any part of such a robot")


def thinner(length: float, **diameter: float) -> None:
    """Raise InputError where the named diameter is no length, or larger than the `length` [m] of its bar."""
    in_metres(**diameter)
    for name, value in diameter.items():
        if float(value) > length:
            raise _millimetres(name, value, f"more than its bar is long, {length:g} m")


def _millimetres(name: str, value: float, why: str) -> InputError:
    return InputError(
        f"{name} = {value:g} m is {why}: is it in millimetres? Lengths are in metres: {name}={float(value) / 1e3:g}"
    )


class Shape(NamedTuple):
    """What a link weighs like, in words, and its inertia (3, 3) about its centre, base axes at home [kg m^2]."""

    words: str
    inertia: Array


def round_bar(mass: float, line: Array, diameter: float) -> Shape:
    """Return a uniform round bar along a line (3,) [m]: m d^2/8 about it, m (l^2/12 + d^2/16) across."""
    length = float(np.linalg.norm(line))
    along = np.outer(line, line) / length**2
    across = mass * (length**2 / 12 + diameter**2 / 16)
    return Shape("uniform round bars", mass * diameter**2 / 8 * along + across * (np.eye(3) - along))


def disc(mass: float, radius: float) -> Shape:
    """Return a thin disc about z: m r^2/2, across m r^2/4."""
    return Shape("thin discs about z", mass * radius**2 / 4 * np.diag([1.0, 1.0, 2.0]))


def bar_mass(length: float, diameter: float, density: float) -> float:
    """Return the mass of a round bar [kg]."""
    return density * np.pi / 4 * diameter**2 * length


def _words(values: Iterable[float]) -> str:
    # Fifteen digits: no 0.30000000000000004, and rods' ball joints still turn about the line between them to rounding.
    return " ".join(f"{float(value) + 0.0:.15g}" for value in np.round(np.ravel(np.asarray(values, float)), 15))


class UrdfFile:
    """Collects the lines of a robot file. All lengths in m, angles in rad, masses in kg."""

    def __init__(self, name: str, about: str):
        self.name = name
        self._about = about
        self._tree: list[str] = []
        self._extension: list[str] = []
        self._shapes: dict[str, list[str]] = {}

    def comment(self, text: str, of: str = "tree") -> None:
        """Add a comment to the tree, or to the extension."""
        lines = self._tree if of == "tree" else self._extension
        indent = "  " if of == "tree" else "    "
        lines += ["", f"{indent}<!-- {text} -->"]

    def link(
        self, name: str, mass: float = 0.0, centre: Sequence[float] | Array = _ORIGIN, shape: Shape | None = None
    ) -> str:
        """Add a link, with the inertia of its shape where it has a mass; `text` says of which."""
        if mass == 0 or shape is None:
            self._tree.append(f"  <link name={quoteattr(name)}/>")
            return name
        self._shapes.setdefault(shape.words, []).append(name)
        entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
        inertia = " ".join(f'{key}="{shape.inertia[at] + 0.0:.12g}"' for key, at in entries.items())
        self._tree.append(
            f'  <link name={quoteattr(name)}><inertial><origin xyz="{_words(centre)}"/><mass value="{mass:.9g}"/>'
            f"<inertia {inertia}/></inertial></link>"
        )
        return name

    def joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        xyz: Sequence[float] | Array = _ORIGIN,
        rpy: Sequence[float] = _ORIGIN,
        axis: Sequence[float] | Array = (0.0, 0.0, 1.0),
        limits: tuple[float, float] = (-_LIMIT, _LIMIT),
    ) -> str:
        """Add a joint between two links that are there."""
        turned = f' rpy="{_words(rpy)}"' if np.any(rpy) else ""
        moving = ""
        if kind != "fixed":
            low, high = limits
            moving = (
                f'<axis xyz="{_words(axis)}"/><limit lower="{low:.9g}" upper="{high:.9g}" effort="1e6" velocity="10"/>'
            )
        self._tree.append(
            f'  <joint name={quoteattr(name)} type="{kind}"><parent link={quoteattr(parent)}/>'
            f'<child link={quoteattr(child)}/><origin xyz="{_words(xyz)}"{turned}/>{moving}</joint>'
        )
        return name

    def frame(self, name: str, parent: str, xyz: Sequence[float] | Array = _ORIGIN) -> str:
        """Add a massless link fixed to another one."""
        self.link(name)
        self.joint(name, "fixed", parent, name, xyz)
        return name

    def tool(self, frame: str, part: str, actuated: Sequence[str], tasks: Mapping[str, str]) -> None:
        """Say which frame is loaded, which joints are driven, which components of the tool's pose are given."""
        coordinates = "".join(f'<coordinate name="{name}" component="{task}"/>' for name, task in tasks.items())
        home = " ".join(f'{name}="0"' for name in actuated)
        self._extension += [
            f"    <tool frame={quoteattr(frame)} part={quoteattr(part)}/>",
            f'    <actuated joints="{" ".join(actuated)}"/>',
            f'    <task_coordinates rotation="xyz">{coordinates}</task_coordinates>',
            f"    <home {home}/>",
        ]

    def loop(self, name: str, first: str, second: str, free: str) -> None:
        """Close a loop between two frames; `free` lists the motions between them."""
        self._extension.append(
            f'    <loop name={quoteattr(name)} frame1={quoteattr(first)} frame2={quoteattr(second)} free="{free}"/>'
        )

    def module(self, name: str, kind: str, joint: str, values: Mapping[str, tuple[float, str]], **places: str) -> None:
        """Add a compliant module: its values with their units, and where it sits."""
        at = "".join(f" {key}={quoteattr(value)}" for key, value in places.items())
        self._extension.append(f'    <module name={quoteattr(name)} type="{kind}" joint={quoteattr(joint)}{at}>')
        for short, (value, unit) in values.items():
            self._extension.append(f'      <parameter name="{short}" value="{value:.12g}" unit="{unit}"/>')
        self._extension.append("    </module>")

    def spring(self, name: str, joint: str, stiffness: float, unit: str) -> None:
        """Add a spring along a joint's axis."""
        self.module(name, "joint_spring", joint, {"stiffness": (stiffness, unit)})

    def bar(self, name: str, joint: str, root: str, tip: str, diameter: float, modulus: float) -> None:
        """Add a round bar that bends, stretches and twists, from `root` on the fixed side of a joint to `tip`."""
        shear = modulus / (2 * (1 + _POISSON))
        values = {"diameter": (diameter, "m"), "youngs_modulus": (modulus, "Pa"), "shear_modulus": (shear, "Pa")}
        self.module(name, "beam", joint, values, root=root, tip=tip)

    def text(self) -> str:
        """Return the whole file."""
        inertias = [f"{words}: {', '.join(names)}" for words, names in self._shapes.items()]
        notes = [f"    <note>{escape(f'inertias are those of {text}')}</note>" for text in inertias]
        lines = [
            '<?xml version="1.0"?>',
            "<!--",
            *(f"  {line}".rstrip() for line in self._about.strip("\n").splitlines()),
            "-->",
            f"<robot name={quoteattr(self.name)}>",
            *self._tree,
            "",
            '  <prup_pin version="1">',
            *self._extension,
            *notes,
            "  </prup_pin>",
            "</robot>",
        ]
        return "\n".join(lines) + "\n"

    def robot(self) -> Robot:
        """Return the robot that the file stands for."""
        description = read_content(self.text().encode(), Path(f"{self.name}.urdf"))
        return Robot(Mechanism(description)).prepared()
