"""The extension does not disturb readers that do not know it."""

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin import robots

PATH = robots.find("3prup")[0]


def test_pinocchio_reads_the_tree_and_ignores_the_extension():
    model = pin.buildModelFromUrdf(str(PATH))
    assert (model.nq, model.nv) == (15, 15)
    assert list(model.names) == list(prup_pin.load("3prup").model.names)


def test_yourdfpy_reads_the_tree_and_ignores_the_extension():
    yourdfpy = pytest.importorskip("yourdfpy")
    urdf = yourdfpy.URDF.load(str(PATH), load_meshes=False, build_collision_scene_graph=False)
    assert len(urdf.actuated_joint_names) == 15
    ours = prup_pin.load("3prup").home
    urdf.update_cfg(ours.joints)
    np.testing.assert_allclose(urdf.get_transform("leg2_bush", "base"), ours.placement("leg2_bush"), atol=1e-12)
