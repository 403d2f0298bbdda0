"""Markers: the pose of any frame beside the tool's, or without it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.channels import Noise, PoseChannel, Stack, channels_of
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.noise import estimate_noise
from prup_pin.diagnosis.toleranced import toleranced_of
from prup_pin.errors import InputError, RecordingFileError, UnknownNameError
from prup_pin.recordings import Noise as SensorNoise
from prup_pin.recordings import Recording, Tolerances, add_noise, read_plan, read_recording, write_recording
from prup_pin.simulation import CorrectedModel, Simulator, effect_named, inputs_of, read_model, write_model
from prup_pin.spatial import rotation_exp, rotation_log

ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"
MARKERS = ("link3", "link5", "tool")
NOISE = SensorNoise(position=2e-6, rotation=1e-5)


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load(ARM)


def standing(arm, n, seed=1, wrench=None):
    """Samples of an arm that holds still in as many poses; without a wrench, nothing but its weight acts."""
    angles = np.random.default_rng(seed).uniform(-1.2, 1.2, (n, 6))
    positions = {name: angles[:, column] for column, name in enumerate(arm.mechanism.actuated)}
    return Recording(np.arange(float(n)), positions=positions, wrench=wrench, noise=NOISE)


def weight(arm):
    return effect_named("self_weight", "robot", "", {"scale": 1.0}, arm.mechanism)


def measured(arm, inputs, effects, turned=True, markers=MARKERS, seed=3):
    seen = prup_pin.simulate(arm, inputs, effects, markers=markers)
    rotations = seen.marker_rotations if turned else {}
    return add_noise(inputs.with_measurements(markers=seen.markers, marker_rotations=rotations), NOISE, seed)


def named(found):
    return [item for item in found.findings if item.physics not in ("self_weight", "finite_deflection")]


def test_a_marker_goes_where_its_frame_goes_in_equilibrium(arm):
    """Against the loaded pose itself: position and orientation of frames on three bodies."""
    wrench = np.random.default_rng(5).normal(size=(3, 6)) * [200, 200, 200, 20, 20, 20]
    inputs = standing(arm, 3, wrench=wrench)
    seen = prup_pin.simulate(arm, inputs, [weight(arm)], markers=MARKERS)
    assert set(seen.markers) == set(seen.marker_rotations) == set(MARKERS)
    for row in range(3):
        pose = arm.pose_from_actuators([values[row] for values in inputs.positions.values()])
        loaded = arm.equilibrium(pose, wrench[row], gravity=True)
        for name in MARKERS:
            placed = loaded.placement(name)
            np.testing.assert_allclose(seen.markers[name][row], placed[:3, 3], atol=1e-12)
            np.testing.assert_allclose(rotation_exp(seen.marker_rotations[name][row]), placed[:3, :3], atol=1e-12)


def test_what_was_simulated_leaves_no_residual(arm):
    inputs = standing(arm, 4)
    seen = prup_pin.simulate(arm, inputs, [weight(arm)], markers=MARKERS)
    recording = inputs.with_measurements(markers=seen.markers, marker_rotations=seen.marker_rotations)
    stack = Stack(channels_of(recording, arm.mechanism))
    run = Simulator(arm, inputs_of(recording, arm)).run([weight(arm)])
    assert stack.exists.sum() == 4 * 6 * len(MARKERS)
    assert np.abs(stack.residual(run)).max() < 1e-12


@pytest.mark.parametrize(("factor", "turned"), [(1.0, False), pytest.param(0.6, True, marks=pytest.mark.slow)])
def test_markers_alone_diagnose_an_arm_under_its_own_weight(arm, factor, turned):
    """No pose of the tool and no load but its own weight; the drive of its second joint is soft, or nothing is."""
    soft = effect_named("stiffness_changed", "joint2/drive", "", {"factor": factor}, arm.mechanism)
    effects = [weight(arm)] if factor == 1 else [weight(arm), soft]
    found = diagnose(arm, measured(arm, standing(arm, 30), effects, turned))
    assert found.verdict == "explained"
    assert "self_weight" in {item.physics for item in found.findings}
    assert found.after["fit"] == pytest.approx(1.0, abs=0.08)
    if factor == 1:
        assert named(found) == []
    else:
        (finding,) = named(found)
        assert (finding.physics, finding.location) == ("stiffness_changed", "joint2/drive")
        assert "stiffness" not in "".join(text for item in found.findings for text in item.alternatives)
        low, high = finding.parameters["factor"].interval
        assert low < factor < high
        assert high - low < 0.03
    units = ("position", "rotation") if turned else ("position",)
    assert set(found.by_channel) == {f"marker {name} {unit}" for name in MARKERS for unit in units}
    proposed = found.next_experiment
    if proposed["plan"]:
        assert proposed["plan"]["markers"] == list(MARKERS)
    else:  # a contact that stiffens a little follows a soft drive under whatever weight does
        left = [*proposed["cannot_separate"], *proposed["undecided"]]
        assert [pair["other"]["physics"] for pair in left] == ["hertzian_contact"]
        assert factor < 1


def test_each_marker_has_a_target_of_its_own(arm):
    """A marker's tolerances move it on its frame, alone, along the frame's axes."""
    tolerances = Tolerances(target_position=3e-4, target_rotation=1e-3)
    inputs = replace(standing(arm, 3), tolerances=tolerances)
    recording = measured(arm, inputs, [weight(arm)])
    toleranced = toleranced_of(recording, arm.mechanism)
    names = [item.name for item in toleranced.law.deviations]
    assert names == [f"{place}.{axis}" for place in ("target", "marker link3", "marker link5")
                     for axis in ("x", "y", "z", "rx", "ry", "rz")]  # fmt: skip
    stack = Stack(channels_of(recording, arm.mechanism))
    simulator = Simulator(arm, inputs_of(recording, arm))
    run = simulator.run([weight(arm)])
    influence = Influence(simulator, run, stack)
    x = np.zeros(len(names))
    x[names.index("marker link5.y")], x[names.index("marker link5.rz")] = 2.0, -1.0
    off = toleranced.effect(x)
    change = influence.change(simulator.setup([weight(arm), off]))
    columns = {channel.name: slice(6 * k, 6 * k + 6) for k, channel in enumerate(stack.channels)}
    moved = change[:, columns["marker link5"]]
    turn = run.pose_of(arm.mechanism.frame("link5"))[1]
    np.testing.assert_allclose(moved[:, :3], 6e-4 * turn[:, :, 1], atol=1e-12)
    np.testing.assert_allclose(moved[:, 3:], -1e-3 * turn[:, :, 2], atol=1e-12)
    assert not change[:, columns["marker link3"]].any()
    assert not change[:, columns["marker tool"]].any()
    after = stack.residual(simulator.run([weight(arm), off], run))
    # A millirad times the noise of a turn is second order.
    np.testing.assert_allclose(stack.residual(run) - after, np.where(stack.exists, change, 0), atol=3e-8)


@pytest.mark.slow
def test_markers_beside_their_frames_are_calibrated(arm):
    """Three targets set by hand: without a tolerance for them the tracker's frame could not be told."""
    tolerances = Tolerances(stiffness=0.1, target_position=3e-4, target_rotation=1e-3)
    inputs = replace(standing(arm, 25), tolerances=tolerances)
    nothing = measured(arm, inputs, [weight(arm)])
    toleranced = toleranced_of(nothing, arm.mechanism)
    x = np.random.default_rng(2).normal(size=len(toleranced))
    found = diagnose(arm, measured(arm, inputs, [toleranced.effect(x), weight(arm)]))
    assert named(found) == []
    assert found.within["nominal"] > 50
    assert found.within["calibrated"] == pytest.approx(1.0, abs=0.1)
    known = {item.name: item for item in found.calibration}
    names = [item.name for item in toleranced.law.deviations]
    for name in ("marker link3.x", "marker link5.z", "marker link5.rx", "joint2/drive.stiffness"):
        assert known[name].learned > 0.8
        assert abs(known[name].x - x[names.index(name)]) < 4 * known[name].share


@pytest.mark.slow
def test_a_marker_beside_its_frame_is_named(arm, tmp_path):
    """Without a tolerance: the tool's target is where it should be, the marker's is not."""
    values = {"x": 5e-4, "y": 0.0, "z": -3e-4, "rx": 0.0, "ry": 2e-3, "rz": 0.0}
    off = effect_named("target_misalignment", "target", "marker link5", values, arm.mechanism)
    inputs = standing(arm, 10)
    seen = prup_pin.simulate(arm, inputs, [weight(arm), off], markers=["link5"])
    recording = inputs.with_measurements(position=seen.position, rotation=seen.rotation, markers=seen.markers)
    recording = recording.with_measurements(marker_rotations=seen.marker_rotations)
    found = diagnose(arm, add_noise(recording, NOISE, 4))
    (finding,) = named(found)
    assert (finding.physics, finding.location) == ("target_misalignment", "target")
    assert finding.effect.place.aspect == "marker link5"
    for name in values:
        assert finding.parameters[name].value == pytest.approx(values[name], abs=1e-5)
    assert found.after["fit"] == pytest.approx(1.0, abs=0.1)
    write_model(CorrectedModel(str(ARM), found.effects), tmp_path / "model.json")
    again = read_model(tmp_path / "model.json").effects
    assert [effect.place for effect in again] == [effect.place for effect in found.effects]
    after = prup_pin.simulate(arm, inputs, again, markers=["link5"])
    np.testing.assert_allclose(after.markers["link5"], seen.markers["link5"], atol=5e-6)


def test_noise_is_estimated_from_markers_where_they_repeat(arm):
    one = standing(arm, 1)
    times = Recording(np.arange(40.0), positions={name: np.full(40, q[0]) for name, q in one.positions.items()})
    recording = measured(arm, times, [weight(arm)])
    recording = replace(recording, noise=SensorNoise())
    from prup_pin.channels import Linear

    inputs = inputs_of(recording, arm)
    linear = Linear.of(Simulator(arm, inputs))
    stack = Stack(channels_of(recording, arm.mechanism))
    noise = estimate_noise(recording, stack, linear, inputs, np.ones(40, bool))
    assert isinstance(noise, Noise)
    assert noise.source == "estimated"
    assert noise.position == pytest.approx(2e-6, rel=0.25)
    assert noise.rotation == pytest.approx(1e-5, rel=0.25)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_marker_in_millimetres_or_degrees_is_named(arm):
    recording = measured(arm, standing(arm, 5), [weight(arm)])
    wide = {**recording.markers, "link5": 1e3 * recording.markers["link5"]}
    with pytest.raises(
        InputError, match=r"marker link5 are .* apart, in the median: .* or other units. Check --robot, p.link5.x"
    ):
        diagnose(arm, recording.with_measurements(markers=wide))
    turned = {**recording.marker_rotations, "link3": recording.marker_rotations["link3"] + [1.5, 0, 0]}
    with pytest.raises(InputError, match=r"orientations of marker link3 .* expected r.link3.x r.link3.y r.link3.z"):
        diagnose(arm, recording.with_measurements(marker_rotations=turned))


def test_a_marker_that_no_frame_has_is_not_used_or_not_found(arm):
    recording = measured(arm, standing(arm, 5), [weight(arm)])
    strange = {**recording.marker_rotations, "elbow": np.zeros((5, 3))}
    found = diagnose(arm, recording.with_measurements(marker_rotations=strange))
    assert found.unused_columns == ("r.elbow.x", "r.elbow.y", "r.elbow.z")
    with pytest.raises(UnknownNameError, match="link5"):
        prup_pin.simulate(arm, standing(arm, 2), markers=["link55"])


@pytest.mark.slow
def test_part_of_a_markers_orientation_is_not_used(arm):
    recording = measured(arm, standing(arm, 5), [weight(arm)])
    partly = {**recording.marker_rotations, "link3": recording.marker_rotations["link3"] * [1, 1, np.nan]}
    found = diagnose(arm, recording.with_measurements(marker_rotations=partly))
    assert found.unused_columns == ("r.link3.x", "r.link3.y")
    assert "marker link3 rotation" not in found.by_channel


# -- files -------------------------------------------------------------------------------------------------------------


def test_markers_are_written_and_read_again(arm, tmp_path):
    recording = measured(arm, standing(arm, 4), [weight(arm)])
    write_recording(recording, tmp_path / "bench.csv")
    again = read_recording(tmp_path / "bench.csv")
    assert again.marker_names == MARKERS
    assert "marker link5" in repr(again)
    for name in MARKERS:
        np.testing.assert_allclose(again.markers[name], recording.markers[name], rtol=1e-8)
        np.testing.assert_allclose(again.marker_rotations[name], recording.marker_rotations[name], rtol=1e-8)
        np.testing.assert_array_equal(again.select([2]).marker_rotations[name], again.marker_rotations[name][[2]])


def test_simulate_predicts_the_markers_that_are_asked_for(arm, tmp_path):
    write_recording(standing(arm, 3), tmp_path / "bench.csv")
    plan = {
        "robot": str(ARM), "markers": ["link3"], "noise": {"position_noise": 1e-6},
        "poses": [{"actuators": dict.fromkeys(arm.mechanism.actuated, 0.2)}],
        "loads": [{"cycle": [0, 1], "wrench": {"fz": -50}}],
    }  # fmt: skip
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    runner = CliRunner()

    def run(*words):
        done = runner.invoke(app, [str(word) for word in words])
        return done.exit_code, done.output

    code, said = run(
        "simulate", tmp_path / "bench.csv", "--robot", ARM, "--marker", "link5", "--out", tmp_path / "p.csv"
    )
    assert code == 0, said
    head = (tmp_path / "p.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "p.link5.x,p.link5.y,p.link5.z,r.link5.x,r.link5.y,r.link5.z" in head
    code, said = run("simulate", "--plan", tmp_path / "plan.json", "--marker", "tool", "--out", tmp_path / "made.csv")
    assert code == 0, said
    assert read_recording(tmp_path / "made.csv").marker_names == ("link3", "tool")
    code, said = run(
        "simulate", tmp_path / "bench.csv", "--robot", ARM, "--marker", "link9", "--out", tmp_path / "p.csv"
    )
    assert code == 2
    assert "link9" in said
    assert "Did you mean" in said


def test_a_plan_with_markers_that_are_no_names_is_refused(tmp_path):
    plan = {"markers": ["link3", 4], "poses": [{"actuators": {"a": 0}}], "loads": [{"wrench": {"fx": 1}}]}
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    with pytest.raises(RecordingFileError, match=r"markers\[1\]: is the number 4; expected the name of a frame"):
        read_plan(tmp_path / "plan.json")


def test_a_marker_channel_knows_what_was_measured(arm):
    recording = Recording(
        np.arange(2.0),
        positions={name: np.zeros(2) for name in arm.mechanism.actuated},
        marker_rotations={"link3": [[0.0, 0.0, 0.1], [np.nan, 0.0, 0.1]]},
    )
    channel = PoseChannel.of_marker(recording, arm.mechanism.frame("link3"))
    np.testing.assert_array_equal(channel.exists, [[False] * 3 + [True] * 3, [False] * 6])
    assert rotation_log(channel.rotation[0])[2] == pytest.approx(0.1)
