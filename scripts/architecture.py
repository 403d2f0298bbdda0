"""Draws docs/pictures/architecture.png and .svg: the rooms of the package, and which imports which.

The arrows are read from the source. `--check` draws nothing: it says whether the picture is of the present imports.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from typing import NamedTuple

from _project import ROOT
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from prup_pin.views.scene.colours import FAINT, INK
from tests.imports import DOORS, needed, room_imports

OUT = ROOT / "docs" / "pictures"
STIFF, LEFT_OUT, BOTH = "#0072B2", "#009E73", INK  # colours of the roads
GROUND = "#E1E5E8"
PITCH, HEIGHT = 0.62, 0.42  # of rows and of boxes [in]
BOTTOM = 0.42
SIZE = (10.6, 12.58)
ROUND = "round,pad=0,rounding_size=0.08"
LEFT, RIGHT = (0.75, 5.05), (5.75, 10.05)


class Box(NamedTuple):
    """Where a room is drawn: its row, counted from the ground, its two sides [in], its road, and what it holds."""

    row: int
    sides: tuple[float, float]
    road: str
    holds: str

    @property
    def middle(self) -> float:
        return sum(self.sides) / 2

    @property
    def low(self) -> float:
        return BOTTOM + PITCH * self.row

    @property
    def high(self) -> float:
        return self.low + HEIGHT


def _halves(sides: tuple[float, float]) -> list[tuple[float, float]]:
    low, high = sides
    return [(low, (low + high) / 2 - 0.08), ((low + high) / 2 + 0.08, high)]


#: What every room may import; arrows to them would cover the page.
GROUND_ROOMS = {
    "errors": "in words",
    "files": "whole",
    "plugins": "of others",
    "numbers": "units",
    "spatial": "frames",
    "parameters": "",
}
BOXES = {
    "modules": Box(1, LEFT, STIFF, "beams, bearings, screws: equations"),
    "mechanism": Box(2, LEFT, STIFF, "robot file: tree, loops, modules"),
    "kernel": Box(3, LEFT, STIFF, "frames, loop gaps, ranks"),
    "kinematics": Box(4, LEFT, STIFF, "closed poses"),
    "statics": Box(5, LEFT, STIFF, "wrench Jacobians, C and K, weight"),
    "loaded": Box(6, LEFT, STIFF, "equilibrium in the deformed position"),
    "sensitivity": Box(7, _halves(LEFT)[0], STIFF, "slopes"),
    "sweep": Box(7, _halves(LEFT)[1], STIFF, "many poses"),
    "design": Box(8, _halves(LEFT)[0], STIFF, "stiff and light"),
    "workspace": Box(8, _halves(LEFT)[1], STIFF, "where to"),
    "robot": Box(9, LEFT, STIFF, "what a user holds"),
    "review": Box(10, (4.22, 5.05), STIFF, ""),
    "robots": Box(10, (1.9, 3.08), STIFF, "files"),
    "loading": Box(11, (0.75, 2.96), STIFF, "by name or file"),
    "build": Box(11, (3.14, 4.16), STIFF, "new"),
    "laws": Box(7, (6.4, 8.4), LEFT_OUT, "physics left out"),
    "imports": Box(8, (RIGHT[1] - 1.35, RIGHT[1]), LEFT_OUT, "logs"),
    "recordings": Box(5, (6.9, RIGHT[1]), LEFT_OUT, "bench tests"),
    "dynamics": Box(6, (6.9, 8.55), LEFT_OUT, "motion"),
    "simulation": Box(12, RIGHT, LEFT_OUT, "a robot under inputs"),
    "compensation": Box(14, (0.75, 2.92), LEFT_OUT, "cancels it"),
    "export": Box(14, (3.08, 4.05), LEFT_OUT, ""),
    "channels": Box(13, RIGHT, LEFT_OUT, "residuals"),
    "diagnosis": Box(14, RIGHT, LEFT_OUT, "locate, compete, judge"),
    "life": Box(15, (RIGHT[0], RIGHT[1] - 1.95), LEFT_OUT, "over time, over a fleet"),
    "testing": Box(15, (RIGHT[1] - 1.8, RIGHT[1] - 0.8), LEFT_OUT, ""),
    "views": Box(16, (LEFT[0], RIGHT[1]), BOTH, "what people see: text, scene, drawing, meshcat, report"),
    "cli": Box(17, (LEFT[0], RIGHT[1]), BOTH, "the command prup-pin"),
}
#: Rooms that are made to be added to.
OPEN = {"modules": "a module", "mechanism": "a format", "laws": "a law, a deed", "channels": "a channel"}


def arrows(rooms: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Return the arrows that are drawn: those from which all other imports follow, without the ground and the doors."""
    without = {room: others - {other for start, other in DOORS if start == room} for room, others in rooms.items()}
    return sorted((room, other) for room, other in needed(without) if other not in GROUND_ROOMS)


def described(rooms: dict[str, set[str]]) -> str:
    """Return rooms and arrows as the picture carries them: 'kernel: mechanism; …'."""
    drawn = arrows(rooms)
    ends = {room: ", ".join(other for start, other in drawn if start == room) for room in sorted(rooms)}
    return "; ".join(f"{room}: {others or 'no arrow'}" for room, others in ends.items())


def carried() -> str:
    """Return the rooms and arrows of the picture in docs/pictures."""
    tree = ElementTree.parse(OUT / "architecture.svg")
    found = tree.find(".//{http://purl.org/dc/elements/1.1/}description")
    return "" if found is None else str(found.text)


def picture(rooms: dict[str, set[str]]) -> Figure:
    """Return the picture. Raises ValueError for a room that has no place in it, and for an arrow that climbs."""
    homeless = set(rooms) - set(GROUND_ROOMS) - set(BOXES)
    if homeless:
        raise ValueError(f"{', '.join(sorted(homeless))}: no place in the picture; give it one in BOXES")
    figure = Figure(figsize=SIZE, dpi=130, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, SIZE[0]), ylim=(0, SIZE[1]))
    axes.axis("off")
    axes.text(0.35, SIZE[1] - 0.42, "The rooms of prup_pin", fontsize=17, fontweight="bold", va="center")
    text = "an arrow says: imports. What can be reached along arrows may be imported too"
    axes.text(0.35, SIZE[1] - 0.76, text, fontsize=11, color=INK, va="center")
    _draw_ground(axes)
    for room in sorted(set(rooms) - set(GROUND_ROOMS)):
        _draw_room(axes, room, BOXES[room])
    for room, other in arrows(rooms):
        _draw_arrow(axes, room, other)
    _draw_doors(axes)
    _draw_plus(axes, (RIGHT[0] + 0.25, BOTTOM + 2.1 * PITCH), INK)
    for line, text in enumerate(("made to be added to:", "; ".join(OPEN.values()))):
        at = BOTTOM + 2.1 * PITCH - 0.24 * line
        axes.text(RIGHT[0] + 0.45, at, text, fontsize=10, color=INK, va="center")
    lines = ("robot file → mechanism → closed pose", "→ wrench Jacobians → C, K, parts")
    _draw_road(axes, LEFT[0], 11.6, "How stiff?", lines, STIFF)
    lines = ("recording → simulation → residual of channels", "→ places → laws compete → verdict")
    _draw_road(axes, RIGHT[0], 2.3, "What was left out?", lines, LEFT_OUT)
    return figure


def _draw_ground(axes) -> None:
    low, high = LEFT[0], RIGHT[1]
    axes.add_patch(FancyBboxPatch((low, BOTTOM), high - low, HEIGHT, boxstyle=ROUND, fc=GROUND, ec="none"))
    width = (high - low) / len(GROUND_ROOMS)
    for index, (room, holds) in enumerate(GROUND_ROOMS.items()):
        _write(axes, low + index * width, BOTTOM + HEIGHT / 2, room, holds, INK)
    text = "what every room may import"
    axes.text((low + high) / 2, BOTTOM - 0.2, text, fontsize=9, color=FAINT, ha="center", va="center")


def _draw_room(axes, room: str, box: Box) -> None:
    low, high = box.sides
    for fill, edge, alpha in (("white", box.road, 1.0), (box.road, "none", 0.08)):
        how = {"boxstyle": ROUND, "fc": fill, "ec": edge, "lw": 1.6, "alpha": alpha, "zorder": 2}
        axes.add_patch(FancyBboxPatch((low, box.low), high - low, HEIGHT, **how))
    _write(axes, low, (box.low + box.high) / 2, room, box.holds, box.road)
    if room in OPEN:
        _draw_plus(axes, (high, box.low), box.road)


def _draw_plus(axes, at: tuple[float, float], colour: str) -> None:
    axes.plot(*at, "o", ms=13, mfc="white", mec=colour, mew=1.4, zorder=4)
    axes.plot(*at, "+", ms=7, mec=colour, mew=1.8, zorder=5)


def _write(axes, left: float, at: float, room: str, holds: str, colour: str) -> None:
    name = axes.text(left + 0.13, at, room, fontsize=11.5, fontweight="bold", color=colour, va="center", zorder=4)
    end = axes.transData.inverted().transform(name.get_window_extent(axes.figure.canvas.get_renderer()).max)[0]
    axes.text(end + 0.12, at - 0.005, holds, fontsize=9.5, color=INK, va="center", zorder=4)


def _draw_arrow(axes, room: str, other: str) -> None:
    upper, lower = BOXES[room], BOXES[other]
    if upper.row <= lower.row:
        raise ValueError(f"{room} imports {other}, which is not drawn below it")
    if upper.sides[0] < lower.sides[1] and lower.sides[0] < upper.sides[1]:
        narrower = min(upper, lower, key=lambda box: box.sides[1] - box.sides[0])
        start, end = (narrower.middle, upper.low), (narrower.middle, lower.high)
    elif upper.middle < lower.middle:
        start = (upper.sides[1], (upper.low + upper.high) / 2)
        end = (lower.sides[0], (lower.low + lower.high) / 2)
    else:
        start = (upper.sides[0], (upper.low + upper.high) / 2)
        end = (lower.sides[1], (lower.low + lower.high) / 2)
    _arrow(axes, start, end)


def _arrow(axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    how = {"mutation_scale": 13, "lw": 1.5, "color": INK, "shrinkA": 1, "shrinkB": 1, "zorder": 3}
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", **how))


def _draw_doors(axes) -> None:
    for room, other in sorted((BOXES[start], BOXES[end]) for start, end in DOORS):
        on_left = room.sides[0] < other.middle
        edge, side = (room.sides[0], other.sides[0]) if on_left else (room.sides[1], other.sides[1])
        outside, at, to = 0.4 if on_left else SIZE[0] - 0.4, (room.low + room.high) / 2, (other.low + other.high) / 2
        axes.plot((edge, outside, outside), (at, at, to), color=FAINT, lw=1.3, ls=(0, (4, 3)))
        _arrow(axes, (outside, to), (side, to))
    text = "only when it is asked for"
    axes.text(
        0.27,
        (at_of("robot") + at_of("views")) / 2,
        text,
        fontsize=9,
        color=FAINT,
        rotation=90,
        ha="center",
        va="center",
    )


def at_of(room: str) -> float:
    """Return the height of a box's middle."""
    return (BOXES[room].low + BOXES[room].high) / 2


def _draw_road(axes, left: float, row: float, title: str, lines: Sequence[str], colour: str) -> None:
    at = BOTTOM + PITCH * row + 1.1
    axes.text(left + 0.13, at, title, fontsize=15, fontweight="bold", color=colour, va="center")
    for index, line in enumerate(lines):
        axes.text(left + 0.13, at - 0.34 - 0.24 * index, line, fontsize=10, color=INK, va="center")


def draw() -> None:
    """Write the picture as PNG and as SVG; the SVG carries rooms and arrows as its description."""
    rooms = room_imports()
    figure = picture(rooms)
    OUT.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT / "architecture.png")
    with rc_context({"svg.hashsalt": "prup_pin"}):
        figure.savefig(OUT / "architecture.svg", metadata={"Description": described(rooms), "Date": None})


def check() -> str:
    """Return what is wrong with the picture in docs/pictures; nothing where it is that of the present imports."""
    rooms = room_imports()
    picture(rooms)
    if carried() == described(rooms):
        return ""
    before, now = (set(text.split("; ")) for text in (carried(), described(rooms)))
    return "\n".join(
        ["docs/pictures/architecture.svg is of other imports; draw it again: python scripts/architecture.py"]
        + [f"- {line}" for line in sorted(before - now)]
        + [f"+ {line}" for line in sorted(now - before)]
    )


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(check() or None)
    draw()
