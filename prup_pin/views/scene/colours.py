"""Colours of the scenes: one perceptually uniform map for values, and a few fixed colours for signs."""

from __future__ import annotations

import numpy as np

from ...spatial import Array

__all__ = ["MAP", "grey_of", "hex_of", "map_colour", "rgb_of"]

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


def grey_of(colour: str) -> str:
    """Return a grey as light as the colour, so that colours are left to values."""
    light = float(rgb_of(colour) @ [0.299, 0.587, 0.114])
    level = 0.36 + 0.52 * light
    return hex_of([level, level, level * 1.02])
