"""What pulls at the tool of a robot in motion: a cord, a hose; and a body that it holds, which is neither."""

import numpy as np
import pinocchio as pin
import pytest

import prup_pin

from .test_states_in_no_order import logged


@pytest.fixture(scope="module")
def ur5():
    return prup_pin.load("ur5")


def pulled(robot, force=None, held=0.0):
    """A log of the robot as it is drawn, with a force (3,) on the tool by its position or a mass [kg] in it: by
    Pinocchio alone."""
    log, model, tool = logged(robot, shuffled=False, faulty=False), robot.model.copy(), robot.mechanism.tool
    efforts = {name: values.copy() for name, values in log.efforts.items()}
    tables = (log.positions, log.velocities, log.accelerations)
    placement = pin.SE3(tool.placement)
    bare = model.createData()
    loaded = model.copy()
    loaded.appendBodyToJoint(tool.joint, pin.Inertia.FromSphere(max(held, 1e-12), 0.05), placement)
    data = loaded.createData()
    for row in range(len(log)):
        q, v, a = (np.array([table[name][row] for name in efforts]) for table in tables)
        added = pin.rnea(loaded, data, q, v, a) - pin.rnea(model, bare, q, v, a)
        if force is not None:
            pin.computeJointJacobians(model, bare, q)
            own = pin.getJointJacobian(model, bare, tool.joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            arm = bare.oMi[tool.joint].rotation @ tool.placement[:3, 3]
            own = own[:3] + np.cross(own[3:].T, arm).T
            added -= own.T @ force(bare.oMi[tool.joint].translation + arm)
        for column, name in enumerate(efforts):
            efforts[name][row] += added[column]
    return log.with_measurements(efforts=efforts)


@pytest.mark.slow
def test_an_even_pull_is_one_force(ur5):
    force = np.array([30.0, -18.0, 10.0])
    told = prup_pin.diagnose(ur5, pulled(ur5, lambda there: force))
    assert told.verdict == "explained"
    assert [item.physics for item in told.findings] == ["external_force"]
    values = told.effects[0].values
    assert [values[name] for name in ("fx", "fy", "fz")] == pytest.approx(force, abs=0.5)


@pytest.mark.slow
def test_a_hose_is_a_force_with_where_the_tool_is(ur5):
    anchor = np.array([0.4, -0.6, 1.2])
    told = prup_pin.diagnose(ur5, pulled(ur5, lambda there: 20.0 * (anchor - there)))
    assert told.verdict == "explained"
    assert [item.physics for item in told.findings] == ["external_spring"]
    values = told.effects[0].values
    assert [values[name] for name in ("kxx", "kyy", "kzz")] == pytest.approx([20.0] * 3, rel=0.05)
    assert [values[name] for name in ("kxy", "kxz", "kyz")] == pytest.approx([0.0] * 3, abs=1.0)


@pytest.mark.slow
def test_what_the_tool_holds_pulls_at_nothing(ur5):
    told = prup_pin.diagnose(ur5, pulled(ur5, held=2.0))
    assert [item.physics for item in told.findings] == ["payload"]
