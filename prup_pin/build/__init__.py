"""Robots of common families from their dimensions: `stewart`, `three_rrr`, `three_prr`, `delta`, `five_bar`.

Each returns a robot; `robot.save("my.urdf")` writes the file it stands for, to be read, changed and extended.
All lengths in m, stiffnesses in N/m or N m/rad, masses in kg.
"""

from .clavel_delta import delta
from .gough_stewart import stewart
from .planar import five_bar, three_rrr
from .planar_slides import three_prr

__all__ = ["delta", "five_bar", "stewart", "three_prr", "three_rrr"]
