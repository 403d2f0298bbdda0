"""What a recording says of each finding's place, sample by sample: the deformation that it asks for, and the law's.

By duality a deformation of a module appears at the tool through the module's wrench Jacobian, so every measured pose
gives an estimate of it; means over neighbouring loads draw a curve through them that knows no law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.influence import Influence
from ...diagnosis.residual import whitening
from ...laws import Effect, Place
from ...laws.law import ASPECTS
from ...laws.modules_at import joint_places, lengths_of, screws, turns
from ...mechanism import Mechanism
from ...modules import DriveModule
from ...robot import Robot
from ...simulation import Simulator
from ...spatial import Array

__all__ = ["Agreement", "Recovered", "Residuals", "component_text", "curve_units", "recovered", "residuals"]

_COMPONENTS = {
    "fx": "force across, along x",
    "fy": "force across, along y",
    "fz": "force along the axis",
    "mx": "moment about x",
    "my": "moment about y",
    "mz": "torque about the axis",
}
_BINS = 8


@dataclass(frozen=True)
class Recovered:
    """A finding as the recording shows it.

    x (n,): what drives it; y (n,): the deformation (torque, travel) that each sample asks for, with its standard
    deviation (n,); law (n,): what the named law gives, or None. `knots`, `curve`, `band` (k,): means over neighbours,
    a curve that knows no law, and their standard deviation. SI; `x_unit`, `y_unit`.
    """

    finding: Finding
    x: Array
    y: Array
    deviation: Array
    law: Array | None
    knots: Array
    curve: Array
    band: Array
    x_label: str
    y_label: str
    x_unit: str
    y_unit: str
    path: bool  # what happened before matters: the law is not one line
    blocks: np.ndarray  # (n,) labels of samples between two moves of the actuators


@dataclass(frozen=True)
class Agreement:
    """A finding that no single load drives: the tool's displacement (n, 6) that the recording asks for, and the law's.

    [m, rad]; zero where nothing was measured. noise: of position and rotation.
    """

    finding: Finding
    asked: Array
    law: Array
    noise: tuple[float, float]


@dataclass(frozen=True)
class Residuals:
    """Residuals in multiples of the noise, (n, 6), whitened; zero columns where nothing was measured."""

    before: Array
    after: Array
    exists: np.ndarray


def residuals(diagnosis: Diagnosis, robot: Robot) -> Residuals | None:
    """Return the whitened residuals of a diagnosis; None where nothing was simulated."""
    found = _influence(diagnosis, robot)
    if found is None:
        return None
    white, exists = _whitening(diagnosis, found)
    before, after = ((white @ raw[..., None])[..., 0] for raw in (diagnosis.residual_before, diagnosis.residual_after))
    return Residuals(before, after, exists)


def recovered(diagnosis: Diagnosis, robot: Robot) -> list[Recovered | Agreement]:
    """Return what the recording shows of each finding; equilibrium in the deformed position is not among them."""
    influence = _influence(diagnosis, robot)
    if influence is None:
        return []
    white, exists = _whitening(diagnosis, influence)
    shown = (
        _recovered(diagnosis, robot.mechanism, influence, white, exists, finding) for finding in diagnosis.findings
    )
    return [one for one in shown if one is not None]


def component_text(mechanism: Mechanism, module: str, component: int) -> str:
    """Return what a module's load component is called, in words."""
    kind = next(item.kind for item in mechanism.modules if item.name == module)
    name = kind.loads[component]
    return _COMPONENTS.get(name, "load along the drive")


def curve_units(mechanism: Mechanism, module: str, component: int) -> tuple[str, str]:
    """Return the units of a module's load and deformation."""
    item = next(one for one in mechanism.modules if one.name == module)
    if isinstance(item.kind, DriveModule):
        return _turning(_turns(mechanism, module))
    return _turning(item.kind.loads[component].startswith("m"))


def _turns(mechanism: Mechanism, module: str) -> bool:
    return turns(mechanism, Place(module))


def _turning(turning: bool) -> tuple[str, str]:
    return ("N m", "rad") if turning else ("N", "m")


# -- estimates ---------------------------------------------------------------------------------------------------------


def _influence(diagnosis: Diagnosis, robot: Robot) -> Influence | None:
    run = diagnosis.final
    if run is None or not len(run.samples) or len(run.samples) != len(diagnosis.residual_after):
        return None
    return Influence(Simulator(robot, run.setup.inputs), run)


def _whitening(diagnosis: Diagnosis, influence: Influence) -> tuple[Array, np.ndarray]:
    # what was not measured has a residual of exactly zero in every sample
    exists = (diagnosis.residual_before != 0) | (diagnosis.residual_after != 0)
    exists &= influence.run.solved[influence.run.samples, None]
    return whitening(diagnosis.noise, influence.compliance, exists), exists


def _recovered(
    diagnosis: Diagnosis,
    mechanism: Mechanism,
    influence: Influence,
    white: Array,
    exists: np.ndarray,
    finding: Finding,
) -> Recovered | Agreement | None:
    effect = finding.effect
    if effect is None and finding.curve is None:
        return None
    asked, law = diagnosis.residual_after, None
    if effect is not None:
        others = [other for other in diagnosis.effects if other is not effect]
        law = -influence.change(influence.simulator.setup(others))
        asked = asked + law
    given = None if law is None else (white @ law[..., None])[..., 0]
    wanted = (white @ asked[..., None])[..., 0]
    best: Recovered | None = None
    most = 0.0
    for view, direction in _views(mechanism, influence, finding, effect):
        made, gain = _estimate(view, (white @ direction[..., None])[..., 0], wanted, given)
        if made is not None and gain > most:
            best, most = made, gain
    if best is not None or law is None:
        return best
    noise = diagnosis.noise.position, diagnosis.noise.rotation
    return Agreement(finding, np.where(exists, asked, 0.0), np.where(exists, law, 0.0), noise)


def _estimate(view: Recovered, direction: Array, wanted: Array, given: Array | None) -> tuple[Recovered | None, float]:
    """Return a view with estimates, and the chi squared that its curve removes."""
    weight = (direction**2).sum(axis=1)
    good = (weight > 1e-6 * weight.max(initial=0.0)) & (weight > 0)
    if good.sum() < 3:
        return None, 0.0
    x, along, weight = view.x[good], direction[good], weight[good]
    y = (along * wanted[good]).sum(axis=1) / weight
    law = None if given is None else (along * given[good]).sum(axis=1) / weight
    bins = _bins(x)
    if bins.max() < 1:
        return None, 0.0
    total = np.bincount(bins, weight)
    knots, curve = (np.bincount(bins, weight * values) / total for values in (x, y))
    left = float((weight * (y - curve[bins]) ** 2).sum())
    gain = float((weight * y**2).sum()) - left
    band = np.sqrt(max(1.0, left / max(len(x) - len(knots), 1)) / total)
    made = replace(
        view,
        x=x,
        y=y,
        deviation=1 / np.sqrt(weight),
        law=law,
        knots=knots,
        curve=curve,
        band=band,
        blocks=view.blocks[good],
    )
    return made, gain


def _bins(x: Array) -> np.ndarray:
    """Return (n,) numbers 0, 1, … of neighbouring samples: one for no load, quantiles on both sides of it."""
    reach = float(np.ptp(x))
    if not reach > 1e-9 * float(np.abs(x).max()):
        return np.zeros(len(x), int)
    sides = np.where(np.abs(x) < 2e-3 * reach, 0, np.sign(x)).astype(int)
    bins, first = np.zeros(len(x), int), 0
    for side in (-1, 0, 1):
        rows = np.flatnonzero(sides == side)
        if not len(rows):
            continue
        count = 1 if side == 0 else int(np.clip(len(rows) // 6, 1, _BINS))
        edges = np.quantile(x[rows], np.linspace(0, 1, count + 1)[1:-1])
        bins[rows] = first + np.searchsorted(np.unique(edges), x[rows], side="right")
        first = int(bins[rows].max()) + 1
    return np.unique(bins, return_inverse=True)[1].ravel()


# -- what is drawn against what ----------------------------------------------------------------------------------------


def _views(
    mechanism: Mechanism, influence: Influence, finding: Finding, effect: Effect | None
) -> list[tuple[Recovered, Array]]:
    """Return what could be drawn for a finding, still empty, each with the direction (n, 6) that it has at the tool."""

    def empty(x: Array, labels: tuple[str, str], units: tuple[str, str], path: bool = False) -> Recovered:
        none = np.zeros(0)
        blocks = influence.simulator.inputs.blocks[influence.run.samples]
        at = np.asarray(x, float)
        return Recovered(finding, at, none, none, None, none, none, none, *labels, *units, path, blocks)

    def by_load(module: str, component: int) -> tuple[Recovered, Array]:
        labels = (component_text(mechanism, module, component), "deformation beyond the model")
        made = empty(
            influence.loads(module)[:, component], labels, curve_units(mechanism, module, component), has_memory
        )
        return made, influence.signature(module)[:, :, component]

    has_memory = effect is not None and any(deed.memory for deed in effect.deeds(influence.run.setup))
    if effect is None:
        assert finding.curve is not None
        return [by_load(finding.curve.module, finding.curve.component)]
    place, samples = effect.place, influence.run.samples
    inputs = influence.simulator.inputs
    if effect.law.physics in ("coulomb_friction", "viscous_friction"):
        return _friction_views(mechanism, influence, place.name, empty)
    if place.name not in influence.rows or effect.law.physics in _OF_GEOMETRY:
        return []
    if effect.law.physics == "thermal_growth":
        warm = 20.0 + inputs.warming[samples]
        signature = influence.signature(place.name)
        if place.name in screws(mechanism):
            length = inputs.actuators[samples, screws(mechanism)[place.name][0]]
            direction = signature[:, :, 0]
        else:
            module = next(item for item in mechanism.modules if item.name == place.name)
            length = lengths_of(influence.run.setup, module)[samples]
            direction = signature[:, :, 2]
        labels, units = ("temperature", "growth per length"), ("°C", "m/m")
        return [(empty(warm, labels, units), direction * length[:, None])]
    if effect.law.physics == "lead_error":
        direction = influence.signature(place.name)[:, :, 0]
        column, lead = screws(mechanism)[place.name]
        position = inputs.actuators[samples, column]
        if place.aspect == "periodic":
            return [(empty(position % lead, ("position within a turn", "extra travel"), ("m", "m")), direction)]
        return [(empty(position, ("position of the nut", "extra travel"), ("m", "m")), direction)]
    if place.aspect in ("radial", "tilting"):
        loads, signature = influence.loads(place.name), influence.signature(place.name)
        part = loads[:, ASPECTS[place.aspect]]
        size = np.linalg.norm(part, axis=1)
        unit = part / np.maximum(size, 1e-12)[:, None]
        direction = (signature[:, :, ASPECTS[place.aspect]] @ unit[..., None])[..., 0]
        name = "radial force" if place.aspect == "radial" else "tilting moment"
        labels, units = (name, "deformation along it"), _turning(place.aspect == "tilting")
        return [(empty(size, labels, units, has_memory), direction)]
    loads = influence.loads(place.name)
    if place.aspect == "axial":
        return [by_load(place.name, 2)] if np.ptp(loads[:, 2]) > _LEAST else []
    # a beam bends and turns at once: no single load drives it
    return [by_load(place.name, 0)] if loads.shape[1] == 1 and np.ptp(loads) > _LEAST else []


#: A load that varies less does not drive anything [N, N m].
_LEAST = 1e-6
#: Laws that act at a part without being driven by its load.
_OF_GEOMETRY = ("geometric_offset", "encoder_offset", "encoder_delay")


def _friction_views(mechanism: Mechanism, influence: Influence, place: str, empty) -> list[tuple[Recovered, Array]]:
    """Return the resisting torque against the joint's motion."""
    joint = joint_places(mechanism).get(place)
    if joint is None:
        return []
    item = mechanism.model.joints[mechanism.joint_id(joint)]
    free = {int(dof): column for column, dof in enumerate(influence.chain.free)}
    if int(item.idx_v) not in free:
        return []
    turning = not item.shortname().startswith("JointModelP")
    motion = influence.found.state.travel[:, int(item.idx_v)]
    labels = ("turn of the joint", "resisting torque") if turning else ("travel of the joint", "resisting force")
    units = ("rad", "N m") if turning else ("m", "N")
    return [(empty(motion, labels, units, True), influence.by_row[:, :, free[int(item.idx_v)]])]
