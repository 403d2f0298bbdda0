"""Independent references for the stiffness of the 3-PRUP robot and of textbook frames.

Nothing here imports the package under test. The robot is solved by the displacement method: beam elements
come from a public frame code (PyNite, or OpenSees), joints are springs and exact constraints between
coincident nodes. The package goes the other way, from forces to strain energy, so agreement means something.

Source of the robot: Rezaei & Akbarzadeh, Mechanism and Machine Theory 126 (2018) 108-140, Table 1 and
Appendices A, C, D. Units are SI throughout: m, N, rad. Wrenches are (fx fy fz mx my mz) about P, twists
(dx dy dz rx ry rz) of P, both in base axes.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook cited here)
from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, isinf, pi

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve, null_space
from scipy.optimize import root
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TABLE_1: dict[str, dict[str, float]] = {
    "geometry": {"a": 0.181, "d": 0.100},
    "branch": {"E": 201e9, "A": 113.1e-6, "I": 1017.9e-12},
    "rod": {"E": 201e9, "A": 314.16e-6, "I": 7854e-12},
    "ball_screw": {"E": 206e9, "A": 176.7e-6, "length": 0.610, "lead": 0.010, "reverse_efficiency": 0.8},
    "ball_nut": {"axial": 505e6},
    "support_bearing": {"axial": 34.64e6},
    "belt": {"stiffness": 18.04e6, "motor_pulley": 0.100, "screw_pulley": 0.035},
    "motor": {"torsional": 6875.5},
    "R_lambda": {"radial": 96.9e6, "axial": 46.4e6, "tilting": 6268.45},
    "R_phi": {"axial": 25e6, "radial": 117.5e6},
    "R_theta_P": {"radial": 65.2e6},
}
"""Table 1 of the paper [m, m^2, m^4, Pa, N/m, N m/rad]; k_t of R_lambda and motor unrounded, from Appendix D."""

POISSON_RATIO = 0.3
"""Torsion of rods and branches (J = 2 I) matters only when a passive joint is locked; Table 1 gives no G."""

LEG_ANGLES: tuple[float, float, float] = (0.0, 2 * pi / 3, 4 * pi / 3)
LOCKABLE_JOINTS: tuple[str, ...] = ("R_lambda", "R_phi", "R_theta", "slide")

_EZ: Array = np.array([0.0, 0.0, 1.0])


# ---------------------------------------------------------------------------------------------- loop geometry


@dataclass(frozen=True)
class LegGeometry:
    """One leg at a pose with closed loops, in base axes [m, rad]."""

    alpha: float
    q: float
    b: float
    angles: tuple[float, float, float]
    """(lambda_i, phi_i, theta_i) of R_lambda, R_phi, R_theta."""
    root: Array
    rod_tip: Array
    u_joint: Array
    e_lambda: Array
    e_phi: Array
    e_theta: Array
    """Also the direction of the star's branch, from P outwards."""
    t1: Array
    """Rows: unit axes of {T1i}, behind R_lambda."""
    t2: Array
    """Rows: unit axes (u, v, w) of {T2i}, behind R_phi."""


@dataclass(frozen=True)
class LoopGeometry:
    """The closed loops of the 3-PRUP at one pose, in base axes [m, rad]."""

    R: Array
    p: Array
    twist_lambda: float
    legs: tuple[LegGeometry, LegGeometry, LegGeometry]
    residual: float
    """Largest loop-closure error [m]."""


def _frozen(values: Array) -> Array:
    values = np.array(values, dtype=float)
    values.setflags(write=False)
    return values


def loop_geometry(z: float, theta: float, phi: float) -> LoopGeometry:
    """Solve the three loops a e_a,i + q_i e_z = b_i R e_a,i + p (Eq. 1) numerically.

    z [m] is the height of P, theta and phi [rad] the tilts in R = R_x(theta) R_y(phi) R_z(lambda).
    The nine unknowns are x, y, lambda, b_1..3 and q_1..3. Raises RuntimeError if the loops do not close.
    """
    a, d = TABLE_1["geometry"]["a"], TABLE_1["geometry"]["d"]
    arms = np.array([[np.cos(alpha), np.sin(alpha), 0.0] for alpha in LEG_ANGLES])

    def platform(unknowns: Array) -> Array:
        return np.asarray(Rotation.from_euler("XYZ", [theta, phi, unknowns[2]]).as_matrix(), dtype=float)

    def closure(unknowns: Array) -> Array:
        p = np.array([unknowns[0], unknowns[1], z])
        b, q = unknowns[3:6, None], unknowns[6:9, None]
        gaps: Array = a * arms + q * _EZ - b * arms @ platform(unknowns).T - p
        return gaps.ravel()

    def closure_jacobian(unknowns: Array) -> Array:
        orientation = platform(unknowns)
        jacobian = np.zeros((9, 9))
        for i, arm in enumerate(arms):
            rows = slice(3 * i, 3 * i + 3)
            jacobian[rows, 0:2] = -np.eye(3)[:, :2]
            jacobian[rows, 2] = -unknowns[3 + i] * orientation @ np.cross(_EZ, arm)
            jacobian[rows, 3 + i] = -orientation @ arm
            jacobian[rows, 6 + i] = _EZ
        return jacobian

    start = np.array([0.0, 0.0, 0.0, a, a, a, z, z, z])
    solution = root(closure, start, jac=closure_jacobian, method="hybr", options={"xtol": 1e-13}).x
    for _ in range(2):  # hybr stops at its tolerance; two Newton steps reach rounding
        solution = solution - np.linalg.solve(closure_jacobian(solution), closure(solution))
    residual = float(np.abs(closure(solution)).max())
    if not residual < 1e-13:
        raise RuntimeError(f"loops do not close at z={z} m, theta={theta}, phi={phi} rad: residual {residual:.2e} m")

    orientation = platform(solution)
    p = np.array([solution[0], solution[1], z])
    legs = []
    for i, (alpha, arm) in enumerate(zip(LEG_ANGLES, arms, strict=True)):
        q, b = solution[6 + i], solution[3 + i]
        leg_frame = Rotation.from_euler("z", alpha).as_matrix()
        angles = Rotation.from_matrix(leg_frame.T @ orientation @ leg_frame).as_euler("ZYX")
        t1 = leg_frame @ Rotation.from_euler("z", angles[0]).as_matrix()
        t2 = t1 @ Rotation.from_euler("y", angles[1]).as_matrix()
        foot = a * arm
        legs.append(
            LegGeometry(
                alpha=alpha,
                q=float(q),
                b=float(b),
                angles=(float(angles[0]), float(angles[1]), float(angles[2])),
                root=_frozen(foot),
                rod_tip=_frozen(foot + (q - d) * _EZ),
                u_joint=_frozen(foot + q * _EZ),
                e_lambda=_frozen(_EZ),
                e_phi=_frozen(t1[:, 1]),
                e_theta=_frozen(t2[:, 0]),
                t1=_frozen(t1.T),
                t2=_frozen(t2.T),
            )
        )
    return LoopGeometry(
        R=_frozen(orientation),
        p=_frozen(p),
        twist_lambda=float(solution[2]),
        legs=(legs[0], legs[1], legs[2]),
        residual=residual,
    )


# ------------------------------------------------------------------------------------------------ frame model


@dataclass(frozen=True)
class Beam:
    """A straight Euler-Bernoulli beam of circular section between two nodes."""

    name: str
    start: int
    end: int
    E: float
    A: float
    I: float

    @property
    def G(self) -> float:
        """Shear modulus [Pa]."""
        return self.E / (2 * (1 + POISSON_RATIO))

    @property
    def J(self) -> float:
        """Torsion constant of a circular section [m^4]."""
        return 2 * self.I


@dataclass(frozen=True)
class Joint:
    """Six springs between two coincident nodes: three along and three about the rows of `axes`.

    A stiffness [N/m, N m/rad] of 0 is a free direction, inf an exact constraint.
    """

    name: str
    start: int
    end: int
    axes: Array
    stiffness: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class FrameModel:
    """Nodes, beams, joints, rigid links (start, end) and clamped nodes; the load acts on `loaded`."""

    nodes: Array
    beams: tuple[Beam, ...]
    joints: tuple[Joint, ...]
    rigid_links: tuple[tuple[int, int], ...]
    clamped: tuple[int, ...]
    loaded: int


def _drive_compliances(q: float, *, joints: bool) -> dict[str, float]:
    """Axial compliances [m/N] in series between the top plate and the rod's root, seen on the rod's axis."""
    screw, belt = TABLE_1["ball_screw"], TABLE_1["belt"]
    compliances = {"ball_screw": 1 / (screw["A"] * screw["E"] * (1 / (screw["length"] - q) + 1 / q))}
    if joints:
        ratio = belt["motor_pulley"] / belt["screw_pulley"]
        motor_torque_per_force = ratio * screw["lead"] * screw["reverse_efficiency"] / (2 * pi)
        belt_force_per_force = motor_torque_per_force * 2 / belt["motor_pulley"]
        compliances["ball_nut"] = 1 / TABLE_1["ball_nut"]["axial"]
        compliances["support_bearing"] = 1 / TABLE_1["support_bearing"]["axial"]
        compliances["motor"] = motor_torque_per_force**2 / TABLE_1["motor"]["torsional"]
        compliances["belt"] = belt_force_per_force**2 / belt["stiffness"]
    return compliances


def _locked_by_leg(locked: Iterable[str]) -> tuple[set[str], set[str], set[str]]:
    by_leg: tuple[set[str], set[str], set[str]] = (set(), set(), set())
    allowed = {f"leg{i + 1}/{joint}": (i, joint) for i in range(3) for joint in LOCKABLE_JOINTS}
    for name in locked:
        if name not in allowed:
            raise ValueError(f"cannot lock {name!r}: expected 'leg1/R_lambda' or alike, joints {LOCKABLE_JOINTS}")
        leg, joint = allowed[name]
        by_leg[leg].add(joint)
    return by_leg


def three_prup_frame(
    z: float, theta: float, phi: float, *, joints: bool = True, locked: Iterable[str] = ()
) -> FrameModel:
    """Describe the 3-PRUP at a pose (z [m], theta, phi [rad]) as a frame of beams and joints.

    `joints=False` keeps the flexible bodies only: branches, rods and ball screws. `locked` names passive
    joints whose own free motion is held, for example "leg1/R_lambda" or "leg3/slide". Raises ValueError for an
    unknown name, and where a rod would need a length q outside (d, screw length).
    """
    geometry = loop_geometry(z, theta, phi)
    shortest, longest = TABLE_1["geometry"]["d"], TABLE_1["ball_screw"]["length"]
    for i, leg in enumerate(geometry.legs):
        if not shortest < leg.q < longest:
            raise ValueError(f"leg {i + 1} needs q = {leg.q:.4f} m at this pose: expected {shortest} < q < {longest} m")
    held = _locked_by_leg(locked)
    rod, branch = TABLE_1["rod"], TABLE_1["branch"]
    r_lambda, r_phi, r_theta = TABLE_1["R_lambda"], TABLE_1["R_phi"], TABLE_1["R_theta_P"]

    nodes: list[Array] = [geometry.p]
    beams: list[Beam] = []
    connections: list[Joint] = []
    links: list[tuple[int, int]] = []
    clamped: list[int] = []

    def node(position: Array) -> int:
        nodes.append(position)
        return len(nodes) - 1

    def spring(value: float) -> float:
        return value if joints else inf

    for i, leg in enumerate(geometry.legs):
        name = f"leg{i + 1}"
        plate, carriage = node(leg.root), node(leg.root)
        tip, sleeve = node(leg.rod_tip), node(leg.rod_tip)
        fork, cross, branch_end = node(leg.u_joint), node(leg.u_joint), node(leg.u_joint)

        def free(joint: str, leg_held: set[str] = held[i]) -> float:
            return inf if joint in leg_held else 0.0

        clamped.append(plate)
        drive = 1 / sum(_drive_compliances(leg.q, joints=joints).values())
        connections.append(Joint(f"{name}/drive", plate, carriage, np.eye(3), (inf, inf, drive, inf, inf, inf)))
        beams.append(Beam(f"{name}/rod", carriage, tip, **rod))
        radial, tilting = spring(r_lambda["radial"]), spring(r_lambda["tilting"])
        connections.append(
            Joint(
                f"{name}/R_lambda",
                tip,
                sleeve,
                leg.t1,
                (radial, radial, spring(r_lambda["axial"]), tilting, tilting, free("R_lambda")),
            )
        )
        links.append((sleeve, fork))
        connections.append(
            Joint(
                f"{name}/R_phi",
                fork,
                cross,
                leg.t2,
                (inf, spring(r_phi["axial"]), spring(r_phi["radial"]), inf, free("R_phi"), inf),
            )
        )
        radial = spring(r_theta["radial"])
        connections.append(
            Joint(
                f"{name}/R_theta_P",
                cross,
                branch_end,
                leg.t2,
                (free("slide"), radial, radial, free("R_theta"), inf, inf),
            )
        )
        beams.append(Beam(f"{name}/branch", 0, branch_end, **branch))

    return FrameModel(_frozen(np.array(nodes)), tuple(beams), tuple(connections), tuple(links), tuple(clamped), 0)


# ------------------------------------------------------------------------------------- solution with PyNite


def _cross_matrix(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def pynite_beam_stiffness(start: Array, end: Array, *, E: float, G: float, A: float, I: float, J: float) -> Array:
    """Return PyNite's 12 x 12 stiffness of a circular beam in base axes [N/m, N, N m].

    The element is asked for along its own x axis and rotated here: PyNite's choice of a member's local axes
    goes through thresholds on its global Y, which a branch in the plane y = 0 meets within rounding.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # older releases import what setuptools has deprecated
        from Pynite import FEModel3D

    axis = np.asarray(end, dtype=float) - np.asarray(start, dtype=float)
    length = float(np.linalg.norm(axis))
    frame = FEModel3D()
    frame.add_material("material", E, G, E / (2 * G) - 1, 0.0)
    frame.add_section("section", A, I, I, J)
    frame.add_node("start", 0.0, 0.0, 0.0)
    frame.add_node("end", length, 0.0, 0.0)
    frame.add_member("beam", "start", "end", "material", "section")
    member = frame.members["beam"]
    local = np.asarray(
        (member.ke() if hasattr(member, "ke") else member.k()), dtype=float
    )  # before PyNite 3 the elastic part is called k

    x = axis / length
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    to_local = block_diag(*[np.array([x, y, np.cross(x, y)])] * 4)
    stiffness: Array = to_local.T @ local @ to_local
    return stiffness


_ROTATION_LENGTH = 0.1
"""Rotations are solved for as rotation x this length [m], so that all unknowns are of one size."""


@dataclass(frozen=True)
class FrameSolution:
    """Displacements of a frame under the six unit loads on its loaded node, one load a column."""

    compliance: Array
    displacements: Array
    """(nodes, 6, 6): node, displacement component [m, rad], unit load."""
    energy: dict[str, Array]
    """Part's name -> (6, 6): twice the strain energy as a quadratic form of the load. Their sum is C."""


def _relative_motion(joint: Joint) -> Array:
    """(6, 12) map from (start, end) displacements to the joint's motion along and about its axes."""
    turn = block_diag(joint.axes, joint.axes)
    return np.hstack([-turn, turn])


def solve_frame(frame: FrameModel) -> FrameSolution:
    """Solve a frame with PyNite's beam elements and exact constraints, all six unit loads at once.

    Rigid directions, rigid links and clamped nodes are eliminated through an orthonormal null space, not by
    penalties. Raises numpy.linalg.LinAlgError if the frame is a mechanism.
    """
    size = 6 * len(frame.nodes)
    stiffness = np.zeros((size, size))
    constraints: list[Array] = []
    parts: dict[str, tuple[Indices, Array]] = {}

    def freedoms(*nodes: int) -> Indices:
        return np.concatenate([np.arange(6 * n, 6 * n + 6) for n in nodes])

    def add_stiffness(name: str, index: Indices, matrix: Array) -> None:
        stiffness[np.ix_(index, index)] += matrix
        parts[name] = (index, matrix)

    def add_constraints(index: Indices, rows: Array) -> None:
        full = np.zeros((len(rows), size))
        full[:, index] = rows
        constraints.append(full)

    for beam in frame.beams:
        matrix = pynite_beam_stiffness(
            frame.nodes[beam.start], frame.nodes[beam.end], E=beam.E, G=beam.G, A=beam.A, I=beam.I, J=beam.J
        )
        add_stiffness(beam.name, freedoms(beam.start, beam.end), matrix)
    for joint in frame.joints:
        index, motion = freedoms(joint.start, joint.end), _relative_motion(joint)
        rigid = np.isinf(joint.stiffness)
        springs = np.where(rigid, 0.0, joint.stiffness)
        if springs.any():
            add_stiffness(joint.name, index, motion.T @ (springs[:, None] * motion))
        if rigid.any():
            add_constraints(index, motion[rigid])
    for start, end in frame.rigid_links:
        carry = np.eye(6)
        carry[:3, 3:] = -_cross_matrix(frame.nodes[end] - frame.nodes[start])
        add_constraints(freedoms(start, end), np.hstack([carry, -np.eye(6)]))
    for node in frame.clamped:
        add_constraints(freedoms(node), np.eye(6))

    scale = np.tile([1.0] * 3 + [1 / _ROTATION_LENGTH] * 3, len(frame.nodes))
    admissible = scale[:, None] * null_space(np.vstack(constraints) * scale)
    reduced = admissible.T @ stiffness @ admissible
    load = admissible[freedoms(frame.loaded)].T
    diagonal = np.diag(reduced)
    if not (diagonal > 1e-13 * diagonal.max()).all():
        raise np.linalg.LinAlgError("the frame is a mechanism: some motion meets no stiffness")
    balance = 1 / np.sqrt(diagonal)
    balanced = balance[:, None] * reduced * balance
    if np.linalg.eigvalsh(balanced)[0] < 1e-13:
        raise np.linalg.LinAlgError("the frame is a mechanism: some motion meets no stiffness")
    factor = cho_factor(balanced)

    def reduced_solve(right: Array) -> Array:
        motion: Array = balance[:, None] * cho_solve(factor, balance[:, None] * right)
        return motion

    motion = reduced_solve(load)
    motion = motion + reduced_solve(load - reduced @ motion)
    displacements = admissible @ motion
    compliance = displacements[freedoms(frame.loaded)]
    energy = {name: displacements[index].T @ matrix @ displacements[index] for name, (index, matrix) in parts.items()}
    return FrameSolution(
        compliance=(compliance + compliance.T) / 2,
        displacements=displacements.reshape(-1, 6, 6),
        energy=energy,
    )


def three_prup_compliance(
    z: float, theta: float, phi: float, *, joints: bool = True, locked: Iterable[str] = ()
) -> Array:
    """Return the robot's compliance C (6, 6) at P in base axes [m/N, 1/N, rad/(N m)], by PyNite's elements.

    Arguments as in `three_prup_frame`: z [m], theta and phi [rad]. Rounding stays below 1e-10 of max|C| while every
    rod's free length q - d exceeds 5 mm; a 12 E I / L^3 stub costs digits (about 1e-7 at 0.5 mm).
    """
    return solve_frame(three_prup_frame(z, theta, phi, joints=joints, locked=locked)).compliance


def three_prup_compliance_parts(
    z: float, theta: float, phi: float, *, joints: bool = True, locked: Iterable[str] = ()
) -> dict[str, Array]:
    """Return each part's share of C, named "leg1/rod", "leg2/R_phi", "leg3/belt" and so on; they sum to C."""
    parts = solve_frame(three_prup_frame(z, theta, phi, joints=joints, locked=locked)).energy
    for i, leg in enumerate(loop_geometry(z, theta, phi).legs):
        drive = parts.pop(f"leg{i + 1}/drive")
        series = _drive_compliances(leg.q, joints=joints)
        for name, compliance in series.items():
            parts[f"leg{i + 1}/{name}"] = drive * (compliance / sum(series.values()))
    return parts


# ------------------------------------------------------------------------------------ solution with OpenSees


def solve_frame_opensees(
    frame: FrameModel, *, rigid_stiffness: float = 1e11, rigid_rotation: float = 1e9, extrapolate: bool = True
) -> Array:
    """Return a frame's compliance (6, 6) from OpenSees alone [m/N, 1/N, rad/(N m)].

    Joints are oriented zeroLength elements, rigid links OpenSees' own. openseespy has no constraints along oblique
    axes, so a joint's rigid directions are springs of `rigid_stiffness` [N/m] and `rigid_rotation` [N m/rad]. Their
    error falls as 1/stiffness until rounding takes over at about 5e-8 of max|C|; `extrapolate` solves again with
    springs twice as stiff and removes the 1/stiffness term, which leaves about 1e-9.
    Raises ImportError or RuntimeError where openseespy cannot be loaded.
    """
    compliance = _opensees_compliance(frame, rigid_stiffness, rigid_rotation)
    if extrapolate:
        compliance = 2 * _opensees_compliance(frame, 2 * rigid_stiffness, 2 * rigid_rotation) - compliance
    return compliance


def _opensees_compliance(frame: FrameModel, rigid_stiffness: float, rigid_rotation: float) -> Array:
    import openseespy.opensees as ops

    def tag(node: int) -> int:
        return node + 1

    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for n, position in enumerate(frame.nodes):
        ops.node(tag(n), *map(float, position))
    for n in frame.clamped:
        ops.fix(tag(n), *[1] * 6)
    for start, end in frame.rigid_links:
        ops.rigidLink("beam", tag(start), tag(end))
    element = 0
    for beam in frame.beams:
        element += 1
        axis = frame.nodes[beam.end] - frame.nodes[beam.start]
        ops.geomTransf("Linear", element, *map(float, np.eye(3)[int(np.argmin(np.abs(axis)))]))
        ops.element(
            "elasticBeamColumn",
            element,
            tag(beam.start),
            tag(beam.end),
            *(beam.A, beam.E, beam.G, beam.J, beam.I, beam.I),
            element,
        )
    material = 0
    for joint in frame.joints:
        materials, directions = [], []
        for direction, value in enumerate(joint.stiffness, start=1):
            if value == 0:
                continue
            stiffness = (rigid_stiffness if direction <= 3 else rigid_rotation) if isinf(value) else float(value)
            material += 1
            ops.uniaxialMaterial("Elastic", material, stiffness)
            materials.append(material)
            directions.append(direction)
        element += 1
        x, y = (list(map(float, axis)) for axis in joint.axes[:2])
        ops.element(
            "zeroLength",
            element,
            *(tag(joint.start), tag(joint.end)),
            *("-mat", *materials),
            *("-dir", *directions),
            *("-orient", *x, *y),
        )

    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("UmfPack")
    ops.algorithm("Linear")
    compliance = np.zeros((6, 6))
    for column in range(6):
        ops.timeSeries("Constant", column + 1)
        ops.pattern("Plain", column + 1, column + 1)
        ops.load(tag(frame.loaded), *map(float, np.eye(6)[column]))
        ops.integrator("LoadControl", 0.0)
        ops.analysis("Static", "-noWarnings")
        if ops.analyze(1) != 0:
            raise RuntimeError(f"OpenSees did not solve unit load {column + 1} of 6")
        compliance[:, column] = ops.nodeDisp(tag(frame.loaded))
        ops.remove("loadPattern", column + 1)
    ops.wipe()
    return compliance


def three_prup_compliance_opensees(
    z: float, theta: float, phi: float, *, joints: bool = True, locked: Iterable[str] = ()
) -> Array:
    """Return the robot's compliance C (6, 6) at P in base axes from OpenSees; see `three_prup_compliance`.

    Raises ImportError or RuntimeError where openseespy cannot be loaded.
    """
    return solve_frame_opensees(three_prup_frame(z, theta, phi, joints=joints, locked=locked))


# ------------------------------------------------------------------------------------------ textbook answers


def propped_cantilever(length: float, load_at: float, *, E: float, I: float) -> Array:
    """Return C (2, 2) at the load of a beam fixed at x = 0 and simply supported at x = length.

    Transverse force [N] and moment [N m] act at x = load_at = a; the answers are deflection [m] and slope [rad],
    positive with the load. Bending only; axial stretch does not enter. With b = length - a,

        deflection/force = a^3 b^2 (4 L - a) / (12 E I L^3),

    Roark, Formulas for Stress and Strain (7th ed.), Table 8.1 case 1c, and Gere & Goodno, Mechanics of Materials,
    chapter 'Statically Indeterminate Beams' (prop removed, then put back). E [Pa], I [m^4], lengths [m].
    """
    a, b, L = load_at, length - load_at, length
    released = np.array([[a**3 / 3, a**2 / 2], [a**2 / 2, a]])
    prop_deflection = np.array([a**2 * (3 * L - a) / 6, a * (2 * L - a) / 2])
    answer = released - np.outer(prop_deflection, prop_deflection) / (L**3 / 3)
    answer[0, 0] = a**3 * b**2 * (4 * L - a) / (12 * L**3)
    return answer / (E * I)


def propped_cantilever_reaction(length: float, load_at: float) -> float:
    """Return the prop's force per unit transverse force at a = load_at: a^2 (3 L - a) / (2 L^3).

    Gere & Goodno, 'Statically Indeterminate Beams', propped cantilever with a concentrated load.
    """
    return load_at**2 * (3 * length - load_at) / (2 * length**3)


def fixed_fixed_beam(length: float, load_at: float, *, E: float, I: float) -> Array:
    """Return C (2, 2) at the load of a beam clamped at both ends; arguments as in `propped_cantilever`.

    Bending only. With a = load_at and b = length - a,

        deflection/force = a^3 b^3 / (3 E I L^3),  slope/force = a^2 b^2 (b - a) / (2 E I L^3),
        slope/moment = a b (a^2 - a b + b^2) / (E I L^3).

    Roark, Table 8.1 cases 1d (force) and 3d (moment).
    """
    a, b, L = load_at, length - load_at, length
    coupling = a**2 * b**2 * (b - a) / 2
    return np.array([[a**3 * b**3 / 3, coupling], [coupling, a * b * (a**2 - a * b + b**2)]]) / (E * I * L**3)


def parallel_guided_beams(length: float, count: int, *, E: float, I: float) -> float:
    """Return deflection per force [m/N] of a rigid block on `count` parallel beams that it keeps upright.

    Each beam is fixed to the ground and to the block (fixed-guided): L^3 / (12 E I count). Bending only, axially
    rigid beams. Roark, Table 8.1 case 1b, guided end, load at the guided end.
    """
    return length**3 / (12 * E * I * count)


@dataclass(frozen=True)
class PortalFrame:
    """A portal with fixed feet, in its plane: x along the beam, y up, moments and rotations counter-clockwise."""

    compliance: Array
    """(3, 3) at the middle of the beam: (fx, fy, m) -> (dx, dy, r) [m/N, 1/N, rad/(N m)]."""
    sway: float
    """Horizontal deflection per horizontal force at beam level [m/N], bending only."""
    corner_rotation: float
    """Clockwise rotation of both corners per horizontal force at beam level [rad/N], bending only."""


def portal_frame(
    height: float,
    span: float,
    *,
    E: float,
    I_column: float,
    I_beam: float,
    A_column: float = inf,
    A_beam: float = inf,
) -> PortalFrame:
    """Return the closed-form compliance of a symmetric portal frame with fixed feet.

    Two columns (height, I_column) carry a beam (span, I_beam). Areas of inf are the textbook's inextensible
    members; finite areas add the axial stretch to `compliance` (not to `sway` and `corner_rotation`).
    Under a horizontal force at beam level, with k = I_beam height / (I_column span), slope-deflection gives

        sway/force = height^3 (2 + 3 k) / (12 E I_column (1 + 6 k)),
        corner rotation/force = height^2 / (4 E I_column (1 + 6 k)),

    as in Kleinlogel, Rigid Frame Formulas (rectangular frame with fixed feet, N2 = 1 + 6 k). The full
    `compliance` is the force method: cut the beam in the middle, integrate the unit moments (h - y, +-span/2, 1)
    over each column and (0, s, 1) over each half beam, and let the two half frames act in parallel. Lengths [m],
    E [Pa], I [m^4], A [m^2].
    """
    h, half = height, span / 2

    def half_frame(side: float) -> Array:
        # Counter-clockwise moment at (x, y) under (fx, fy, m) at the cut (0, h): (h - y)(-fx) + (0 - x) fy + m.
        s = -side * half
        column = np.array(
            [
                [h**3 / 3, -s * h**2 / 2, -(h**2) / 2],
                [-s * h**2 / 2, s**2 * h, s * h],
                [-(h**2) / 2, s * h, h],
            ]
        ) / (E * I_column)
        beam = np.array(
            [
                [0.0, 0.0, 0.0],
                [0.0, half**3 / 3, -side * half**2 / 2],
                [0.0, -side * half**2 / 2, half],
            ]
        ) / (E * I_beam)
        stretch = np.diag([half / (E * A_beam), h / (E * A_column), 0.0])
        return column + beam + stretch

    left, right = half_frame(-1.0), half_frame(1.0)
    k = I_beam * h / (I_column * span)
    return PortalFrame(
        compliance=_frozen(np.linalg.inv(np.linalg.inv(left) + np.linalg.inv(right))),
        sway=h**3 * (2 + 3 * k) / (12 * E * I_column * (1 + 6 * k)),
        corner_rotation=h**2 / (4 * E * I_column * (1 + 6 * k)),
    )


def tapered_cantilever(length: float, tip_diameter: float, root_diameter: float, *, E: float) -> Array:
    """Return C (2, 2) at the tip of a solid circular cantilever whose diameter grows linearly from tip to root.

    (force [N], moment [N m]) -> (deflection [m], slope [rad]), positive with the load. Euler-Bernoulli. With
    I_t at the tip and r = root_diameter / tip_diameter, integrating x^n / (E I(x)) from the tip gives

        deflection/force = L^3 / (3 E I_t r^3),  slope/force = L^2 (r + 2) / (6 E I_t r^3),
        slope/moment = L (1 + r + r^2) / (3 E I_t r^3).

    Method and problem: Gere & Goodno, Mechanics of Materials, 'Nonprismatic Beams'. Lengths [m], E [Pa].
    """
    r, L = root_diameter / tip_diameter, length
    rigidity = E * pi * tip_diameter**4 / 64 * r**3
    coupling = L**2 * (r + 2) / 6
    return np.array([[L**3 / 3, coupling], [coupling, L * (1 + r + r**2) / 3]]) / rigidity


def timoshenko_cantilever(
    length: float,
    *,
    E: float,
    I: float,
    G: float,
    A: float,
    shear_coefficient: float,
) -> Array:
    """Return C (2, 2) at the tip of a cantilever with shear: deflection/force = L^3/(3 E I) + L/(kappa G A).

    (force [N], moment [N m]) -> (deflection [m], rotation of the section [rad]), positive with the load. kappa is
    `shear_coefficient`. Timoshenko, Strength of Materials, Part I, 'Effect of Shearing Force on the Deflection of
    Beams'. SI units.
    """
    L = length
    bending = np.array([[L**3 / 3, L**2 / 2], [L**2 / 2, L]]) / (E * I)
    bending[0, 0] += L / (shear_coefficient * G * A)
    return bending
