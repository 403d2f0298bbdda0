"""Pictures: a robot at a pose with its compliance, and which module yields. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import fixed, number, readable_unit
from ...robot import Robot
from ...spatial import Array
from ...statics import Compliance
from ..scene.colours import INK, PALE, rgb_of, share_colours
from ..scene.painter import pose_scene
from ..scene.scene import Legend, Lines, Part, Scene, mesh_of
from ..text.answer import Answer, load_text, ranked
from ..text.values import percent_text
from .plotting import (
    Figure,
    Labels,
    LineCollection,
    ListedColormap,
    Patch,
    PolyCollection,
    plain_axes,
    plain_words,
    sheet,
)


@plain_words
def pose_figure(
    robot: Robot,
    pose: ClosedPose,
    compliance: Compliance | None = None,
    wrench=None,
    scale: float | None = None,
    *,
    narrow: bool = False,
) -> Figure:
    """Return the scene of a pose on paper: the robot, its deflection under a wrench, the compliance at its tool.

    What `painter.pose_scene` says holds here. Save it with `figure.savefig("pose.png")`. `narrow`: for a phone.
    """
    figure = sheet(*(NARROW if narrow else WIDE), dpi=100)
    scene_figure(figure, pose_scene(robot, pose, wrench, scale, compliance=compliance))
    return figure


@plain_words
def shares_figure(compliance: Compliance, wrench=None, *, narrow: bool = False) -> Figure:
    """Return horizontal bars of each module's share in the work of a wrench, in % and µm, in the colours of the scene.

    Without a wrench: a unit force along the softest direction. `narrow`: for a phone. Raises InputError where the
    wrench deflects nothing.
    """
    answer = Answer(compliance, wrench)
    if answer.shares is None:
        raise InputError("this load deflects nothing, so there are no shares to draw")
    shares = {name: answer.shares[name] for name in ranked(answer.shares)}
    shown = {name: share for name, share in shares.items() if share >= 5e-4}
    shown = dict(list(shown.items())[:24])
    rest = [name for name in shares if name not in shown]
    unit, factor = readable_unit(answer.amount, "rad" if answer.load.turns else "m")
    rows = [(name, share, answer.contributions[name]) for name, share in shown.items()]
    if rest:
        label = rest[0] if len(rest) == 1 else f"{len(rest)} others"
        rows.append((label, sum(shares[name] for name in rest), sum(answer.contributions[name] for name in rest)))
    colours, _ = share_colours(answer.shares)
    what = "tool turns" if answer.load.turns else "tool moves"
    told = (
        f"{load_text(answer)}: the {what} by {number(answer.amount * factor, 4)} {unit}; {unit}: the part of each "
        "module in this"
    )
    width, size, letter, room = (5.2, 8.5, 0.07, 1.75) if narrow else (9.5, 9.5, 0.081, 1.32)
    lines = wrap(told, 58 if narrow else 130)
    head = 1.1 + 0.22 * (len(lines) - 1)
    height = head + 0.9 + 0.33 * len(rows)
    figure = sheet(width, height)
    left = min(0.45, (0.38 + letter * max(len(row[0]) for row in rows)) / width)
    axes = figure.add_axes((left, 0.55 / height, 0.97 - left, 1 - (head + 0.55) / height))
    largest = max(share for _, share, _ in rows)
    amounts = fixed([factor * amount for _, _, amount in rows])
    lengths, shades = [100 * share for _, share, _ in rows], [colours.get(name, PALE) for name, _, _ in rows]
    bars = axes.barh(range(len(rows)), lengths, 0.68, color=shades, zorder=2)
    labels = [
        f"{percent_text(share, coarse=True)} %   {amount} {unit}"
        for (_, share, _), amount in zip(rows, amounts, strict=True)
    ]
    axes.bar_label(bars, labels, padding=7, fontsize=size, color="#222222")
    axes.set_yticks(range(len(rows)), [row[0] for row in rows], fontsize=size)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(0, 100 * room * largest)
    axes.set_xlabel("share of the work done by the load [%]", fontsize=size)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=size)
    plain_axes(axes, None, "x", ("top", "right", "left"))
    if compliance.legs:
        parts = {leg: answer.share_of(part) or 0.0 for leg, part in compliance.legs.items()}
        legs = [f"{leg}  {percent_text(share, coarse=True)} %" for leg, share in parts.items()]
        text = "\n".join(["all of a leg", *legs[:12]])
        axes.text(0.98, 0.03, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=size, linespacing=1.5)
    write_head(figure, f"{answer.mechanism.name}: which part yields", lines, size + 0.5)
    return figure


# -- a scene on paper --------------------------------------------------------------------------------------------------


#: Sizes of a wide figure and a narrow one [inches], the latter as high as its scene and legend; letters in a line.
WIDE, NARROW = (11.0, 7.2), (5.2, 9.2)
_LETTERS = {WIDE: 120, NARROW: 62}
#: Heights on a phone [inches]: of a scene, a row of the legend, the scale above it, the title, a line under that.
_SCENE, _ROW, _SCALE, _TITLE, _HEAD_LINE = (2.2, 4.2), 0.2, 0.75, 0.7, 0.23
#: Light that comes from all sides, as a share; the rest comes from above the eye.
_AMBIENT = 0.6
#: Room about the scene, as a share of it.
_ROOM = 0.05


class SceneDrawing:
    """Axes on which a scene is drawn, at a `place` of the figure, and what puts labels beside its parts."""

    def __init__(self, figure: Figure, place: tuple[float, float, float, float], scene: Scene):
        self.plane = scene.page[:2]
        self.axes: Any = figure.add_axes(place)
        self.axes.axis("off")
        flat = self.flat(scene.bounds)
        low, high = flat.min(axis=0), flat.max(axis=0)
        half = (0.5 + _ROOM) * (high - low)
        wide, tall = figure.get_size_inches() * place[2:]
        half = np.maximum(half, half[::-1] * np.array([wide / tall, tall / wide]))
        (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
        self.axes.set_xlim(left, right)
        self.axes.set_ylim(bottom, top)
        figure.canvas.draw()  # labels are placed on the page
        self.labels = Labels(figure, self.axes)
        self.labels.obstacles.append(self.flat(scene.obstacles))
        for part in scene.parts:
            if isinstance(part.shape, Lines):
                ends = self.flat(part.shape.ends @ part.placement[:3, :3].T + part.placement[:3, 3])
                drawn = LineCollection(list(ends), colors=part.colour, linewidths=0.6, zorder=1)
                self.axes.add_collection(drawn, autolim=False)
        for over in (False, True):
            solid = [part for part in scene.parts if part.on_top is over and not isinstance(part.shape, Lines)]
            if solid:
                self._paint(scene, solid, 20 if over else 10)

    def flat(self, points: Array) -> Array:
        """Return (..., 2) coordinates on the page."""
        return np.asarray(points) @ self.plane.T

    def _paint(self, scene: Scene, parts: Sequence[Part], order: float) -> None:
        """Draw parts as triangles, the farthest first; of what is seen through only those that face the eye."""
        light = scene.viewer + 0.7 * scene.up
        light = light / np.linalg.norm(light)
        every = [_triangles(part) for part in parts]
        corners, colours = (np.concatenate(found) for found in zip(*every, strict=True))
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        colours[:, :3] *= (_AMBIENT + (1 - _AMBIENT) * np.abs(normals @ light))[:, None]
        shown = (colours[:, 3] == 1) | (normals @ scene.viewer > 0)
        corners, colours = corners[shown], colours[shown]
        farthest = np.argsort(corners.mean(axis=1) @ scene.viewer, kind="stable")
        flat, faces = list(self.flat(corners[farthest])), colours[farthest]
        edges = np.where(faces[:, 3:] == 1, faces, 0.0)  # closes the seams between triangles
        painted = PolyCollection(
            flat, facecolors=faces, edgecolors=edges, linewidths=0.3, rasterized=True, zorder=order
        )
        self.axes.add_collection(painted, autolim=False)


def _triangles(part: Part) -> tuple[Array, Array]:
    """Return the corners (n, 3, 3) of a part's triangles in base axes, and their colours (n, 4)."""
    assert not isinstance(part.shape, Lines)
    mesh = mesh_of(part.shape)
    corners = (mesh.vertices @ part.placement[:3, :3].T + part.placement[:3, 3])[mesh.faces]
    colours = np.full((len(corners), 4), part.opacity)
    colours[:, :3] = rgb_of(part.colour) if mesh.colours is None else mesh.colours[mesh.faces].mean(axis=1)
    return corners, colours


def scene_figure(figure: Figure, scene: Scene, below: float = 0.0) -> SceneDrawing:
    """Draw a scene with its labels and legend on an empty figure that is WIDE or NARROW.

    below: height that a narrow one keeps free at its lower end [inches].
    """
    size = WIDE if figure.get_figwidth() > NARROW[0] else NARROW
    lines = [part for line in scene.legend.lines for part in wrap(line, _LETTERS[size])]
    place, legend = (0.01, 0.02, 0.68, 0.82), (0.70, 0.80)
    if size is NARROW:
        place, legend = _stacked(figure, scene, len(lines), below)
    drawing = SceneDrawing(figure, place, scene)
    for label in sorted(scene.labels, key=lambda label: not label.strong):
        at, beside = drawing.flat(label.at), drawing.flat(label.beside)
        weight = "bold" if label.strong else "normal"
        drawing.labels.put(label.text, at, label.colour, at - beside, 9.5, weight)
    write_head(figure, scene.legend.title, lines, 11 if size is WIDE else 9.5)
    _write_legend(figure, scene.legend, legend)
    return drawing


def _stacked(
    figure: Figure, scene: Scene, lines: int, below: float
) -> tuple[tuple[float, float, float, float], tuple[float, float]]:
    """Make a figure as high as so many lines, the scene and its legend; return where these two stand, in shares."""
    wide, tall = np.ptp(scene.bounds @ scene.page[:2].T, axis=0)
    high = float(np.clip(0.96 * NARROW[0] * tall / wide, *_SCENE))
    rows = sum(text.count("\n") + 1 for _, text in _signs(scene.legend))
    legend = _ROW * rows + (_SCALE if scene.legend.scale_title else 0.0) + below
    whole = _TITLE + _HEAD_LINE * lines + high + legend + 0.2
    figure.set_size_inches(NARROW[0], whole)
    bottom = (legend + 0.1) / whole
    return (0.02, bottom, 0.96, high / whole), (0.05, bottom)


def _signs(legend: Legend) -> list[tuple[str, str]]:
    """Return the colours and texts of a legend's rows, no line too long."""
    signs = [(row.colour, f"{row.name}  {row.value}".strip()) for row in (*legend.rows, *legend.signs)]
    return [(colour, "\n".join(wrap(text, 40))) for colour, text in signs]


def _write_legend(figure: Figure, legend: Legend, place: tuple[float, float]) -> None:
    """Explain the colours, in the order of the scene's own legend."""
    (left, top), height = place, figure.get_figheight()
    if legend.scale_title:
        axes = figure.add_axes((left + 0.01, top - 0.45 / height, 0.2, 0.13 / height))
        axes.imshow(np.linspace(0, 1, 256)[None], cmap=ListedColormap(legend.scale_colours), aspect="auto")
        axes.set_yticks([])
        axes.set_xticks([0, 255], list(legend.scale_ends), fontsize=9)
        axes.tick_params(length=0, pad=2)
        axes.set_title(legend.scale_title, fontsize=9.5, loc="left", pad=4)
        axes.spines[:].set_visible(False)
        top -= _SCALE / height
    signs = _signs(legend)
    handles, labels = [Patch(color=colour or "none") for colour, _ in signs], [text for _, text in signs]
    how = {"frameon": False, "fontsize": 9.5, "handlelength": 1.2, "labelspacing": 0.3}
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(left, top), **how)


def write_head(figure: Figure, title: str, lines: Sequence[str] = (), size: float = 11.0) -> None:
    """Write a title and lines under it at the upper left."""
    height = figure.get_figheight()
    figure.text(0.025, 1 - 0.32 / height, title, fontsize=1.45 * size, weight="bold", va="center")
    for index, line in enumerate(lines):
        place = 1 - (0.61 + 0.024 * size * index) / height
        figure.text(0.025, place, line, fontsize=size, color=INK, va="center")
