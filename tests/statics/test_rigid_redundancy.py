"""A planar loop whose bearings are rigid along their axes: nothing tells the loads across its plane."""

import numpy as np
import pytest

import prup_pin

ROBOT = """<robot name="five_bar">
  <link name="base"/>{links}
  <prup_pin version="1">
    <tool frame="left_end"/><actuated joints="left_motor right_motor"/><home left_motor="0" right_motor="0"/>
    <loop name="meet" frame1="left_end" frame2="right_end" free="rz"/>{modules}
  </prup_pin>
</robot>"""
SIDES = {"left": ((-0.14, 0.0), (-0.322, 0.25)), "right": ((0.17, 0.02), (0.365, 0.22))}
END = (0.05, 0.484)
SOFT = {"shoulder": 6e7, "elbow": 4e7}  # radial, N/m


def robot_file(axial=""):
    links, modules = "", ""
    for side, (base, elbow) in SIDES.items():
        for joint, parent, child, kind, way in (
            (f"{side}_motor", "base", f"{side}_arm", "revolute", base),
            (f"{side}_elbow", f"{side}_arm", f"{side}_rod", "revolute", np.subtract(elbow, base)),
            (f"{side}_tip", f"{side}_rod", f"{side}_end", "fixed", np.subtract(END, elbow)),
        ):
            links += f'<link name="{child}"/><joint name="{joint}" type="{kind}"><parent link="{parent}"/>'
            links += f'<child link="{child}"/><origin xyz="{way[0]} {way[1]} 0"/><axis xyz="0 0 1"/>'
            links += '<limit lower="-3" upper="3" effort="1e3" velocity="9"/></joint>'
        modules += f'<module name="{side}_drive" type="joint_spring" joint="{side}_motor">'
        modules += '<parameter name="stiffness" value="30000" unit="N m/rad"/></module>'
        for place, joint in (("shoulder", f"{side}_motor"), ("elbow", f"{side}_elbow")):
            modules += f'<module name="{side}_{place}" type="bearing" joint="{joint}" axis="0 0 1">{axial}'
            modules += f'<parameter name="radial_stiffness" value="{SOFT[place]}" unit="N/m"/></module>'
    return ROBOT.format(links=links, modules=modules)


def compliance_of(tmp_path, axial=""):
    path = tmp_path / "five_bar.urdf"
    path.write_text(robot_file(axial))
    robot = prup_pin.load(path)
    return robot.compliance(robot.home)


def test_bearings_share_the_work_as_forces_along_the_rods_say(tmp_path):
    """By hand: at the tool the rods' forces balance the load; a rod's force is that of its bearings."""
    found = compliance_of(tmp_path)
    rods = np.array([np.subtract(END, elbow) for _, elbow in SIDES.values()])
    rods /= np.linalg.norm(rods, axis=1)[:, None]
    forces = np.linalg.inv(rods.T)  # of each rod by the load (2, 2)
    for side, force in zip(SIDES, forces, strict=True):
        for place, stiffness in SOFT.items():
            part = found.parts[f"{side}_{place}"]
            np.testing.assert_allclose(part[:2, :2], np.outer(force, force) / stiffness, rtol=1e-9)
            assert np.abs(found.wrench_jacobians[f"{side}_{place}"]).max() < 10  # N per N, N m per N


@pytest.mark.parametrize("stiffness", [1e12, 1e15])
def test_what_is_rigid_is_the_limit_of_what_hardly_yields(tmp_path, stiffness):
    axial = f'<parameter name="axial_stiffness" value="{stiffness}" unit="N/m"/>'
    axial += f'<parameter name="tilting_stiffness" value="{stiffness}" unit="N m/rad"/>'
    rigid, nearly = (compliance_of(tmp_path, each) for each in ("", axial))
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    np.testing.assert_allclose(rigid.C[plane], nearly.C[plane], rtol=1e-9)
