"""Test plans: the file, the inputs that follow from it, and sensor noise."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

from prup_pin.errors import InputError, RecordingFileError, UnreachablePoseError
from prup_pin.recordings import (
    ActuatorPose,
    LoadProgramme,
    Noise,
    RandomPoses,
    Recording,
    TaskPose,
    TestPlan,
    Tolerances,
    add_noise,
    read_plan,
    read_recording,
    write_plan,
    write_recording,
)

PLAN = {
    "robot": "3prup",
    "notes": "as on the bench",
    "poses": [
        {"actuators": {"a": 0.4, "b": 0.5}},
        {"at": {"z": 0.4, "theta": 0.1}},
        {"random": {"count": 3, "bounds": {"z": [0.3, 0.5], "theta": [-0.2, 0.2]}}},
    ],
    "loads": [
        {"cycle": [0, 0.5, 1, 0], "wrench": {"fx": 60, "mz": 5}},
        {"random_directions": 2, "force": 60, "moment": 10, "cycle": [0, 1], "poses": [0, 4]},
    ],
    "sample_interval": 0.25,
    "temperature": {"from": 20, "to": 35},
    "noise": {"position_noise": 2e-6, "force_noise": 0.03},
    "encoder_resolution": 1e-4,
    "seed": 7,
}


def solve(at):
    """Stand in for a robot: two slides above and below z."""
    return {"a": at["z"] + at["theta"] / 3, "b": at["z"] - at["theta"] / 3}


@pytest.fixture
def write(tmp_path):
    def write_file(value):
        path = tmp_path / "plan.json"
        path.write_text(value if isinstance(value, str) else json.dumps(value))
        return path

    return write_file


def test_read(write):
    plan = read_plan(write(PLAN))
    assert plan.poses == (
        ActuatorPose({"a": 0.4, "b": 0.5}),
        TaskPose({"z": 0.4, "theta": 0.1}),
        RandomPoses(3, {"z": (0.3, 0.5), "theta": (-0.2, 0.2)}),
    )
    assert plan.loads == (
        LoadProgramme((0, 0.5, 1, 0), wrench={"fx": 60, "mz": 5}),
        LoadProgramme((0, 1), random_directions=2, force=60, moment=10, poses=(0, 4)),
    )
    assert plan.noise == Noise(position=2e-6, force=0.03)
    assert (plan.temperature, plan.sample_interval, plan.encoder_resolution, plan.seed) == ((20, 35), 0.25, 1e-4, 7)
    assert (plan.robot, plan.notes) == ("3prup", "as on the bench")
    assert plan.pose_count == 5


def test_defaults(write):
    plan = read_plan(write({"poses": [{"at": {"z": 0.4}}], "loads": [{"wrench": {"fz": 1}}]}))
    assert plan.loads[0].cycle == (0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5, 0)
    assert plan.temperature is None
    assert plan.noise == Noise()
    assert read_plan(write({**PLAN, "temperature": 22})).temperature == 22


@pytest.mark.parametrize("temperature", [None, 22.0, (20.0, 35.0)])
def test_write_and_read(tmp_path, write, temperature):
    values = {**PLAN, "temperature": {"from": 20, "to": 35} if isinstance(temperature, tuple) else temperature}
    plan = read_plan(write(values))
    write_plan(plan, tmp_path / "again.json")
    assert read_plan(tmp_path / "again.json") == plan


def test_tolerances_go_through_a_plan_into_the_recording(tmp_path, write):
    plan = read_plan(write({**PLAN, "tolerances": {"stiffness": 0.1, "mass": None}}))
    assert plan.tolerances == Tolerances(stiffness=0.1)
    assert plan.inputs(solve).tolerances == Tolerances(stiffness=0.1)
    write_plan(plan, tmp_path / "again.json")
    assert read_plan(tmp_path / "again.json") == plan
    assert read_plan(write(PLAN)).tolerances == Tolerances()


def test_inputs(write):
    plan = read_plan(write(PLAN))
    recording = plan.inputs(solve)
    assert len(recording) == 5 * 4 + 2 * (2 * 2)
    np.testing.assert_allclose(np.diff(recording.time), 0.25)
    table = recording.actuator_positions(["a", "b"])
    np.testing.assert_allclose(table[0], [0.4, 0.5])
    np.testing.assert_allclose(table[8], [0.4333, 0.3667], atol=1e-12)  # rounded by the encoder
    np.testing.assert_allclose(table / 1e-4, np.round(table / 1e-4), atol=1e-8)
    mean = table[12:].mean(axis=1)
    assert ((mean > 0.2999) & (mean < 0.5001)).all()
    assert recording.blocks().tolist() == [*[0] * 8, *[1] * 4, *[2] * 4, *[3] * 4, *[4] * 8]
    np.testing.assert_allclose(recording.wrench[:4, [0, 5]], [[0, 0], [30, 2.5], [60, 5], [0, 0]])
    drawn = recording.wrench[[5, 7, 25, 27]]
    assert len(np.unique(drawn[:, 0])) == 4
    for part, size in ((drawn[:, :3], 60), (drawn[:, 3:], 10)):
        norm = np.linalg.norm(part, axis=1)
        assert ((norm >= 0.2 * size) & (norm <= size)).all()
    assert (recording.temperature[0], recording.temperature[-1]) == (20, 35)
    assert recording.run_names == ("",)
    assert recording.position is None
    assert (recording.noise, recording.robot) == (plan.noise, "3prup")


def test_inputs_follow_from_the_seed(write):
    a, b = (read_plan(write(PLAN)).inputs(solve) for _ in range(2))
    np.testing.assert_array_equal(a.wrench, b.wrench)
    np.testing.assert_array_equal(a.positions["a"], b.positions["a"])
    other = read_plan(write({**PLAN, "seed": 8})).inputs(solve)
    assert (other.wrench[5] != a.wrench[5]).any()
    assert other.positions["a"][-1] != a.positions["a"][-1]
    fewer = read_plan(write({**PLAN, "loads": PLAN["loads"][:1]})).inputs(solve)
    assert set(fewer.positions["a"]) == set(a.positions["a"])  # other loads, same poses


def test_inputs_are_a_recording_file(write, tmp_path):
    recording = add_noise(read_plan(write(PLAN)).inputs(solve), Noise(force=0.03), 1)
    write_recording(recording, tmp_path / "inputs.csv")
    back = read_recording(tmp_path / "inputs.csv")
    np.testing.assert_allclose(back.wrench, recording.wrench, rtol=1e-8)
    assert back.noise == Noise(force=0.03)


def test_unreachable_poses(write):
    plan = read_plan(write(PLAN))

    def low_only(at):
        if at["z"] > 0.41:
            raise UnreachablePoseError("too high", requested=at)
        return solve(at)

    assert len(plan.inputs(low_only)) == 28  # drawn again

    def never(at):
        raise UnreachablePoseError("too high", requested=at)

    with pytest.raises(UnreachablePoseError, match=r"poses\[1\]\.at: too high") as caught:
        plan.inputs(never)
    assert caught.value.requested == {"z": 0.4, "theta": 0.1}
    drawn = TestPlan(plan.poses[2:], plan.loads[:1])
    with pytest.raises(UnreachablePoseError, match=r"poses\[0\]\.random: 0 of 3 poses found in 60 draws"):
        drawn.inputs(never)


def test_poses_that_move_other_joints(write):
    with pytest.raises(InputError, match="pose 1 moves c; pose 0 moves a, b"):
        read_plan(write(PLAN)).inputs(lambda at: {"c": 1.0})


def changed(path, value):
    """Return the plan with another value at a path of keys; KeyError as value removes the key."""
    plan = copy.deepcopy(PLAN)
    at = plan
    for key in path[:-1]:
        at = at[key]
    if value is KeyError:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return plan


@pytest.mark.parametrize(
    ("path", "value", "key", "message"),
    [
        (["poses"], KeyError, "poses", "is missing"),
        (["poses"], [], "poses", "is empty; expected a list of poses"),
        (["poses"], {"at": 1}, "poses", "is an object; expected a list"),
        (["poses", 0], 5, "poses[0]", "is the number 5; expected an object"),
        (["poses", 0], {}, "poses[0]", "expected one of: actuators, at, random"),
        (["poses", 1, "random"], {}, "poses[1]", "has at and random; expected one of"),
        (["poses", 1, "att"], {}, "poses[1].att", "unknown key. Did you mean 'at'"),
        (["poses", 0, "actuators", "a"], "left", "poses[0].actuators.a", 'is the text "left"; expected a number'),
        (["poses", 0, "actuators"], {}, "poses[0].actuators", "is empty; expected positions by joint name"),
        (["poses", 1, "at", "z"], None, "poses[1].at.z", "is null; expected a number [m or rad]"),
        (["poses", 2, "random", "count"], 2.5, "poses[2].random.count", "is the number 2.5; expected a whole number"),
        (["poses", 2, "random", "count"], 10**12, "poses[2].random.count", "from 1 to 100000"),
        (["poses", 2, "random", "bounds"], {}, "poses[2].random.bounds", "is empty"),
        (["poses", 2, "random", "bounds", "z"], [0.5], "poses[2].random.bounds.z", "expected a list [low, high]"),
        (["poses", 2, "random", "bounds", "z"], [0.5, 0.3], "poses[2].random.bounds.z", "goes from 0.5 to 0.3"),
        (["poses", 2, "random", "bounds", "z", 1], "a", "poses[2].random.bounds.z[1]", "expected a number"),
        (["loads"], KeyError, "loads", "is missing"),
        (["loads", 0, "wrench", "fq"], 1, "loads[0].wrench.fq", "unknown key. Valid: fx, fy"),
        (["loads", 0, "wrench", "fx"], True, "loads[0].wrench.fx", "is true; expected a number [N]"),
        (["loads", 0, "wrench"], KeyError, "loads[0]", "has neither wrench nor random_directions"),
        (["loads", 0, "random_directions"], 3, "loads[0]", "has both wrench and random_directions"),
        (["loads", 0, "force"], 3, "loads[0].force", "a wrench has its own size"),
        (["loads", 0, "cycle"], [], "loads[0].cycle", "is empty"),
        (["loads", 0, "cycle", 2], "1", "loads[0].cycle[2]", "expected a number"),
        (["loads", 1, "force"], -5, "loads[1].force", "expected a number of at least 0 [N]"),
        (["loads", 1, "poses", 1], 5, "loads[1].poses[1]", "is the number 5; expected a whole number from 0 to 4"),
        (["loads", 1, "random_directions"], 0, "loads[1].random_directions", "expected a whole number"),
        (["sample_interval"], 0, "sample_interval", "expected a number above 0 [s]"),
        (["encoder_resolution"], -1, "encoder_resolution", "of at least 0"),
        (["temperature"], "warm", "temperature", "expected a number"),
        (["temperature"], {"from": 20}, "temperature.to", "is null"),
        (["noise", "position_noise"], 0, "noise.position_noise", "expected one standard deviation above 0 [m]"),
        (
            ["tolerances"],
            {"stiffness": 0},
            "tolerances.stiffness",
            "expected one standard deviation above 0 [relative]",
        ),
        (
            ["tolerances"],
            {"stifness": 1},
            "tolerances.stifness",
            "no tolerance has this name. Did you mean 'stiffness'",
        ),
        (["tolerances"], "typical", "tolerances", 'is the text "typical"; expected an object'),
        (["noise", "position"], 1, "noise.position", "unknown key. Did you mean 'position_noise'"),
        (["seed"], -1, "seed", "expected a whole number of at least 0"),
        (["robot"], 3, "robot", "expected a text"),
        (["pose"], [], "pose", "unknown key. Did you mean 'poses'"),
    ],
)
def test_bad_plans(write, path, value, key, message):
    with pytest.raises(RecordingFileError) as caught:
        read_plan(write(changed(path, value)))
    (problem,) = caught.value.problems
    assert problem.key == key
    assert message in problem.message
    assert f"plan.json: {key}: " in str(caught.value)


def test_all_problems_of_a_plan_at_once(write):
    plan = changed(["poses", 1, "at", "z"], "x") | {"seed": "y"}
    plan["poses"].append({"actuators": {"a": 0.4}})
    with pytest.raises(RecordingFileError) as caught:
        read_plan(write(plan))
    assert [problem.key for problem in caught.value.problems] == ["poses[1].at.z", "poses[3].actuators.b", "seed"]


def test_not_a_plan(write, tmp_path):
    with pytest.raises(RecordingFileError, match=r"plan\.json:2: is not valid JSON"):
        read_plan(write('{"poses": [],\n "loads" }'))
    with pytest.raises(RecordingFileError, match="holds a list"):
        read_plan(write("[]"))
    with pytest.raises(RecordingFileError, match="is empty"):
        read_plan(write(""))
    with pytest.raises(RecordingFileError, match="file not found"):
        read_plan(tmp_path / "other.json")


def test_plans_made_in_python():
    load = LoadProgramme(wrench={"fx": 1})
    pose = TaskPose({"z": 0.4})
    with pytest.raises(InputError, match="at least one pose"):
        TestPlan((), (load,))
    with pytest.raises(InputError, match=r"loads\[0\]\.poses: no pose 3; there are poses 0 to 0"):
        TestPlan((pose,), (LoadProgramme(wrench={"fx": 1}, poses=(3,)),))
    with pytest.raises(InputError, match="either a wrench or"):
        LoadProgramme()
    with pytest.raises(InputError, match="'fq'"):
        LoadProgramme(wrench={"fq": 1})
    with pytest.raises(InputError, match="sample_interval"):
        TestPlan((pose,), (load,), sample_interval=0)


def test_noise():
    n = 20_000
    clean = Recording(
        time=np.arange(n),
        positions={"a": np.ones(n)},
        efforts={"a": np.full(n, 7.0)},
        wrench=np.zeros((n, 6)),
        wrench_columns=("fx", "mz"),
        position=np.where(np.arange(n)[:, None] == 4, np.nan, np.ones((n, 3))),
        rotation=np.zeros((n, 3)),
        markers={"tip": np.zeros((n, 3))},
    )
    noise = Noise(position=2e-6, rotation=1e-5, force=0.03, moment=0.002, effort=0.5)
    noisy = add_noise(clean, noise, seed=3)
    assert noisy.noise == noise
    # A standard deviation from 20 000 samples is known to 0.5 %.
    for values, deviation in (
        (noisy.position - 1, 2e-6),
        (noisy.rotation, 1e-5),
        (noisy.wrench[:, 0], 0.03),
        (noisy.wrench[:, 5], 0.002),
        (noisy.efforts["a"] - 7, 0.5),
        (noisy.markers["tip"], 2e-6),
    ):
        assert np.nanstd(values) == pytest.approx(deviation, rel=0.025)
        assert abs(np.nanmean(values)) < 5 * deviation / np.sqrt(n)
    assert (noisy.wrench[:, 1:5] == 0).all()  # no column, no sensor
    assert np.isnan(noisy.position[4]).all()
    np.testing.assert_array_equal(noisy.positions["a"], clean.positions["a"])
    assert abs(np.corrcoef(noisy.rotation[:, 0], noisy.markers["tip"][:, 0])[0, 1]) < 0.04
    np.testing.assert_array_equal(add_noise(clean, noise, seed=3).wrench, noisy.wrench)
    assert (add_noise(clean, noise, seed=4).rotation != noisy.rotation).all()
    only = add_noise(clean, Noise(rotation=1e-5), seed=3)
    np.testing.assert_array_equal(only.rotation, noisy.rotation)  # a channel's noise is its own
    np.testing.assert_array_equal(only.efforts["a"], clean.efforts["a"])


BOX = {"random": {"count": 2, "bounds": {"z": [-1e308, 1e308]}}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"poses": [BOX]}, "poses[0].random.bounds.z[0]: is the number -1e+308; expected a number of 1000 at most"),
        (
            {"poses": [{"at": {"z": -1e308}}]},
            "poses[0].at.z: is the number -1e+308; expected a number of 1e+09 at most",
        ),
        (
            {"loads": [{"wrench": {"fx": 1e300}}]},
            "loads[0].wrench.fx: is the number 1e+300; expected a number of 1e+09",
        ),
        (
            {"poses": [{"random": {"count": 100_000, "bounds": {"z": [0, 1]}}}]}
            | {"loads": [{"random_directions": 100_000, "force": 1}]},
            "loads: come to 90000000000 samples; expected at most 10000000",
        ),
    ],
)
def test_a_plan_of_no_bench_is_refused_before_it_is_carried_out(write, change, message):
    with pytest.raises(RecordingFileError) as raised:
        read_plan(write({**PLAN, "loads": [{"wrench": {"fx": 1}}], **change}))
    assert message in str(raised.value)


def test_the_same_in_python():
    with pytest.raises(InputError, match="bounds of 'z' = -1e\\+308, 1: expected at most 1000"):
        RandomPoses(1, {"z": (-1e308, 1)})
    with pytest.raises(InputError, match="the plan has 90000000000 samples; expected at most 10000000"):
        TestPlan((RandomPoses(100_000, {"z": (0, 1)}),), (LoadProgramme(random_directions=100_000, force=1.0),))


def test_a_box_that_nothing_of_is_within_reach_is_given_up_early():
    asked = []

    def never(at):
        asked.append(at)
        raise UnreachablePoseError("out of reach")

    plan = TestPlan((RandomPoses(100_000, {"z": (500, 501)}),), (LoadProgramme(wrench={"fx": 1}, poses=(0,)),))
    with pytest.raises(UnreachablePoseError, match="0 of 100000 poses found in 100 draws; narrow the bounds"):
        plan.inputs(never)
    assert len(asked) == 100
