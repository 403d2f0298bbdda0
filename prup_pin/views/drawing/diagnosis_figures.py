"""Pictures of a diagnosis: the places on the robot, local responses, residuals, efforts. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import Any

import numpy as np

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.chances import normal_isf
from ...diagnosis.efforts import EffortCurve, EffortDiagnosis
from ...diagnosis.locate import Agreement, Recovered, Residuals
from ...diagnosis.proposal import Proposal
from ...kinematics import ClosedPose
from ...modules import DriveModule
from ...numbers import number, readable_unit
from ...robot import Robot
from ...spatial import Array
from ..scene.colours import AFTER, AXES, BAND, BEFORE, FOUND, INK, PALE
from ..scene.painter import pose_scene
from ..scene.scene import Legend
from ..scene.skeleton import Skeleton, skeleton
from ..text.diagnosis_words import finding_text
from .figures import NARROW, WIDE, SceneDrawing, scene_figure
from .plotting import (
    Figure,
    Line2D,
    page_figure,
    panels,
    plain_axes,
    plain_words,
    sheet,
    zero_lines,
)

#: What was measured.
_MEASURED = "#23272E"
#: Letters that stand beside a row.
_LINE = 18
#: Joints that a page shows, those whose effort the findings change most, and the time that it shows of them [s].
_MOST_JOINTS, _SECONDS = 6, 12.0
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
    numbered = [(name, index) for index, item in enumerate(findings, 1) for name in item.at_each or (item.location,)]
    own = {name for name, _ in numbered}
    beside = dict.fromkeys(name for item in findings for name in item.candidates if name not in own)
    every = [(name, _points(robot, pose, parts, name), index) for name, index in (*numbered, *((n, 0) for n in beside))]
    return [Mark(name, at, index) for name, at, index in every if at is not None]


def _points(robot: Robot, pose: ClosedPose, parts: Skeleton, name: str) -> Array | None:
    """Return the points (n, 3) of a place: a beam's ends, a module, a joint, a frame; None of the robot as a whole."""
    mechanism = robot.mechanism
    module = next((item for item in mechanism.modules if item.name == name), None)
    seats = {item.name: item.at[None] for item in parts.joints}
    for segment in parts.segments:
        if segment.name == name and segment.kind == "beam":
            return np.array([segment.start, segment.end])
    if module is not None and isinstance(module.kind, DriveModule):
        return seats.get(str(mechanism.model.names[module.joint]))  # drawn where its joint has its seat
    if module is not None:
        return module.frame.at(pose.placements)[None, :3, 3]
    lengths = [length for length in mechanism.description.lengths if length.parameter.owner == name]
    for joint in (joint for length in lengths for joint, _ in length.moves if mechanism.model.existJointName(joint)):
        return seats.get(joint)
    if mechanism.model.existJointName(name):
        return pose.placements[mechanism.joint_id(name)][None, :3, 3]
    if name in mechanism.frame_names:
        return pose.placement(name)[None, :3, 3]
    if name == "robot" or lengths:
        return None
    return parts.tool[None, :3, 3]  # what the mechanism does not know: a sensor, a payload


@plain_words
def place_figure(robot: Robot, diagnosis: Diagnosis, *, narrow: bool = False) -> Figure:
    """Return a picture of the robot with the places of the findings marked. `narrow`: for a phone."""
    run = diagnosis.final
    poses = [] if run is None else run.geometry.poses
    if run is not None:  # where joints yield or lengths are others, its poses are no poses of the robot file's
        robot = run.geometry.robot
    pose = poses[len(poses) // 2] if poses else robot.home
    figure = sheet(*(NARROW if narrow else WIDE), dpi=100)
    scene = pose_scene(robot, pose, ellipsoids="none")
    found = marks(robot, pose, diagnosis.told)
    # the findings beside the drawing, by the numbers that it shows; below it on a phone
    lines = _finding_lines(diagnosis, found, *((4, 50) if narrow else (9, 40)))
    below = 0.26 * len(lines)  # inches
    drawing = scene_figure(figure, replace(scene, legend=Legend(scene.legend.title)), below)
    middle = drawing.flat(scene.bounds).mean(axis=0)
    for at, numbers in _draw_marks(drawing, found):
        drawing.labels.put(", ".join(map(str, numbers)), at, FOUND, at - middle, 17, "bold")
    place = (0.06, below / figure.get_figheight()) if narrow else (0.655, 0.87)
    figure.text(*place, "\n".join(lines), fontsize=11, color=FOUND, va="top", linespacing=1.6)
    return figure


def _finding_lines(diagnosis: Diagnosis, found: Sequence[Mark], most: int, width: int) -> list[str]:
    """Return the findings by the numbers of their marks, and last what marks without a number are."""
    texts = [f"{index}  {finding_text(finding)}" for index, finding in enumerate(diagnosis.told, 1)]
    lines = [line for text in texts for line in wrap(text, width, subsequent_indent="    ", break_on_hyphens=False)]
    if len(lines) > most:
        lines[most - 1 :] = ["…"]
    shown = {tuple(np.round(mark.points, 6).ravel()) for mark in found if mark.number}
    if any(tuple(np.round(mark.points, 6).ravel()) not in shown for mark in found):
        lines += wrap("dashed ring, pale beam: may be there instead, these data cannot tell", width)
    return lines or ["nothing is missing" if diagnosis.since is None else "nothing has changed"]


def _draw_marks(drawing: SceneDrawing, found: Sequence[Mark]) -> list[tuple[Array, list[int]]]:
    """Draw the marks; return each point on the page with the numbers of the findings there."""
    numbers: dict[tuple, tuple[Array, list[int]]] = {}
    span = float(np.ptp(drawing.axes.get_ylim()))
    for mark in found:
        flat = drawing.flat(mark.points)
        strong = mark.number > 0
        if len(flat) == 2:
            thick, alpha = (15.0, 0.35) if strong else (10.0, 0.16)
            drawing.axes.plot(*flat.T, color=FOUND, lw=thick, alpha=alpha, solid_capstyle="round", zorder=30)
        at = flat.mean(axis=0)
        if len(flat) == 1:
            size, width, line, face = (24, 2.6, "-", FOUND + "22") if strong else (17, 1.2, (0, (2, 1.5)), "none")
            style = {"facecolors": face, "edgecolors": FOUND, "linewidths": width, "linestyles": [line]}
            drawing.axes.scatter(*at[:, None], s=size**2, zorder=200, **style)
        ring = np.linspace(0, 2 * np.pi, 13)[:, None] * np.array([1.0, 1.0]) + np.array([0.0, np.pi / 2])
        drawing.labels.obstacles.append(at + 0.024 * span * np.sin(ring))
        if strong:
            numbers.setdefault(tuple(np.round(at, 6)), (at, []))[1].append(mark.number)
    return list(numbers.values())


# -- response ----------------------------------------------------------------------------------------------------------


@plain_words
def response_figure(finding: Finding, *, narrow: bool = False) -> Figure:
    """Return a finding's local response: estimates of every sample, the curve that knows no law, and the law.

    Of what hangs on no single load: what the recording asks for at the tool against what the law gives. `narrow`: for
    a phone.
    """
    response = finding.recovered
    if isinstance(response, Agreement):
        return _agreement_figure(finding, response, narrow)
    figure = page_figure(4.9, narrow, finding_text(finding))
    axes: Any = figure.subplots()
    if response is not None:
        draw_response(axes, response, finding.physics)
        # below the drawing, which may fill any of its corners
        figure.legend(fontsize=9, frameon=False, loc="outside lower center", ncols=1 if narrow else 3, handlelength=1.2)
    return figure


def draw_response(axes, response: Recovered, physics: str, letters: float = 10) -> None:
    """Draw what each sample asks of a finding's place, the means that know no law, and the law."""
    reach = np.abs(response.curve) + within_all_95(len(response.knots)) * response.band
    if response.law is not None:
        reach = np.concatenate((reach, np.abs(response.law)))
    x_unit, x_factor = readable_unit(float(np.abs(response.x).max(initial=0.0)), response.x_unit)
    y_unit, y_factor = readable_unit(float(reach.max(initial=0.0)), response.y_unit)
    x, y, knots = x_factor * response.x, y_factor * response.y, x_factor * response.knots
    curve, band = y_factor * response.curve, y_factor * response.band
    zero_lines(axes, x)
    weight = 1 / response.deviation**2
    strong = np.clip(weight / np.quantile(weight, 0.9), 0.12, 1.0)
    colours = np.tile([0.29, 0.31, 0.35, 1.0], (len(x), 1))
    colours[:, 3] = 0.45 * strong
    axes.scatter(x, y, s=30 if response.path else 9, color=colours, linewidths=0, zorder=2, label="each measured pose")
    if not response.path:
        wide = within_all_95(len(knots)) * band
        axes.fill_between(knots, curve - wide, curve + wide, color=AFTER, alpha=0.18, lw=0, zorder=3)
        told = "means over neighbours; all within the band: 95 %"
        axes.plot(knots, curve, "o-", color=AFTER, lw=1.4, ms=4, zorder=4, label=told)
    if response.law is not None:
        law, name = y_factor * response.law, f"the law: {physics.replace('_', ' ')}"
        order = np.argsort(x, kind="stable")
        if not response.path and np.abs(np.diff(law[order])).sum() <= 3 * np.ptp(law):
            axes.plot(x[order], law[order], color=FOUND, lw=2.2, zorder=5, label=name)
        else:  # it goes up and down along this load, and hangs on more
            axes.scatter(x, law, s=9, color=FOUND, linewidths=0, zorder=5, label=name)
        for block in np.unique(response.blocks) if response.path else ():
            here = response.blocks == block
            axes.plot(x[here], law[here], color=FOUND, lw=0.6, alpha=0.35, zorder=4)
    top = 1.25 * float(max((y_factor * reach).max(), np.quantile(np.abs(y), 0.5)))
    low, high = min(float(np.quantile(y, 0.02)), 0.0), max(float(np.quantile(y, 0.98)), 0.0)
    pad = 0.12 * max(high - low, 1e-12)
    axes.set_ylim(max(low - pad, -top), min(high + pad, top))
    labels = (f"{response.x_label} [{x_unit}]", f"{response.y_label} [{y_unit}]")
    plain_axes(axes, letters - 1, labels=labels)


def within_all_95(count: int) -> float:
    """Return within how many standard deviations all of so many independent means lie, with 95 %."""
    return float(normal_isf((1 - 0.95 ** (1 / count)) / 2))


def _agreement_figure(finding: Finding, response: Agreement, narrow: bool) -> Figure:
    shown = [group for group in response.columns if np.any(response.asked[:, group.where])][:2]
    figure = page_figure(4.0 * max(len(shown), 1) if narrow else 4.6, narrow, finding_text(finding))
    for axes, (kind, si, block) in zip(panels(figure, len(shown), 1 if narrow else 2), shown, strict=True):
        asked, law = response.asked[:, block], response.law[:, block]
        largest = float(np.abs(law).max(initial=0.0)) or float(np.abs(asked).max(initial=0.0))
        unit, factor = readable_unit(largest, si)
        reach = 1.08 * factor * largest
        noise = 2 * factor * response.noise.of_unit(si)
        line = np.array([-reach, reach])
        axes.fill_between(line, line - noise, line + noise, color=BAND, lw=0, zorder=1, label="noise, ± 2 σ")
        axes.plot(line, line, color=FOUND, lw=1.6, zorder=2, label="the law")
        for column, (colour, name) in enumerate(zip(AXES, _AXIS_NAMES[si], strict=True)):
            style = {"color": colour, "ms": 4, "alpha": 0.6, "label": name}
            axes.plot(factor * law[:, column], factor * asked[:, column], ".", **style)
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach - 2 * noise, reach + 2 * noise)
        plain_axes(axes, 9, labels=[f"{kind} that the {what} [{unit}]" for what in ("law gives", "recording asks for")])
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
    count = max(len(rows), 1)
    title = "Residual" if narrow else "Measured less simulated"
    figure = page_figure(1.0 + 1.35 * count, narrow, title, width=11)
    grid = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    samples = diagnosis.samples
    parts = [part for part in diagnosis.recordings if len(part.used)]
    spans = [(samples[part.used[0]] - 0.5, samples[part.used[-1]] + 0.5) for part in parts]
    for axes, ((kind, si, block), channel) in zip(grid, rows, strict=False):
        before, after = diagnosis.residual_before[:, channel], diagnosis.residual_after[:, channel]
        unit, factor = readable_unit(float(np.quantile(np.abs(before), 0.98)), si)
        axes.margins(x=0.005)
        if len(parts) > 1:
            for part, ends in zip(parts, spans, strict=True):
                own = 2 * factor * part.noise.of_unit(si)
                told = "noise, ± 2 σ" if part is parts[0] else None
                axes.fill_between(ends, -own, own, color=BAND, lw=0, zorder=0, label=told)
        else:
            noise = 2 * factor * diagnosis.noise.of_unit(si)
            axes.axhspan(-noise, noise, color=BAND, zorder=0, label="noise, ± 2 σ")
        for edge, _ in spans[1:]:
            axes.axvline(edge, color=PALE, lw=0.8, zorder=1)
        axes.plot(samples, factor * before, ".", color=BEFORE, ms=3.2, zorder=2, label="before")
        axes.plot(samples, factor * after, ".", color=AFTER, ms=2.6, zorder=3, label="after")
        axis = _AXIS_NAMES[si][channel - block.start]
        axes.set_ylabel("\n".join([*_lines(kind), f"{axis} [{unit}]"]), fontsize=8.5)
        plain_axes(axes, 8, "y")
    if len(parts) > 1:
        for part, (edge, _) in zip(parts, spans, strict=True):
            at = grid[0].get_xaxis_transform()
            grid[0].text(edge, 1.02, part.name, transform=at, fontsize=7.5, va="bottom", clip_on=False)
    grid[-1].set_xlabel("sample", fontsize=9)
    keys = grid[0].get_legend_handles_labels()
    figure.legend(*keys, loc="outside upper right", ncols=3, frameon=False, fontsize=9.5, markerscale=2.5)
    return figure


def _lines(channel: str) -> list[str]:
    """Return a channel's name in lines as short as a row is high: a marker's own name, then what of it."""
    name, _, what = channel.removeprefix("marker ").rpartition(" ")
    return [text if len(text) <= _LINE else f"{text[: _LINE - 1]}…" for text in (name, what) if text]


@plain_words
def histogram_figure(found: Residuals, begun: str = "robot file", *, narrow: bool = False) -> Figure:
    """Return histograms of the residuals in multiples of the noise, before and after, against the normal curve.

    begun: what the residual before is less. narrow: for a phone.
    """
    groups = [(name, block) for name, _, block in found.columns if found.exists[:, block].any()]
    across = 1 if narrow else 2
    figure = page_figure(3.0 * max(-(-len(groups) // across), 1), narrow, width=11)
    grid = panels(figure, len(groups), across)
    edges = np.linspace(-6, 6, 49).tolist()
    normal = np.linspace(-6, 6, 200)
    for axes, (name, block) in zip(grid, groups, strict=True):
        there = found.exists[:, block]
        before, after = (np.clip(values[:, block][there], -5.99, 5.99) for values in (found.before, found.after))
        bars = {"bins": edges, "density": True}
        axes.hist(before, color=BEFORE, alpha=0.55, label=f"filled: with the {begun}", zorder=2, **bars)
        axes.hist(after, histtype="step", color=AFTER, lw=1.8, label="outline: corrected model", zorder=3, **bars)
        density = np.exp(-0.5 * normal**2) / np.sqrt(2 * np.pi)
        axes.plot(normal, density, "--", color=INK, lw=1.2, label="dashed: noise alone", zorder=4)
        axes.set_xlim(-6, 6)
        axes.set_title(name, fontsize=11, loc="left", color=INK)
        axes.set_yticks([])
        labels = ("multiples of the noise (beyond ± 6: in the outermost bars)",)
        plain_axes(axes, 8, None, ("top", "right", "left"), labels)
    grid[0].legend(frameon=False, fontsize=9, loc="upper left")
    grid[0].set_ylim(top=1.45 * grid[0].get_ylim()[1])  # room for the legend above the curve
    return figure


# -- efforts -----------------------------------------------------------------------------------------------------------


@plain_words
def effort_figure(efforts: EffortDiagnosis, *, narrow: bool = False) -> Figure:
    """Return measured and predicted efforts over time, and their residual against the speed, joint by joint.

    `narrow`: for a phone, without the latter.
    """
    gain = [efforts.by_joint[name]["before"] - efforts.by_joint[name]["after"] for name in efforts.joints]
    chosen = sorted(np.argsort(gain)[::-1][:_MOST_JOINTS].tolist())
    figure = page_figure(0.7 + 2.1 * len(chosen), narrow, width=11)
    ratios = (1,) if narrow else (2.3, 1)
    grid = figure.subplots(len(chosen), len(ratios), squeeze=False, width_ratios=ratios)
    shown = _window(efforts)
    time = efforts.time[shown]
    steps = np.diff(time)  # pieces apart in time are no line
    gaps = np.flatnonzero(steps > 5 * np.median(steps)) + 1 if len(time) > 2 else np.zeros(0, int)
    for row, column in zip(grid, chosen, strict=True):
        name, unit = efforts.joints[column], efforts.units[column]
        zero_lines(row[0])
        for values, colour, width, order in (
            (efforts.rigid, BEFORE, 1.2, 2),
            (efforts.measured, _MEASURED, 1.6, 3),
            (efforts.predicted, AFTER, 1.1, 4),
        ):
            own = np.insert(values[shown, column], gaps, np.nan)
            row[0].plot(np.insert(time, gaps, np.nan), own, color=colour, lw=width, zorder=order)
        drawn, found = (number(100 * efforts.shares[name][of], 3) for of in ("rigid", "heldout"))
        text = f"{drawn} % of it unexplained as drawn, {found} % with the findings"
        row[0].set_title(
            f"{name}\n{text}" if narrow else f"{name}: {text}", fontsize=8.5 if narrow else 9.5, loc="left"
        )
        plain_axes(row[0], 8.5, labels=("", f"effort [{unit}]"))
        for axes in row[1:]:
            good = efforts.good[:, column]
            speed = efforts.speed[good, column]
            zero_lines(axes)
            for values, colour, order in ((efforts.rigid, BEFORE, 2), (efforts.predicted, AFTER, 3)):
                left = (efforts.measured - values)[good, column]
                axes.scatter(speed, left, s=3, color=colour, linewidths=0, alpha=0.5, zorder=order, rasterized=True)
            turning = "m/s" if name in efforts.sliding else "rad/s"
            plain_axes(axes, 8.5, labels=(f"speed [{turning}]", f"left [{unit}]"))
    grid[-1, 0].set_xlabel("time [s]", fontsize=9)
    keys = {"measured": _MEASURED, "rigid, as drawn": BEFORE, "with the findings": AFTER}
    handles = [Line2D([], [], color=colour, lw=2, label=word) for word, colour in keys.items()]
    size = 9 if narrow else 11
    figure.legend(handles=handles, loc="outside upper left", ncols=3, frameon=False, fontsize=size, handlelength=1.2)
    return figure


def _window(efforts: EffortDiagnosis) -> np.ndarray:
    """Return the samples of the stretch of time that is drawn: where the efforts change most."""
    time = efforts.time
    if time[-1] - time[0] <= _SECONDS:
        return np.arange(len(time))
    change = np.abs(efforts.predicted - efforts.rigid).sum(axis=1)
    starts = np.arange(time[0], time[-1] - _SECONDS + 1e-9, _SECONDS / 2)
    sums = [change[(time >= start) & (time < start + _SECONDS)].sum() for start in starts]
    start = starts[int(np.argmax(sums))]
    return np.flatnonzero((time >= start) & (time < start + _SECONDS))


def effort_curve_figure(finding: Finding, curve: EffortCurve, *, narrow: bool = False) -> Figure:
    """Return what the efforts ask for at a joint against what drives it, before any law, and the law.

    `narrow`: for a phone.
    """
    return _effort_curve(finding_text(finding), f"the law: {finding.physics.replace('_', ' ')}", curve, narrow)


def formula_figure(proposal: Proposal, curve: EffortCurve, *, narrow: bool = False) -> Figure:
    """Return the same of a formula that is proposed, drawn over what it is to explain."""
    return _effort_curve(f"A formula for {proposal.joint}", f"{proposal.law.symbol} = {proposal.text}", curve, narrow)


@plain_words
def _effort_curve(title: str, law: str, curve: EffortCurve, narrow: bool) -> Figure:
    figure = page_figure(4.6, narrow, title)
    axes: Any = figure.subplots()
    unit, factor = readable_unit(float(np.abs(curve.x).max(initial=0.0)), curve.x_unit)
    x = factor * curve.x
    zero_lines(axes, x)
    words = "what the efforts ask for, means of neighbours, 95 %"
    axes.errorbar(x, curve.y, 1.96 * curve.deviation, fmt="o", ms=5, color=AFTER, lw=1.2, zorder=3, label=words)
    if curve.law is not None:
        axes.plot(x, curve.law, color=FOUND, lw=2.2, zorder=4, label=law)
    labels = (f"{curve.against} of {curve.joint} [{unit}]", f"effort beyond the rest of the model [{curve.y_unit}]")
    plain_axes(axes, 8.5, labels=labels)
    figure.legend(frameon=False, fontsize=9, loc="outside lower center", ncols=1 if narrow else 2)
    return figure
