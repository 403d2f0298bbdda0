"""`prup-pin export`, as a user meets it."""

import json
from pathlib import Path

import pytest

import prup_pin
from prup_pin.simulation import CorrectedModel, Known, effect_named, write_model


@pytest.fixture
def model(tmp_path):
    """A corrected 3-PRUP: an encoder's zero, which a robot file holds, and play, which none does."""
    mechanism = prup_pin.load("3prup").mechanism
    off = effect_named("encoder_offset", "leg1/motor", "", {"offset": 2e-4}, mechanism)
    gap = effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 6e-5, "closing_load": 1.0}, mechanism)
    known = (Known({"offset": (1.9e-4, 2.1e-4)}, 0.3), Known({}, 0.12))
    path = tmp_path / "corrected_model.json"
    write_model(CorrectedModel("3prup", (off, gap), notes="diagnosis of bench.csv", known=known), path)
    return path


@pytest.mark.parametrize("name", ["corrected.urdf", "corrected.xml"])
def test_it_says_what_the_file_holds_and_what_it_leaves_out(run, model, name):
    done = run("export", model, "--to", name)
    assert done.exit_code == 0, done.output
    held, _, left = done.stdout.partition("Left out")
    assert "encoder_offset" in held
    assert "offset = 0.0002 m (95 %: 0.00019 to 0.00021)" in " ".join(held.split())
    assert "backlash" in left
    assert "12 %" in left
    assert f"Written: {name}" in left
    text = Path(name).read_text()
    assert "diagnosis of bench.csv" in text
    assert "backlash at leg2/ball_nut (explains 12 % of the held-out squared residual)" in text
    placed = prup_pin.load(name).model
    drawn = prup_pin.load("3prup").model
    at = placed.getJointId("leg1_slide")
    moved = placed.jointPlacements[at].translation - drawn.jointPlacements[at].translation
    assert abs(moved - [0, 0, 2e-4]).max() < 1e-12


@pytest.mark.parametrize(
    ("to", "told"),
    [
        ("corrected.step", "'.step' is no ending of a robot file; expected .urdf, or .xml"),
        ("corrected", "'corrected' has no ending; expected .urdf, or .xml"),
        ("away/corrected.urdf", "there is no folder 'away'"),
        (".", "'.' is a folder; give a file in it"),
    ],
)
def test_a_target_that_cannot_be_is_refused_before_anything_is_written(run, model, tmp_path, to, told):
    done = run("export", model, "--to", to)
    assert done.exit_code == 2
    assert told in " ".join(done.stderr.split())
    assert [path.name for path in tmp_path.iterdir()] == ["corrected_model.json"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda value: value.update(version=2), "version: is the number 2; this prup_pin reads version 1"),
        (lambda value: value["effects"][0].update(physics="encoder_ofset"), "Did you mean 'encoder_offset'"),
        (lambda value: value["effects"][0].update(share="much"), 'effects[0].share: is the text "much"'),
        (
            lambda value: value["effects"][0]["parameters"]["offset"].update(interval=[1]),
            "effects[0].parameters.offset.interval: is a list; expected two numbers, the ends of a 95 % interval",
        ),
        (lambda value: value["effects"][0]["parameters"]["offset"].update(value=5.0), "is the number 5; expected"),
    ],
    ids=["another version", "a misspelt law", "a share", "an interval", "a value out of bounds"],
)
def test_a_model_edited_by_hand_is_told_where_it_is_wrong(run, model, tmp_path, change, told):
    value = json.loads(model.read_text())
    change(value)
    model.write_text(json.dumps(value))
    done = run("export", model, "--to", "corrected.urdf")
    assert done.exit_code == 2
    assert told in " ".join(done.stderr.split())
    assert [path.name for path in tmp_path.iterdir()] == ["corrected_model.json"]


def test_a_file_that_is_there_is_replaced_as_a_whole(run, model):
    Path("corrected.urdf").write_text("something else")
    assert run("export", model, "--to", "corrected.urdf").exit_code == 0
    assert prup_pin.load("corrected.urdf").name == "3prup"
