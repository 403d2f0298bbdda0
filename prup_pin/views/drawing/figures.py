"""Pictures: a robot at a pose with its compliance, and which module yields. Needs matplotlib."""

from __future__ import annotations

from textwrap import wrap

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import fixed, number, readable_unit
from ...robot import Robot
from ...statics import Compliance
from ..scene.colours import PALE, share_colours
from ..scene.painter import pose_scene
from ..text.answer import Answer, load_text, ranked
from ..text.values import percent_text
from .plotting import Figure, plain_axes, plain_words, sheet
from .scene_figure import NARROW, WIDE, scene_figure, write_head


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
