"""The report: one self-contained page for whoever builds the machine.

The page holds everything and fetches nothing. What a robot file names is escaped by the template engine; beyond that
the page allows only its own scripts, by their hashes.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import fixed, number, quantity, readable_unit, some
from ...review import number_remarks
from ...robot import Robot
from ...spatial import Array, as_wrench
from ...statics import Compliance
from ..scene.colours import share_colours
from ..text import answer as words
from ..text.answer import Answer
from ..text.values import (
    default_parameters,
    direction_text,
    given_parameters,
    mobility_rows,
    module_parameters,
    percent_text,
    pose_text,
    position_text,
    workshop_text,
)
from .pages import page

#: Modules and values that are listed, and what changes the deflection by less [% per %] is not.
SOFTEST, VALUES, LITTLE = 10, 8, 0.01
#: Largest size of the scene [characters]; a heavier one would make a page that cannot be mailed.
SCENE_LIMIT = 3_500_000


def report_html(
    robot: Robot,
    pose: ClosedPose | Mapping[str, float] | None = None,
    wrench=None,
    *,
    scale: float | None = None,
    frame: str | None = None,
    compliance: Compliance | None = None,
    changes: Mapping[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> str:
    """Return one self-contained HTML page: scene, K, C, deflection, shares, softest parts, what to stiffen first, sag,
    assumptions.

    pose: a closed pose, or task coordinates such as {"z": 0.4}; none: home.
    wrench: (6,) or {"fx": 300}, on the tool, base axes [N, N m]; none: a unit force along the softest direction.
    scale: the deflection is drawn this many times larger; none: a round number that shows it.
    frame: one more frame whose deflection is wanted.
    compliance: that of the pose, where it is not the one at rest: `robot.compliance(pose, load=…)`.
    changes: parameters that differ from the robot file, by name, to be named in the report.
    notes: remarks to be added.

    Raises what `robot.pose` and `robot.compliance` raise.
    """
    from ..drawing import figures

    if pose is None:
        pose = robot.home
    elif not isinstance(pose, ClosedPose):
        pose = robot.pose(**pose)
    if compliance is None:
        compliance = robot.compliance(pose)
    elif compliance.pose is not pose:
        raise InputError("this compliance belongs to another pose; ask for robot.compliance(pose)")
    answer = Answer(compliance, None if wrench is None else as_wrench(wrench), frame, robot)
    scene, scene_note = _scene(robot, answer, scale)
    load = answer.load.wrench if answer.load.wrench.any() else None
    softest = [name for name in words.ranked(answer.shares or {}) if (answer.shares or {})[name] > 1e-6][:SOFTEST]
    # the table of displacements in common units, the sag among them; and where down is
    columns, moved, units = words.displacements(answer)
    rows, gravity, down = [(name, *cells) for name, cells in moved.items()], answer.mechanism.gravity, ""
    if gravity.any():
        rows.append(("sag by own weight", *words.displacement_cells(answer.sag, units)[:4], *("", "", "")))
        down = direction_text(gravity / np.linalg.norm(gravity))
    # a rigid module would just take its part away where no loop carries load of its own
    adds_up = compliance.pose.balance.self_stress.shape[1] == 0
    return page(
        "report_page.html",
        robot,
        answer=answer,
        words=words,
        figures=figures,
        load=words.load_text(answer),
        doubts=list(number_remarks(robot)),
        asked=_asked(robot, answer, changes or {}),
        facts=_facts(answer),
        scene=scene,
        scene_note=scene_note,
        script_hashes=_script_hashes(scene),
        pictured=(robot, pose, compliance, load, scale),
        displacement_columns=("frame", *(f">{name}" for name in columns)),
        displacement_rows=rows,
        down=down,
        softest=_softest(robot, answer, softest, adds_up),
        exact_without=adds_up,
        moved=_moved(answer, answer.deflection),
        stiffen_first=_stiffen_first(answer),
        mobility=mobility_rows(robot.mechanism, robot.mobility(pose)),
        notes=list(notes),
    )


# -- what the page says ------------------------------------------------------------------------------------------------


def _moved(answer: Answer, deflection: Array) -> str:
    """Return '4.69 mm, 25.4 mrad'; of a pure force or moment only what it asks for, where that is not zero."""
    metres, radians = float(np.linalg.norm(deflection[:3])), float(np.linalg.norm(deflection[3:]))
    texts = [quantity(metres, "m"), quantity(radians, "rad")]
    if answer.load.turns:
        return texts[1]
    return ", ".join(texts) if answer.load.wrench[3:].any() else texts[0]


def _asked(robot: Robot, answer: Answer, changes: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return pose, load and what differs from the robot file, in words."""
    pose = answer.compliance.pose
    at = pose.base_from_tool[:3, 3]
    load = words.load_text(answer).removeprefix("under ")
    return [
        ("Task", pose_text(robot, pose.coordinates, degrees="°")),
        ("Actuators", pose_text(robot, pose.actuators, degrees="°")),
        (f"Tool '{answer.tool}'", [f"{axis} {position_text(v)} mm" for axis, v in zip("xyz", at, strict=True)]),
        ("Load", [load if answer.load.given else f"{load} (none was given)"]),
        ("Changed", [f"{name} = {workshop_text(v, robot.parameters[name].unit)}" for name, v in changes.items()]),
        ("Locked joints", sorted(robot.mechanism.locked)),
    ]


def _facts(answer: Answer) -> list[tuple[str, str, str]]:
    """Return the answer in a few (label, value, detail)."""
    metres, radians = (float(np.linalg.norm(answer.deflection[block])) for block in (slice(0, 3), slice(3, 6)))
    moved, turned = quantity(metres, "m"), quantity(radians, "rad")
    per = "" if answer.load.given else " per N m" if answer.load.turns else " per N"
    if answer.load.turns:
        first = (f"The tool turns{per}", turned, f"and moves {moved}" if metres else "and does not move")
    else:
        first = (f"The tool moves{per}", moved, f"and turns {turned}" if radians else "and does not turn")
    facts = [first]
    facts += [(title, text, words.ALONG) for title, text in words.along_texts(answer).items()]
    if answer.shares is not None:
        names = words.softest(answer.shares)
        which = "the softest part" if len(names) == 1 else f"each of the {len(names)} softest parts"
        facts.append((f"Share of {which}", f"{percent_text(answer.shares[names[0]])} %", ", ".join(some(names, 6))))
    if answer.mechanism.gravity.any():
        amount = quantity(float(np.linalg.norm(answer.sag[:3])), "m")
        facts.append(("Sag", amount, "the tool, under the robot's own weight"))
    return facts


def _softest(robot: Robot, answer: Answer, names: Sequence[str], adds_up: bool) -> list[dict[str, Any]]:
    """Return what is told of some modules; of modules with equal values all but the first refer to it."""
    shares = answer.shares or {}
    modules = {module.name: module for module in answer.mechanism.modules}
    colours, _ = share_colours(shares)
    largest = max((shares[name] for name in names), default=0.0)
    unit, factor = readable_unit(answer.amount, "rad" if answer.load.turns else "m")
    amounts = fixed([answer.contributions[name] * factor for name in names])
    rows: list[dict[str, Any]] = []
    seen: dict[tuple, str] = {}
    for name, amount in zip(names, amounts, strict=True):
        own = module_parameters(robot, modules[name])
        values = [(_words(p.short), workshop_text(p.value, p.unit), p.source) for p in given_parameters(own)]
        first = seen.setdefault((modules[name].kind.kind, *values), name)
        rest = answer.deflection - answer.compliance.parts[name] @ answer.load.wrench
        rows.append(
            {
                "name": name,
                "kind": _words(modules[name].kind.kind),
                "summary": modules[name].kind.summary,
                "percent": percent_text(shares[name]),
                "colour": colours[name],
                "bar": f"{100 * max(shares[name], 0.0) / largest:.1f}",
                "amount": f"{amount} {unit}",
                "without": _moved(answer, rest) if adds_up else None,
                "parameters": values,
                "like": None if first == name else first,
                "defaults": [f"{_words(p.short)} {workshop_text(p.value, p.unit)}" for p in default_parameters(own)],
            }
        )
    return rows


def _words(name: str) -> str:
    return name.replace("_", " ")


def _stiffen_first(answer: Answer) -> list[dict[str, str]]:
    """Return the values that change the deflection along the load most; none of a robot whose modules bear a load."""
    if answer.compliance.load is not None:
        return []
    return [
        {
            "module": line.parameter.owner,
            "value": f"{_words(line.parameter.short)} {workshop_text(line.parameter.value, line.parameter.unit)}",
            "percent": number(line.percent, 3).replace("-", "\u2212"),
        }
        for line in answer.stiffen_first[:VALUES]
        if abs(line.percent) > LITTLE
    ]


# -- what the page shows -----------------------------------------------------------------------------------------------


def _scene(robot: Robot, answer: Answer, scale: float | None) -> tuple[str, str]:
    """Return the page of the 3-D scene, and what must be said about it or its absence."""
    from ..meshcat.view import view

    compliance, wrench = answer.compliance, answer.load.wrench
    size = 0
    for moved in (wrench, None) if wrench.any() else (None,):
        page = view(robot, compliance.pose, moved, scale, compliance=compliance).static_html()
        size = len(page)
        if size <= SCENE_LIMIT:
            left_out = moved is None and wrench.any()
            note = "Its meshes are heavy, so the scene leaves out the deflection; prup-pin view shows it."
            return page, note if left_out else ""
    return "", f"The 3-D scene is not shown: its meshes take {number(size / 1e6, 2)} MB; prup-pin view shows it."


def _script_hashes(scene: str) -> list[str]:
    """Return the hashes of the scripts that may run: a frame obeys the page's policy as well as its own."""
    scripts = re.findall(r"<script>(.*?)</script>", scene.replace("\r\n", "\n"), re.DOTALL)
    return [f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode('ascii')}'" for s in scripts]
