"""How a contract speaks: each check's first line is its sentence, and an AssertionError says who breaks it, and how."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np


def title(thing: object) -> str:
    """Return what a law, kind of module or reader is called: its class's name, or its own."""
    inner = getattr(thing, "law", None)
    name = getattr(thing, "__name__", type(thing).__name__)
    return name if inner is None else f"{name} of {title(inner)}"


def require(holds: object, broken: str) -> None:
    """Raise AssertionError with what is broken, in words, unless it holds."""
    if not holds:
        raise AssertionError(broken)


def near(found: Any, expected: Any, *, atol: float = 0.0, rtol: float = 0.0) -> None:
    """Raise AssertionError with the largest difference where numbers are further apart than allowed, or not finite."""
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=atol, equal_nan=False)


def contract(subject: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a check say whose contract is broken: `subject` names the argument that is checked.

    Whatever the checked code raises by itself breaks the contract as well.
    """

    def told(check: Callable[..., None]) -> Callable[..., None]:
        names = check.__code__.co_varnames[: check.__code__.co_argcount]
        sentence = str(check.__doc__).partition("\n")[0]

        @wraps(check)
        def asked(*given: Any, **named: Any) -> None:
            values = dict(zip(names, given, strict=False)) | named
            place = f" at {values['place']}" if "place" in values else ""
            try:
                check(*given, **named)
            except Exception as error:
                why = str(error) if isinstance(error, AssertionError) else f"{type(error).__name__}: {error}"
                raise AssertionError(f"{title(values[subject])}{place} breaks: {sentence} {why.strip()}") from error

        return asked

    return told
