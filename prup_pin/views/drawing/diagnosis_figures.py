"""Pictures of a diagnosis: the place on the robot, the local response, the residuals. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

import numpy as np

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.locate import Agreement, Recovered, Residuals
from ...kinematics import ClosedPose
from ...modules import DriveModule
from ...numbers import readable_unit
from ...robot import Robot
from ...spatial import Array
from ..scene.camera import camera_of
from ..scene.colours import AXES, FOUND, INK
from ..scene.skeleton import Skeleton, skeleton
from ..text.diagnosis_words import finding_text
from .drawing import Drawing, Layout
from .figures import draw_compass, draw_legend, draw_mechanism, draw_tool
from .plotting import Figure, plain_axes, plain_words, sheet

#: What is measured less simulated before a diagnosis, and after it.
BEFORE, AFTER = "#9AA3AD", "#0B6AA8"
#: Letters that stand beside a row.
_LINE = 18
_BAND = "#DCE3EA"
#: Times its range that a law may go up and down along its load and still be drawn as a line.
_ZIGZAG = 3
_WIDE = Layout(
    (11, 6.6), (0.02, 0.02, 0.62, 0.86), (0.725, 0.49, 0.255, 0.34), (0.015, 0.02, 0.13, 0.19), (0.715, 0.39),
    (0, 0, 0, 0), 40,
)  # fmt: skip
_NARROW = Layout(
    (5.2, 8.2), (0.02, 0.37, 0.96, 0.54), (0, 0, 0, 0), (0.0, 0.35, 0.24, 0.13), (0.5, 0.2), (0, 0, 0, 0), 50
)
_AXIS_NAMES = {"m": ("x", "y", "z"), "rad": ("about x", "about y", "about z")}


@dataclass(frozen=True)
class Mark:
    """A point or a line of the robot that a finding names: points (1, 3) or (2, 3)."""

    name: str
    points: Array
    number: int  # of the finding; 0 for a place that the data cannot tell from it


def marks(robot: Robot, pose: ClosedPose, findings: Sequence[Finding]) -> list[Mark]:
    """Return where the findings and their candidates are; places that are everywhere have no mark."""
    parts = skeleton(pose)
    made: list[Mark] = []
    named: set[str] = set()
    for index, finding in enumerate(findings, 1):
        for name in finding.at_each or (finding.location,):
            at = _points(robot, pose, parts, name)
            if at is not None:
                made.append(Mark(name, at, index))
                named.add(name)
    for finding in findings:
        for name in finding.candidates:
            at = None if name in named else _points(robot, pose, parts, name)
            if at is not None:
                made.append(Mark(name, at, 0))
                named.add(name)
    return made


def _points(robot: Robot, pose: ClosedPose, parts: Skeleton, name: str) -> Array | None:
    mechanism = robot.mechanism
    for segment in parts.segments:
        if segment.name == name and segment.kind == "beam":
            return np.array([segment.start, segment.end])
    module = next((item for item in mechanism.modules if item.name == name), None)
    if module is not None and isinstance(module.kind, DriveModule):
        # the drive is drawn where its joint has its seat
        joint = str(mechanism.model.names[module.joint])
        return next((item.at[None] for item in parts.joints if item.name == joint), None)
    if module is not None:
        return (pose.placements[module.frame.joint] @ module.frame.placement)[None, :3, 3]
    for length in mechanism.description.lengths:
        if length.parameter.owner == name:
            joints = [joint for joint, _ in length.moves if mechanism.model.existJointName(joint)]
            if joints:
                return next((item.at[None] for item in parts.joints if item.name == joints[0]), None)
    if mechanism.model.existJointName(name):
        return pose.placements[mechanism.joint_id(name)][None, :3, 3]
    if name in mechanism.frame_names:
        return pose.placement(name)[None, :3, 3]
    if name == "robot" or name in (length.parameter.owner for length in mechanism.description.lengths):
        return None
    # what the mechanism does not know stands at its tool: a sensor, a payload
    return parts.tool[None, :3, 3]


@plain_words
def place_figure(robot: Robot, diagnosis: Diagnosis, beside: Finding | None = None, *, narrow: bool = False) -> Figure:
    """Return a picture of the robot with the places of the findings marked; one's local response is drawn beside it.

    `narrow`: for a phone.
    """
    response = None if beside is None else beside.recovered
    run = diagnosis.final
    poses = [] if run is None else run.geometry.poses
    pose = poses[len(poses) // 2] if poses else robot.home
    parts = skeleton(pose)
    camera = camera_of(robot, pose)
    layout = _NARROW if narrow else _WIDE
    figure = sheet(*layout.size)
    flat, size = camera.flat(parts.points), parts.size
    low, high = flat.min(axis=0) - 0.1 * size, flat.max(axis=0) + 0.1 * size
    # a tall robot leaves room at its sides, where labels may go
    middle, half = (low + high) / 2, (high - low) / 2
    _, _, wide, high_ = layout.drawing
    half[0] = max(half[0], half[1] * (wide * layout.size[0]) / (high_ * layout.size[1]))
    drawing = Drawing(figure, layout.drawing, camera, middle - half, middle + half)
    draw_mechanism(drawing, parts)
    texts = draw_tool(drawing, parts)
    found = marks(robot, pose, diagnosis.told)
    _draw_marks(drawing, found)
    middle = camera.flat(parts.points).mean(axis=0)
    for text, at in _mark_texts(drawing, found):
        drawing.labels.put(text, at, FOUND, at - middle, 17, "bold")
    drawing.write(texts, parts.legs, parts.points, size)
    draw_compass(figure, camera, robot.mechanism.gravity, layout)
    draw_legend(figure, parts, False, None, layout)
    place = (0.06, 0.33) if narrow else (0.655, 0.87 if response is None else 0.965)
    _draw_list(figure, diagnosis, found, place, layout.line, 4 if narrow else 9)
    if beside is not None and isinstance(response, Recovered) and not narrow:
        small = figure.add_axes(layout.beside)
        _draw_response(small, response, beside.physics, 8.0)
        small.legend(frameon=False, fontsize=7, loc="best", handlelength=1.2)
    figure.text(0.025, 0.95, robot.name, fontsize=16, weight="bold", va="center")
    return figure


def _draw_marks(drawing: Drawing, found: Sequence[Mark]) -> None:
    span = float(np.ptp(drawing.axes.get_ylim()))
    for mark in found:
        flat = drawing.camera.flat(mark.points)
        strong = mark.number > 0
        if len(flat) == 2:
            thick, alpha = (15.0, 0.35) if strong else (10.0, 0.16)
            drawing.axes.plot(*flat.T, color=FOUND, lw=thick, alpha=alpha, solid_capstyle="round", zorder=3)
        size, width = (24, 2.6) if strong else (17, 1.2)
        at = flat.mean(axis=0) if len(flat) == 2 else flat[0]
        line = "-" if strong else (0, (2, 1.5))
        if len(flat) == 1:
            drawing.axes.scatter(
                *at[:, None],
                s=size**2,
                facecolors=FOUND + "22" if strong else "none",
                edgecolors=FOUND,
                linewidths=width,
                linestyles=[line],
                zorder=200,
            )
        ring = np.linspace(0, 2 * np.pi, 13)[:, None] * np.array([1.0, 1.0]) + np.array([0.0, np.pi / 2])
        drawing.labels.avoid(at + 0.024 * span * np.sin(ring))


def _mark_texts(drawing: Drawing, found: Sequence[Mark]) -> list[tuple[str, Array]]:
    """Return one label per point: the numbers of the findings there."""
    at: dict[tuple, tuple[Array, list[Mark]]] = {}
    for mark in found:
        if mark.number:
            point = drawing.camera.flat(mark.points).mean(axis=0)
            at.setdefault(tuple(np.round(point, 6)), (point, []))[1].append(mark)
    return [(", ".join(str(mark.number) for mark in marks), point) for point, marks in at.values()]


def _draw_list(
    figure: Figure, diagnosis: Diagnosis, found: Sequence[Mark], place: tuple[float, float], line: int, most: int
) -> None:
    """Write the findings beside the drawing, by the numbers that it shows; `most` lines of `line` letters."""
    lines = []
    for index, finding in enumerate(diagnosis.told, 1):
        lines += wrap(f"{index}  {finding_text(finding)}", line, subsequent_indent="    ", break_on_hyphens=False)
    if any(not mark.number for mark in found):
        lines.append("dashed: these data cannot tell them apart")
    if len(lines) > most:
        lines[most - 1 :] = ["…"]
    text = "\n".join(lines) or "nothing is missing"
    figure.text(*place, text, fontsize=11, color=FOUND, va="top", linespacing=1.6)


# -- response ----------------------------------------------------------------------------------------------------------


@plain_words
def response_figure(finding: Finding, *, narrow: bool = False) -> Figure:
    """Return a finding's local response: estimates of every sample, the curve that knows no law, and the law.

    Of what hangs on no single load: what the recording asks for at the tool against what the law gives.
    """
    response = finding.recovered
    if isinstance(response, Agreement):
        return _agreement_figure(finding, response, narrow)
    figure = sheet(*((5.2, 4.8) if narrow else (9.5, 4.9)))
    axes = figure.add_axes((0.15, 0.27, 0.81, 0.61) if narrow else (0.1, 0.19, 0.87, 0.7))
    if response is not None:
        size = 9.5 if narrow else 10
        _draw_response(axes, response, finding.physics, size)
        # below the drawing, which may fill any of its corners
        figure.legend(fontsize=size - 1, frameon=False, loc="lower left", bbox_to_anchor=(axes.get_position().x0, 0.0),
                      ncols=1 if narrow else 3, handlelength=1.2)  # fmt: skip
    _title(figure, finding, narrow)
    return figure


def _title(figure: Figure, finding: Finding, narrow: bool) -> None:
    size = 11.5 if narrow else 13
    figure.text(0.04 if narrow else 0.1, 0.94, finding_text(finding), fontsize=size, weight="bold", va="center")


def _draw_response(axes, response: Recovered, physics: str, size: float) -> None:
    reach = np.abs(response.curve) + 2 * response.band
    if response.law is not None:
        reach = np.concatenate((reach, np.abs(response.law)))
    x_unit, x_factor = readable_unit(float(np.abs(response.x).max(initial=0.0)), response.x_unit)
    y_unit, y_factor = readable_unit(float(reach.max(initial=0.0)), response.y_unit)
    x, y, knots = x_factor * response.x, y_factor * response.y, x_factor * response.knots
    curve, band = y_factor * response.curve, y_factor * response.band
    axes.axhline(0, color="#C3C9D0", lw=0.8, zorder=1)
    if response.x.min() < 0 < response.x.max():
        axes.axvline(0, color="#C3C9D0", lw=0.8, zorder=1)
    weight = 1 / response.deviation**2
    strong = np.clip(weight / np.quantile(weight, 0.9), 0.12, 1.0)
    colours = np.tile([0.29, 0.31, 0.35, 1.0], (len(x), 1))
    colours[:, 3] = 0.45 * strong
    axes.scatter(x, y, s=30 if response.path else 9, color=colours, linewidths=0, zorder=2, label="each measured pose")
    means = "their means, 95 %" if size < 9 else "means over neighbours, 95 %"
    if not response.path:
        axes.fill_between(knots, curve - 1.96 * band, curve + 1.96 * band, color=AFTER, alpha=0.18, lw=0, zorder=3)
        axes.plot(knots, curve, "o-", color=AFTER, lw=1.4, ms=4, zorder=4, label=means)
    if response.law is not None:
        law = y_factor * response.law
        name = physics.replace("_", " ")
        if response.path:
            axes.scatter(x, law, s=9, color=FOUND, linewidths=0, zorder=5, label=f"the law: {name}")
            for block in np.unique(response.blocks):
                here = response.blocks == block
                axes.plot(x[here], law[here], color=FOUND, lw=0.6, alpha=0.35, zorder=4)
        else:
            order = np.argsort(x, kind="stable")
            if np.abs(np.diff(law[order])).sum() > _ZIGZAG * np.ptp(law):  # it hangs on more than this load
                axes.scatter(x, law, s=9, color=FOUND, linewidths=0, zorder=5, label=f"the law: {name}")
            else:
                axes.plot(x[order], law[order], color=FOUND, lw=2.2, zorder=5, label=f"the law: {name}")
    top = 1.25 * float(max((y_factor * reach).max(), np.quantile(np.abs(y), 0.5)))
    low, high = min(float(np.quantile(y, 0.02)), 0.0), max(float(np.quantile(y, 0.98)), 0.0)
    pad = 0.12 * max(high - low, 1e-12)
    axes.set_ylim(max(low - pad, -top), min(high + pad, top))
    axes.set_xlabel(f"{response.x_label} [{x_unit}]", fontsize=size)
    axes.set_ylabel(f"{response.y_label} [{y_unit}]", fontsize=size)
    plain_axes(axes, size - 1)


def _agreement_figure(finding: Finding, response: Agreement, narrow: bool) -> Figure:
    figure = sheet(*((5.2, 8.0) if narrow else (9.5, 4.6)))
    _title(figure, finding, narrow)
    shown = [group for group in response.columns if np.any(response.asked[:, group.where])][:2]
    for index, (kind, si, block) in enumerate(shown):
        below = (0.16, 0.53 - 0.46 * index, 0.8, 0.36)
        axes = figure.add_axes(below if narrow else (0.1 + 0.47 * index, 0.13, 0.38, 0.73))
        asked, law = response.asked[:, block], response.law[:, block]
        largest = float(np.abs(law).max(initial=0.0)) or float(np.abs(asked).max(initial=0.0))
        unit, factor = readable_unit(largest, si)
        reach = 1.08 * factor * largest
        noise = 2 * factor * response.noise.of_unit(si)
        line = np.array([-reach, reach])
        axes.fill_between(line, line - noise, line + noise, color=_BAND, lw=0, zorder=1, label="noise, ± 2 σ")
        axes.plot(line, line, color=FOUND, lw=1.6, zorder=2, label="the law")
        for column, colour in enumerate(AXES):
            label = _AXIS_NAMES[si][column]
            axes.plot(
                factor * law[:, column], factor * asked[:, column], ".", color=colour, ms=4, alpha=0.6, label=label
            )
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach - 2 * noise, reach + 2 * noise)
        axes.set_xlabel(f"{kind} that the law gives [{unit}]", fontsize=10)
        axes.set_ylabel(f"{kind} that the recording asks for [{unit}]", fontsize=10)
        plain_axes(axes, 9)
        axes.legend(frameon=False, fontsize=9, loc="best", handlelength=1.2)
    return figure


# -- residuals ---------------------------------------------------------------------------------------------------------


@plain_words
def sample_figure(diagnosis: Diagnosis, *, narrow: bool = False) -> Figure:
    """Return the residual of each channel over the samples, before and after, with the band of the noise.

    `narrow`: for a phone.
    """
    every = [(group, column) for group in diagnosis.columns for column in range(group.where.start, group.where.stop)]
    rows = [(group, column) for group, column in every if np.any(diagnosis.residual_before[:, column])]
    figure = sheet(5.2 if narrow else 11, 1.0 + 1.35 * max(len(rows), 1))
    height = figure.get_size_inches()[1]
    each = (height - 1.0) / max(len(rows), 1)
    samples = diagnosis.samples
    parts = [part for part in diagnosis.recordings if len(part.used)]
    edges = [samples[part.used[0]] for part in parts]
    for row, ((kind, si, block), channel) in enumerate(rows):
        bottom = (height - 0.45 - (row + 1) * each + 0.12) / height
        left = 0.17 if narrow else 0.1
        axes = figure.add_axes((left, bottom, 0.98 - left, (each - 0.18) / height))
        noise = diagnosis.noise.of_unit(si)
        before, after = diagnosis.residual_before[:, channel], diagnosis.residual_after[:, channel]
        unit, factor = readable_unit(float(np.quantile(np.abs(before), 0.98)), si)
        if len(parts) > 1:
            for part, edge in zip(parts, edges, strict=True):
                own, ends = 2 * factor * part.noise.of_unit(si), (edge - 0.5, samples[part.used[-1]] + 0.5)
                told = "noise, ± 2 σ" if part is parts[0] else None
                axes.fill_between(ends, -own, own, color=_BAND, lw=0, zorder=0, label=told)
        else:
            axes.axhspan(-2 * factor * noise, 2 * factor * noise, color=_BAND, zorder=0, label="noise, ± 2 σ")
        for edge in edges[1:]:
            axes.axvline(edge - 0.5, color="#C3C9D0", lw=0.8, zorder=1)
        axes.plot(samples, factor * before, ".", color=BEFORE, ms=3.2, zorder=2, label="before")
        axes.plot(samples, factor * after, ".", color=AFTER, ms=2.6, zorder=3, label="after")
        axis = _AXIS_NAMES[si][channel - block.start]
        axes.set_ylabel("\n".join([*_lines(kind), f"{axis} [{unit}]"]), fontsize=8.5)
        axes.margins(x=0.005)
        plain_axes(axes, 8, "y")
        if row < len(rows) - 1:
            axes.tick_params(axis="x", labelbottom=False)
        else:
            axes.set_xlabel("sample", fontsize=9)
        if row == 0 and len(parts) > 1:
            for part, edge in zip(parts, edges, strict=True):
                place = axes.get_xaxis_transform()
                axes.text(edge, 1.02, part.name, transform=place, fontsize=7.5, va="bottom", clip_on=False)
        if row == 0:
            handles, texts = axes.get_legend_handles_labels()
            figure.legend(
                handles, texts, loc="upper right", ncols=3, frameon=False, fontsize=9.5, markerscale=2.5,
                bbox_to_anchor=(0.985, 1.0), borderaxespad=0.2,
            )  # fmt: skip
    title = "Residual" if narrow else "Measured less simulated"
    figure.text(0.04 if narrow else 0.1, 1 - 0.2 / height, title, fontsize=12, weight="bold", va="center")
    return figure


def _lines(channel: str) -> list[str]:
    """Return a channel's name in lines as short as a row is high: a marker's own name, then what of it."""
    name, _, what = channel.removeprefix("marker ").rpartition(" ")
    return [text if len(text) <= _LINE else f"{text[: _LINE - 1]}…" for text in (name, what) if text]


@plain_words
def histogram_figure(found: Residuals, *, narrow: bool = False) -> Figure:
    """Return histograms of the residuals in multiples of the noise, before and after, against the normal curve.

    `narrow`: for a phone.
    """
    groups = [(name, block) for name, _, block in found.columns if found.exists[:, block].any()]
    across = 1 if narrow else 2
    lines = max(-(-len(groups) // across), 1)
    figure = sheet(5.2 if narrow else 11, 3.3 * lines)
    edges = np.linspace(-6, 6, 49).tolist()
    grid = np.linspace(-6, 6, 200)
    for index, (name, block) in enumerate(groups):
        line = lines - 1 - index // across
        left, width = (0.06, 0.88) if narrow else (0.1 + 0.46 * (index % 2), 0.41)
        axes = figure.add_axes((left, (line + 0.18) / lines, width, 0.64 / lines))
        there = found.exists[:, block]
        clipped = [np.clip(values[:, block][there], -5.99, 5.99) for values in (found.before, found.after)]
        axes.hist(clipped[0], color=BEFORE, alpha=0.55, label="before", zorder=2, bins=edges, density=True)
        axes.hist(clipped[1], histtype="step", color=AFTER, lw=1.8, label="after", zorder=3, bins=edges, density=True)
        normal = np.exp(-0.5 * grid**2) / np.sqrt(2 * np.pi)
        axes.plot(grid, normal, "--", color=INK, lw=1.2, label="noise alone", zorder=4)
        axes.set_xlim(-6, 6)
        axes.set_title(name, fontsize=11, loc="left", color=INK)
        axes.set_xlabel("multiples of the noise (beyond ± 6: in the outermost bars)", fontsize=8.5)
        axes.set_yticks([])
        plain_axes(axes, 8.5, None, ("top", "right", "left"))
        if index == 0:
            axes.legend(frameon=False, fontsize=9, loc="upper left")
    return figure
