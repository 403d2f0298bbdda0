"""The reference answers for themselves: symmetry, energy, textbooks, and two frame codes against each other."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from .frame_fe import (
    LEG_ANGLES,
    TABLE_1,
    Array,
    Beam,
    FrameModel,
    Joint,
    fixed_fixed_beam,
    loop_geometry,
    parallel_guided_beams,
    portal_frame,
    propped_cantilever,
    propped_cantilever_reaction,
    solve_frame,
    solve_frame_opensees,
    tapered_cantilever,
    three_prup_compliance,
    three_prup_compliance_opensees,
    three_prup_compliance_parts,
    three_prup_frame,
    timoshenko_cantilever,
)

# Relative to the largest entry; 1.4e-10 was seen with one BLAS thread and PyNite 3, 2.1e-10 with PyNite 2.
ROUNDING = 1e-9

CENTRE = (0.4, 0.0, 0.0)
TILTED = (0.4, np.deg2rad(25), np.deg2rad(15))
POSES = [CENTRE, TILTED, (0.4, np.deg2rad(-15), np.deg2rad(10)), (0.3, np.deg2rad(-20), np.deg2rad(-25))]
LOCKED = [
    ("leg1/R_lambda",),
    ("leg2/R_phi",),
    ("leg3/R_theta",),
    ("leg1/R_lambda", "leg2/R_theta", "leg3/R_phi", "leg2/slide"),
]

# Table 4: per leg q [m], lambda, phi, theta [deg], as printed
TABLE_4 = [
    ((0.4, 0, 0), [(0.4, 0, 0, 0)] * 3),
    ((0.4, 25, 15), [(0.35, 3.34, 15, 25), (0.51, -0.34, -28.9, 1.31), (0.36, -3.01, 12.95, -26.1)]),
    ((0.4, -15, 10), [(0.37, -1.32, 10, -15), (0.38, 1.10, 7.7, 16.28), (0.46, 0.22, -17.9, -1.38)]),
]

E, G = 200e9, 77e9


def relative_error(value: Array, expected: Array) -> float:
    return float(np.abs(value - expected).max() / np.abs(expected).max())


def least_eigenvalue(matrix: Array, length: float = 0.1) -> float:
    """Smallest eigenvalue with rotations measured as arcs of `length` [m], relative to the largest entry."""
    scale = np.diag([1.0] * 3 + [length] * 3)
    scaled = scale @ matrix @ scale
    return float(np.linalg.eigvalsh(scaled)[0] / np.abs(scaled).max())


def move(rotation: Array) -> Array:
    """(6, 6) map of wrenches under a proper rotation or a reflection; moments are axial vectors."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = rotation
    turn[3:, 3:] = np.linalg.det(rotation) * rotation
    return turn


@pytest.fixture(scope="module")
def opensees() -> None:
    try:
        import openseespy.opensees  # noqa: F401
    except (ImportError, RuntimeError) as error:
        pytest.skip(f"openseespy does not load here (on Debian it needs libblas3 and liblapack3): {error}")


class TestLoopGeometry:
    @pytest.mark.parametrize(("pose", "legs"), TABLE_4)
    def test_reproduces_table_4(self, pose, legs):
        geometry = loop_geometry(pose[0], *np.deg2rad(pose[1:]))
        for leg, (q, *angles) in zip(geometry.legs, legs, strict=True):
            assert leg.q == pytest.approx(q, abs=0.0051)
            assert np.rad2deg(leg.angles) == pytest.approx(angles, abs=0.051)

    @pytest.mark.parametrize("pose", POSES)
    def test_joint_chain_reaches_the_platform(self, pose):
        geometry = loop_geometry(*pose)
        for leg, alpha in zip(geometry.legs, LEG_ANGLES, strict=True):
            turned = Rotation.from_euler("z", alpha)
            for axis, angle in zip("zyx", leg.angles, strict=True):
                turned = turned * Rotation.from_euler(axis, angle)
            turned = turned * Rotation.from_euler("z", -alpha)
            assert turned.as_matrix() == pytest.approx(geometry.R, abs=1e-12)
            assert leg.u_joint == pytest.approx(geometry.p + leg.b * leg.e_theta, abs=1e-12)
            assert leg.e_theta @ leg.e_phi == pytest.approx(0, abs=1e-12)
            assert leg.e_lambda @ leg.e_phi == pytest.approx(0, abs=1e-12)

    def test_platform_twist_closed_form(self):
        for _, theta, phi in POSES:
            twist = loop_geometry(0.4, theta, phi).twist_lambda
            assert np.tan(twist) == pytest.approx(-np.sin(theta) * np.sin(phi) / (np.cos(theta) + np.cos(phi)))

    def test_rod_outside_the_screw_is_refused(self):
        with pytest.raises(ValueError, match="leg 2 needs q"):
            three_prup_frame(0.55, np.deg2rad(38), np.deg2rad(35))


class TestThreePrup:
    @pytest.mark.parametrize("pose", POSES)
    @pytest.mark.parametrize("joints", [True, False])
    def test_symmetric_positive_definite(self, pose, joints):
        compliance = three_prup_compliance(*pose, joints=joints)
        assert relative_error(compliance.T, compliance) == 0
        assert least_eigenvalue(compliance) > 1e-3

    def test_centre_by_hand(self):
        """Vertical force and vertical moment at the centre: three equal legs, each a chain of known springs."""
        z, a, d = CENTRE[0], TABLE_1["geometry"]["a"], TABLE_1["geometry"]["d"]
        length = z - d
        branch = a**3 / (3 * 201e9 * 1017.9e-12)
        screw = 1 / (176.7e-6 * 206e9 * (1 / (0.610 - z) + 1 / z))
        ratio = (0.100 / 0.035) * 0.010 * 0.8 / (2 * pi)
        drive = screw + 1 / 505e6 + 1 / 34.64e6 + ratio**2 / 6875.5 + (ratio * 2 / 0.100) ** 2 / 18.04e6
        vertical = branch + 1 / 65.2e6 + 1 / 117.5e6 + 1 / 46.4e6 + length / (201e9 * 314.16e-6) + drive
        bending = ((length + d) ** 3 - d**3) / (3 * 201e9 * 7854e-12)
        tangential = branch + 1 / 65.2e6 + 1 / 25e6 + 1 / 96.9e6 + d**2 / 6268.45 + bending
        compliance = three_prup_compliance(*CENTRE)
        assert compliance[2, 2] == pytest.approx(vertical / 3, rel=1e-10)
        assert compliance[5, 5] == pytest.approx(tangential / (3 * a**2), rel=1e-10)

    @pytest.mark.parametrize("joints", [True, False])
    def test_three_fold_symmetry_at_the_centre(self, joints):
        compliance = three_prup_compliance(*CENTRE, joints=joints)
        third = move(Rotation.from_euler("z", 2 * pi / 3).as_matrix())
        assert relative_error(third @ compliance @ third.T, compliance) < 1e-11
        assert compliance[0, 0] == pytest.approx(compliance[1, 1], rel=1e-11)

    def test_tilt_turned_by_a_third_turns_the_compliance(self):
        turn = Rotation.from_euler("z", 2 * pi / 3).as_matrix()
        orientation = turn @ loop_geometry(*TILTED).R @ turn.T
        theta, phi, _ = Rotation.from_matrix(orientation).as_euler("XYZ")
        third = move(turn)
        expected = third @ three_prup_compliance(*TILTED) @ third.T
        assert relative_error(three_prup_compliance(TILTED[0], theta, phi), expected) < 1e-11

    def test_mirrored_tilt_mirrors_the_compliance(self):
        z, theta, phi = TILTED
        mirror = move(np.diag([1.0, -1.0, 1.0]))
        expected = mirror @ three_prup_compliance(z, theta, phi) @ mirror.T
        assert relative_error(three_prup_compliance(z, -theta, phi), expected) < 1e-11

    @pytest.mark.parametrize("locked", [(), *LOCKED])
    def test_energy_balance(self, locked):
        """Work of the load equals the strain energy of all parts, and no part stores a negative energy."""
        parts = three_prup_compliance_parts(*TILTED, locked=locked)
        compliance = three_prup_compliance(*TILTED, locked=locked)
        assert relative_error(sum(parts.values()), compliance) < 1e-11
        assert len(parts) == 3 * 10
        assert min(least_eigenvalue(part) for part in parts.values()) > -1e-8

    def test_without_redundancy_bodies_do_not_feel_the_joints(self):
        """The free robot is statically determinate: a part's share of C depends on no other part's stiffness."""
        everything = three_prup_compliance_parts(*TILTED)
        bodies = three_prup_compliance_parts(*TILTED, joints=False)
        assert {name.split("/")[1] for name in bodies} == {"rod", "branch", "ball_screw"}
        largest = np.abs(sum(everything.values())).max()
        assert max(np.abs(everything[name] - part).max() for name, part in bodies.items()) / largest < 1e-11

    @pytest.mark.parametrize("locked", LOCKED)
    def test_locking_a_joint_only_stiffens(self, locked):
        free, held = three_prup_compliance(*TILTED), three_prup_compliance(*TILTED, locked=locked)
        assert relative_error(held, free) > 1e-3
        assert least_eigenvalue(free - held) > -ROUNDING

    def test_locks_add_up(self):
        names = [f"leg{i}/{joint}" for i in (1, 2, 3) for joint in ("R_lambda", "R_phi", "R_theta", "slide")]
        steps = [three_prup_compliance(*TILTED, locked=names[:count]) for count in range(len(names) + 1)]
        assert all(least_eigenvalue(before - after) > -1e-10 for before, after in pairwise(steps))

    def test_unknown_lock_is_refused(self):
        with pytest.raises(ValueError, match="leg4/R_lambda"):
            three_prup_compliance(*CENTRE, locked=("leg4/R_lambda",))


class TestOpenSees:
    @pytest.mark.parametrize("pose", POSES)
    @pytest.mark.parametrize("joints", [True, False])
    def test_agrees_with_pynite(self, opensees, pose, joints):
        expected = three_prup_compliance(*pose, joints=joints)
        assert relative_error(three_prup_compliance_opensees(*pose, joints=joints), expected) < 5e-9

    @pytest.mark.parametrize("locked", LOCKED)
    @pytest.mark.parametrize("joints", [True, False])
    def test_agrees_with_pynite_when_overconstrained(self, opensees, locked, joints):
        expected = three_prup_compliance(*TILTED, joints=joints, locked=locked)
        found = three_prup_compliance_opensees(*TILTED, joints=joints, locked=locked)
        assert relative_error(found, expected) < 1e-8

    def test_plain_penalty_is_worse(self, opensees):
        """Shows why the OpenSees answer is extrapolated: at the same stiffness one solution is off by 1e-6."""
        frame, expected = three_prup_frame(*TILTED), three_prup_compliance(*TILTED)
        assert 1e-6 < relative_error(solve_frame_opensees(frame, extrapolate=False), expected) < 1e-4


def line_frame(points: Array, beams: list[Beam], joints: list[Joint], clamped: tuple[int, ...], loaded: int) -> Array:
    return solve_frame(FrameModel(points, tuple(beams), tuple(joints), (), clamped, loaded)).compliance


BEAM = {"E": E, "A": 3e-4, "I": 8e-9}
VERTICAL_PLANE = np.ix_([1, 5], [1, 5])
"""Deflection along y and rotation about z of a beam along x."""


class TestTextbook:
    @pytest.mark.parametrize("load_at", [0.1, 0.35, 0.8])
    def test_propped_cantilever(self, load_at):
        length = 0.9
        points = np.array([[0, 0, 0], [load_at, 0, 0], [length, 0, 0], [length, 0, 0]], dtype=float)
        support = Joint("prop", 3, 2, np.eye(3), (0, np.inf, 0, 0, 0, 0))
        beams = [Beam("left", 0, 1, **BEAM), Beam("right", 1, 2, **BEAM)]
        found = line_frame(points, beams, [support], (0, 3), 1)
        expected = propped_cantilever(length, load_at, E=E, I=BEAM["I"])
        assert relative_error(found[VERTICAL_PLANE], expected) < 1e-10

    def test_propped_cantilever_reaction(self):
        """The prop's force makes the propped end's deflection vanish."""
        length, a = 0.9, 0.35
        reaction = propped_cantilever_reaction(length, a)
        assert reaction * length**3 / 3 == pytest.approx(a**2 * (3 * length - a) / 6)

    @pytest.mark.parametrize("load_at", [0.1, 0.45, 0.8])
    def test_fixed_fixed_beam(self, load_at):
        length = 0.9
        points = np.array([[0, 0, 0], [load_at, 0, 0], [length, 0, 0]], dtype=float)
        found = line_frame(points, [Beam("left", 0, 1, **BEAM), Beam("right", 1, 2, **BEAM)], [], (0, 2), 1)
        assert relative_error(found[VERTICAL_PLANE], fixed_fixed_beam(length, load_at, E=E, I=BEAM["I"])) < 1e-10

    def test_parallel_guided_beams(self):
        length, count = 0.3, 4
        points = np.zeros((2 * count + 1, 3))
        points[1 : count + 1, 0], points[count + 1 :, 0] = 0, length
        points[0, 0] = length
        beams = [Beam(f"beam{i}", 1 + i, 1 + count + i, **BEAM) for i in range(count)]
        upright = (np.inf, np.inf, np.inf, np.inf, np.inf, np.inf)
        joints = [Joint(f"block{i}", 0, 1 + count + i, np.eye(3), upright) for i in range(count)]
        points = np.vstack([points, points[:1]])
        joints.append(Joint("guide", len(points) - 1, 0, np.eye(3), (0, 0, np.inf, np.inf, np.inf, np.inf)))
        clamped = (*range(1, count + 1), len(points) - 1)
        found = line_frame(points, beams, joints, clamped, 0)
        assert found[1, 1] == pytest.approx(parallel_guided_beams(length, count, E=E, I=BEAM["I"]), rel=1e-10)

    @pytest.mark.parametrize(("height", "span"), [(0.5, 0.8), (1.0, 0.3)])
    def test_portal_frame(self, height, span):
        column, beam = {"E": E, "A": 3e-4, "I": 8e-9}, {"E": E, "A": 2e-4, "I": 5e-9}
        corners = [[-span / 2, 0, 0], [-span / 2, height, 0], [0, height, 0], [span / 2, height, 0], [span / 2, 0, 0]]
        beams = [
            Beam("left column", 0, 1, **column),
            Beam("left half", 1, 2, **beam),
            Beam("right half", 2, 3, **beam),
            Beam("right column", 3, 4, **column),
        ]
        found = line_frame(np.array(corners, dtype=float), beams, [], (0, 4), 2)[np.ix_([0, 1, 5], [0, 1, 5])]
        portal = portal_frame(height, span, E=E, I_column=8e-9, I_beam=5e-9, A_column=3e-4, A_beam=2e-4)
        assert relative_error(found, portal.compliance) < 1e-10

    def test_portal_frame_sway_is_the_textbook_s(self):
        height, span = 0.5, 0.8
        portal = portal_frame(height, span, E=E, I_column=8e-9, I_beam=5e-9)
        assert portal.compliance[0, 0] == pytest.approx(portal.sway, rel=1e-12)
        rigid_beam = portal_frame(height, span, E=E, I_column=8e-9, I_beam=1.0)
        assert rigid_beam.sway == pytest.approx(parallel_guided_beams(height, 2, E=E, I=8e-9), rel=1e-6)
        loose_beam = portal_frame(height, span, E=E, I_column=8e-9, I_beam=1e-18)
        assert loose_beam.sway == pytest.approx(height**3 / (3 * E * 8e-9) / 2, rel=1e-6)

    def test_portal_frame_corner_rotation(self):
        """Columns: shear V = (12 sway/h^3 - 6 rotation/h^2) E I each, and two of them carry the unit force."""
        height = 0.5
        portal = portal_frame(height, 0.8, E=E, I_column=8e-9, I_beam=5e-9)
        shear = E * 8e-9 * (12 * portal.sway / height**3 - 6 * portal.corner_rotation / height**2)
        assert 2 * shear == pytest.approx(1, rel=1e-12)

    @pytest.mark.parametrize(("tip", "root"), [(0.01, 0.01), (0.01, 0.025), (0.02, 0.012)])
    def test_tapered_cantilever(self, tip, root):
        length = 0.4

        def bending(power: int) -> float:
            def curvature(x: float) -> float:
                return x**power / (E * pi * (tip + (root - tip) * x / length) ** 4 / 64)

            return quad(curvature, 0, length, epsabs=0, epsrel=1e-12)[0]

        expected = np.array([[bending(2), bending(1)], [bending(1), bending(0)]])
        assert tapered_cantilever(length, tip, root, E=E) == pytest.approx(expected, rel=1e-10)

    def test_tapered_cantilever_by_stepped_frame(self):
        """A staircase of prismatic PyNite beams converges on the taper."""
        length, tip, root, steps = 0.4, 0.01, 0.025, 60
        points = np.column_stack([np.linspace(0, length, steps + 1), np.zeros((steps + 1, 2))])
        diameters = root + (tip - root) * (np.arange(steps) + 0.5) / steps
        beams = [Beam(f"step{i}", i, i + 1, E, pi * d**2 / 4, pi * d**4 / 64) for i, d in enumerate(diameters)]
        found = line_frame(points, beams, [], (0,), steps)[VERTICAL_PLANE]
        assert relative_error(found, tapered_cantilever(length, tip, root, E=E)) < 1e-3

    def test_timoshenko_cantilever(self):
        length, inertia, area, shear_coefficient = 0.06, 8e-9, 3e-4, 0.9
        found = timoshenko_cantilever(length, E=E, I=inertia, G=G, A=area, shear_coefficient=shear_coefficient)
        shear_free = timoshenko_cantilever(length, E=E, I=inertia, G=np.inf, A=area, shear_coefficient=1.0)
        assert found[0, 0] - shear_free[0, 0] == pytest.approx(length / (shear_coefficient * G * area), rel=1e-9)
        assert found[0, 1] == pytest.approx(found[1, 1] * length / 2)

    def test_timoshenko_cantilever_by_opensees(self, opensees):
        import openseespy.opensees as ops

        length, inertia, area, shear_coefficient = 0.06, 8e-9, 3e-4, 0.9
        expected = timoshenko_cantilever(length, E=E, I=inertia, G=G, A=area, shear_coefficient=shear_coefficient)
        for column, load in enumerate([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]):
            ops.wipe()
            ops.model("basic", "-ndm", 2, "-ndf", 3)
            ops.node(1, 0.0, 0.0)
            ops.node(2, length, 0.0)
            ops.fix(1, 1, 1, 1)
            ops.geomTransf("Linear", 1)
            ops.element("ElasticTimoshenkoBeam", 1, 1, 2, E, G, area, inertia, shear_coefficient * area, 1)
            ops.timeSeries("Constant", 1)
            ops.pattern("Plain", 1, 1)
            ops.load(2, *load)
            ops.constraints("Plain")
            ops.numberer("Plain")
            ops.system("FullGeneral")
            ops.algorithm("Linear")
            ops.integrator("LoadControl", 0.0)
            ops.analysis("Static", "-noWarnings")
            assert ops.analyze(1) == 0
            assert ops.nodeDisp(2)[1:] == pytest.approx(expected[:, column], rel=1e-9)
            ops.wipe()

    def test_a_mechanism_is_refused(self):
        points = np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0]], dtype=float)
        hinge = Joint("hinge", 0, 1, np.eye(3), (np.inf, np.inf, np.inf, np.inf, np.inf, 0))
        with pytest.raises(np.linalg.LinAlgError):
            line_frame(points, [Beam("beam", 1, 2, **BEAM)], [hinge], (0,), 2)
