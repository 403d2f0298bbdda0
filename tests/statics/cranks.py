"""Cranks: one beam on a sprung joint, whose ends are frames of the link that turns, or of the one that stays."""

import numpy as np

LENGTH, DIAMETER, MODULUS, SPRING = 0.4, 0.012, 2.0e11, 5000.0
INERTIA = np.pi * DIAMETER**4 / 64
FORCE = 20.0


def crank_file(root="crank", tip="crank_end", joint="drive", visual=""):
    """Return a robot file: base, joint `drive` about z, link `crank` along x, and a joint `wrist` at its far end."""
    return f"""<robot name="crank">
  <link name="base"/><link name="crank">{visual}</link><link name="crank_end"/><link name="hand"/><link name="tool"/>
  <joint name="drive" type="revolute"><parent link="base"/><child link="crank"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="crank"/><child link="crank_end"/><origin xyz="{LENGTH} 0 0"/></joint>
  <joint name="wrist" type="revolute"><parent link="crank"/><child link="hand"/><origin xyz="{LENGTH} 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="tool" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>
  <prup_pin version="1"><gravity xyz="0 0 -9.81"/><tool frame="tool"/><actuated joints="drive wrist"/>
    <module name="spring" type="joint_spring" joint="drive">
      <parameter name="stiffness" value="{SPRING}" unit="N m/rad"/></module>
    <module name="rod" type="beam" joint="{joint}" root="{root}" tip="{tip}">
      <parameter name="diameter" value="{DIAMETER}" unit="m"/>
      <parameter name="youngs_modulus" value="{MODULUS}" unit="Pa"/></module>
  </prup_pin>
</robot>
"""


def along(fractions):
    """Return deflections (n,) [m] and slopes (n,) [rad] of the crank's sections under the force, closed form.

    The tool's force in y acts 0.1 m beyond the rod: a cantilever under force and moment on a turning spring.
    """
    x, moment = LENGTH * np.asarray(fractions), FORCE * (LENGTH + 0.1)
    slope = moment * x - FORCE * x**2 / 2
    turn = moment / SPRING
    bent = moment * x**2 / 2 - FORCE * x**3 / 6
    return turn * x + bent / (MODULUS * INERTIA), turn + slope / (MODULUS * INERTIA)
