"""`prup-pin diagnose --against`: what has changed since an earlier test, from end to end, and what is refused."""

import json
from pathlib import Path

import pytest

from prup_pin.errors import PrupPinError

from .reference.concealed.since import draw_pair, write

ARM = Path(__file__).parent / "robots" / "elastic_arm" / "elastic_arm.urdf"


@pytest.fixture(scope="module")
def tested(tmp_path_factory):
    """A folder with both tests of an arm to which nothing happened, and the first one's diagnosis."""
    from typer.testing import CliRunner

    from prup_pin.cli import app

    folder = tmp_path_factory.mktemp("tested")
    write(draw_pair(3, "elastic_arm", "nothing", (5, 4)), folder, folder / "sealed", str(ARM))
    done = CliRunner().invoke(
        app, ["diagnose", str(folder / "then.csv"), "--out", str(folder / "monday"), "--no-report"]
    )
    assert done.exit_code == 0, done.output
    return folder


def test_nothing_has_changed_in_the_terminal_the_json_and_the_report(tested, run, tmp_path):
    model = tested / "monday" / "corrected_model.json"
    done = run("diagnose", tested / "now.csv", "--against", model, "--out", tmp_path / "friday")
    assert done.exit_code == 0, done.output
    said = " ".join(done.stdout.split())
    assert said.startswith("Nothing has changed since the earlier test beyond what that could know")
    assert "compared with diagnosis of then.csv" in said
    assert "What else would have been seen" in said
    assert "%" in said
    document = json.loads((tmp_path / "friday" / "diagnosis.json").read_text())
    assert (document["verdict"], document["since"]["explained"]) == ("nothing_missing", True)
    assert not [item for item in document["findings"] if item["parameters"]]
    seen = [item for item in document["since"]["seen"] if item["physics"] == "stiffness_changed"]
    assert len({item["location"] for item in seen}) == 6
    assert all(0.001 < abs(item["smallest"] - item["neutral"]) < 0.1 for item in seen)
    page = (tmp_path / "friday" / "report.html").read_text()
    assert "has changed since an earlier test" in page
    assert "Then and now" in page
    assert "How well the earlier model holds" in page
    assert "filled bars with the earlier model" in page
    assert "before</th>" not in page  # nothing fell
    # the next test may be compared with this one
    again = json.loads((tmp_path / "friday" / "corrected_model.json").read_text())
    assert again["posterior"]["root"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda it: it.pop("posterior"), "(key posterior): it was written by an older version"),
        (lambda it: it.update(version=9), "version: is the number 9; this prup_pin reads version 1"),
        (lambda it: it["posterior"]["parameters"][0].update(value=7.0), "was changed by hand"),
        (lambda it: it["posterior"].update(explained="no"), "posterior.explained: is the text"),
        (lambda it: it.update(robot="3prup", effects=[], posterior={"parameters": [], "root": []}), "and the earlier"),
    ],
    ids=["without a posterior", "another version", "changed by hand", "no true or false", "another robot"],
)
def test_models_that_cannot_be_compared_with_are_refused_with_what_to_do(change, told, tested, run, tmp_path):
    value = json.loads((tested / "monday" / "corrected_model.json").read_text())
    value["robot"] = str(ARM)
    change(value)
    (tmp_path / "model.json").write_text(json.dumps(value))
    done = run("diagnose", tested / "now.csv", "--against", "model.json", "--out", "friday")
    said = " ".join(str(done.exception if isinstance(done.exception, PrupPinError) else done.output).split())
    assert done.exit_code != 0
    assert told in said
    assert not (tmp_path / "friday").exists()


def test_the_earlier_model_is_not_written_over(tested, run):
    model = tested / "monday" / "corrected_model.json"
    done = run("diagnose", tested / "now.csv", "--against", model, "--out", tested / "monday")
    said = " ".join(str(done.exception if isinstance(done.exception, PrupPinError) else done.output).split())
    assert done.exit_code != 0
    assert "holds the earlier model" in said
