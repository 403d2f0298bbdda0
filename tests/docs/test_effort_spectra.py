"""The picture of a joint's spectra on docs/efforts.md: its lines are right, and the cut-off stands where it is."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

SPEC = importlib.util.spec_from_file_location(
    "effort_spectra", Path(__file__).parents[2] / "scripts" / "effort_spectra.py"
)
spectra = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(spectra)

RATE = 200.0


def test_white_noise_has_the_density_that_it_has_and_the_cutoff_is_marked():
    noise = np.random.default_rng(1).normal(size=(4, 40_000))
    sizes = {"measured": 8.0, "predicted": 4.0, "of the motion": 2.0, "left": 1.0}
    efforts = {key: size * row for (key, size), row in zip(sizes.items(), noise, strict=True)}
    (axes,) = spectra.effort_spectra_figure("elbow", RATE, efforts, 12.0, 80.0).axes
    *lines, cutoff = axes.lines
    for line, size in zip(lines, sizes.values(), strict=True):
        # one-sided: variance over half the rate
        assert np.median(line.get_ydata()) == pytest.approx(size / np.sqrt(RATE / 2), rel=0.05)
        assert line.get_xdata()[-1] == pytest.approx(80.0, rel=0.01)
    assert list(cutoff.get_xdata()) == [12.0, 12.0]
    assert "12 Hz" in axes.texts[0].get_text()
