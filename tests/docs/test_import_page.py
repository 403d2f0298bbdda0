"""The page on logs: what it shows of the guessed map is there, and the recording is what the log says."""

import numpy as np
import yaml
from typer.testing import CliRunner

from prup_pin.cli import app
from prup_pin.recordings import read_recording

from .carried_out import BLOCK, ROOT
from .test_as_printed import blocks, commands

PAGE = ROOT / "docs" / "import.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_the_map_on_the_page_is_guessed_and_the_recording_is_the_motion(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    first, guessed, corrected, made, _ = blocks(PAGE)
    exec(first.text, {})
    assert CliRunner().invoke(app, commands(guessed)[0].split()[1:]).exit_code == 0
    text = (tmp_path / "run.map.yaml").read_text()
    parts = [block["text"] for block in BLOCK.finditer(TEXT) if block["what"] == "part of run.map.yaml"]
    assert len(parts) == 2
    for part in parts:
        assert part in text
    exec(corrected.text, {})
    assert CliRunner().invoke(app, commands(made)[0].split()[1:]).exit_code == 0
    recording = read_recording("recording.csv")
    t = recording.time
    assert np.abs(recording.positions["elbow_joint"] - np.radians(50) * np.sin(1.1 * t)).max() < 1e-8
    assert np.abs(recording.efforts["wrist_3_joint"] - 10.4 * np.cos(1.7 * t)).max() < 1e-7


def test_the_map_on_the_page_has_the_keys_that_a_map_has():
    from prup_pin.imports.map import KEYS

    shown = next(part for part in TEXT.split("```yaml\n")[1:] if part.startswith("robot:")).split("```")[0]
    assert set(yaml.safe_load(shown)) == set(KEYS)
