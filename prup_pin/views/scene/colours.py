"""Colours of all pictures, in a browser and on paper: one perceptually uniform map for shares and other values, and a
few fixed colours for signs. A colour means the same wherever it is seen; legs are told apart by their names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...spatial import Array

#: Words and rigid parts, and words beside them.
INK, FAINT = "#374151", "#6b7280"
#: The robot without load, the load, what it displaces; a place that a diagnosis found.
GHOST, LOAD, MOVED, FOUND = "#7d8794", "#0f7b3e", "#111827", "#c2255c"
#: Compliant parts where no share is shown: bodies, and symbols of drives, bearings and springs.
BEAM, SYMBOL = "#6f8aa5", "#b08d57"
#: Before anything was found or compensated, and after it: what a model leaves, what is estimated.
BEFORE, AFTER = "#9AA3AD", "#0B6AA8"
#: Zero and what bears no load; the band of a noise; the metal of drives.
PALE, BAND, METAL = "#C3C9D0", "#DCE3EA", "#8a929b"
#: x, y, z.
AXES = ("#d62728", "#2a9d3f", "#1f5fd0")
ELLIPSOIDS: Mapping[str, str] = {"translation": "#2a9d8f", "rotation": "#7a5195"}

#: 'Magma' of matplotlib (public domain) from light to dark, without its ends: lightness falls evenly, and people with
#: any kind of colour blindness see the order. What yields little is pale, what yields much is dark.
MAP = (
    "#fddea0",
    "#fec185",
    "#fea571",
    "#fc8961",
    "#f66c5c",
    "#e95462",
    "#d5446d",
    "#bd3977",
    "#a3307e",
    "#8b2981",
    "#732081",
    "#5c167f",
    "#440f76",
)


def rgb_of(colour: str) -> Array:
    """Return red, green, blue (0 to 1) of '#rrggbb'."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def hex_of(rgb) -> str:
    """Return '#rrggbb' of red, green, blue (0 to 1)."""
    values = np.clip(np.round(np.asarray(rgb, float)[:3] * 255), 0, 255).astype(int)
    return "#{:02x}{:02x}{:02x}".format(*values)


_TABLE = np.array([rgb_of(colour) for colour in MAP])


def map_rgb(fractions) -> Array:
    """Return (..., 3) colours of values between 0 and 1."""
    at = np.clip(np.asarray(fractions, float), 0, 1)
    places = np.linspace(0, 1, len(_TABLE))
    return np.stack([np.interp(at, places, _TABLE[:, channel]) for channel in range(3)], axis=-1)


def map_colour(fraction: float) -> str:
    """Return the colour of a value between 0 and 1."""
    return hex_of(map_rgb(fraction))


def share_colours(shares: Mapping[str, float]) -> tuple[dict[str, str], float]:
    """Return a colour for each share, and the share at the dark end of the map: the largest one, rounded up."""
    largest = max([*shares.values(), 0.0])
    if largest <= 0:
        return dict.fromkeys(shares, map_colour(0.0)), 0.0
    step = 10.0 ** np.floor(np.log10(largest)) / 2
    top = float(np.ceil(largest / step - 1e-9) * step)
    return {name: map_colour(share / top) for name, share in shares.items()}, top


def grey_of(colour: str) -> str:
    """Return a grey as light as the colour, so that colours are left to values."""
    light = float(rgb_of(colour) @ [0.299, 0.587, 0.114])
    level = 0.36 + 0.52 * light
    return hex_of([level, level, level * 1.02])
