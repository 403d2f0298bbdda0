"""A corrected model names packages and files whose laws, modules and robot it uses, and says which are not there."""

import json
from importlib import metadata

import pytest

from prup_pin.errors import RecordingFileError
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.plugins import along
from prup_pin.simulation import CorrectedModel, read_model, write_model

from ..plugged import HOSE


@pytest.fixture
def hose(tmp_path):
    (tmp_path / "hose.py").write_text(HOSE)
    return tmp_path / "hose.py"


@pytest.fixture
def model(hose, tmp_path):
    with along(hose):
        law = list(EFFORT_LAWS)[-1]
        effect = Effect(law, Place("carriage", "effort"), {"cubic": 3.0})
        write_model(CorrectedModel("ball_screw_axis", (effect,)), tmp_path / "model.json")
        assert read_model(tmp_path / "model.json").effects == (effect,)
    return tmp_path / "model.json"


def refused(path, *words):
    with pytest.raises(RecordingFileError) as raised:
        read_model(path)
    text = " ".join(str(raised.value).split())
    assert "1 problem " in text
    for word in words:
        assert word in text


def test_a_file_is_named_with_its_hash_and_asked_for(model):
    (need,) = json.loads(model.read_text())["needs"]
    assert need["file"] == "hose.py"
    assert len(need["sha256"]) == 64
    assert need["for"] == ["law pulling_hose"]
    refused(model, "needs[0].sha256: hose.py (sha256 ", "uses law pulling_hose, is not here: add --with hose.py")


def test_another_file_of_that_name_is_not_that_file(model, hose):
    hose.write_text(HOSE + "# changed\n")
    with along(hose):
        refused(model, "is here as hose.py (sha256 ", "take that one, or write", "here if both say the same")


def test_the_same_file_by_another_name_is(model, hose):
    with along(hose.rename(hose.with_name("renamed.py"))):
        assert read_model(model).effects[0].law.physics == "pulling_hose"


def test_a_model_of_the_package_alone_needs_nothing(tmp_path):
    write_model(CorrectedModel("3prup"), tmp_path / "model.json")
    assert "needs" not in json.loads((tmp_path / "model.json").read_text())


NUMPY = metadata.version("numpy")


@pytest.mark.parametrize(
    ("needs", "said"),
    [
        ([{"package": "no-such-laws", "version": "1.2"}], "no-such-laws 1.2, of which this model uses something, is "
         "not here: pip install 'no-such-laws==1.2'"),
        ([{"package": "numpy", "version": "0.1", "for": ["law x", "law y"]}], "numpy 0.1, of which this model uses law "
         f"x, law y, is here as numpy {NUMPY}: take that one, or write \"{NUMPY}\" here if both say the same"),
        ({"package": "numpy"}, "needs: is an object; expected a list"),
        ([{"package": "numpy"}], "needs[0].version: is missing; expected a text"),
        ([{"package": "numpy", "version": NUMPY, "from": "x"}], "needs[0].from: unknown key"),
        (["numpy"], "needs[0]: is"),
    ],
)  # fmt: skip
def test_packages_are_asked_for_and_bad_needs_are_told(tmp_path, needs, said):
    path = tmp_path / "model.json"
    write_model(CorrectedModel("3prup"), path)
    values = json.loads(path.read_text())
    path.write_text(json.dumps({**values, "needs": needs}))
    with pytest.raises(RecordingFileError) as raised:
        read_model(path)
    assert said in " ".join(str(raised.value).split())


def test_a_package_in_its_version_is_there(tmp_path):
    path = tmp_path / "model.json"
    write_model(CorrectedModel("3prup"), path)
    values = json.loads(path.read_text())
    path.write_text(json.dumps({**values, "needs": [{"package": "numpy", "version": NUMPY}]}))
    assert read_model(path) == CorrectedModel("3prup")
