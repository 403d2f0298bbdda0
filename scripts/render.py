"""Renders a saved HTML page to a PNG in headless Chromium.

python scripts/render.py view.html picture.png [--size 1200x750] [--wait 8]

Pages narrower than 500 px, a telephone's, are cut out by Pillow: pip install ".[test]" brings it.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from html import escape
from importlib.util import find_spec
from pathlib import Path

#: Chromium's windows are no narrower: pages of telephones are shown in a frame of their width, which is cut out.
LEAST_WIDTH = 500
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def find_chromium() -> str | None:
    """Return a Chromium on the path, or None."""
    return next((found for found in map(shutil.which, NAMES) if found), None)


def command(chromium: str, folder: str, size: tuple[int, int]) -> list[str]:
    """Return how Chromium is called: without a screen, drawing in software, with its files in `folder`."""
    return [
        chromium,
        "--headless",
        "--no-sandbox",
        "--hide-scrollbars",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--use-gl=angle",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        f"--user-data-dir={folder}",
        f"--window-size={size[0]},{size[1]}",
    ]


def render(page: str, picture: Path, size: tuple[int, int] = (1200, 750), seconds: float = 8.0) -> None:
    """Render a page (path or address) to a PNG. `seconds` is the page's own time before the picture is taken."""
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("Chromium is not installed; on Debian and Ubuntu: apt-get install chromium")
    file, _, moment = page.partition("#")
    address = page if "://" in page else Path(file).resolve().as_uri() + (f"#{moment}" if moment else "")
    narrow, window = size[0] < LEAST_WIDTH, (max(size[0], LEAST_WIDTH), size[1])
    if narrow and find_spec("PIL") is None:
        raise SystemExit(f"A page narrower than {LEAST_WIDTH} px is cut out by Pillow: pip install pillow")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        shown = address
        if narrow:
            frame = Path(folder) / "narrow.html"
            style = f"border: 0; display: block; width: {size[0]}px; height: {size[1]}px"
            frame.write_text(f'<body style="margin: 0"><iframe src="{escape(address)}" style="{style}"></iframe>')
            shown = frame.as_uri()
        shot = [f"--virtual-time-budget={int(1000 * seconds)}", f"--screenshot={picture.resolve()}", shown]
        done = subprocess.run([*command(chromium, folder, window), *shot], capture_output=True, text=True, timeout=600)
    if done.returncode or not picture.is_file():
        raise SystemExit(f"Chromium made no picture of {address}:\n{done.stderr[-2000:]}")
    if narrow:
        from PIL import Image

        with Image.open(picture) as whole:
            part = whole.crop((0, 0, *size))
        part.save(picture)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", help="HTML file or address")
    parser.add_argument("picture", type=Path, help="PNG to write")
    parser.add_argument("--size", default="1200x750", help="width x height in pixels")
    parser.add_argument("--wait", type=float, default=8.0, help="seconds of the page's own time")
    arguments = parser.parse_args()
    width, _, height = arguments.size.partition("x")
    render(arguments.page, arguments.picture, (int(width), int(height)), arguments.wait)


if __name__ == "__main__":
    sys.exit(main())
