"""The contract of a compliant module.

A module is a stateless equation: it declares which quantities it needs and turns their values, the geometry of
the pose and, where it is nonlinear, the present load into a compliance. It knows nothing of robots.

Two kinds of load exist:

- `WrenchModule`: the wrench carried across the module, (fx, fy, fz, mx, my, mz) about the module's origin in the
  module's axes, z along its axis (a beam: from root to tip; a bearing: its axle).
- `DriveModule`: the force or torque of one joint axis, times a constant transmission ratio.

All equations broadcast: values have shape (n,) for n modules of one kind, geometry and loads (..., n) with leading
pose axes, so that a single pose is the batch of one.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..parameters import Quantity
from ..spatial import WRENCH_NAMES, Array
from .flexibility import BodyWeight, SectionFlexibilities

Values = Mapping[str, Any]
Mask = NDArray[np.bool_]


class ModuleGeometry(NamedTuple):
    """What a pose tells the modules of one kind.

    `length` [m] from root to tip and `position` [m or rad] of the joint are (..., n). `inboard_is_root` (n,) tells
    which end is nearer to the ground; `anchored_at_tip` (n,) which end is fixed in the material, so that a body
    longer than the span reaches beyond the other one.
    """

    length: Array
    position: Array
    inboard_is_root: Array
    anchored_at_tip: Array


class CompliantModule(ABC):
    """A kind of compliant part. Final subclasses are listed in `modules.KINDS`."""

    #: The word robot files use.
    kind: ClassVar[str]
    #: One sentence for documentation and `prup-pin info`.
    summary: ClassVar[str]
    #: What the load components are called.
    loads: ClassVar[tuple[str, ...]]
    #: True for bodies, False for joints, as the paper divides them (Eq. 18).
    is_body: ClassVar[bool] = False
    #: True where the module needs the frames `root` and `tip`.
    spans_frames: ClassVar[bool] = False
    #: True where the compliance depends on the load.
    nonlinear: ClassVar[bool] = False
    #: True where the compliance depends on the joint's position.
    follows_joint: ClassVar[bool] = False
    #: True for a beam whose section law holds along its deformed line, so that it can be followed under any load.
    bends_exactly: ClassVar[bool] = False
    quantities: ClassVar[tuple[Quantity, ...]] = ()

    @property
    def constant(self) -> bool:
        """True where the compliance depends on neither pose nor load, so that it is computed once."""
        return not (self.spans_frames or self.follows_joint or self.nonlinear)

    def prepare(self, values: Values) -> Values:
        """Return the values with constants of the equation added, so that they are computed once per robot.

        `compliance` takes values with or without them.
        """
        return values

    @abstractmethod
    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        """Return d(deformation)/d(load), (..., n, k, k), at `load` (..., n, k); None means unloaded."""

    def deformation(self, values: Values, at: ModuleGeometry, load: Array) -> Array:
        """Return the deformation conjugate to `load`, (..., n, k)."""
        return (self.compliance(values, at, None) @ load[..., None])[..., 0]

    def weight_deformation(self, values: Values, at: ModuleGeometry, gravity: Array) -> Array:
        """Return the correction (..., n, k) for a weight that is spread along the module.

        `gravity` (..., n, 3) [m/s^2] in module axes. See `flexibility.own_weight_deformation`.
        """
        return np.zeros((*gravity.shape[:-1], len(self.loads)))

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight | None:
        """Return mass and centre of the body whose weight this module carries, or None for a weightless kind."""
        return None

    def section_law(self, values: Values, at: ModuleGeometry) -> SectionFlexibilities | None:
        """Return a beam's flexibilities along its length, from which its elastic line follows, or None."""
        return None

    def line_density(self, values: Values, at: ModuleGeometry) -> Callable[[Array], Array]:
        """Return a beam's mass per length [kg/m] as a function of the distances (..., n, points) from the tip."""
        return lambda u: np.zeros_like(u)

    def holds_joint(self, values: Values) -> bool:
        """Return True where the module carries a load along its joint's own axis, so that the joint is not free."""
        return False

    def problems(self, values: Values, at: ModuleGeometry) -> Mask | None:
        """Return a mask of modules whose equation does not hold at this geometry, or None."""
        return None

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        """Return what is wrong with module `index` of the batch, in words."""
        return "outside its range"


def defects(kind: CompliantModule) -> Iterator[str]:
    """Yield in words what a kind of module does not declare, or declares so that no robot file can name it."""
    for name in ("kind", "summary"):
        if not (isinstance(text := getattr(kind, name, None), str) and text.strip()):
            yield f"{name} is {text!r}; expected a text"
    word = getattr(kind, "kind", "")
    if isinstance(word, str) and word and not re.fullmatch(r"[a-z][a-z0-9_]*", word):
        yield f"kind is {word!r}; expected a word of lower-case letters, digits and _"
    if isinstance(kind, WrenchModule) == isinstance(kind, DriveModule):
        yield "expected either a WrenchModule or a DriveModule"
    quantities = kind.quantities
    if not (isinstance(quantities, tuple) and all(isinstance(item, Quantity) for item in quantities)):
        yield f"quantities is {quantities!r}; expected a tuple of Quantity"
        return
    yield from (text for quantity in quantities for text in quantity.defects(needs_start=False))
    names = [quantity.name for quantity in quantities]
    if len(set(names)) < len(names):
        yield f"quantities share a name: {', '.join(names)}"
    for quantity in quantities:
        if unknown := set(quantity.derived_from) - set(names):
            yield f"quantity '{quantity.name}' is derived from {', '.join(unknown)}, which is no quantity of it"


class WrenchModule(CompliantModule):
    """A module loaded by the wrench across it, in module axes: u, v across, w along the module's axis."""

    loads = WRENCH_NAMES


class DriveModule(CompliantModule):
    """A module loaded through one joint axis: load = ratio x joint force (or torque)."""

    loads = ("axial",)

    def ratio(self, values: Values) -> Array | float:
        """Return load per joint force, (n,)."""
        return 1.0


def diagonal(*entries: Array) -> Array:
    """Return (..., k, k) diagonal matrices from k arrays that broadcast together."""
    if len(entries) == 1:
        return entries[0][..., None, None]
    columns = np.broadcast_arrays(*entries)
    matrix = np.zeros((*columns[0].shape, len(columns), len(columns)))
    for i, column in enumerate(columns):
        matrix[..., i, i] = column
    return matrix


def required(name: str, unit: str, description: str, **options: Any) -> Quantity:
    """Return a quantity without default."""
    return Quantity(name, unit, description, **options)


def or_rigid(name: str, unit: str, description: str) -> Quantity:
    """Return a stiffness that is infinite where the robot file does not give it."""
    return Quantity(name, unit, description, default=np.inf)
