"""How an effort may follow one variable: powers, gaps, saturations, bumps, decays, waves, as functions of values (N,).

Textbook shapes, chosen before any machine was looked at: springs that stiffen and stops (Shigley's Mechanical
Engineering Design, ch. 10), drag (Batchelor, ch. 5.11), friction that fades (Armstrong-Hélouvry, Dupont and Canudas de
Wit 1994), detents (Furlani, Permanent Magnet and Electromechanical Devices, ch. 5), waves of whatever turns. All
parameters of a shape have the unit of its variable, so that units compose: a shape is of a `power` of that unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...spatial import Array


@dataclass(frozen=True)
class Shape:
    """A function of values (N,) and parameters, which returns (N,), or (N, c) of c `heights`.

    text: in symbols; power: of the variable's unit. `places` are parameters that may lie anywhere in the variable's
    range, `sizes` positive ones.
    """

    of: Callable[..., Array]
    text: str
    power: int = 0
    places: tuple[str, ...] = ()
    sizes: tuple[str, ...] = ()
    heights: tuple[str, ...] = ("coefficient",)

    @property
    def name(self) -> str:
        """What it is called in code."""
        return self.of.__name__

    @property
    def parameters(self) -> tuple[str, ...]:
        """Its parameters, in the order of its arguments."""
        return (*self.places, *self.sizes)

    def powers(self) -> tuple[int, ...]:
        """Return the power of the variable's unit of each height."""
        return (0, 1) if len(self.heights) > 1 and self.power else (self.power,) * len(self.heights)

    def tried(self, low: float, high: float) -> Iterator[tuple[float, ...]]:
        """Yield parameters among which the best are looked for, of a variable between two ends."""
        span = high - low
        if not self.parameters:
            yield ()
        elif not self.sizes:
            yield from ((low + span * share,) for share in _PLACES)
        elif not self.places:
            shares: Sequence[float] = [1 / count for count in _WAVES] if self.of is wave else _SIZES
            reach = span if self.of is wave else max(abs(low), abs(high))
            yield from ((reach * share,) for share in shares)
        else:
            for size in _WIDTHS:  # so near to each other that one of them shows whatever there is
                for place in np.linspace(0, 1, round(1 / size) + 1):
                    yield low + span * float(place), span * size


#: Shares of a variable's range where something may begin, and of its reach over which it may go on.
_PLACES = tuple((np.arange(19) + 1.0) / 20)
_SIZES = (0.03, 0.1, 0.2, 0.4, 0.7)
#: Widths of bumps, as shares of a range, and how many waves it may hold.
_WIDTHS = (0.02, 0.05, 0.12, 0.3)
_WAVES = tuple(np.arange(0.6, 12.0, 0.3))


def linear(x: Array) -> Array:
    """Return x."""
    return x


def square(x: Array) -> Array:
    """Return the square."""
    return x**2


def signed_square(x: Array) -> Array:
    """Return |x| x."""
    return np.abs(x) * x


def cube(x: Array) -> Array:
    """Return the third power."""
    return x**3


def magnitude(x: Array) -> Array:
    """Return |x|."""
    return np.abs(x)


def square_about(x: Array, rest: float) -> Array:
    """Return the square of the way from `rest`."""
    return (x - rest) ** 2


def signed_square_about(x: Array, rest: float) -> Array:
    """Return |y| y of the way y from `rest`."""
    return np.abs(x - rest) * (x - rest)


def cube_about(x: Array, rest: float) -> Array:
    """Return the third power of the way from `rest`."""
    return (x - rest) ** 3


def beyond(x: Array, start: float) -> Array:
    """Return how far x is above `start`; nothing below it."""
    return np.maximum(x - start, 0.0)


def below(x: Array, start: float) -> Array:
    """Return how far x is below `start`; nothing above it."""
    return np.maximum(start - x, 0.0)


def beyond_squared(x: Array, start: float) -> Array:
    """Return the square of how far x is above `start`."""
    return np.maximum(x - start, 0.0) ** 2


def below_squared(x: Array, start: float) -> Array:
    """Return the square of how far x is below `start`."""
    return np.maximum(start - x, 0.0) ** 2


def above(x: Array, start: float) -> Array:
    """Return 1 where x is above `start`, else 0: the mean over the way to the samples before and after."""
    middle = 0.5 * (x[1:] + x[:-1])
    ends = np.stack([np.append(x[:1], middle), np.append(middle, x[-1:])])
    low, high = ends.min(axis=0), ends.max(axis=0)
    return np.clip(np.divide(high - start, high - low, out=np.where(x > start, 1.0, 0.0), where=high > low), 0.0, 1.0)


def stop_above(x: Array, start: float) -> Array:
    """Return (N, 2): 1 above `start`, and how far x is above it: a stop with a preload."""
    return np.stack([above(x, start), beyond(x, start)], axis=-1)


def stop_below(x: Array, start: float) -> Array:
    """Return (N, 2): -1 below `start`, and how far x is below it, negative: a stop with a preload."""
    return np.stack([above(x, start) - 1.0, -below(x, start)], axis=-1)


def outside(x: Array, reach: float) -> Array:
    """Return x less a dead zone of `reach` to both sides."""
    return x - np.clip(x, -reach, reach)


def saturation(x: Array, reach: float) -> Array:
    """Return tanh(x / reach)."""
    return np.tanh(x / reach)


def decay(x: Array, reach: float) -> Array:
    """Return exp(-|x| / reach)."""
    return np.exp(-np.abs(x) / reach)


def bump(x: Array, centre: float, width: float) -> Array:
    """Return exp(-y^2) of the way y from `centre` in multiples of `width`."""
    return np.exp(-(((x - centre) / width) ** 2))


def detent(x: Array, centre: float, width: float) -> Array:
    """Return y exp(-y^2) of the way y from `centre` in multiples of `width`: what pulls back to a place, near it."""
    return (x - centre) / width * np.exp(-(((x - centre) / width) ** 2))


def wave(x: Array, period: float) -> Array:
    """Return (N, 2): cosine and sine of 2 pi x / period."""
    phase = 2 * np.pi * x / period
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1)


#: All shapes, plainer ones first.
SHAPES = {
    shape.name: shape
    for shape in (
        Shape(linear, "{x}", 1),
        Shape(magnitude, "|{x}|", 1),
        Shape(square, "{x}^2", 2),
        Shape(signed_square, "|{x}| {x}", 2),
        Shape(cube, "{x}^3", 3),
        Shape(square_about, "({x} - {rest})^2", 2, ("rest",)),
        Shape(signed_square_about, "|{x} - {rest}| ({x} - {rest})", 2, ("rest",)),
        Shape(cube_about, "({x} - {rest})^3", 3, ("rest",)),
        Shape(above, "[{x} > {start}]", 0, ("start",)),
        Shape(beyond, "max({x} - {start}, 0)", 1, ("start",)),
        Shape(below, "max({start} - {x}, 0)", 1, ("start",)),
        Shape(beyond_squared, "max({x} - {start}, 0)^2", 2, ("start",)),
        Shape(below_squared, "max({start} - {x}, 0)^2", 2, ("start",)),
        Shape(stop_above, "stop({x} > {start})", 1, ("start",), heights=("preload", "stiffness")),
        Shape(stop_below, "stop({x} < {start})", 1, ("start",), heights=("preload", "stiffness")),
        Shape(outside, "({x} beyond {reach})", 1, sizes=("reach",)),
        Shape(saturation, "tanh({x} / {reach})", sizes=("reach",)),
        Shape(decay, "exp(-|{x}| / {reach})", sizes=("reach",)),
        Shape(bump, "exp(-(({x} - {centre}) / {width})^2)", places=("centre",), sizes=("width",)),
        Shape(detent, "detent(({x} - {centre}) / {width})", places=("centre",), sizes=("width",)),
        Shape(wave, "wave(2 pi {x} / {period})", sizes=("period",), heights=("cosine", "sine")),
    )
}
