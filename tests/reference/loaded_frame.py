"""Independent references for the 3-PRUP robot under loads that bend it far enough to change its geometry.

The same robot, parameters and units as `frame_fe` (SI: m, N, rad), now with equilibrium in the deformed position.
It is assembled stress-free at its rigid pose and then loaded at P by a dead wrench: force and moment keep their
components in base axes while the platform moves and turns. Nothing here imports the package under test.

Two solutions share the geometry of the loops, the drive's stiffness, and nothing else:

* `loaded_three_prup`: OpenSees, the whole robot assembled from corotational beam elements and springs;
* `loaded_three_prup_rods`: no frame code; rods and branches are curves whose moment balance is integrated along
  the arc, and one root search closes the legs on the platform.

At 200 N and 50 N m they agree within 1e-9 m and 4e-9 rad (extrapolated), of deflections of 2 mm and 0.013 rad.

What the model is, where small deflections leave it open:

* rods and branches bend and stretch, without shear; their torsion is made 1000 times as stiff as bending;
* rod: cantilever of material length q - d whose root is held except along base z, where the drive's spring is;
* R_lambda: tilting springs at the rod's tip; sleeve of length d, rigid; its axis e_z' is the sleeve's;
* U joint and bush: three free rotations, so no moment at the U joint's centre; the bush slides without friction, so
  the force is normal to the branch's deformed tangent t and the free length b follows. e_phi is normal to e_z' and t;
* springs of R_lambda (radial, axial along e_z'), R_phi (axial along e_phi, radial) and R_theta_P (radial) act on
  that force at the U joint's centre, along the deformed axes. The force does not move by their deflection, some
  10 um: letting it move changes the answer by 2e-8 m and 7e-8 rad at those loads;
* the drive is computed at the q of the rigid pose, and so is the rod's length: letting the drive's deflection
  lengthen the rod changes the answer by 6e-8 m and 2e-7 rad. The axes of R_lambda are the sleeve's, not the rod's:
  3e-9 m, 1e-8 rad. None of these three choices is more than a matter of taste.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook cited here)
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial.transform import Rotation

from .frame_fe import TABLE_1, Array, LegGeometry, LoopGeometry, loop_geometry

Parameters = Mapping[str, Mapping[str, float]]
"""Table 1's numbers under the names of `frame_fe.TABLE_1`; the entry "geometry" is not read."""

TORSION = 1e3
"""Torsional over bending stiffness of rods, branches and hinges."""

_EZ: Array = np.array([0.0, 0.0, 1.0])


def geometry_from_lengths(q: Array) -> LoopGeometry:
    """Return the closed loops whose legs have the lengths q (3,) [m]: `loop_geometry` solved for (z, theta, phi)."""
    target = np.asarray(q, dtype=float)

    def error(pose: Array) -> Array:
        return np.array([leg.q for leg in loop_geometry(*map(float, pose)).legs]) - target

    pose = np.array([target.mean(), 0.0, 0.0])
    for _ in range(30):
        miss = error(pose)
        if np.abs(miss).max() < 1e-14:
            break
        step = 1e-6
        slope = np.column_stack([(error(pose + h) - error(pose - h)) / (2 * step) for h in step * np.eye(3)])
        pose = pose - np.linalg.solve(slope, miss)
    if not np.abs(error(pose)).max() < 1e-12:
        raise RuntimeError(f"no pose found with leg lengths {target} m")
    return loop_geometry(*map(float, pose))


def drive_stiffness(q: float, parameters: Parameters = TABLE_1) -> float:
    """Return the stiffness [N/m] of screw, nut, support bearing, belt and motor in series, on the rod's axis."""
    screw, belt = parameters["ball_screw"], parameters["belt"]
    ratio = belt["motor_pulley"] / belt["screw_pulley"]
    torque_per_force = ratio * screw["lead"] * screw["reverse_efficiency"] / (2 * pi)
    belt_per_force = 2 * torque_per_force / belt["motor_pulley"]
    compliance = 1 / (screw["A"] * screw["E"] * (1 / (screw["length"] - q) + 1 / q))
    compliance += 1 / parameters["ball_nut"]["axial"] + 1 / parameters["support_bearing"]["axial"]
    compliance += torque_per_force**2 / parameters["motor"]["torsional"] + belt_per_force**2 / belt["stiffness"]
    return 1 / compliance


def _unit(vector: Array) -> Array:
    return vector / float(np.linalg.norm(vector))


# ------------------------------------------------------------------------------- OpenSees, corotational frame

RIGID_BENDING = 1e8
"""E I [N m^2] of parts that are rigid; what they still yield is taken off R_lambda's springs."""
RIGID_STRETCH = 1e10
"""E A [N] of the same parts."""
HINGE = 1e-3
"""Length [m] of the beam that is R_lambda's tilting spring, centred on the rod's tip."""


@dataclass
class _Contact:
    """A bush on its branch, as the last analysis left it: what the next one takes as fixed."""

    b: float
    """Free length of the branch [m]."""
    e_z: Array
    """Axis of R_lambda."""
    e_phi: Array
    tangent: Array
    """Direction of the branch at the bush."""


class _StepTooLargeError(RuntimeError):
    """Newton's method did not converge in a load step."""


def loaded_three_prup(
    geometry: LoopGeometry,
    wrench: Array,
    *,
    parameters: Parameters = TABLE_1,
    elements: int = 16,
    steps: int = 4,
    extrapolate: bool = False,
    tolerance: float = 1e-11,
) -> tuple[Array, Array]:
    """Return the displacement of P [m] and the turn of the platform [rad] under a dead wrench on P, by OpenSees.

    `geometry` is the robot's rigid pose, from `frame_fe.loop_geometry` or `geometry_from_lengths`. `wrench` is
    (fx fy fz mx my mz) [N, N m] in base axes, constant in them. The turn is the rotation vector rho in base axes
    with R = exp([rho]x) R_rigid. Each rod and each branch is a chain of `elements` equal elastic beam elements with
    OpenSees' corotational transformation; the load grows in `steps`, each solved by Newton's method.

    Springs that turn with the mechanism, and the bush that slides, are iterated on: an analysis takes the branches'
    free lengths and the springs' axes as fixed, the next takes them from its result, until they repeat to
    `tolerance` [m, rad]. Where the branch is of another length than at the rigid pose, its end is off the U joint's
    centre in the unloaded frame; the joint's springs start with that stretch, and the way along the branch is free.

    A nodal moment of OpenSees is conjugate to the node's spin and keeps its components, which is a dead moment in
    base axes. A nodal rotation, though, is the sum of the spins of all iterations and no rotation vector; turns are
    therefore read from the places of unloaded arms.

    The error falls as elements^-2: 5e-9 m and 2e-8 rad at 16 elements, 200 N and 50 N m. `extrapolate` repeats the
    analysis with twice the elements and removes that term; what R_lambda's hinge has in length leaves 1e-9 m and
    4e-9 rad, which grows with the square of the load. Newton's method takes about 100 N at a time; where a step
    does not converge, `steps` is doubled. Raises RuntimeError if 100 steps or the iteration do not converge,
    ImportError or RuntimeError where openseespy cannot be loaded.
    """
    wrench = np.asarray(wrench, dtype=float)
    contacts = [_Contact(leg.b, leg.e_lambda, leg.e_phi, leg.e_theta) for leg in geometry.legs]
    for _ in range(25):
        while True:
            try:
                displacement, turn, found = _frame_analysis(geometry, contacts, wrench, parameters, elements, steps)
                break
            except _StepTooLargeError:
                if steps > 50:
                    raise
                steps *= 2
        change = max(
            float(
                np.abs(np.r_[old.b - new.b, old.e_z - new.e_z, old.e_phi - new.e_phi, old.tangent - new.tangent]).max()
            )
            for old, new in zip(contacts, found, strict=True)
        )
        contacts = found
        if change < tolerance:
            break
    else:
        raise RuntimeError(f"bushes and joint axes still move by {change:.1e} after 25 analyses")
    if extrapolate:
        fine = loaded_three_prup(
            geometry, wrench, parameters=parameters, elements=2 * elements, steps=steps, tolerance=tolerance
        )
        displacement, turn = ((4 * f - c) / 3 for f, c in zip(fine, (displacement, turn), strict=True))
    return displacement, turn


def _frame_analysis(
    geometry: LoopGeometry,
    contacts: list[_Contact],
    wrench: Array,
    parameters: Parameters,
    elements: int,
    steps: int,
) -> tuple[Array, Array, list[_Contact]]:
    """Solve the frame with given free lengths and joint axes; return P's motion and the contacts it leads to."""
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    places: list[Array] = []
    counts = {"element": 0, "material": 0}

    def next_tag(kind: str) -> int:
        counts[kind] += 1
        return counts[kind]

    def node(position: Array, fixed: tuple[int, ...] = (0,) * 6) -> int:
        places.append(np.asarray(position, dtype=float))
        ops.node(len(places), *map(float, position))
        if any(fixed):
            ops.fix(len(places), *fixed)
        return len(places)

    def beam(start: int, end: int, *, EA: float, EI: float) -> None:
        element = next_tag("element")
        axis = places[end - 1] - places[start - 1]
        ops.geomTransf("Corotational", element, *map(float, np.eye(3)[int(np.argmin(np.abs(axis)))]))
        ops.element("elasticBeamColumn", element, start, end, EA, 1.0, 1.0, TORSION * EI, EI, EI, element)

    def chain(start: int, end: Array, **section: float) -> int:
        for s in np.linspace(0, 1, elements + 1)[1:]:
            last = node((1 - s) * places[start - 1] + s * end)
            beam(start if s == 1 / elements else last - 1, last, **section)
        return last

    def rigid(start: int, end: Array) -> int:
        last = node(end)
        beam(start, last, EA=RIGID_STRETCH, EI=RIGID_BENDING)
        return last

    def springs(start: int, end: int, x: Array, y: Array, stiffness: tuple[float, ...], stretch: Array) -> None:
        axes = (x, y, np.cross(x, y))[: len(stiffness)]
        materials = []
        for axis, value in zip(axes, stiffness, strict=True):
            elastic, stretched = next_tag("material"), next_tag("material")
            ops.uniaxialMaterial("Elastic", elastic, value)
            ops.uniaxialMaterial("InitStrainMaterial", stretched, elastic, float(axis @ stretch))
            materials.append(stretched)
        directions = range(1, len(stiffness) + 1)
        orientation = (*map(float, x), *map(float, y))
        ops.element(
            "zeroLength",
            next_tag("element"),
            start,
            end,
            "-mat",
            *materials,
            "-dir",
            *directions,
            "-orient",
            *orientation,
        )

    rod, branch, r_lambda = parameters["rod"], parameters["branch"], parameters["R_lambda"]
    r_phi, r_theta = parameters["R_phi"], parameters["R_theta_P"]["radial"]
    d = float(geometry.legs[0].u_joint[2] - geometry.legs[0].rod_tip[2])
    hinge_and_sleeve = HINGE**2 / (12 * r_lambda["tilting"]) + d**3 / (3 * RIGID_BENDING)
    radial = 1 / (1 / r_lambda["radial"] - hinge_and_sleeve)
    axial = 1 / (1 / r_lambda["axial"] - (1 + d) / RIGID_STRETCH)

    platform = node(geometry.p)
    arms = [rigid(platform, geometry.p + 0.1 * axis) for axis in np.eye(3)]
    ends = []
    for leg, contact in zip(geometry.legs, contacts, strict=True):
        plate, carriage = node(leg.root, (1,) * 6), node(leg.root, (1, 1, 0, 1, 1, 1))
        springs(plate, carriage, _EZ, np.eye(3)[0], (drive_stiffness(leg.q, parameters),), np.zeros(3))
        tip = chain(carriage, leg.rod_tip, EA=rod["E"] * rod["A"], EI=rod["E"] * rod["I"])
        below = rigid(tip, leg.rod_tip - HINGE / 2 * _EZ)
        sleeve = node(leg.rod_tip + HINGE / 2 * _EZ)
        beam(below, sleeve, EA=RIGID_STRETCH * HINGE, EI=r_lambda["tilting"] * HINGE)
        fork = rigid(sleeve, leg.u_joint)

        end = chain(
            platform, geometry.p + contact.b * leg.e_theta, EA=branch["E"] * branch["A"], EI=branch["E"] * branch["I"]
        )
        beyond = rigid(end, geometry.p + (contact.b + 0.1) * leg.e_theta)
        yoke, cross = (node(places[end - 1], (0, 0, 0, 1, 1, 1)) for _ in range(2))
        ops.equalDOF(fork, yoke, 1, 2, 3)
        e_x = _unit(np.cross(contact.e_phi, contact.e_z))
        springs(yoke, cross, e_x, contact.e_phi, (radial, radial, axial), np.zeros(3))
        springs(
            cross,
            end,
            contact.e_phi,
            np.cross(contact.tangent, contact.e_phi),
            (1 / (1 / r_phi["axial"] + 1 / r_theta), 1 / (1 / r_phi["radial"] + 1 / r_theta)),
            places[end - 1] - places[fork - 1],
        )
        ends.append((sleeve, fork, cross, end, beyond))

    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(platform, *map(float, wrench))
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("UmfPack")
    ops.test("NormDispIncr", 1e-10, 40)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1 / steps)
    ops.analysis("Static", "-noWarnings")
    for step in range(steps):
        if ops.analyze(1) != 0:
            raise _StepTooLargeError(f"OpenSees did not converge in load step {step + 1} of {steps}")

    def place(tag: int) -> Array:
        return places[tag - 1] + np.array(ops.nodeDisp(tag)[:3])

    turn = Rotation.align_vectors([place(arm) - place(platform) for arm in arms], np.eye(3))[0].as_rotvec()
    displacement = np.array(ops.nodeDisp(platform)[:3])
    found = []
    for contact, (sleeve, fork, cross, end, beyond) in zip(contacts, ends, strict=True):
        e_z, tangent = _unit(place(fork) - place(sleeve)), _unit(place(beyond) - place(end))
        centre = place(fork) + np.array(ops.nodeDisp(cross)[:3]) - np.array(ops.nodeDisp(fork)[:3])
        b = contact.b - float(tangent @ (place(end) - centre))
        found.append(_Contact(b, e_z, _unit(np.cross(e_z, tangent)), tangent))
    ops.wipe()
    return displacement, turn, found


# --------------------------------------------------------------------------------- curves, integrated along the arc

_FORCE = 100.0
"""Size of forces [N] among the unknowns of the root search, whose lengths and angles are of order 1."""


def _cantilever_end(
    start: Array,
    direction: Array,
    length: Array,
    load_at: Array,
    force: Array,
    section: Mapping[str, float],
    steps: int,
) -> tuple[Array, Array]:
    """Return end and end tangent of a cantilever under a dead force that acts at the place `load_at`.

    Along the unstretched arc s, r' = (1 + t.F / EA) t and t' = m x t / EI with m = (load_at - r) x F: a rod without
    shear and of one bending stiffness about all its diameters, whose torsion does not move its axis. Fourth-order
    Runge-Kutta; arguments broadcast over leading dimensions. SI units.
    """
    E, A, I = section["E"], section["A"], section["I"]

    def slope(r: Array, t: Array) -> tuple[Array, Array]:
        stretch = 1 + (t * force).sum(-1, keepdims=True) / (E * A)
        return stretch * t, np.cross(np.cross(load_at - r, force), t) / (E * I)

    h = np.asarray(length, dtype=float)[..., None] / steps
    r, t = start, direction
    for _ in range(steps):
        r1, t1 = slope(r, t)
        r2, t2 = slope(r + h / 2 * r1, t + h / 2 * t1)
        r3, t3 = slope(r + h / 2 * r2, t + h / 2 * t2)
        r4, t4 = slope(r + h * r3, t + h * t3)
        r, t = r + h / 6 * (r1 + 2 * r2 + 2 * r3 + r4), t + h / 6 * (t1 + 2 * t2 + 2 * t3 + t4)
    return r, t


def _turned(rotation_vector: Array, vector: Array) -> Array:
    """Rodrigues' formula, over leading dimensions."""
    angle = np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
    once = np.cross(rotation_vector, vector)
    half = np.sinc(angle / (2 * pi))
    turned: Array = vector + np.sinc(angle / pi) * once + half**2 / 2 * np.cross(rotation_vector, once)
    return turned


def loaded_three_prup_rods(
    geometry: LoopGeometry, wrench: Array, *, parameters: Parameters = TABLE_1, steps: int = 16
) -> tuple[Array, Array]:
    """Return what `loaded_three_prup` returns, without a frame code; each rod and branch in `steps` of Runge-Kutta.

    Unknowns: P and the platform's turn; per leg the force on it, the branch's free length, the U joint's centre
    on the sleeve and the end of the branch. Equations: rods, branches and springs meet, the bushes slide freely, the
    platform is in equilibrium. Raises RuntimeError if Newton's method does not reach rounding.
    """
    wrench = np.asarray(wrench, dtype=float)
    rod, branch, r_lambda = parameters["rod"], parameters["branch"], parameters["R_lambda"]
    r_phi, r_theta = parameters["R_phi"], parameters["R_theta_P"]["radial"]

    def leg_residual(leg: LegGeometry, p: Array, turn: Array, unknown: Array) -> tuple[Array, Array, Array]:
        force, b, centre, end = _FORCE * unknown[..., :3], unknown[..., 3], unknown[..., 4:7], unknown[..., 7:]
        foot = leg.root + force[..., 2:] / drive_stiffness(leg.q, parameters) * _EZ
        length = np.broadcast_to(leg.rod_tip[2] - leg.root[2], b.shape)
        tip, axis = _cantilever_end(foot, np.broadcast_to(_EZ, foot.shape), length, centre, force, rod, steps)
        moment = np.cross(centre - tip, force)
        moment = moment - (moment * axis).sum(-1, keepdims=True) * axis
        e_z = _turned(moment / r_lambda["tilting"], axis)
        reached, tangent = _cantilever_end(p, _turned(turn, leg.e_theta), b, end, -force, branch, steps)
        e_phi = np.cross(e_z, tangent)
        e_phi = e_phi / np.linalg.norm(e_phi, axis=-1, keepdims=True)
        along_z = (force * e_z).sum(-1, keepdims=True) * e_z
        along_phi = (force * e_phi).sum(-1, keepdims=True) * e_phi
        deflection = along_z / r_lambda["axial"] + (force - along_z) / r_lambda["radial"]
        deflection = deflection + along_phi / r_phi["axial"] + (force - along_phi) / r_phi["radial"] + force / r_theta
        equations = [
            centre - tip - (leg.u_joint[2] - leg.rod_tip[2]) * e_z,
            end - reached,
            end - centre - deflection,
            (tangent * force).sum(-1, keepdims=True) / _FORCE,
        ]
        return np.concatenate(equations, axis=-1), force, np.cross(end - p, force)

    def residual(unknowns: Array) -> Array:
        p, turn = unknowns[..., :3], unknowns[..., 3:6]
        equations, balance_force, balance_moment = [], wrench[:3], wrench[3:]
        for i, leg in enumerate(geometry.legs):
            leg_equations, force, moment = leg_residual(leg, p, turn, unknowns[..., 6 + 10 * i : 16 + 10 * i])
            equations.append(leg_equations)
            balance_force, balance_moment = balance_force - force, balance_moment - moment
        return np.concatenate([*equations, balance_force / _FORCE, balance_moment / (_FORCE * 0.1)], axis=-1)

    legs = [np.r_[np.zeros(3), leg.b, leg.u_joint, leg.u_joint] for leg in geometry.legs]
    unknowns = np.concatenate([geometry.p, np.zeros(3), *legs])
    probes = 1e-5 * np.eye(len(unknowns))
    for _ in range(30):
        with np.errstate(over="ignore", invalid="ignore"):
            jacobian = ((residual(unknowns + probes) - residual(unknowns - probes)) / 2e-5).T
            step = np.linalg.solve(jacobian, residual(unknowns))
        unknowns = unknowns - step
        if not np.isfinite(step).all():
            raise RuntimeError("the loaded robot is not closed: Newton's method went astray")
        if np.abs(step).max() < 1e-12:
            break
    else:
        raise RuntimeError(f"the loaded robot is not closed: the last step still was {np.abs(step).max():.1e}")
    return unknowns[:3] - geometry.p, unknowns[3:6]
