"""Several recordings of one device: one diagnosis; each has its own noise, runs, and sensors if it says so."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.channels import Noise as Sensed
from prup_pin.cli import app
from prup_pin.diagnosis.calibration import calibrated
from prup_pin.diagnosis.evidence import fold_labels
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.prepare import prepare
from prup_pin.diagnosis.toleranced import toleranced_of
from prup_pin.errors import InputError, RecordingFileError
from prup_pin.laws import Effect
from prup_pin.laws.in_recording import in_groups, lasting
from prup_pin.recordings import (
    SENSORS,
    Noise,
    Recording,
    Together,
    Tolerances,
    add_noise,
    read_recording,
    write_recording,
)
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.simulation.model_file import law_named

from ..as_written import as_written

ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"
NOISE = Noise(position=2e-6, rotation=1e-5)
COARSE = Noise(position=2e-5, rotation=1e-4)
G = 9.80665
UP, WALL, CEILING = (0.0, 0.0, -G), (0.0, -G, 0.0), (0.0, 0.0, G)
ONE_POSE = np.tile([0.3, 0.5, -0.8, 0.2, 0.4, -0.1], (12, 1))


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load(ARM)


def standing(arm, angles, gravity=UP, **more):
    positions = {name: angles[:, column] for column, name in enumerate(arm.mechanism.actuated)}
    given = None if gravity is None else np.tile(gravity, (len(angles), 1))
    return Recording(np.arange(float(len(angles))), positions=positions, gravity=given, noise=NOISE, **more)


def poses(n, seed):
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (n, 6))


def weight(arm):
    return effect_named("self_weight", "robot", "", {"scale": 1.0}, arm.mechanism)


def measured(arm, inputs, effects=(), seed=1, noise=NOISE):
    seen = prup_pin.simulate(arm, inputs, [*effects, weight(arm)])
    return add_noise(inputs.with_measurements(position=seen.position, rotation=seen.rotation), noise, seed)


def together(arm, *recordings):
    return Together.of(recordings, arm.mechanism.actuated, arm.mechanism.gravity)


def named(found):
    return [item for item in found.findings if item.physics not in ("self_weight", "finite_deflection")]


# -- what several tell -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_recordings_are_one_with_two_runs(arm):
    """The same samples, in two files or under two labels of one file: the same answer to the last digit."""
    soft = effect_named("stiffness_changed", "joint2/drive", "", {"factor": 0.7}, arm.mechanism)
    whole = measured(arm, standing(arm, poses(24, 3), UP), [soft])
    whole = replace(whole, run=np.repeat([0, 1], 12), run_names=("one", "two"))
    parts = [whole.select(np.arange(12)), whole.select(np.arange(12, 24))]
    one, two = prup_pin.diagnose(arm, whole), prup_pin.diagnose(arm, parts)
    assert one.verdict == two.verdict == "explained"
    assert [(item.physics, item.location, item.parameters) for item in one.findings] == [
        (item.physics, item.location, item.parameters) for item in two.findings
    ]
    np.testing.assert_array_equal(one.residual_after, two.residual_after)
    assert [part.name for part in two.recordings] == ["recording 1", "recording 2"]


@pytest.mark.slow
def test_what_one_does_not_load_the_other_shows(arm):
    """Upright, the first joint carries no weight; on the wall it does."""
    soft = effect_named("stiffness_changed", "joint1/drive", "", {"factor": 0.6}, arm.mechanism)
    upright = measured(arm, standing(arm, poses(20, 1), UP), [soft], 1)
    wall = measured(arm, standing(arm, poses(20, 2), WALL), [soft], 2)
    assert named(prup_pin.diagnose(arm, upright)) == []
    (finding,) = named(prup_pin.diagnose(arm, [upright, wall]))
    assert (finding.physics, finding.location) == ("stiffness_changed", "joint1/drive")
    assert finding.parameters["factor"].interval[0] < 0.6 < finding.parameters["factor"].interval[1]


@pytest.mark.slow
def test_twins_of_each_recording_are_told_apart_by_both(arm):
    """In one pose a soft drive is an encoder's zero, upright as well as on the ceiling; only one of them turns over."""
    tolerances = Tolerances(stiffness=0.1, encoder_offset=1e-4)
    inputs = [standing(arm, ONE_POSE, gravity, tolerances=tolerances) for gravity in (UP, CEILING)]
    toleranced = toleranced_of(inputs[0], arm.mechanism)
    x = np.random.default_rng(8).normal(size=len(toleranced))
    both = [measured(arm, given, [toleranced.effect(x)], seed) for seed, given in enumerate(inputs)]
    twins = ("joint2/drive.stiffness", "joint2.encoder_offset")
    for recording in both:
        alone = calibrated(arm, recording)
        assert twins in alone.twins
        assert {item.name: item.learned for item in alone.parameters}[twins[0]] < 0.1
    found = calibrated(arm, both)
    assert found.twins == ()
    assert found.calibrated == pytest.approx(1.0, abs=0.12)
    known = {item.name: item for item in found.parameters}
    names = [item.name for item in toleranced.law.deviations]
    for name in twins:
        assert known[name].learned > 0.9
        assert abs(known[name].x - x[names.index(name)]) < 4 * known[name].share


@pytest.mark.slow
def test_each_recording_has_its_own_noise(arm):
    """The coarse one neither drowns the fine one nor is taken for structure."""
    soft = effect_named("stiffness_changed", "joint2/drive", "", {"factor": 0.95}, arm.mechanism)
    fine = measured(arm, standing(arm, poses(20, 1)), [soft], 1)
    coarse = measured(arm, standing(arm, poses(20, 2)), [soft], 2, COARSE)
    found = prup_pin.diagnose(arm, [fine, coarse])
    assert [part.noise.position for part in found.recordings] == [2e-6, 2e-5]
    for part in found.recordings:
        assert part.after == pytest.approx(1.0, abs=0.15)
        assert part.before > 3 * part.after
    (alone,), (finding,) = named(prup_pin.diagnose(arm, fine)), named(found)
    assert (finding.physics, finding.location) == ("stiffness_changed", "joint2/drive")
    assert np.ptp(finding.parameters["factor"].interval) < 1.05 * np.ptp(alone.parameters["factor"].interval)
    assert 2e-6 < found.noise.position < 2e-5


def test_noise_of_several_is_that_of_one_where_all_are_alike():
    one = Sensed(1e-6, 1e-5, 0.0, 0.0, "declared")
    assert Sensed.of_several([one, one], np.array([0, 1])) is one
    both = Sensed.of_several([one, replace(one, position=7e-6, source="estimated")], np.array([0, 1]))
    assert both.position == pytest.approx(5e-6)
    assert both.source == "estimated"
    parts = [(part.position, rows.tolist()) for part, rows in both.parts(np.array([1]))]
    assert parts == [(1e-6, [False]), (7e-6, [True])]


def loaded(arm, seed, n=20, **more):
    random = np.random.default_rng(seed)
    wrench = np.zeros((n, 6))
    wrench[:, :3] = 100 * random.normal(size=(n, 3))
    return replace(standing(arm, poses(n, seed), None, **more), wrench=wrench, wrench_columns=("fx", "fy", "fz"))


@pytest.fixture(scope="module")
def set_up_twice(arm):
    """Two recordings of a toleranced arm, the tracker set up anew for the second, and what is off about all of it."""
    tolerances = Tolerances(
        stiffness=0.1, frame_position=3e-4, frame_rotation=1e-3, target_position=3e-4, wrench_bias_force=2.0
    )
    first = loaded(arm, 1, path="first.csv", tolerances=tolerances)
    second = loaded(arm, 2, path="second.csv", tolerances=tolerances, own_sensors=("pose_sensor", "wrench_sensor"))
    both = together(arm, first, second)
    toleranced = toleranced_of(both.recording, arm.mechanism, both.groups)
    off = toleranced.effect(np.random.default_rng(9).normal(size=len(toleranced)))
    plain = toleranced_of(first, arm.mechanism)

    def of(label):
        """The robot as one recording's sensors see it, by the parameters' names alone."""
        names = [item.name for item in plain.law.deviations]
        return Effect(plain.law, off.place, {name: off.values.get(name + label, off.values[name]) for name in names})

    made = [measured(arm, first, [of("")], 1), measured(arm, second, [of(" in second.csv")], 2, COARSE)]
    return made, off


@pytest.mark.slow
def test_a_recording_may_have_sensors_of_its_own(arm, set_up_twice):
    made, off = set_up_twice
    found = prup_pin.diagnose(arm, made)
    assert named(found) == []
    assert found.within["calibrated"] == pytest.approx(1.0, abs=0.1)
    names = {item.name for item in found.calibration}
    assert {"pose_sensor.x", "pose_sensor.x in second.csv", "wrench_sensor.bias_fz in second.csv", "target.x"} <= names
    assert "target.x in second.csv" not in names
    for item in found.calibration:
        apart = item.deviation.amount(item.value) - item.deviation.amount(off.values[item.name])
        assert abs(apart) < 4.5 * item.share * abs(item.deviation.amount(item.value) / item.x)
    assert [part.own for part in found.recordings] == [(), ("pose_sensor", "wrench_sensor")]
    shared = prup_pin.diagnose(arm, [made[0], replace(made[1], own_sensors=())])
    assert shared.within["calibrated"] > 10


def test_other_tolerances_of_a_sensor_say_that_it_is_another_one(arm, set_up_twice):
    (first, second), _ = set_up_twice
    wider = replace(second, own_sensors=(), tolerances=replace(second.tolerances, frame_position=6e-4))
    both = together(arm, first, wider)
    assert [source.own for source in both.sources] == [("pose_sensor",), ("pose_sensor",)]
    assert [group.label for group in both.groups["pose_sensor"]] == ["first.csv", "second.csv"]
    assert [group.tolerances["frame_position"] for group in both.groups["pose_sensor"]] == [3e-4, 6e-4]
    assert both.groups["pose_sensor"][1].tolerances["frame_rotation"] == 1e-3


def test_own_encoders_are_zeroed_anew(arm):
    tolerances = Tolerances(encoder_offset=1e-4)
    first = standing(arm, poses(8, 1), tolerances=tolerances, path="a.csv")
    second = standing(arm, poses(8, 2), tolerances=tolerances, path="b.csv", own_sensors=("encoders",))
    both = together(arm, first, second)
    toleranced = toleranced_of(both.recording, arm.mechanism, both.groups)
    names = [item.name for item in toleranced.law.deviations]
    assert len(names) == 12
    x = np.zeros(12)
    x[names.index("joint2.encoder_offset in b.csv")] = 1.0
    inputs = replace(inputs_of(both.recording, arm), sources=both.which)
    setup = Simulator(arm, inputs).setup([toleranced.effect(x)])
    expected = np.zeros((16, 6))
    expected[8:, 1] = 1e-4
    np.testing.assert_allclose(setup.travel, expected, atol=1e-18)


@pytest.mark.slow
def test_a_fault_of_a_sensor_is_that_of_its_recording(arm):
    """Without tolerances the tracker's frame is right as declared, but for the recording where it is not."""
    values = {"rx": 1e-3, "ry": 0.0, "rz": -5e-4, "tx": 2e-4, "ty": 0.0, "tz": 0.0}
    off = effect_named("pose_sensor_misalignment", "pose_sensor", "", values, arm.mechanism)
    first = measured(arm, loaded(arm, 1, path="first.csv"), [], 1)
    second = measured(arm, loaded(arm, 2, path="second.csv", own_sensors=("pose_sensor",)), [off], 2)
    found = prup_pin.diagnose(arm, [first, second])
    (finding,) = named(found)
    assert (finding.physics, finding.location) == ("pose_sensor_misalignment", "pose_sensor")
    assert finding.effect.place.aspect == "in second.csv"
    assert finding.statement.endswith("in second.csv")
    for name, value in values.items():
        assert finding.parameters[name].value == pytest.approx(value, abs=1e-5)
    assert found.after["fit"] == pytest.approx(1.0, abs=0.1)
    assert [effect.law.physics for effect in lasting(found.effects, arm.mechanism)] == ["self_weight"]


@pytest.mark.parametrize("words", [("pose_sensor_misalignment", "pose_sensor"), ("wrench_sensor_bias", "wrench_sensor"),
                                   ("target_misalignment", "target"), ("encoder_offset", "joint3/drive")])  # fmt: skip
def test_first_order_of_a_sensors_law_in_one_recording(arm, words):
    """It does to that recording's samples what it does to all of them, and nothing to the others'."""
    physics, place = words
    both = together(arm, loaded(arm, 1, 3), replace(loaded(arm, 2, 3), own_sensors=tuple(SENSORS)))
    whole = law_named(physics)
    laws = list(in_groups(whole, both.groups))
    assert [law.group.label for law in laws] == ["", "recording 2"]
    simulator = Simulator(arm, replace(inputs_of(both.recording, arm), sources=both.which))
    run = simulator.run()
    influence = Influence(simulator, run)

    def change(law):
        at = next(each for each in law.places(arm.mechanism) if each.name.partition("/")[0] == place.partition("/")[0])
        values = dict(law.starts(at, arm.mechanism)[0])
        effect = Effect(law, at, values).checked(arm.mechanism)
        after = simulator.run([effect], run)
        return influence.change(simulator.setup([effect])), after.position - run.position

    (all_first, all_moved), (first, moved), (second, moved_too) = map(change, (whole, *laws))
    for own, whole_change in ((first, all_first), (moved, all_moved)):
        np.testing.assert_array_equal(own[3:], 0.0)
        np.testing.assert_allclose(own[:3], whole_change[:3], atol=1e-13)
    for own, whole_change in ((second, all_first), (moved_too, all_moved)):
        np.testing.assert_array_equal(own[:3], 0.0)
        np.testing.assert_allclose(own[3:], whole_change[3:], atol=1e-13)
    assert np.abs(all_moved).max() > 1e-7


def test_what_is_the_robots_is_so_in_all_recordings(arm):
    with pytest.raises(InputError, match="acts on the robot, in all recordings alike"):
        weight(arm).deeds(Simulator(arm, inputs_of(loaded(arm, 1, 2), arm)).setup())[0].within(np.ones(2, bool))


# -- histories and folds -----------------------------------------------------------------------------------------------


def test_what_laws_remember_starts_anew_with_each_recording(arm):
    """Creep and dry friction of the second recording are those of the second recording alone."""
    creep = effect_named("creep", "joint2/drive", "", {"share": 0.5, "time_constant": 3.0}, arm.mechanism)
    effects = [weight(arm), creep]
    first, second = (replace(loaded(arm, seed, 6), positions=standing(arm, ONE_POSE[:6]).positions) for seed in (1, 2))
    both = together(arm, first, second).recording
    run = Simulator(arm, inputs_of(both, arm)).run(effects)
    alone = Simulator(arm, inputs_of(second, arm)).run(effects)
    np.testing.assert_allclose(run.position[6:], alone.position, atol=1e-11)
    onwards = replace(both, time=np.arange(12.0), run=None, run_names=("",))
    remembered = Simulator(arm, inputs_of(onwards, arm)).run(effects)
    assert np.abs(remembered.position[6:] - alone.position).max() > 1e-7


@pytest.mark.parametrize("count", [2, 3])
def test_no_fold_holds_samples_of_two_recordings(arm, count):
    """Also where there are fewer standstills than folds, and the actuators never move."""
    given = prepare(arm, [measured(arm, standing(arm, ONE_POSE), seed=seed) for seed in range(count)], lambda *_: None)
    labels, which = fold_labels(given.inputs.blocks), given.together.which
    assert len(np.unique(labels)) >= 5
    for label in np.unique(labels):
        assert len(np.unique(which[labels == label])) == 1
    assert len(np.unique(given.inputs.blocks)) == count


def test_no_fold_holds_samples_of_two_standstills():
    """Also of one recording with fewer standstills than folds: each is cut."""
    blocks = np.repeat([0, 1, 2], 7)
    labels = fold_labels(blocks)
    assert len(np.unique(labels)) == 21
    np.testing.assert_array_equal(fold_labels(np.arange(5)), np.arange(5))


def test_columns_may_differ(arm):
    """Position here, orientation and a marker there; gravity of the robot file where a recording has none."""
    first = measured(arm, standing(arm, poses(6, 1), None))
    second = measured(arm, standing(arm, poses(5, 2), WALL))
    second = replace(second, position=None, markers={"link5": np.zeros((5, 3))}, temperature=np.full(5, 22.0))
    both = together(arm, replace(first, rotation=None), second).recording
    assert np.isnan(both.position[6:]).all()
    assert np.isnan(both.rotation[:6]).all()
    assert np.isnan(both.markers["link5"][:6]).all()
    np.testing.assert_array_equal(both.gravity, np.repeat([UP, WALL], (6, 5), axis=0))
    assert any("no temperature was recorded" in text for text in both.remarks)
    assert both.run.tolist() == [0] * 6 + [1] * 5


# -- bad input ---------------------------------------------------------------------------------------------------------


def test_recordings_of_different_robots_are_refused(arm):
    first, second = (measured(arm, standing(arm, poses(6, seed))) for seed in (1, 2))
    with pytest.raises(InputError, match="different robots: recording 1 of '3prup', recording 2 of 'ur5'"):
        prup_pin.diagnose(arm, [replace(first, robot="3prup"), replace(second, robot="ur5")])
    strange = replace(second, path="b.csv", positions={"slide": np.zeros(6)})
    with pytest.raises(InputError, match=r"b.csv is of another robot: it has q.slide; expected .* q.joint1"):
        prup_pin.diagnose(arm, [first, strange])
    some = {name: values for name, values in second.positions.items() if name != "joint4"}
    with pytest.raises(InputError, match=r"b.csv lacks q.joint4"):
        prup_pin.diagnose(arm, [first, replace(second, path="b.csv", positions=some)])
    with pytest.raises(InputError, match="no recording was given"):
        prup_pin.diagnose(arm, [])


def test_a_recording_given_twice_is_refused(arm):
    first = replace(measured(arm, standing(arm, poses(6, 1))), path="a.csv")
    with pytest.raises(InputError, match=r"a.csv is given twice: its noise would count"):
        prup_pin.diagnose(arm, [first, first])
    with pytest.raises(InputError, match=r"a.csv and copy.csv hold the same samples, to the last digit.*Give each"):
        prup_pin.diagnose(arm, [first, replace(first, path="copy.csv")])


def test_one_device_has_one_tolerance_of_a_kind(arm):
    first, second = (
        replace(measured(arm, standing(arm, poses(6, seed))), path=f"{seed}.csv", tolerances=Tolerances(stiffness=size))
        for seed, size in ((1, 0.1), (2, 0.2))
    )
    with pytest.raises(InputError, match=r"'stiffness' is 0.1 in 1.csv, 0.2 in 2.csv: one device has one"):
        prup_pin.diagnose(arm, [first, second])


def test_an_error_names_the_recording(arm):
    seen = (as_written(measured(arm, standing(arm, poses(6, seed)))) for seed in (1, 2))
    first, second = (replace(recording, path=f"{day}.csv") for day, recording in enumerate(seen, 1))
    with pytest.raises(InputError, match=r"^2.csv: measured and simulated .* this is another robot") as told:
        prup_pin.diagnose(arm, [first, replace(second, position=second.position[::-1] + 30.0)])
    # a row to look at: where it was measured, where the robot file has it
    where = re.search(r"in line (\d) it was measured at (\S+ \S+ \S+), and the robot file puts it at", str(told.value))
    there = second.position[::-1][int(where[1]) - 2] + 30.0
    assert np.allclose(np.array(where[2].split(), float), there, rtol=5e-3)
    lost = {**second.positions, "joint1": np.full(6, np.nan)}
    with pytest.raises(InputError, match=r"^2.csv: column q.joint1 is empty in every row"):
        prup_pin.diagnose(arm, [first, replace(second, positions=lost)])


# -- files -------------------------------------------------------------------------------------------------------------


def test_own_sensors_are_read_and_written(arm, tmp_path):
    recording = replace(measured(arm, standing(arm, poses(3, 1))), own_sensors=("pose_sensor", "target"))
    write_recording(recording, tmp_path / "a.csv")
    assert read_recording(tmp_path / "a.csv").own_sensors == ("pose_sensor", "target")
    beside = tmp_path / "a.json"
    said = json.loads(beside.read_text(encoding="utf-8"))
    for value, expected in ((True, ("pose_sensor", "target", "wrench_sensor", "encoders")), (False, ()), (None, ())):
        beside.write_text(json.dumps({**said, "own_sensors": value}), encoding="utf-8")
        assert read_recording(tmp_path / "a.csv").own_sensors == expected
    by_run = replace(recording, own_sensors=(), own_by_run=("pose_sensor",))
    write_recording(by_run, tmp_path / "a.csv")
    read = read_recording(tmp_path / "a.csv")
    assert (read.own_sensors, read.own_by_run) == ((), ("pose_sensor",))
    for value, told in (
        (["pose_sensr"], r"own_sensors\[0\].*Did you mean 'pose_sensor'"),
        ("all", "expected true, or"),
        ({"by_run": ["trget"]}, r"own_sensors.by_run\[0\].*Did you mean 'target'"),
        ({"by_day": ["target"]}, r'for each run \{"by_run": \[…\]\}'),
    ):
        beside.write_text(json.dumps({**said, "own_sensors": value}), encoding="utf-8")
        with pytest.raises(RecordingFileError, match=told):
            read_recording(tmp_path / "a.csv")
    with pytest.raises(InputError, match="pose_sensor"):
        replace(recording, own_sensors=("tracker",))


@pytest.mark.usefixtures("without_pictures")
def test_from_the_shell(arm, set_up_twice, tmp_path):
    (first, second), _ = set_up_twice
    paths = [tmp_path / "first.csv", tmp_path / "second.csv"]
    for path, recording in zip(paths, (first, second), strict=True):
        write_recording(replace(recording, robot=str(ARM)), path)
    runner = CliRunner()

    def run(*words):
        done = runner.invoke(app, [str(word) for word in words])
        return done.exit_code, done.output

    code, said = run("diagnose", *paths, "--out", tmp_path / "out")
    assert code == 0, said
    assert "first.csv, 20 samples, 20 used" in said
    document = json.loads((tmp_path / "out/diagnosis.json").read_text(encoding="utf-8"))
    assert [item["recording"] for item in document["recordings"]] == ["first.csv", "second.csv"]
    assert [item["noise"]["position"] for item in document["recordings"]] == [2e-6, 2e-5]
    assert document["recordings"][1]["own_sensors"] == ["pose_sensor", "wrench_sensor"]
    assert all(item["residual"]["after"] < 1.2 < item["residual"]["before"] for item in document["recordings"])
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "its own pose sensor, wrench sensor" in page
    model = json.loads((tmp_path / "out/corrected_model.json").read_text(encoding="utf-8"))
    kept = model["effects"][0]["parameters"]
    assert "joint2/drive.stiffness" in kept
    assert "pose_sensor.x" in kept
    assert not any("second.csv" in name for name in kept)
    code, said = run("predict", tmp_path / "out/corrected_model.json", paths[0], "--out", tmp_path / "p.csv")
    assert code == 0, said
    code, said = run("calibrate", *paths, "--out", tmp_path / "model.json")
    assert code == 0, said
    assert "which is noise" in said
    code, said = run("diagnose", paths[0], paths[0], "--out", tmp_path / "twice", "--no-report")
    assert code == 2
    assert "first.csv is given twice" in said
