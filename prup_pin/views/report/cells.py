"""A robot, a compliance, a diagnosis as HTML for a notebook's cell: `_repr_html_` of the three loads this file.

A few lines and tables, without script or network. Colours are the notebook's own, so that dark themes stay readable.
"""

from __future__ import annotations

from collections import Counter

from ...diagnosis import Diagnosis
from ...errors import PrupPinError
from ...numbers import number, quantity, some
from ...robot import Robot
from ...statics import Compliance
from ..text.answer import Answer, compliance_table, first_shares, load_text, rigid_texts, stiffness_tables
from ..text.diagnosis_words import (
    EFFORT_COLUMNS,
    channel_rows,
    effort_rows,
    finding_text,
    parameter_texts,
    verdict_text,
)
from ..text.values import clean, percent_text, pose_text
from .pages import page_template


def robot_html(robot: Robot) -> str:
    """Return what a robot consists of, and what is assumed."""
    mechanism = robot.mechanism
    try:
        home = ", ".join(some(pose_text(robot, robot.home.coordinates or robot.home.actuators, 4, "°")))
    except PrupPinError as error:
        home = f"none: {error}"
    kinds = Counter(module.kind.kind.replace("_", " ") for module in mechanism.modules)
    actuated = f"of which {len(mechanism.actuated)} actuated: {', '.join(some(mechanism.actuated))}"
    tool = "none; load(..., tool=…) says where forces act" if mechanism.tool is None else mechanism.tool.name
    facts = {
        "joints": f"{mechanism.model.njoints - 1}, {actuated}",
        "loops": str(len(mechanism.loops) or "none"),
        "tool": tool,
        "task coordinates": ", ".join(some(robot.task_coordinates)) or "none",
        "home": home,
        "compliant modules": ", ".join(f"{count} × {kind}" for kind, count in kinds.items()) or "none",
        "parameters": f"{len(robot.parameters)}: robot.parameters, robot.to_dataframe()",
        "assumed": "; ".join(robot.assumptions) or "nothing besides small deflections",
    }
    return _cell(robot.name, facts=facts)


def compliance_html(compliance: Compliance) -> str:
    """Return the pose, K (or the directions in which nothing yields), C, and what yields most."""
    answer, pose = Answer(compliance), compliance.pose
    at = ", ".join(f"{name} {number(clean(value), 4)}" for name, value in (pose.coordinates or pose.actuators).items())
    facts = {"pose": f"{at or 'home'} [m, rad]"}
    if answer.stiffness is None:
        facts["K does not exist"] = f"no module yields under {'; '.join(rigid_texts(answer))}"
    matrices = (*stiffness_tables(answer), compliance_table(answer))
    tables = [(f"{each.title} {each.detail}", each.headers, each.lines) for each in matrices]
    bars = first_shares(answer.shares or {}, 6)
    largest = max((abs(share) for _, share in bars), default=0.0) or 1.0
    amount = quantity(answer.amount, "rad" if answer.load.turns else "m")
    return _cell(
        f"{pose.mechanism.name}: compliance at '{answer.tool}'",
        facts=facts,
        tables=tables,
        yields=f"What yields {load_text(answer)}: the tool {'turns' if answer.load.turns else 'moves'} {amount}",
        bars=[(name, percent_text(share), f"{12 * max(share, 0.0) / largest:.2f}") for name, share in bars],
    )


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """Return the verdict, the findings with their intervals, and the residual before and after."""
    rows = []
    for count, finding in enumerate(diagnosis.told, 1):
        for index, texts in enumerate(parameter_texts(finding.parameters) or [("", "", "")]):
            rows.append((*(("", "") if index else (str(count), finding_text(finding))), *texts))
    known = not any(value != value for value in diagnosis.before.values())
    tables = [
        ("", ("", "left out", "parameter", ">value", ">95 % interval"), rows),
        ("", ("residual, RMS", ">before", ">after", ""), channel_rows(diagnosis) if known else []),
        ("", EFFORT_COLUMNS, effort_rows(diagnosis)),
    ]
    return _cell("Diagnosis", verdict=verdict_text(diagnosis), tables=tables, remarks=diagnosis.remarks)


def _cell(title: str, **parts) -> str:
    """Return what a cell shows; tables are (caption, columns with > before numbers, rows), if they have rows."""
    empty = {"verdict": "", "facts": {}, "tables": (), "yields": "", "bars": (), "remarks": ()}
    return page_template("cell.html").render(title=title, **{**empty, **parts})
