"""A robot, a compliance, a diagnosis as HTML for a notebook's cell: `_repr_html_` of the three loads this file.

Colours are the notebook's own, so that dark themes stay readable. All names are escaped: robot files are anybody's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape

from ...diagnosis import Diagnosis
from ...errors import PrupPinError
from ...numbers import number, quantity
from ...robot import Robot
from ...statics import Compliance
from ..text.answer import Answer, MatrixTable, compliance_table, load_text, ranked, rigid_texts, stiffness_tables
from ..text.diagnosis_words import channel_rows, effort_rows, finding_text, parameter_texts, verdict_text
from ..text.values import clean, percent_text, pose_text

#: Modules whose shares are listed.
_SHOWN = 6
_CELL = "text-align: right; padding: 1px 9px; font-variant-numeric: tabular-nums; white-space: nowrap"
_TABLE = '<table style="border-collapse: collapse; margin: 0">'
_WORDS = "text-align: left; padding: 1px 9px; white-space: normal"


def robot_html(robot: Robot) -> str:
    """Return what a robot consists of, and what is assumed."""
    mechanism = robot.mechanism
    kinds = Counter(module.kind.kind.replace("_", " ") for module in mechanism.modules)
    rows = [
        (
            "joints",
            f"{mechanism.model.njoints - 1}, of which {len(mechanism.actuated)} actuated: {_some(mechanism.actuated)}",
        ),
        ("loops", str(len(mechanism.loops) or "none")),
        (
            "tool",
            mechanism.tool.name if mechanism.tool is not None else "none; load(..., tool=…) says where forces act",
        ),
        ("task coordinates", _some(robot.task_coordinates) or "none"),
        ("home", _home(robot)),
        ("compliant modules", ", ".join(f"{count} × {kind}" for kind, count in kinds.items()) or "none"),
        ("parameters", f"{len(robot.parameters)}: robot.parameters, robot.to_dataframe()"),
        ("assumed", "; ".join(robot.assumptions) or "nothing besides small deflections"),
    ]
    return _block(robot.name, [_facts(rows)])


def _home(robot: Robot) -> str:
    try:
        home = robot.home
        return _some([text.replace(" deg", "°") for text in pose_text(robot, home.coordinates or home.actuators, 4)])
    except PrupPinError as error:
        return f"none: {error}"


def _some(names: Iterable[str]) -> str:
    shown = list(names)
    return ", ".join(shown[:8]) + (f", … ({len(shown)})" if len(shown) > 8 else "")


def compliance_html(compliance: Compliance) -> str:
    """Return the pose, K (or the directions in which nothing yields), C, and what yields most."""
    answer, pose = Answer(compliance), compliance.pose
    at = ", ".join(f"{name} {number(clean(value), 4)}" for name, value in (pose.coordinates or pose.actuators).items())
    parts = [_facts([("pose", f"{at or 'home'} [m, rad]")])]
    if answer.stiffness is None:
        texts = "; ".join(rigid_texts(answer))
        parts.append(_facts([("K does not exist", f"no module yields under {texts}")]))
    parts += [_matrix(table) for table in stiffness_tables(answer)]
    parts.append(_matrix(compliance_table(answer)))
    if answer.shares is not None:
        amount = quantity(answer.amount, "rad" if answer.load.turns else "m")
        names = ranked(answer.shares)
        shown = names[:_SHOWN] if len(names) > _SHOWN + 1 else names  # one more is named rather than counted
        bars = [(name, answer.shares[name]) for name in shown]
        if more := names[len(shown) :]:
            bars.append((f"{len(more)} others", sum(answer.shares[name] for name in more)))
        moves = "turns" if answer.load.turns else "moves"
        parts.append(_caption(f"What yields {load_text(answer)}: the tool {moves} {amount}") + _bars(bars))
    return _block(f"{pose.mechanism.name}: compliance at '{answer.tool}'", parts)


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """Return the verdict, the findings with their intervals, and the residual before and after."""
    parts = [f'<p style="margin: 4px 0 8px">{escape(verdict_text(diagnosis))}</p>']
    rows = []
    for count, finding in enumerate(diagnosis.told, 1):
        values = parameter_texts(finding.parameters) or [("", "", "")]
        for index, (name, value, interval) in enumerate(values):
            first = (str(count), finding_text(finding)) if index == 0 else ("", "")
            rows.append((*first, name, value, interval))
    if rows:
        parts.append(_table(("", "left out", "parameter", "value", "95 % interval"), rows, words=3))
    if not any(value != value for value in diagnosis.before.values()):
        parts.append(_table(("residual, RMS", "before", "after", ""), channel_rows(diagnosis), words=1))
    if efforts := effort_rows(diagnosis):
        parts.append(_table(("joint", "noise", "× noise", "% of the effort"), efforts, words=1))
    parts += [f'<p style="margin: 4px 0; opacity: 0.75">{escape(text)}</p>' for text in diagnosis.remarks]
    return _block("Diagnosis", parts)


# -- pieces ------------------------------------------------------------------------------------------------------------


def _block(title: str, parts: Sequence[str]) -> str:
    head = f'<div style="font-weight: 650; font-size: 1.15em; margin: 2px 0 4px">{escape(title)}</div>'
    return f'<div style="max-width: 62em; overflow-x: auto; line-height: 1.45">{head}{"".join(parts)}</div>'


def _caption(text: str) -> str:
    return f'<div style="font-weight: 650; margin: 9px 0 2px">{escape(text)}</div>'


def _facts(rows: Sequence[tuple[str, str]]) -> str:
    cells = "".join(
        f'<tr><td style="{_WORDS}; opacity: 0.7; white-space: nowrap; vertical-align: top">{escape(name)}</td>'
        f'<td style="{_WORDS}">{escape(text)}</td></tr>'
        for name, text in rows
    )
    return f"{_TABLE}{cells}</table>"


def _matrix(table: MatrixTable) -> str:
    rows = [(name, *cells) for name, cells in zip(table.rows, table.cells, strict=True)]
    return _caption(f"{table.title} {table.detail}") + _table(("", *table.columns), rows, words=1)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]], words: int) -> str:
    """Return a table whose first `words` columns are words, the others numbers."""
    styles = [_WORDS if index < words else _CELL for index in range(len(columns))]
    head = "".join(f'<th style="{style}">{escape(name)}</th>' for style, name in zip(styles, columns, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td style="{s}">{escape(cell)}</td>' for s, cell in zip(styles, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f"{_TABLE}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _bars(shares: Sequence[tuple[str, float]]) -> str:
    """Return rows of name, share and a bar as long as the share."""
    largest = max(abs(share) for _, share in shares) or 1.0
    rows = "".join(
        f'<tr><td style="{_WORDS}">{escape(name)}</td><td style="{_CELL}">{percent_text(share)} %</td>'
        f'<td style="padding: 1px 9px"><div style="height: 0.7em; border-radius: 2px; background: #bd3977; '
        f'width: {12 * max(share, 0.0) / largest:.2f}em"></div></td></tr>'
        for name, share in shares
    )
    return f"{_TABLE}{rows}</table>"
