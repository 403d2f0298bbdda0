"""Efforts of bodies in motion by virtual work in base axes, against Pinocchio and against MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

from tests.reference.concealed.chain import GRAVITY, example_file, read_chain

FIVE_BAR = Path(__file__).parents[1] / "robots/weighty_five_bar/weighty_five_bar.urdf"
ARMS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", ()),
    "panda": ("panda_description/urdf/panda.urdf", ("panda_finger_joint1", "panda_finger_joint2")),
    "kinova": ("kinova_description/robots/kinova.urdf", ()),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", ()),
}


def states(chain, count=5, span=0.5):
    rng = np.random.default_rng(3)
    return [scale * rng.uniform(-1, 1, (count, len(chain.actuated))) for scale in (span, 2.0, 5.0)]


def by_pinocchio(path, chain, q, qd, qdd):
    """Return the efforts of the tree (N, joints); joints that the chain holds stay at zero."""
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = GRAVITY
    data = model.createData()
    out = []
    for x, v, a in zip(q, qd, qdd, strict=True):
        where, rate, pull = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for i, joint in enumerate(chain.joints):
            found = model.joints[model.getJointId(joint.name)]
            where[found.idx_q : found.idx_q + found.nq] = x[i] if found.nq == 1 else [np.cos(x[i]), np.sin(x[i])]
            rate[found.idx_v], pull[found.idx_v] = v[i], a[i]
        tau = pin.rnea(model, data, where, rate, pull)
        out.append([tau[model.joints[model.getJointId(joint.name)].idx_v] for joint in chain.joints])
    return np.array(out)


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_needs_the_efforts_that_pinocchio_finds(name):
    file, held = ARMS[name]
    chain = read_chain(example_file(file), held)
    q, qd, qdd, _ = chain.closed(*states(chain))
    ours = chain.efforts(q, qd, qdd)
    theirs = by_pinocchio(example_file(file), chain, q, qd, qdd)
    assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max()
    assert np.abs(theirs).min(axis=0).max() > 0.1


def test_an_arm_needs_the_efforts_that_mujoco_finds():
    path = example_file(ARMS["xarm7"][0])
    root = etree.fromstring(path.read_bytes())
    for part in root.xpath("//visual|//collision|//dynamics|//limit"):
        part.getparent().remove(part)
    for joint in root.xpath("//joint[@type='revolute']"):
        joint.set("type", "continuous")
    options = etree.SubElement(etree.SubElement(root, "mujoco"), "compiler")
    options.set("fusestatic", "false")
    model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
    model.opt.gravity[:] = GRAVITY
    data = mujoco.MjData(model)
    chain = read_chain(path)
    q, qd, qdd, _ = chain.closed(*states(chain))
    ours = chain.efforts(q, qd, qdd)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:] = q[k], qd[k]
        mujoco.mj_forward(model, data)
        data.qacc[:] = qdd[k]
        mujoco.mj_inverse(model, data)
        theirs = data.qfrc_inverse
        assert np.abs(ours[k] - theirs).max() < 1e-9 * np.abs(theirs).max()


def test_a_five_bar_moves_as_its_efforts_and_closure_forces_would_have_it():
    """Forward: the masses' matrix and the closure's Jacobian by Pinocchio give back the accelerations."""
    chain = read_chain(FIVE_BAR)
    q, qd, qdd, share = chain.closed(*states(chain, span=0.4))
    reduced = (share.swapaxes(-1, -2) @ chain.efforts(q, qd, qdd)[..., None])[..., 0]
    model = pin.buildModelFromUrdf(str(FIVE_BAR))
    model.gravity.linear = GRAVITY
    data = model.createData()
    ends = [model.getFrameId(name) for name in ("left_point", "right_point")]
    order = [model.joints[model.getJointId(joint.name)].idx_v for joint in chain.joints]
    for k in range(len(q)):
        where, rate = np.zeros(model.nv), np.zeros(model.nv)
        where[order], rate[order] = q[k], qd[k]
        mass = pin.crba(model, data, where)
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.nonLinearEffects(model, data, where, rate)
        pin.computeJointJacobians(model, data, where)
        pin.forwardKinematics(model, data, where, rate, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        world = pin.LOCAL_WORLD_ALIGNED
        jacobian = np.subtract(*(pin.getFrameJacobian(model, data, end, world)[[0, 2]] for end in ends[::-1]))
        drift = np.subtract(
            *(pin.getFrameClassicalAcceleration(model, data, end, world).linear[[0, 2]] for end in ends[::-1])
        )
        assert np.abs(data.oMf[ends[0]].translation - data.oMf[ends[1]].translation).max() < 1e-12
        effort = np.zeros(model.nv)
        effort[[order[i] for i in chain.actuated]] = reduced[k]
        system = np.block([[mass, jacobian.T], [jacobian, np.zeros((2, 2))]])
        moved = np.linalg.solve(system, np.r_[effort - bias, -drift])[: model.nv]
        assert np.abs(moved[order] - qdd[k]).max() < 1e-9 * np.abs(qdd).max()
