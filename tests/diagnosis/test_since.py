"""What has changed since an earlier test: devices of a simulator that shares no code with the package, tested twice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.since import Earlier
from prup_pin.diagnosis.toleranced import Toleranced, changes_per_tolerance
from prup_pin.errors import InputError
from prup_pin.laws.deviations import Calibration
from prup_pin.recordings import read_recording
from prup_pin.simulation import Simulator, inputs_of, read_model, write_model
from prup_pin.spatial import rotation_exp, rotation_log
from prup_pin.views.report.as_json import diagnosis_as_json
from prup_pin.views.text.diagnosis_words import verdict_text

from ..reference.concealed.since import CHANGES, draw_pair, write

ARM = Path(__file__).parents[1] / "robots" / "elastic_arm" / "elastic_arm.urdf"


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load(ARM)


class Pair:
    """An arm that was tested twice: the model of the first test, the second recording, and what happened."""

    def __init__(self, seed, arm, folder, poses=(8, 6)):
        drawn = draw_pair(seed, "elastic_arm", CHANGES[seed % 4], poses)
        write(drawn, folder, folder / "sealed", str(ARM))
        self.truth = drawn["truth"]
        self.then, self.now = (read_recording(folder / f"{name}.csv") for name in ("then", "now"))
        self.first = diagnose(arm, self.then)
        write_model(corrected_model(self.first, arm, [self.then], str(ARM)), folder / "model.json")
        self.model = read_model(folder / "model.json")


@pytest.fixture(scope="module")
def grown(arm, once):
    return once("since_grown", lambda folder: Pair(0, arm, folder))


@pytest.fixture(scope="module")
def moved(arm, tmp_path_factory):
    return Pair(2, arm, tmp_path_factory.mktemp("moved"), (10, 8))


@pytest.fixture(scope="module")
def found(grown, arm, once):
    return once("since_found", lambda _: diagnose(arm, grown.now, against=grown.model))


def named(diagnosis):
    return [item for item in diagnosis.findings if item.parameters]


@pytest.mark.slow
def test_play_that_grew_is_told_from_what_it_was_and_nothing_else(found, grown):
    (finding,) = named(found)
    assert (finding.physics, finding.location) == ("backlash", grown.truth["places"][0])
    gap = finding.parameters["half_gap"]
    assert gap.interval[0] < grown.truth["now"] < gap.interval[1]
    assert gap.before == pytest.approx(grown.truth["then"], rel=0.05)
    (told,) = [item for item in found.since.values if item.parameter == "half_gap"]
    assert told.has_changed
    low, high = told.difference.interval
    assert low < grown.truth["now"] - grown.truth["then"] < high
    assert "half gap grew from" in finding.statement
    assert found.verdict == "explained"
    assert verdict_text(found).startswith("Changed since the earlier test: backlash at")


@pytest.mark.slow
def test_the_model_of_the_second_test_is_that_of_the_first_with_what_changed(found, grown, arm, tmp_path):
    model = corrected_model(found, arm, [grown.now], str(ARM))
    write_model(model, tmp_path / "model.json")
    again = read_model(tmp_path / "model.json")
    assert [effect.law.physics for effect in again.effects] == [e.law.physics for e in grown.model.effects]
    (gap,) = [effect for effect in again.effects if effect.law.physics == "backlash"]
    assert gap.values["half_gap"] == pytest.approx(grown.truth["now"], rel=0.05)
    assert len(again.posterior.values) == len(grown.model.posterior.values)
    # what two tests say is known no worse than what one says
    sizes = [dict(zip(map(str, m.posterior.values), np.linalg.norm(m.posterior.root, axis=1), strict=True))
             for m in (grown.model, again)]  # fmt: skip
    calibrated = [name for name in sizes[0] if name.startswith("effects[0]") and "gap" not in name]
    assert sum(sizes[1][name] < 1.1 * sizes[0][name] for name in calibrated) == len(calibrated)


@pytest.mark.slow
def test_what_is_told_stands_in_the_json(found):
    document = diagnosis_as_json(found, None)["since"]
    assert set(document) == {"notes", "explained", "set_up", "values", "seen"}
    first = document["values"][0]
    assert (first["parameter"], first["unit"], first["changed"]) == ("half_gap", "rad", True)
    assert first["then"]["value"] < first["now"]["value"]
    assert first["seen_from"] > 0
    assert {"physics", "location", "parameter", "unit", "smallest", "neutral", "strong"} == set(document["seen"][0])


@pytest.mark.slow
def test_a_tracker_that_was_moved_is_told_and_one_that_was_set_up_again_is_not(moved, arm):
    told = diagnose(arm, moved.now, against=moved.model)
    (finding,) = named(told)
    assert finding.physics == "pose_sensor_misalignment"
    shift = np.linalg.norm([finding.parameters[f"t{axis}"].value for axis in "xyz"])
    assert shift == pytest.approx(moved.truth["now"], rel=0.1)
    assert "the robot is as it was" in verdict_text(told)
    assert "own_sensors" in finding.remedy
    # set up again anywhere
    turn, shift = rotation_exp(np.array([0.1, -0.4, 1.2])), np.array([1.0, -2.0, 0.3])
    turned = rotation_log(turn @ rotation_exp(moved.now.rotation))
    far = replace(moved.now, position=moved.now.position @ turn.T + shift, rotation=turned)
    free = diagnose(arm, replace(far, own_sensors=("pose_sensor",)), against=moved.model)
    assert free.verdict == "nothing_missing"
    assert not named(free)
    assert free.since.set_up == ("pose_sensor",)
    assert any("set up since" in text and "pose sensor" in text for text in free.remarks)


def test_what_is_known_together_changes_what_is_measured_as_the_simulation_does(grown, arm):
    """By central differences of the whole simulation, of numbers of unit variance."""
    earlier = Earlier.of(grown.model, arm, [grown.now])
    anew = Toleranced(Calibration(()), np.zeros(0))
    toleranced = earlier.toleranced(anew, arm.mechanism)
    simulator = Simulator(arm, inputs_of(grown.now.select(range(0, 40, 7)), arm), earlier.effects)
    x = 0.3 * np.random.default_rng(5).normal(size=len(toleranced))
    run = simulator.run([toleranced.effect(x)])
    influence = Influence(simulator, run)
    first = changes_per_tolerance(simulator, influence, toleranced, x, ())
    for place in range(0, len(x), 9):
        ends = [simulator.run([toleranced.effect(x + size * np.eye(len(x))[place])], run) for size in (0.5, -0.5)]
        slope = ends[0].position - ends[1].position
        assert np.allclose(first[:, :3, place], slope[run.samples], rtol=0.02, atol=2e-9)
    # all at what was found: nothing is off
    assert np.allclose(simulator.run([toleranced.effect(np.zeros(len(x)))]).position, simulator.run().position)


# -- models that cannot be compared with -------------------------------------------------------------------------------


def refused(robot, recording, model):
    with pytest.raises(InputError) as caught:
        diagnose(robot, recording, against=model)
    return str(caught.value)


def test_a_model_without_what_its_test_knew_is_refused(grown, arm):
    told = refused(arm, grown.now, replace(grown.model, posterior=None))
    assert "does not say how well its values are known together (key posterior)" in told
    assert "diagnose the earlier recording again" in told


def test_a_model_changed_by_hand_is_refused(grown, arm):
    place, effect = next((i, e) for i, e in enumerate(grown.model.effects) if e.law.physics == "backlash")
    edited = replace(effect, values={**effect.values, "half_gap": 2e-4})
    effects = (*grown.model.effects[:place], edited, *grown.model.effects[place + 1 :])
    told = refused(arm, grown.now, replace(grown.model, effects=effects))
    assert f"changed by hand: effects[{place}].parameters.half_gap is 0.0002" in told


def test_a_model_of_another_robot_is_refused(grown, arm):
    other = prup_pin.load("3prup")
    told = refused(other, replace(grown.now, robot=None), grown.model)
    assert "is of another robot" in told
    assert "Give the corrected model of an earlier diagnosis of this robot" in told
    told = refused(arm, replace(grown.now, robot="3prup"), grown.model)
    assert "of '3prup', and the earlier model of" in told


def test_a_model_of_other_values_is_refused(grown, arm):
    softer = arm.with_parameters({"joint2/drive.stiffness": 1e4})
    assert "joint2/drive.stiffness is 10000" in refused(softer, grown.now, grown.model)


def test_efforts_alone_are_refused_with_what_to_do(grown, arm):
    n = len(grown.now)
    efforts = dict.fromkeys(arm.mechanism.actuated, np.zeros(n))
    only = replace(grown.now, position=None, rotation=None, efforts=efforts)
    told = refused(arm, only, grown.model)
    assert "only efforts were recorded" in told
    assert "diagnose this recording by itself" in told
