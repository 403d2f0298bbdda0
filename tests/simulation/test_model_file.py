"""The corrected model's file."""

import json
import re
import shutil

import pytest

from prup_pin.errors import InputError, ParameterError, RecordingFileError, UnknownNameError
from prup_pin.laws import LAWS, Effect
from prup_pin.robots import packaged_folder
from prup_pin.simulation import CorrectedModel, effect_named, read_model, simulate, write_model

from .bench import inputs, three_prup


@pytest.fixture(scope="module")
def robot():
    return three_prup()


def written(folder, **changes):
    value = {
        "format": "prup_pin corrected model",
        "version": 1,
        "robot": "3prup",
        "finite_deflection": True,
        "effects": [entry()],
    }
    path = folder / "model.json"
    path.write_text(json.dumps({key: item for key, item in {**value, **changes}.items() if item != "absent"}))
    return path


def entry(**changes):
    value = {
        "physics": "stiffness_changed",
        "location": "leg1/R_lambda",
        "aspect": "tilting",
        "parameters": {"factor": {"value": 0.3, "unit": "1"}},
    }
    return {**value, **changes}


def problems(path):
    with pytest.raises(RecordingFileError) as caught:
        read_model(path)
    return {problem.key: problem.message for problem in caught.value.problems}


def test_a_file_becomes_a_model(tmp_path, robot):
    model = read_model(written(tmp_path, notes="by hand"))
    assert (model.robot, model.variant, model.notes) == ("3prup", None, "by hand")
    (effect,) = model.effects
    assert effect == effect_named("stiffness_changed", "leg1/R_lambda", "tilting", {"factor": 0.3}, robot.mechanism)
    assert model.load().name == "3prup"


def test_sensors_of_each_run_survive_the_file(tmp_path):
    model = read_model(written(tmp_path, own_sensors={"by_run": ["pose_sensor"]}))
    assert model.own_by_run == ("pose_sensor",)
    write_model(model, tmp_path / "again.json")
    assert read_model(tmp_path / "again.json").own_by_run == ("pose_sensor",)
    told = problems(written(tmp_path, own_sensors={"by_run": ["pose_sensr"], "by_day": []}))
    assert set(told) == {"own_sensors.by_run[0]", "own_sensors.by_day"}


def test_every_law_survives_the_file(tmp_path, robot):
    mechanism = robot.mechanism
    effects = []
    for law in LAWS:
        for place in list(law.places(mechanism))[-1:]:
            effects.append(Effect(law, place, dict(law.starts(place, mechanism)[0])))
    # A printed error, and what only rigid joints, links and slides of trees, loops of ball joints, or slides whose
    # screw nobody described have.
    left_out = {type(law).__name__ for law in LAWS} - {type(effect.law).__name__ for effect in effects}
    assert left_out == {
        "EveryJointCompliance",
        "GrowthFromSupport",
        "GuidePlay",
        "GuideTwist",
        "JointCompliance",
        "LinkBending",
        "LinkGrowth",
        "LoopEndPosition",
        "ModelEquationError",
        "SeatPosition",
        "UnevenJointCompliance",
    }
    model = CorrectedModel("3prup", tuple(effects), notes="all at once")
    write_model(model, tmp_path / "all.json")
    assert read_model(tmp_path / "all.json") == model
    first = (tmp_path / "all.json").read_bytes()
    write_model(read_model(tmp_path / "all.json"), tmp_path / "all.json")
    assert (tmp_path / "all.json").read_bytes() == first
    assert not list(tmp_path.glob(".*"))


def test_the_file_simulates_as_the_effects_do(tmp_path, robot):
    effects = (effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 3e-5, "closing_load": 1.0}, robot.mechanism),)
    write_model(CorrectedModel("3prup", effects), tmp_path / "m.json")
    model = read_model(tmp_path / "m.json")
    bench = inputs(robot)
    here, there = simulate(robot, bench, effects), simulate(model.load(), bench, model.effects)
    assert (here.position == there.position).all()


def test_variants_and_files_beside_the_model(tmp_path):
    for file in packaged_folder().glob("3prup*"):
        shutil.copy(file, tmp_path / file.name.replace("3prup", "mine"))
    folder = tmp_path / "out"
    folder.mkdir()
    write_model(CorrectedModel(str(tmp_path / "mine.urdf"), variant="as_published"), folder / "m.json")
    assert json.loads((folder / "m.json").read_text())["robot"] == "../mine.urdf"
    moved = tmp_path.parent / f"{tmp_path.name}_moved"
    tmp_path.rename(moved)
    model = read_model(moved / "out" / "m.json")
    assert model.load().name == "3prup_as_published"
    write_model(model, moved / "again.json")
    assert json.loads((moved / "again.json").read_text())["robot"] == "./mine.urdf" or "mine.urdf" in model.robot
    assert read_model(moved / "again.json").load().name == "3prup_as_published"


def test_an_only_aspect_need_not_be_said(tmp_path):
    factor = {"factor": {"value": 0.3, "unit": "1"}}
    only = entry(location="leg1/R_theta_P", parameters=factor)
    del only["aspect"]
    (effect,) = read_model(written(tmp_path, effects=[only])).effects
    assert effect.place.aspect == "radial"


def test_all_problems_are_told_at_once_with_their_places(tmp_path):
    effects = [
        entry(physics="stiffnes_changed"),
        entry(location="leg1/R_lambada"),
        entry(aspect="twisting"),
        entry(aspect=""),
        entry(parameters={"factor": {"value": -1, "unit": "1"}}),
        entry(parameters={"factor": {"value": 0.3, "unit": "%"}}),
        entry(parameters={"faktor": {"value": 0.3, "unit": "1"}}),
        entry(parameters={"factor": 0.3}),
        entry(parameters={"factor": {"value": "a third", "unit": "1", "ci95": []}}),
        entry(extra=1),
        "backlash",
        {"physics": "backlash"},
    ]
    found = problems(written(tmp_path, effects=effects, finite_deflection=False, note="x"))
    for key, text in {
        "note": r"unknown key.*'notes'",
        "finite_deflection": "false; expected true",
        "effects[0].physics": "'stiffness_changed'",
        "effects[1].location": "'leg1/R_lambda'",
        "effects[2].aspect": "'tilting'",
        "effects[3].aspect": "radial, axial, tilting; say which",
        "effects[4].parameters.factor.value": "the number -1; expected > 0 and <= 100",
        "effects[5].parameters.factor.unit": 'the text "%"; expected "1"',
        "effects[6].parameters.faktor": "'factor'",
        "effects[6].parameters.factor": "is missing",
        "effects[7].parameters.factor": "expected an object",
        "effects[8].parameters.factor.value": 'the text "a third"; expected a number',
        "effects[8].parameters.factor.ci95": "unknown key",
        "effects[9].extra": "unknown key",
        "effects[10]": 'the text "backlash"; expected an object',
        "effects[11].location": "is missing",
        "effects[11].parameters": "is missing",
    }.items():
        assert key in found, found.keys()
        assert re.search(text, found[key]) or text in found[key], (key, found[key])
    assert len(found) == 17


@pytest.mark.parametrize(
    ("changes", "key", "text"),
    [
        ({"format": "other"}, "format", '"prup_pin corrected model"'),
        ({"format": "absent"}, "format", "is missing"),
        ({"version": 2}, "version", "the number 2; this prup_pin reads version 1"),
        ({"version": True}, "version", "true"),
        ({"robot": "absent"}, "robot", "is missing"),
        ({"robot": 3}, "robot", "the number 3"),
        ({"robot": "4prup"}, "robot", "'3prup'"),
        ({"robot": "gone.urdf"}, "robot", "gone.urdf"),
        ({"variant": "as_publised"}, "variant", "'as_published'"),
        ({"effects": "absent"}, "effects", "is missing"),
        ({"effects": {}}, "effects", "an object; expected a list"),
        ({"notes": 1}, "notes", "the number 1"),
    ],
)
def test_problems_of_the_whole(tmp_path, changes, key, text):
    found = problems(written(tmp_path, **changes))
    assert list(found) == [key]
    assert text in found[key]


def test_what_can_be_checked_without_the_robot_is(tmp_path):
    effects = [entry(physics="backlsh"), entry(parameters={"factor": {"value": None, "unit": "1"}})]
    found = problems(written(tmp_path, robot="4prup", effects=effects))
    assert set(found) == {"robot", "effects[0].physics", "effects[1].parameters.factor.value"}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ('{"format": ', "not valid JSON"),
        ("", "is empty"),
        ("time,q.a\n0,1", "it looks like a table, a recording perhaps; expected a corrected model, a JSON object"),
        ("[]", "holds a list"),
        ('{"robot": "a", "robot": "b"}', "stands 2 times"),
        ('{"robot": "a", "verdict": "", "findings": []}', "1 problem(?s:.*)a diagnosis; expected the corrected_model"),
        ('{"version": NaN}', "format"),
    ],
)
def test_broken_files(tmp_path, content, text):
    path = tmp_path / "broken.json"
    path.write_text(content)
    with pytest.raises(RecordingFileError, match=text):
        read_model(path)


def test_a_missing_file_names_its_neighbours(tmp_path):
    written(tmp_path)
    with pytest.raises(RecordingFileError, match=r"not found.*model\.json"):
        read_model(tmp_path / "modell.json")


def test_what_cannot_be_read_again_is_not_written(tmp_path, robot):
    good = effect_named("stiffness_changed", "leg1/R_lambda", "tilting", {"factor": 0.3}, robot.mechanism)
    target = tmp_path / "m.json"
    for values in ({"factor": -1.0}, {"factor": float("nan")}):
        with pytest.raises(ParameterError):
            write_model(CorrectedModel("3prup", (Effect(good.law, good.place, values),)), target)
    with pytest.raises(UnknownNameError):
        write_model(CorrectedModel("4prup"), target)
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="folder"):
        write_model(CorrectedModel("3prup"), tmp_path)


def test_the_noise_of_efforts_is_kept_by_joint_in_its_unit(tmp_path):
    path = tmp_path / "model.json"
    write_model(CorrectedModel("3prup", effort_noise={"leg1_slide": 2.5}), path)
    assert json.loads(path.read_text())["effort_noise"] == {"leg1_slide": {"value": 2.5, "unit": "N"}}
    assert read_model(path).effort_noise == {"leg1_slide": 2.5}
    path.write_text(path.read_text().replace("2.5", "-1").replace('"N"', '"N m"'))
    with pytest.raises(RecordingFileError, match=r"effort_noise\.leg1_slide\.unit") as caught:
        read_model(path)
    assert "expected a number above 0" in str(caught.value)


def test_a_model_of_which_something_is_unexplained_says_so(tmp_path):
    path = tmp_path / "corrected_model.json"
    for verdict, warned in (("unexplained", True), ("explained", False), ("", False)):
        write_model(CorrectedModel("3prup", verdict=verdict), path)
        assert read_model(path).verdict == verdict
        assert ("valid only near the data of that diagnosis" in read_model(path).caution) is warned
