"""What a corrected model needs beside this package: whose laws, modules and robot it uses, in which version."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import metadata
from typing import Any

from ..laws import Law, brought_laws
from ..mechanism import Mechanism
from ..modules import KINDS
from ..plugins import Plugin, Source, files
from ..robots import brought_robots

Used = Mapping[Source, tuple[str, ...]]


def needs_of(robot: str, mechanism: Mechanism, laws: Iterable[Law]) -> Used:
    """Return whose things are used, and which: 'law settling', 'module rubber_mount', 'robot table'.

    robot: as it is loaded; laws: those of the effects.
    """
    words, kinds = {law.physics for law in laws}, {module.kind.kind for module in mechanism.modules}
    used: dict[Source, tuple[str, ...]] = {}
    groups: tuple[tuple[str, Iterable[Plugin], set[str]], ...] = (
        ("law", brought_laws() if words else (), words),
        ("module", KINDS.brought(), kinds),
        ("robot", brought_robots() if robot else (), {robot}),
    )
    for what, plugins, names in groups:
        for plugin in plugins:
            if plugin.name in names:
                told = (*used.get(plugin.source, ()), f"{what} {plugin.name}")
                used[plugin.source] = tuple(dict.fromkeys(told))
    return used


def taking_part(mechanism: Mechanism) -> list[str]:
    """Return in words what of others has part in a diagnosis: laws that have a place, modules of the robot."""
    laws = [found.thing for found in brought_laws() if found.thing.places(mechanism)]
    used = needs_of("", mechanism, laws)
    return [f"Brought along by {source}: {', '.join(things)}." for source, things in used.items()]


def as_json(used: Used) -> list[dict[str, Any]]:
    """Return needs as a corrected model's file holds them."""
    keys = {False: ("package", "version"), True: ("file", "sha256")}
    return [
        {**dict(zip(keys[source.is_file], (source.name, source.version), strict=True)), "for": list(things)}
        for source, things in used.items()
    ]


def lacking(source: Source, things: str) -> str:
    """Return in words what is not there, or in another version, and what to do; '' where it is as it was."""
    present = None
    if source.is_file:
        there = {digest: path.name for path, digest in files()}
        if source.version in there:
            return ""
        present = next((digest for digest, name in there.items() if name == source.name), None)
    else:
        with suppress(metadata.PackageNotFoundError):
            present = metadata.version(source.name)
        if present == source.version:
            return ""
    uses = f"{source}, of which this model uses {things}"
    if present is None:
        return f"{uses}, is not here: {source.remedy}"
    other = replace(source, version=present)
    return f'{uses}, is here as {other}: take that one, or write "{present}" here if both say the same'
