"""A YAML file with the line of each key, and what is wrong with keys and values, collected."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from ..errors import nearest_names
from ..recordings.problems import KeyProblem, Problems, is_number, json_kind, read_bytes, shown

#: A map of a thousand columns has a tenth of these characters.
_LONGEST = 1_000_000
#: Values within values.
_DEEPEST = 20


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc] # the fast one, where there is one
    """Reads 2e-5 as a number, which YAML 1.1 takes for a text."""


_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))


def load_yaml(path: Path, problems: Problems, keys: Sequence[str]) -> tuple[dict[str, Any], dict[tuple, int]]:
    """Return the content of a map's YAML file, an object of `keys`, and the line of each key."""
    text = read_bytes(path, "a map (YAML)", (".yaml", ".yml")).decode("utf-8-sig", "replace")
    if len(text) > _LONGEST:
        problems.add(KeyProblem(f"holds {len(text)} characters; no map has more than {_LONGEST}", None, path.name))
        return {}, {}
    content: Any = None
    try:
        depth = 0
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            wrong = "nests its values too deep" if depth > _DEEPEST else ""
            if isinstance(event, yaml.AliasEvent):  # a few are a value of any size, or one that holds itself
                wrong = f"*{shown(event.anchor)} is not read; write the value out"
            if wrong:
                mark = event.start_mark
                problems.add(KeyProblem(wrong, mark.line + 1 if mark is not None else None, path.name))
                return {}, {}
        loader = _Loader(text)
        node = loader.get_single_node()
        content = loader.construct_document(node) if node is not None else None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or str(error)
        line = mark.line + 1 if mark is not None else None
        problems.add(KeyProblem(f"is not valid YAML: {shown(what)}", line, path.name))
        return {}, {}
    except (ValueError, TypeError, AttributeError, LookupError) as error:  # a date that is none, a number of digits
        problems.add(KeyProblem(f"holds a value that cannot be read: {shown(error)}", None, path.name))
        return {}, {}
    if not isinstance(content, dict):
        problems.add(KeyProblem(f"holds {json_kind(content)}; expected keys: {', '.join(keys)}", 1, path.name))
        return {}, {}
    lines: dict[tuple, int] = {}

    def walk(item: Any, place: tuple) -> None:
        if isinstance(item, yaml.MappingNode):
            for key, value in item.value:
                inner = (*place, key.value)
                lines[inner] = key.start_mark.line + 1
                walk(value, inner)
        elif isinstance(item, yaml.SequenceNode):
            for k, value in enumerate(item.value):
                inner = (*place, f"[{k}]")
                lines[inner] = value.start_mark.line + 1
                walk(value, inner)

    walk(node, ())
    return content, lines


class KeyReader:
    """Reads keys and values of a file; what is wrong is collected, each with its line."""

    def __init__(self, problems: Problems, lines: Mapping[tuple, int]):
        self.problems, self.lines = problems, lines

    def wrong(self, message: str, *place: str) -> None:
        """Note what is wrong with a key, or with its value."""
        self.problems.add(KeyProblem(message, self.lines.get(place), key=": ".join(map(str, place))))

    def known(self, given: Any, keys: Sequence[str], *place: str) -> dict[str, Any]:
        """Return an object whose keys are known ones; what is none is a problem and gives {}."""
        if given is None:
            return {}
        if not isinstance(given, dict):
            self.wrong(f"is {json_kind(given)}; expected keys: {', '.join(keys)}", *place)
            return {}
        for key in given:
            if key not in keys:
                self.wrong(f"is no key here. {nearest_names(str(key), list(keys))}", *place, str(key))
        return given

    def number(self, given: Mapping[str, Any], key: str, fallback: float, *place: str) -> float:
        """Return a number, the fallback where there is none; a value that is no number is a problem."""
        value = given.get(key, fallback)
        if not is_number(value):
            self.wrong(f"is {json_kind(value)}; expected a number", *place, key)
            return fallback
        return float(value)
