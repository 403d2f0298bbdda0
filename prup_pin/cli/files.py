"""Files that commands write: whole or not at all, and refused before anything is computed."""

from __future__ import annotations

import re
import webbrowser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import InputError
from ..files import check_takes_files, writable, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def file_name(robot: str) -> str:
    """Return the name of a robot, or of its file, as that of a file in the current folder."""
    return re.sub(r"[^\w.-]+", "_", Path(robot).stem).strip("._-")[:80] or "robot"


@contextmanager
def blamed(option: str, path: Path) -> Iterator[None]:
    """Have an error about a path name the option by which it was typed."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    except (OSError, ValueError) as error:  # a NUL character
        raise InputError(f"{option}: cannot write '{path}': {getattr(error, 'strerror', '') or error}") from error


def check_folder(path: Path | None, option: str, whole: bool = False) -> None:
    """Raise InputError, before anything is computed, where a file cannot be written.

    whole: nor may a pipe or a device stand there.
    """
    if path is None:
        return
    with blamed(option, path):
        if path.is_dir():
            raise InputError(f"'{path}' is a folder; give a file in it")
        if not path.parent.is_dir():
            raise InputError(f"cannot write '{path}': there is no folder '{path.parent}'")
        if whole or path.is_file() or not path.exists():
            check_takes_files(writable(path).parent)


def check_csv(out: Path, source: Path | None, what: str) -> None:
    """Raise InputError, before anything is computed, where the table cannot be written or would replace its source.

    Without a source a whole recording is written, with its JSON beside.
    """
    check_folder(out, "--out", whole=True)
    if out.suffix.lower() == ".json":
        raise InputError(f"--out: '{out}' would be a table in a .json file; give a .csv file")
    if source is None:
        check_folder(out.with_suffix(".json"), "--out", whole=True)
    elif same_file(out, source):
        raise InputError(f"--out: '{out}' is the {what} itself; give another file")


def same_file(out: Path, source: Path) -> bool:
    """Return True where a file would be written over what it is made from."""
    try:
        return source.exists() and out.exists() and out.samefile(source)
    except (OSError, ValueError):  # a path that cannot be; who reads it says so
        return False


def folder_for(folder: Path | None, option: str) -> None:
    """Raise InputError, before anything is computed, where no files can be written into a folder, there or not yet."""
    if folder is None:
        return
    with blamed(option, folder):
        there = next(place for place in (folder, *folder.parents) if place.exists())
        if not there.is_dir():
            raise InputError(f"'{there}' is a file; give a folder")
        check_takes_files(there)


def write_figures(
    folder: Path, figures: Mapping[str, Figure], option: str, kinds: Sequence[str] = ("png", "svg")
) -> list[Path]:
    """Write pictures by name, each in all kinds, and return where they are. Raises InputError, with none written."""
    from ..views.drawing.plotting import encoded

    made = {folder / f"{name}.{kind}": (encoded(figure, kind),) for name, figure in figures.items() for kind in kinds}
    with blamed(option, folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(made)
    return list(made)


def write(path: Path, content: str, option: str) -> None:
    """Write a file whole or not at all: another one that is there stays until the new one is complete.

    What is no file, a pipe or a device, is written into.
    """
    check_folder(path, option)
    with blamed(option, path):
        if path.exists() and not path.is_file():
            path.write_text(content, encoding="utf-8")
        else:
            write_whole({path: (content,)})


def list_written(paths: Iterable[Path], missing: Iterable[str] = ()) -> None:
    """Say which files there are now, and which are missing and why."""
    typer.echo("\nWritten: " + "\n         ".join(map(str, paths)))
    for text in missing:
        typer.echo(f"Left out: {text}")


def say_written(page: Path, open_browser: bool) -> None:
    """Say where a page is, and open it where that is wanted."""
    typer.echo(f"Written: {page} ({page.stat().st_size / 1e6:.1f} MB); open it in a browser")
    if open_browser:
        webbrowser.open(page.resolve().as_uri())
