"""Logs of poses that are written otherwise than they say are told so, before any physics, and others are not."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prup_pin import build, load
from prup_pin.diagnosis import conventions, diagnose, load_conventions
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.diagnosis.load_conventions import conventions_of_loads
from prup_pin.diagnosis.readings import Columns, readings
from prup_pin.errors import InputError
from prup_pin.recordings import Convention, Noise, Recording, joints_of, read_recording
from prup_pin.recordings.conventions import Drawn, Evidence, convention_of, may_be_read, written_as
from prup_pin.simulation import effect_named, simulate
from prup_pin.spatial import rotation_exp, rotation_log
from tests.as_written import as_written
from tests.reference.concealed import draw, misread
from tests.reference.concealed.scattered import draw_scattered
from tests.reference.concealed.scattered import write as write_scattered
from tests.reference.posed_tree import placed, turned

SLIDES = draw.SLIDES
WAYS = {way.name: way for way in misread.of_poses(SLIDES, slide=True, tree=False)}


@pytest.fixture(scope="module")
def bench(once):
    """A faultless 3-PRUP's log, by a simulator that shares no code with the package."""
    return once("written_bench", drawn_bench)


def drawn_bench(folder):
    draw.write(draw.draw(5, [], level=60.0, poses=(8, 1)), folder, folder / "sealed", "bench")
    return folder / "bench.csv"


def rewritten(bench, folder, *names):
    table = misread.read(bench)
    for name in names:
        table = WAYS[name].change(table)
    path = folder / "log.csv"
    misread.write(path, table)
    path.with_suffix(".json").write_text(bench.with_suffix(".json").read_text())
    return read_recording(path)


def test_a_log_that_is_written_as_it_says_is_left_alone(robot, bench):
    logs = read_logs(robot, read_recording(bench))
    assert logs.findings() == ()
    assert logs.conventions == ((),)


@pytest.mark.slow
def test_a_leg_that_is_soft_is_no_other_unit_of_force(tmp_path):
    """Beside scatter: forces in pounds-force leave a third of the squares, not of the root mean square."""
    file = str(Path(__file__).parents[1] / "robots" / "six_ups" / "six_ups.urdf")
    drawn = draw_scattered(9100, "six_ups", ["stiffness_changed"], sensors=1.316857008588989)
    write_scattered(drawn, tmp_path, tmp_path / "sealed", "device", file)
    assert conventions_of_loads(load(file), read_recording(tmp_path / "device.csv")) is None


def standing_on(robot, turning, moving):
    """Return a log of a robot whose base turns by moment / turning [N m/rad] and moves by force / moving [N/m]."""
    rng, names = np.random.default_rng(3), list(robot.mechanism.actuated)
    home = np.array(list(robot.home.actuators.values()))
    each = np.diag([300.0, 300.0, 600.0, 60.0, 60.0, 60.0])
    q, wrench, seen, turns = [], [], [], []
    for row in home + rng.uniform(-0.06, 0.06, (8, len(names))):
        pose = robot.pose_from_actuators(row)
        compliance, at = robot.compliance(pose), pose.base_from_tool
        for load_ in np.concatenate((np.zeros((1, 6)), each, -each)):
            moved = compliance.deflection(load_)
            force, moment = load_[:3], load_[3:] + np.cross(at[:3, 3], load_[:3])
            turn = rotation_exp(moment / turning)
            q, wrench = [*q, row], [*wrench, load_]
            seen.append(turn @ (at[:3, 3] + moved[:3]) + force / moving + rng.normal(0, 2e-6, 3))
            turns.append(rotation_log(turn @ rotation_exp(moved[3:]) @ at[:3, :3]) + rng.normal(0, 1e-5, 3))
    return Recording(
        time=np.arange(len(q), dtype=float),
        positions=dict(zip(names, np.array(q).T, strict=True)),
        wrench=np.array(wrench),
        position=np.array(seen),
        rotation=np.array(turns),
        noise=Noise(position=2e-6, rotation=1e-5),
    )


@pytest.mark.slow
@pytest.mark.parametrize("turning", [1e4, 3e3])
def test_pounds_force_are_told_beside_a_base_that_yields_and_only_where_they_are(robot, turning):
    log = standing_on(robot, turning, 300 * turning)
    assert conventions_of_loads(robot, log) is None
    told = conventions_of_loads(robot, written_as(log, [Convention("force", "lbf")], Drawn()))
    assert [str(item) for item in told.conventions] == ["force=lbf"]


def test_a_reaction_in_the_tools_axes_is_tried_with_the_commonest_words():
    """Neither word alone brings a log nearer. The first of the two was lost: the pair was found by chance alone."""
    commonest = next(readings(Recording(time=np.arange(2.0)), Columns(), "wrench"))
    assert (Convention("wrench", "reaction"), Convention("wrench", "tool_frame")) in commonest
    assert all(item.word != "as_written" for reading in commonest for item in reading)


@pytest.mark.parametrize("said", [(), ("reaction", "tool_frame")], ids=str)
def test_a_reaction_in_the_tools_axes_is_told_beside_a_soft_elbow_and_only_where_it_is(said):
    """Noise that is not declared; an elbow of half its stiffness was unknown physics, and nothing was told."""
    arm, rng = load("ur5", joint_stiffness=8e4), np.random.default_rng(1)
    q = np.repeat(rng.uniform(-1.2, 1.2, (16, 6)), 5, axis=0)
    each = rng.normal(size=(16, 6)) * [120, 120, 120, 25, 25, 25]
    wrench = np.concatenate([np.outer((0.0, 0.5, 1.0, -0.5, -1.0), row) for row in each])
    positions = dict(zip(arm.mechanism.actuated, q.T, strict=True))
    bench = Recording(time=np.arange(80.0), positions=positions, wrench=wrench)
    soft = effect_named("stiffness_changed", "elbow_joint", "", {"factor": 0.5}, arm.mechanism)
    seen = simulate(arm, bench, [soft])
    log = replace(bench, position=seen.position + rng.normal(0, 5e-6, (80, 3)),
                  rotation=seen.rotation + rng.normal(0, 2e-5, (80, 3)))  # fmt: skip
    tool = np.array([arm.pose_from_actuators(row).base_from_tool for row in q])
    way = [Convention("wrench", word) for word in said]
    told = conventions_of_loads(arm, written_as(log, way, Drawn(tool=lambda _: tool)))
    assert ({item.word for item in told.conventions} if told else set()) == set(said)


def test_what_a_base_does_that_yields_is_left_to_no_unit_of_forces(robot):
    """Modules alone, each as soft as suits, leave much of it, of which a unit takes most on one platform."""
    loaded = load_conventions._loaded(robot, standing_on(robot, 3e3, 1e6))
    written = load_conventions._left(loaded, loaded.wrench)
    assert written.yielding < 0.01 * written.softened
    pounds = load_conventions._left(loaded, loaded.wrench * [*3 * (4.4482216152605,), 1, 1, 1])
    assert not pounds.tells_against(written)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("forces in kN", "force=as_written"),
        ("forces in kN", "wrench=as_written"),
        pytest.param("positions in mm", "p=as_written", marks=pytest.mark.slow),
        pytest.param("inverse rotation", "r=as_written", marks=pytest.mark.slow),
        ("all joints in mm", "q=as_written"),
        pytest.param("two joints exchanged", f"q.{SLIDES[0]}=as_written", marks=pytest.mark.slow),
    ],
)
def test_what_is_declared_to_be_as_written_is_read_in_no_other_way(robot, bench, tmp_path, name, said):
    log = rewritten(bench, tmp_path, name)
    columns, _, word = said.partition("=")
    declared = convention_of(columns, word, joints_of(log))
    told = ()
    with suppress(InputError):  # two other readings that are as good
        told = read_logs(robot, replace(log, conventions=(declared,))).conventions[0]
    assert WAYS[name].said not in map(str, told)
    assert may_be_read(replace(log, conventions=(declared,)), told)


@pytest.mark.parametrize(
    "name",
    [
        "positions in mm",
        "base mirrored",
        pytest.param("inverse rotation", marks=pytest.mark.slow),  # as angles in another order
        "angles about turned X Y Z",
        "yaw, pitch, roll in deg",
        "vector part of a quaternion",
        "all joints in mm",
        pytest.param("two joints exchanged", marks=pytest.mark.slow),  # as of two legs turned round
        pytest.param("reaction", marks=pytest.mark.slow),  # as in test_cli_diagnose.py
        pytest.param("wrench in the tool's axes", marks=pytest.mark.slow),  # as of a reaction in them
        pytest.param("moments about the base's origin", marks=pytest.mark.slow),  # as about a sensor's point
        pytest.param("forces in kN", marks=pytest.mark.slow),  # as beside other units
        pytest.param("moments in N mm", marks=pytest.mark.slow),  # moments that no robot bears take long to follow
        pytest.param("reaction in the tool's axes", marks=pytest.mark.slow),  # as of an arm with a soft elbow
        pytest.param("mm, and inverse rotation", marks=pytest.mark.slow),  # each of them alone
    ],
)
def test_what_is_written_otherwise_is_told_and_read_so(robot, bench, tmp_path, name):
    true, log = read_recording(bench), rewritten(bench, tmp_path, name)
    logs = read_logs(robot, log)
    assert " + ".join(map(str, logs.conventions[0])) == WAYS[name].said
    (read,) = logs.recordings
    np.testing.assert_allclose(read.position, true.position, atol=1e-9)
    np.testing.assert_allclose(read.rotation, true.rotation, atol=1e-8)
    np.testing.assert_allclose(read.wrench, true.wrench, atol=1e-3 * np.abs(true.wrench).max())
    np.testing.assert_allclose(read.positions[SLIDES[0]], true.positions[SLIDES[0]], atol=1e-9)
    for finding in logs.findings():
        assert finding.physics == "log_convention"
        assert finding.evidence["as_read"] < 0.6 * finding.evidence.get("as_written", np.inf)  # none: no such posture


@pytest.mark.parametrize(
    "said",
    [
        ("q=mm", "r=deg"),
        ("p=mm", "q=mm", "r=deg"),
        ("p=um", "q=cm", "r=euler_xyz_deg"),
        pytest.param(("p=mm", "q=mm", "r=deg", "force=kN"), marks=pytest.mark.slow),
        pytest.param(("force=kN", "moment=N_mm"), marks=pytest.mark.slow),  # moments that no robot bears
    ],
    ids=str,
)
def test_joints_positions_and_orientations_in_other_units_at_once_are_all_told(robot, bench, said):
    """Slides in mm alone brought no orientation nearer that was in degrees, and so nothing was told."""
    true = read_recording(bench)
    way = [convention_of(*item.split("="), joints_of(true)) for item in said]
    logs = read_logs(robot, written_as(true, way, Drawn(slides=frozenset(SLIDES))))
    assert sorted(map(str, logs.conventions[0])) == sorted(said)
    np.testing.assert_allclose(logs.recordings[0].position, true.position, atol=1e-9)
    np.testing.assert_allclose(logs.recordings[0].rotation, true.rotation, atol=1e-8)


@pytest.mark.parametrize("tracker", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "said", [pytest.param(("q=deg", "r=deg"), marks=pytest.mark.slow), ("p=mm", "q=deg", "r=deg")], ids=" ".join
)
def test_an_arm_in_other_units_throughout_is_read_as_it_is_meant(said, tracker):
    arm, rng = load("ur5"), np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (12, 6))
    seen = np.array([arm.pose_from_actuators(row).base_from_tool for row in q])
    if tracker:
        seen = placed(turned([0.4, -0.3, 2.1]), [3.0, -2.0, 0.8]) @ seen
    true = Recording(
        time=np.arange(12.0),
        positions=dict(zip(arm.mechanism.actuated, q.T, strict=True)),
        position=seen[:, :3, 3] + 1e-5 * rng.normal(size=(12, 3)),
        rotation=rotation_log(seen[:, :3, :3]),
    )
    way = [convention_of(*item.split("="), joints_of(true)) for item in said]
    logs = read_logs(arm, written_as(true, way, Drawn()))
    assert sorted(map(str, logs.conventions[0])) == sorted(said)
    assert read_logs(arm, true).conventions == ((),)


def of_arm(arm, renamed=lambda name: name, count=12):
    """A log of an arm's positions and orientations, its joints by other names."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (count, 6))
    seen = np.array([arm.pose_from_actuators(row).base_from_tool for row in q])
    return Recording(
        time=np.arange(float(count)),
        positions={renamed(name): column for name, column in zip(arm.mechanism.actuated, q.T, strict=True)},
        position=seen[:, :3, 3] + 1e-5 * rng.normal(size=(count, 3)),
        rotation=rotation_log(seen[:, :3, :3]),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "said",
    [
        ("q=deg", "q.elbow_joint=reversed"),
        ("q=deg", "q.wrist_1_joint=quarter_turns:1"),
        ("q.shoulder_lift_joint=reversed", "q.wrist_1_joint=reversed"),
        ("q.elbow_joint=deg", "q.wrist_2_joint=reversed"),
        ("p=mm", "r=euler_xyz"),
    ],
    ids=" ".join,
)
def test_two_misreadings_of_an_arm_are_both_told(said):
    """The joint that counts the other way round made nonsense of the right unit, and nothing was told."""
    arm = load("ur5")
    true = of_arm(arm)
    way = [convention_of(*item.split("="), joints_of(true)) for item in said]
    logs = read_logs(arm, written_as(true, way, Drawn()))
    assert sorted(map(str, logs.conventions[0])) == sorted(said)


@pytest.mark.parametrize("turned_round", [SLIDES[:2], pytest.param(SLIDES[1:], marks=pytest.mark.slow)])
def test_two_legs_that_count_the_other_way_round_are_told(robot, bench, turned_round):
    true = read_recording(bench)
    way = [Convention(f"q.{name}", "reversed") for name in turned_round]
    logs = read_logs(robot, written_as(true, way, Drawn(slides=frozenset(SLIDES))))
    for name in SLIDES:  # all three, and one of them back again, is the same
        np.testing.assert_allclose(logs.recordings[0].positions[name], true.positions[name], atol=1e-12)


@pytest.mark.parametrize("order", [pytest.param(SLIDES, marks=pytest.mark.slow), SLIDES[::-1]])
def test_a_unit_and_a_leg_turned_round_are_told_whatever_the_order_of_columns(robot, bench, order):
    true = read_recording(bench)
    true = replace(true, positions={name: true.positions[name] for name in order})
    way = [Convention("q", "mm"), Convention(f"q.{SLIDES[1]}", "reversed")]
    logs = read_logs(robot, written_as(true, way, Drawn(slides=frozenset(SLIDES))))
    assert sorted(map(str, logs.conventions[0])) == sorted(map(str, way))


GANTRY = """<robot name="gantry"><link name="base"/>
{joints}<prup_pin version="1"><tool frame="z_part"/><actuated joints="x y z"/></prup_pin></robot>"""


def test_exchanged_columns_are_no_mirror(tmp_path):
    """A portal's positions look alike in either: nobody measures in left-handed axes, and both are told."""
    joints, before = "", "base"
    for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")):
        joints += f'''<link name="{name}_part"/><joint name="{name}" type="prismatic"><parent link="{before}"/>
        <child link="{name}_part"/><axis xyz="{axis}"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>\n'''
        before = f"{name}_part"
    (tmp_path / "gantry.urdf").write_text(GANTRY.format(joints=joints))
    portal, rng = load(tmp_path / "gantry.urdf"), np.random.default_rng(4)
    x, y, z = rng.uniform(0.1, 0.9, (3, 14))
    position = np.column_stack((x, y, z)) + 1e-5 * rng.normal(size=(14, 3))
    exchanged = Recording(time=np.arange(14.0), positions={"y": x, "x": y, "z": z}, position=position)
    logs = read_logs(portal, exchanged)
    assert [str(each) for each in logs.conventions[0]] == ["q=order:x,y,z"]
    (finding,) = logs.findings()
    assert "As good on this log: p=axes:y,x,z" in finding.statement
    np.testing.assert_array_equal(logs.recordings[0].positions["x"], x)


@pytest.mark.slow
def test_loads_tell_a_mirrored_tracker_from_exchanged_legs(tmp_path):
    """A Delta is its own mirror image, but the loads on it are not."""
    build.delta(
        base_radius=0.2, platform_radius=0.06, arm=0.25, rod=0.6, rod_spacing=0.08, height=0.55, motor_stiffness=4000,
        rod_diameter=0.012,
    ).save(tmp_path / "delta.urdf")  # fmt: skip
    delta, rng = load(tmp_path / "delta.urdf"), np.random.default_rng(5)
    motors = delta.mechanism.actuated
    q = np.repeat(rng.uniform(-0.2, 0.2, (6, 3)), 9, axis=0)
    loads = rng.normal(size=(54, 6)) * np.repeat([60.0, 0.0], 3)
    bench = Recording(np.arange(54.0), positions=dict(zip(motors, q.T, strict=True)), wrench=loads,
                      noise=Noise(position=2e-6, rotation=1e-5))  # fmt: skip
    seen = simulate(delta, bench, []).position + rng.normal(0, 2e-6, (54, 3))
    logs = read_logs(delta, replace(bench, position=seen * [1.0, -1.0, 1.0]))
    assert [str(each) for each in logs.conventions[0]] == ["p=axes:x,-y,z"]


def test_a_platform_of_slides_and_hinges_in_mm_and_degrees_is_told_by_both_units():
    """Neither unit alone closes a loop."""
    columns = Columns(q=("slide", "hinge"), slides=frozenset(["slide"]))
    both = next(readings(Recording(time=np.arange(2.0)), columns, "joints"))
    assert (Convention("q", "mm"), Convention("q", "deg")) in both


def test_the_point_of_a_sensor_is_found(robot, bench, tmp_path):
    logs = read_logs(robot, rewritten(bench, tmp_path, "moments about a sensor's point"))
    ((convention,),) = logs.conventions
    assert (convention.columns, convention.word) == ("wrench", "about")
    np.testing.assert_allclose(convention.argument, [0.03, -0.01, 0.11], atol=5e-3)


@pytest.mark.slow  # daily where all is as drawn
@pytest.mark.parametrize("seed", [6, 9])
def test_the_point_of_a_sensor_is_found_beside_a_module_that_is_softer(robot, tmp_path, seed):
    """It was sought with every module as drawn, and two centimetres off."""
    draw.write(draw.draw(seed, ["stiffness_changed"], level=60.0, poses=(8, 1)), tmp_path, tmp_path / "sealed", "bench")
    log = rewritten(tmp_path / "bench.csv", tmp_path, "moments about a sensor's point")
    ((convention,),) = read_logs(robot, log).conventions
    np.testing.assert_allclose(convention.argument, [0.03, -0.01, 0.11], atol=5e-4)


def test_two_readings_that_are_as_good_are_refused_with_both(robot, bench, monkeypatch):
    first, second = (Convention(f"q.{name}", "reversed") for name in SLIDES[:2])
    found = Evidence((first,), "positions", "m", 0.2, 1e-3, 0.9, ((second,),))
    monkeypatch.setattr(conventions, "_of_poses", lambda *_: found)
    with pytest.raises(InputError) as caught:
        read_logs(robot, read_recording(bench))
    told = str(caught.value)
    assert "--convention q.leg1_slide=reversed or --convention q.leg2_slide=reversed" in told
    assert "200 mm apart as it is written, and 1 mm as it is read" in told


def test_loads_are_asked_once_of_each_reading(robot, bench, tmp_path, monkeypatch):
    """They were asked once more of the reading that they had chosen."""
    asked = []
    monkeypatch.setattr(conventions, "_of_loads", lambda _, log: asked.append(log))
    read_logs(robot, rewritten(bench, tmp_path, "positions in mm"))
    assert len(asked) == 1


def test_recordings_that_are_written_alike_are_told_once(robot, bench, tmp_path):
    log = rewritten(bench, tmp_path, "positions in mm")
    half = len(log) // 2
    logs = read_logs(robot, [log.select(slice(0, half)), replace(log.select(slice(half, None)), path="b.csv")])
    assert len(logs.findings()) == 1
    assert [str(item) for own in logs.conventions for item in own] == ["p=mm", "p=mm"]


def test_a_robot_that_cannot_stand_as_the_log_has_it_is_told_no_distance(robot, bench, tmp_path):
    """Slides in mm lie beyond all loops: a thousand times the reach stood for that, and was told as metres."""
    (finding,) = read_logs(robot, rewritten(bench, tmp_path, "all joints in mm")).findings()
    assert "The robot cannot stand as it is written; measured and drawn positions are 0.0" in finding.statement
    assert set(finding.evidence) == {"of", "unit", "as_read"}


def test_what_nobody_recorded_of_one_joint_is_no_unit_of_the_others():
    """Without the elbow positions were nearer to the drawing in inches."""
    arm = load("ur5")
    rng = np.random.default_rng(4)
    q = np.array([0.3, -1.2, 1.4, -0.5, 0.6, 0.2]) + rng.uniform(-0.8, 0.8, (60, 6))
    names = arm.mechanism.actuated
    position = np.array([arm.pose_from_actuators(row).base_from_tool[:3, 3] for row in q])
    columns = {name: q[:, k] for k, name in enumerate(names) if name != "elbow_joint"}
    log = Recording(time=np.arange(60.0), positions=columns, position=position)
    assert read_logs(arm, log).conventions == ((),)


@pytest.mark.slow
@pytest.mark.parametrize("near", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["base", "tracker"])
def test_zeros_of_another_table_are_told_in_quarter_turns(near):
    """Two joints of an arm count as its table of Denavit and Hartenberg does, one of them the other way round."""
    arm, rng = load("ur5"), np.random.default_rng(3)
    names = list(arm.mechanism.actuated)
    q = rng.uniform(-1.2, 1.2, (30, len(names)))
    seen = np.array([arm.pose_from_actuators(row).base_from_tool for row in q])
    if not near:
        seen = placed(turned([0.4, -0.3, 2.1]), [3.0, -2.0, 0.8]) @ seen
    log = Recording(
        time=np.arange(30.0),
        positions=dict(zip(names, (q * [1, -1, 1, 1, 1, 1] + np.pi / 2 * np.array([0, 1, 3, 0, 0, 0])).T, strict=True)),
        position=seen[:, :3, 3] + 1e-3 * rng.normal(size=(30, 3)),
        rotation=np.array([rotation_log(each) for each in seen[:, :3, :3]]),
    )
    logs = read_logs(arm, as_written(log, "p r"))
    (evidence,) = logs.evidence[0]
    assert evidence.read < 0.01
    assert evidence.held > 0.99
    read = logs.recordings[0].actuator_positions(names)
    if near:  # a tracker may stand on its head: then other joints go the other way round as well
        assert [str(item) for item in evidence.conventions] == [
            "q.shoulder_lift_joint=reversed", "q.shoulder_lift_joint=quarter_turns:3", "q.elbow_joint=quarter_turns:3"
        ]  # fmt: skip
        np.testing.assert_allclose(read - read[0], q - q[0], atol=1e-9)


def planar(turn=0.0, columns=2):
    """Return a planar robot, and a log of it in which what lies across its plane was not measured."""
    bars, rng = load(str(Path(__file__).parents[2] / "examples" / "five_bar.urdf")), np.random.default_rng(8)
    names = list(bars.mechanism.actuated)
    home = np.array(list(bars.home.actuators.values()))
    around = np.kron(np.eye(2), turned([0.0, 0.0, turn]))
    q, wrench, seen = [], [], []
    for row in home + rng.uniform(-0.3, 0.3, (10, len(names))):
        pose = bars.pose_from_actuators(row)
        compliance = bars.compliance(pose)
        for fx, fy in ((0, 0), (30, 0), (60, 0), (0, 30), (0, -60)):
            load_ = np.array([fx, fy, 0, 0, 0, 0.0])
            at = pose.base_from_tool[:3, 3] + compliance.deflection(load_)[:3]
            q, wrench, seen = [*q, row], [*wrench, load_], [*seen, around[:3, :3] @ at + rng.normal(0, 2e-6, 3)]
    position = np.array(seen)
    position[:, columns:] = np.nan
    positions = dict(zip(names, np.array(q).T, strict=True))
    return bars, Recording(time=np.arange(50.0), positions=positions, wrench=np.array(wrench), position=position)


@pytest.mark.parametrize("turn", [0.0, pytest.param(0.5, marks=pytest.mark.slow)], ids=["base", "tracker"])
@pytest.mark.parametrize("said", ["p=mm", "wrench=reaction", "force=kN", "p=axes:y,-x,z"])
def test_a_planar_bench_that_measured_no_z_is_read_as_it_is_meant(said, turn):
    bars, true = planar(turn)
    if turn and said.startswith("p=axes"):
        pytest.skip("a tracker that stands elsewhere is as good a reason")
    columns, _, word = said.partition("=")
    (convention,) = [convention_of(columns, word, {})]
    logs = read_logs(bars, written_as(true, [convention], Drawn()))
    assert " + ".join(map(str, logs.conventions[0])) == said
    np.testing.assert_allclose(logs.recordings[0].position, true.position, atol=1e-12)
    assert [item.others for item in logs.evidence[0]] == [()]
    assert read_logs(bars, true).conventions == ((),)


@pytest.mark.slow
def test_what_no_reading_brings_near_is_refused_where_z_was_not_measured():
    bars, log = planar()
    with pytest.raises(InputError, match=r"positions of the tool are .* m apart.*p\.x p\.y \(expected") as caught:
        diagnose(bars, as_written(replace(log, position=300 * log.position), "q wrench"))
    assert "nan" not in str(caught.value)


@pytest.mark.slow  # daily of a planar bench
@pytest.mark.parametrize("missing", [0, 1, 2], ids=["x", "y", "z"])
def test_two_components_of_a_robot_in_space_tell_their_unit(robot, bench, missing):
    """Wherever the tracker stands, which is told from what was measured too."""
    log = read_recording(bench)
    position = 1e3 * (log.position @ turned([0.4, -0.3, 2.1]).T + [3.0, -2.0, 0.8])
    position[:, missing] = np.nan
    logs = read_logs(robot, replace(log, position=position, rotation=None))
    assert [str(item) for item in logs.conventions[0]] == ["p=mm"]


def test_exact_loads_in_a_plane_are_read_as_they_are():
    """No noise, no load across the plane: nothing may be divided by either."""
    five_bar, rng = build.five_bar(
        base=0.2, arm=0.25, rod=0.4, height=0.4, motor_stiffness=4000, arm_diameter=0.02, rod_diameter=0.015,
    ), np.random.default_rng(7)  # fmt: skip
    motors = five_bar.mechanism.actuated
    q = np.repeat(rng.uniform(-0.1, 0.1, (6, 2)), 6, axis=0)
    loads = np.zeros((36, 6))
    loads[:, :2] = rng.normal(0, 50.0, (36, 2))
    bench = Recording(np.arange(36.0), positions=dict(zip(motors, q.T, strict=True)), wrench=loads)
    logs = read_logs(five_bar, replace(bench, position=simulate(five_bar, bench, []).position))
    assert logs.conventions == ((),)
