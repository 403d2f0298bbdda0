"""Every Jacobian of the kinematics against finite differences, on and off closure, for every kind of closure."""

from itertools import chain, combinations

import numpy as np
import pinocchio as pin
import pytest

import prup_pin

AXES = ("x", "y", "z", "rx", "ry", "rz")
FREE = list(chain.from_iterable(combinations(AXES, n) for n in range(5)))

CHAIN = """
  <link name="{side}{index}"/>
  <joint name="{side}_joint{index}" type="{kind}">
    <parent link="{parent}"/><child link="{side}{index}"/>
    <origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>"""


def two_chains(tmp_path, free, rotation="xyz"):
    """Two random chains of seven joints from one base, joined by a closure that leaves `free` free."""
    generator = np.random.default_rng(7)
    parts = []
    for side in ("left", "right"):
        parent = "base"
        for index in range(7):
            numbers = [" ".join(f"{x:.6f}" for x in generator.uniform(-0.5, 0.5, 3)) for _ in range(3)]
            kind = "prismatic" if index == 3 else "revolute"
            parts.append(
                CHAIN.format(
                    side=side, index=index, kind=kind, parent=parent, xyz=numbers[0], rpy=numbers[1], axis=numbers[2]
                )
            )
            parent = f"{side}{index}"
    path = tmp_path / "chains.urdf"
    path.write_text(
        '<robot name="chains"><link name="base"/>' + "".join(parts) + '<prup_pin version="1"><tool frame="left4"/>'
        '<actuated joints="left_joint0 right_joint0"/><task_coordinates rotation="'
        + rotation
        + '">'
        + "".join(f'<coordinate name="{axis}" component="{axis}"/>' for axis in AXES)
        + "</task_coordinates>"
        + f'<loop name="loop" frame1="left6" frame2="right6" free="{" ".join(free)}"/></prup_pin></robot>'
    )
    return prup_pin.load(path)


def differences(function, model, q, step=1e-6):
    columns = []
    for unit in np.eye(model.nv):
        columns.append(
            (function(pin.integrate(model, q, step * unit)) - function(pin.integrate(model, q, -step * unit)))
            / (2 * step)
        )
    return np.array(columns).T


@pytest.mark.parametrize("free", FREE, ids=lambda free: "+".join(free) or "weld")
def test_closure_jacobian_is_exact_off_closure_too(tmp_path, free):
    robot = two_chains(tmp_path, free)
    kinematics = robot._kinematics
    q = np.random.default_rng(3).uniform(-0.4, 0.4, robot.model.nq)
    evaluation = kinematics.evaluate(q)
    assert len(evaluation.residual) == 6 - len(free)
    numeric = differences(lambda at: kinematics.evaluate(at).residual, robot.model, q)
    np.testing.assert_allclose(evaluation.closure, numeric, atol=2e-9)


@pytest.mark.parametrize(
    "free", [(), ("rz",), ("rx",), ("rx", "ry", "rz"), ("z",), ("x", "rx"), ("rx", "rz"), ("ry", "rz")], ids="+".join
)
def test_newton_closes_and_leaves_only_the_free_motions(tmp_path, free):
    robot = two_chains(tmp_path, free)
    kinematics = robot._kinematics
    closed = kinematics.home
    evaluation = kinematics.evaluate(closed)
    assert np.abs(evaluation.residual).max() < 1e-12
    assert evaluation.assembled
    loop = robot.mechanism.loops[0]
    ends = [evaluation.placements[end.joint] @ end.placement for end in (loop.first, loop.second)]
    relative = np.linalg.inv(ends[0]) @ ends[1]
    for axis, name in enumerate("xyz"):
        if name not in free:
            assert abs(relative[axis, 3]) < 1e-11
    turning = [axis for axis in ("rx", "ry", "rz") if axis in free]
    if not turning:
        np.testing.assert_allclose(relative[:3, :3], np.eye(3), atol=1e-10)
    if len(turning) == 1:
        kept = ("rx", "ry", "rz").index(turning[0])
        np.testing.assert_allclose(relative[:3, kept], np.eye(3)[kept], atol=1e-10)


@pytest.mark.parametrize("rotation", ["xyz", "zyx"])
def test_task_rows(tmp_path, rotation):
    robot = two_chains(tmp_path, (), rotation)
    kinematics = robot._kinematics
    q = np.random.default_rng(5).uniform(-0.4, 0.4, robot.model.nq)
    goal = kinematics.task.goal(np.zeros(6))

    def residual(at):
        evaluation = kinematics.evaluate(at)
        return np.array(goal(at, evaluation.placements)[0])

    evaluation = kinematics.evaluate(q)
    rows = goal(q, evaluation.placements)[1](evaluation.jacobian)
    np.testing.assert_allclose(rows, differences(residual, robot.model, q), atol=2e-9)
    # the angles rebuild the rotation
    x, y, z, rx, ry, rz = kinematics.task.pose_vector(evaluation.placements)
    tool = robot.mechanism.tool
    placed = evaluation.placements[tool.joint] @ tool.placement
    turn = [pin.utils.rotate(axis, angle) for axis, angle in zip("xyz", (rx, ry, rz), strict=True)]
    expected = turn[0] @ turn[1] @ turn[2] if rotation == "xyz" else turn[2] @ turn[1] @ turn[0]
    np.testing.assert_allclose(placed[:3, :3], expected, atol=1e-12)
    np.testing.assert_allclose(placed[:3, 3], (x, y, z), atol=1e-15)


def test_a_loop_that_cannot_close_is_named(tmp_path):
    path = tmp_path / "gap.urdf"
    path.write_text(
        """<robot name="gap"><link name="base"/><link name="a"/><link name="b"/>
        <joint name="ja" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
          <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="jb" type="revolute"><parent link="base"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
          <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <prup_pin version="1"><tool frame="a"/><actuated joints="ja"/>
          <loop name="far_apart" frame1="a" frame2="b"/></prup_pin>
        </robot>"""
    )
    robot = prup_pin.load(path)
    with pytest.raises(prup_pin.UnreachablePoseError, match=r"do not close from its home.*1 m.*'far_apart'"):
        robot.home  # noqa: B018
