"""Pictures: the mechanism at a pose, its compliance, and which module yields. Needs matplotlib.

The mechanism is drawn in parallel projection: gravity points down on the page, nearer parts cover farther ones, and
labels are placed where nothing else is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import fixed, number, quantity, readable_unit
from ...robot import Robot
from ...spatial import Array, as_wrench, wrench_text
from ...statics import Compliance
from ..scene.camera import FORCE_LENGTH, Camera, camera_of, hull
from ..scene.colours import (
    AXES,
    BEAM,
    ELLIPSOIDS,
    FAINT,
    GHOST,
    INK,
    LOAD,
    MAP,
    PALE,
    ROLES,
    map_rgb,
    rgb_of,
    share_colours,
)
from ..scene.elastic import Deflections, fitting_scale, principal, tips_apart
from ..scene.skeleton import Skeleton, skeleton
from ..text.answer import Answer, load_text, ranked
from ..text.values import percent_text, pose_words
from .plotting import (
    NARROW,
    WIDE,
    Drawing,
    Figure,
    Layout,
    ListedColormap,
    Polygon,
    plain_axes,
    plain_words,
    sheet,
)

_PLATE = "#aeb6bf"
#: Beams under load, where a legend stands for all their colours; letters in an ellipsoid.
_MIDDLE, _DARK = MAP[len(MAP) // 2], "#14352B"
SOFT, _TRANSLATION = ELLIPSOIDS["translation"], slice(0, 3)


# -- drawing -----------------------------------------------------------------------------------------------------------


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
    """Return a picture of the mechanism, its deflection under a wrench, and the compliance at its tool.

    Under a wrench the mechanism is drawn pale, and over it deflected, `scale` times larger than life (None: a round
    number that shows it, as in the 3-D scene), with beams and joints coloured by their shares. The ellipsoid is the
    displacement of the tool under unit forces in all directions. Save it with `figure.savefig("pose.png")`. `narrow`:
    for a phone.
    """
    if compliance is not None and compliance.pose is not pose:
        raise InputError("this compliance belongs to another pose; ask for robot.compliance(pose)")
    if wrench is not None and compliance is None:
        raise InputError("a wrench deflects nothing without a compliance: give robot.compliance(pose)")
    load = None if wrench is None else as_wrench(wrench)
    parts = skeleton(pose)
    size = parts.size
    camera = camera_of(robot, pose)
    layout = NARROW if narrow else WIDE
    figure = sheet(*layout.size)
    moved = Deflections(compliance, load) if load is not None and compliance is not None else None
    if moved is not None and scale is None:
        scale = fitting_scale(moved, size)
    times = scale or 0.0
    ghost = moved if times else None
    extent = [camera.flat(parts.points)]
    if ghost is not None:
        extent += [camera.flat(ghost.curve(segment, times)) for segment in parts.segments]
    tool = parts.tool[:3, 3]
    if load is not None and load[:3].any():
        extent.append(camera.flat(tool + FORCE_LENGTH * size * load[:3] / np.linalg.norm(load[:3]))[None])
    extent.append(camera.flat(tool) + 0.16 * size * np.array([[-1, -1], [1, 1]]))
    flat = np.concatenate(extent)
    drawing = Drawing(figure, layout.drawing, camera, flat.min(axis=0) - 0.07 * size, flat.max(axis=0) + 0.07 * size)
    answer = None if compliance is None or load is None else Answer(compliance, load)
    shares = (answer.shares if answer is not None else None) or {}
    colours, top = share_colours(shares)
    # of joints on which something other than a beam yields: that of the softest part there
    softest = sorted(
        (module for module in robot.mechanism.modules if module.name in shares), key=lambda m: shares[m.name]
    )
    joints = {
        str(robot.model.names[module.joint]): colours[module.name] for module in softest if not module.kind.spans_frames
    }
    draw_mechanism(drawing, parts, pale=ghost is not None)
    if compliance is not None:  # around the tool, in proportion to the mechanism's size
        values, vectors = principal(compliance, _TRANSLATION)
        outline = camera.flat(tool) + _silhouette(camera, 0.15 * size * values / (values[0] or 1.0), vectors)
        if values[0] > 0:
            drawing.axes.add_patch(Polygon(outline, facecolor=SOFT, alpha=0.35, edgecolor=SOFT, lw=1.0, zorder=9.0))
    if ghost is not None:
        _draw_deflected(drawing, parts, ghost, times, {**joints, **colours})
    texts = draw_tool(drawing, parts)
    if load is not None and load.any():
        texts += _draw_wrench(drawing, tool, load, size)
    drawing.write(texts, parts.legs, parts.points, size)
    draw_compass(figure, camera, robot.mechanism.gravity, layout)
    if compliance is not None:
        draw_ellipsoid(figure, camera, compliance, layout)
    draw_legend(figure, drawing, layout)
    if ghost is not None and top:
        _draw_scale(figure, top, layout)
    _write_title(figure, robot, pose, compliance, load, scale if ghost is not None else None, layout)
    return figure


def draw_mechanism(drawing: Drawing, parts: Skeleton, pale: bool = False) -> None:
    """Draw bodies, joints and loop closures; pale, where the deflected ones are to be drawn over them."""
    axes, camera = drawing.axes, drawing.camera
    beam, link = (PALE, PALE) if pale else (BEAM, INK)
    elastic = "elastic beam without load" if pale else "elastic beam"
    for plate in parts.plates:
        outline = hull(camera.flat(plate.corners))
        if len(outline) >= 3:
            ground = plate.body == 0
            order = (5 if ground else 10) + camera.depth(plate.corners) * 0.1
            plain = Polygon(
                outline, facecolor=_PLATE, edgecolor=INK, alpha=0.35 if ground else 0.5, lw=1.2, zorder=order
            )
            axes.add_patch(plain).set_label("rigid body, base")
            drawing.labels.avoid(np.vstack((outline, outline[:1])))
    for anchor in parts.anchors:
        _draw_ground(drawing, anchor, parts.size)
    for segment in sorted(parts.segments, key=lambda s: camera.depth(np.array([s.start, s.end]))):
        line = np.array([segment.start, segment.end])
        if segment.kind == "beam":
            drawing.rod(line, beam, elastic)
        elif segment.kind == "slide":
            drawing.line(line, GHOST if pale else INK, 1.6, linestyle=(0, (4, 2)), label="slide")
        else:
            drawing.line(line, link, 4.0, label="rigid link")
    marks: dict[tuple, tuple] = {}
    rank = [*ROLES].index
    for joint in parts.joints:
        style = max((word.strip() for word in joint.role.split(",")), key=rank)
        shape = "s" if joint.type == "prismatic" else "o"
        key = tuple(np.round(joint.at, 6))
        present = marks.get(key)
        if present is None or (rank(style), shape == "o") > (rank(present[1]), present[2] == "o"):
            marks[key] = (joint.at, style, shape)
    for at, style, shape in marks.values():
        edge = GHOST if pale else INK
        drawing.mark(at, shape, 10.5 if style == "actuated" else 7.5, ROLES[style], edge, label=f"{style} joint")
    for first, second in parts.closures:
        if np.linalg.norm(first - second) > 1e-6:
            drawing.line(np.array([first, second]), INK, 1.2, linestyle=":")
        drawing.mark(second, "D", 10, "none", INK, lift=19, label="loop closure")


def _draw_ground(drawing: Drawing, at: Array, size: float) -> None:
    """Draw the hatched symbol of a fixed point, hatched away from the mechanism."""
    flat, half = drawing.camera.flat(at), 0.028 * size
    edge = flat + np.array([[-half, 0], [half, 0]])
    drawing.axes.plot(*edge.T, color=INK, lw=1.8, zorder=6)
    away = 1.0 if flat[1] > np.mean(drawing.axes.get_ylim()) else -1.0
    for step in np.linspace(-half, half, 6)[:-1]:
        start = flat + np.array([step, 0])
        end = start + np.array([0.4 * half, away * 0.45 * half])
        drawing.axes.plot(*np.array([start, end]).T, color=INK, lw=1.0, zorder=6)
    for height in (0, 0.25, 0.5):
        drawing.labels.avoid(edge + np.array([0, away * height * half]))


def _draw_deflected(
    drawing: Drawing, parts: Skeleton, ghost: Deflections, scale: float, colours: Mapping[str, str]
) -> None:
    """Draw the deflected mechanism over the pale one, beams and joints in the colours of their shares."""

    def there(body: int, point: Array) -> Array:
        return point + ghost.shift(body, point, scale)

    sign = (_MIDDLE, 4.5) if any(segment.kind == "beam" for segment in parts.segments) else (INK, 2.2)
    drawing.sign(f"deflected, drawn × {number(scale)}", *sign)
    for segment in parts.segments:
        beam = segment.kind == "beam"
        colour = colours.get(segment.name, MAP[0]) if beam else INK
        drawing.line(ghost.curve(segment, scale), colour, 4.5 if beam else 2.2, lift=5.0)
    for plate in parts.plates:
        if plate.body:
            outline = hull(drawing.camera.flat(np.array([there(plate.body, corner) for corner in plate.corners])))
            if len(outline) >= 3:
                drawing.axes.add_patch(Polygon(outline, facecolor=_PLATE, alpha=0.5, edgecolor=INK, lw=1.4, zorder=16))
    for joint in parts.joints:
        if joint.name in colours:
            at = there(joint.body, joint.at)
            drawing.mark(at, "s" if joint.type == "prismatic" else "o", 8, colours[joint.name], INK, lift=24)
    drawing.mark(there(parts.tool_body, parts.tool[:3, 3]), "o", 6, INK, "white", lift=26)


def draw_tool(drawing: Drawing, parts: Skeleton) -> list[tuple]:
    """Draw the tool's axes; return their labels."""
    at, turn = parts.tool[:3, 3], parts.tool[:3, :3]
    texts: list[tuple] = []
    for axis, colour, name in zip(turn.T, AXES, "xyz", strict=True):
        tip = at + 0.085 * parts.size * axis
        drawing.arrow(at, tip, colour, 2.0, 9, lift=40)
        flat = drawing.camera.flat(np.array([at, tip]))
        texts.append((name, flat[1], colour, flat[1] - flat[0]))
    drawing.mark(at, "o", 5, "black", "white", lift=45, mew=1.0)
    return texts


def _draw_wrench(drawing: Drawing, at: Array, load: Array, size: float) -> list[tuple]:
    """Draw a force as an arrow and a moment as an arc around its axis; return their labels."""
    camera = drawing.camera
    drawing.sign("load on the tool", LOAD, 3.0)
    texts: list[tuple] = []
    for block, unit in ((load[:3], "N"), (load[3:], "N m")):
        amount = float(np.linalg.norm(block))
        if amount == 0:
            continue
        axis = block / amount
        label = f"{number(amount, 4)} {unit}"
        if unit == "N":
            tip = at + FORCE_LENGTH * size * axis
            drawing.arrow(at, tip, LOAD, 3.0, 17)
            flat = camera.flat(np.array([at, tip]))
            texts.append((label, flat[1], LOAD, flat[1] - flat[0]))
            continue
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        other = np.cross(axis, across)
        start = np.arctan2(other @ camera.viewer, across @ camera.viewer) + np.radians(215)
        angles = start + np.linspace(0, np.radians(290), 60)
        arc = at + 0.08 * size * (np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * other)
        drawing.line(arc[:-2], LOAD, 2.6, lift=48, halo=False)
        drawing.arrow(arc[-3], arc[-1], LOAD, 2.6, 15)
        flat = camera.flat(arc)
        texts.append((label, flat[30], LOAD, flat[30] - camera.flat(at)))
    return texts


# -- around the drawing ------------------------------------------------------------------------------------------------


def draw_compass(figure: Figure, camera: Camera, gravity: Array, layout: Layout) -> None:
    """Draw the base's axes and gravity in the corner."""
    drawing = Drawing(figure, layout.compass, camera, (-2.0, -2.0), (2.3, 2.0))
    axes, labels = drawing.axes, drawing.labels
    texts = []
    for axis, colour, name in zip(np.eye(3), AXES, "xyz", strict=True):
        drawing.arrow(np.zeros(3), axis, colour, 1.8, 9)
        flat = camera.flat(axis)
        texts.append((name, flat, colour, flat))
    if np.linalg.norm(gravity) > 0:
        start, end = (1.75, 0.75), (1.75, -0.75)
        axes.annotate(
            "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": FAINT, "lw": 1.6, "shrinkA": 0}
        )
        labels.avoid(np.array([start, end]))
        labels.put("gravity", np.array(end), FAINT, np.array([0, -1]), 8.5)
    for text, at, colour, towards in texts:
        labels.put(text, at, colour, towards, 9.5)
    labels.put("base", np.zeros(2), FAINT, np.array([-1, -1]), 8.5)


def draw_legend(figure: Figure, drawing: Drawing, layout: Layout, columns: int = 1) -> None:
    """Explain every sign that was drawn, each once."""
    handles, labels = drawing.axes.get_legend_handles_labels()
    signs = dict(zip(labels, handles, strict=True))
    handles, labels = list(signs.values()), list(signs)
    at = layout.legend
    style = {"frameon": False, "fontsize": 9.5, "handlelength": 2.4, "ncols": columns}
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=at, **style)


def _write_title(
    figure: Figure, robot: Robot, pose: ClosedPose, compliance, load, scale: float | None, layout: Layout
) -> None:
    at = pose_words(robot, pose)
    if len(at) > 90:
        at = f"{at[:88].rpartition(',')[0]}, …"
    lines = wrap(at, layout.line)
    if load is not None and load.any() and compliance is not None:
        moved = float(np.linalg.norm(compliance.deflection(load)[:3]))
        line = f"under {wrench_text(np.round(load, 3))} the tool moves by {quantity(moved, 'm')}"
        if scale:
            line += f"; deflection drawn × {number(scale)}"
        lines += wrap(line, layout.line)
    write_head(figure, robot.name, lines, 11 if layout is WIDE else 9.5)


def write_head(figure: Figure, title: str, lines: Sequence[str] = (), size: float = 11.0) -> None:
    """Write a title and lines under it at the upper left."""
    height = figure.get_figheight()
    figure.text(0.025, 1 - 0.32 / height, title, fontsize=1.45 * size, weight="bold", va="center")
    for index, line in enumerate(lines):
        place = 1 - (0.61 + 0.024 * size * index) / height
        figure.text(0.025, place, line, fontsize=size, color=INK, va="center")


def _draw_scale(figure: Figure, top: float, layout: Layout) -> None:
    """Draw the map of shares with its ends."""
    axes = figure.add_axes(layout.scale)
    axes.imshow(np.linspace(0, 1, 256)[None], cmap=ListedColormap(map_rgb(np.linspace(0, 1, 256))), aspect="auto")
    axes.set_yticks([])
    axes.set_xticks([0, 255], ["0", f"{number(100 * top, 3)} %"], fontsize=9)
    axes.tick_params(length=0, pad=2)
    axes.set_title("share of a part in the deflection", fontsize=9.5, loc="left", pad=4)
    axes.spines[:].set_visible(False)


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


# -- the ellipsoid of compliance: how far, and whereto, a unit force in every direction moves the tool -----------------


def _silhouette(camera: Camera, values: Array, vectors: Array) -> Array:
    """Return the outline of the projected ellipsoid, (n, 2), about its centre."""
    half = camera.plane @ vectors * values
    u, s, _ = np.linalg.svd(half, full_matrices=False)
    angle = np.linspace(0, 2 * np.pi, 121)
    return (u * s @ np.array([np.cos(angle), np.sin(angle)])).T


def draw_ellipsoid(figure: Figure, camera: Camera, compliance: Compliance, layout: Layout) -> None:
    """Draw the ellipsoid large, in the same view, with its semi-axes in µm/N."""
    values, vectors = principal(compliance, _TRANSLATION)
    drawing = Drawing(figure, layout.beside, camera, (-1.75, -1.6), (1.75, 1.6))
    axes, labels = drawing.axes, drawing.labels
    axes.set_title("Compliance at the tool", fontsize=11, weight="bold", loc="center", pad=14)
    words = "displacement by 1 N in every direction" if layout is WIDE else "displacement by 1 N"
    axes.text(0.5, 1.0, words, transform=axes.transAxes, ha="center", fontsize=9, color=FAINT)
    if values[0] <= 0:
        axes.text(0, 0, "no force moves the tool", ha="center", color=FAINT)
        return
    yields = values > 1e-9 * values[0]
    outline = _silhouette(camera, values / values[0], vectors)
    shine = 0.45 * outline[np.argmax(outline @ [-0.6, 0.8])]
    pale = 0.45 + 0.55 * rgb_of(SOFT)
    for share in np.linspace(1.0, 0.04, 25):
        axes.fill(*(share * outline + (1 - share) * shine).T, color=np.clip((1.2 - 0.4 * share) * pale, 0, 1), zorder=2)
    axes.plot(*outline.T, color="#2F6355", lw=1.2, zorder=3)
    labels.avoid(outline)
    labels.obstacles.append(np.concatenate([outline * share for share in np.linspace(0.1, 0.95, 12)]))
    ends = camera.plane @ vectors * (values / values[0])
    ends *= tips_apart(ends / np.maximum(np.linalg.norm(ends, axis=0), 1e-9), yields)
    for value, tip in zip(values[yields], ends.T[yields], strict=True):
        length = float(np.linalg.norm(tip))
        direction = tip / length if length > 1e-6 else np.array([0.0, 1.0])
        edge = max(float((outline @ direction).max()), length) * 1.02
        axes.plot(*np.array([-tip, tip]).T, color=_DARK, lw=1.4, zorder=5)
        axes.plot(*np.array([tip, direction * (edge + 0.18)]).T, color=_DARK, lw=0.8, ls=":", zorder=5)
        axes.plot(*tip, "o", ms=4, color=_DARK, zorder=6)
        labels.put(quantity(value, "m/N"), direction * (edge + 0.16), _DARK, direction, 10.5, "bold")
    if not yields.all():
        text = "rigid across" if yields.sum() == 1 else "rigid in the third direction"
        axes.text(0.5, 0.0, text, transform=axes.transAxes, ha="center", fontsize=9.5, color=_DARK)
