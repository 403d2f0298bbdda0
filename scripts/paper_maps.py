"""Draws docs/pictures/fig21 and fig22 (.png, .svg): the paper's Figs. 21 and 22, as published and correct side by side.

Also share_maps: which module yields where. All at z = 0.3 m, within the limits of the robot file.
"""

from __future__ import annotations

import io
import sys

import numpy as np
from _project import ROOT
from PIL import Image

import prup_pin
from prup_pin.views.drawing.plotting import encoded
from prup_pin.views.drawing.sweep_figures import beside_figure, share_figure

COUNT = 61
OUT = ROOT / "docs" / "pictures"
_DPI = 160
TITLE = "z = 0.3 m, |f| up to 300 N, |m| up to 100 N m each component"


def main(count: int = COUNT) -> None:
    """Write the pictures."""
    angles = np.radians(np.linspace(-55, 55, count))
    names = ["eigenvalues", "ksi", "extremes", "extreme_components", "shares"]
    swept = []
    for word, name in (("as published", "3prup_as_published"), ("correct", "3prup")):
        found = prup_pin.load(name).sweep(z=0.3, theta=angles, phi=angles, quantities=names, force=300, moment=100)
        swept.append((word, found))
    ends = {"eigenvalues": ("1", "6")}
    figures = {
        "fig21": beside_figure(swept, ["eigenvalues", "ksi"], "Fig. 21: eigenvalues of K and KSI, z = 0.3 m", ends),
        "fig22": beside_figure(swept, ["extremes", "extreme_components"], f"Fig. 22: largest deflections, {TITLE}"),
        "share_maps": share_figure(swept[1][1]),
    }
    for name, figure in figures.items():
        (OUT / f"{name}.svg").write_bytes(encoded(figure, "svg"))
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=_DPI)
        # Bands of a dozen colours: a palette shows the same in a third of the bytes.
        small = Image.open(drawn).convert("RGB").quantize(256, dither=Image.Dither.NONE)
        small.save(OUT / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
