"""Efforts and positions that are written otherwise than they say are told with the numbers that gave them away."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.diagnosis.efforts.belongs import check_efforts
from prup_pin.diagnosis.efforts.conventions import EffortReadings, conventions_of_efforts
from prup_pin.diagnosis.efforts.gains import gains_of
from prup_pin.diagnosis.efforts.shares import gains_of_efforts, sampled, tool_load_would_do
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.dynamics.inertial import point_mass
from prup_pin.errors import InputError
from prup_pin.recordings import (
    Convention,
    Drawn,
    Recording,
    Tolerances,
    convention_of,
    joints_of,
    read_as,
    read_recording,
    written_as,
)
from prup_pin.recordings.conventions import may_be_read
from prup_pin.simulation import drawn_for
from tests.reference.concealed import efforts
from tests.reference.concealed.elastic import draw_elastic, write
from tests.statics.build import RobotFile


@pytest.fixture(scope="module")
def ur5():
    return load("ur5").mechanism


@pytest.fixture(scope="module")
def recording(ur5):
    return moved(ur5)


@pytest.fixture(scope="module")
def arm(short_arm):
    return short_arm.mechanism


@pytest.fixture(scope="module")
def arm_log(arm):
    return moved(arm)


def moved(robot):
    """A motion whose efforts are the rigid robot's with a little friction and noise."""
    rng, time, count = np.random.default_rng(3), np.arange(2000) * 0.004, len(robot.actuated)
    home = np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0])[:count]
    q = home + sum(
        rng.uniform(0.2, 0.6, count) * np.sin(rate * time[:, None] + rng.uniform(0, 6, count)) for rate in (1.3, 2.9)
    )
    silent = Recording(time=time, positions=dict(zip(robot.actuated, q.T, strict=True)))
    motion = motion_of(silent, robot, robot.actuated)
    known = InMotion.of(robot, motion)
    tau = known.rigid + 0.8 * np.sign(motion.speed) + 0.1 * rng.normal(size=known.rigid.shape)
    return replace(silent.select(motion.rows), efforts=dict(zip(robot.actuated, tau.T, strict=True)))


def checked(ur5, recording):
    return [doubt.text for doubt in check_efforts(InMotion.of(ur5, motion_of(recording, ur5)))]


def told(ur5, recording):
    """What is told of a log, as it is declared."""
    found = conventions_of_efforts(ur5, recording)
    return [] if found is None else [str(item) for item in found.conventions]


def written(recording, *said):
    """A log as it is written in some conventions."""
    table = joints_of(recording)
    conventions = [convention_of(*text.split("=", 1), table) for text in said]
    return written_as(recording, conventions, drawn_for(load("ur5")))


def changed(recording, group, factors):
    columns = getattr(recording, group)
    return replace(recording, **{group: {name: values * factors.get(name, 1.0) for name, values in columns.items()}})


def test_efforts_of_the_robot_raise_no_doubt(ur5, recording):
    assert told(ur5, recording) == []
    assert checked(ur5, recording) == []


def test_efforts_and_positions_that_are_declared_to_be_as_written_are_read_in_no_other_way(arm, arm_log):
    table = joints_of(arm_log)
    for said in ("tau=N_mm", "q=deg"):
        group = said.partition("=")[0]
        log = replace(written(arm_log, said), conventions=(convention_of(group, "as_written", table),))
        found = conventions_of_efforts(arm, log)
        assert found is None or may_be_read(log, found.conventions)


EXCHANGED = "shoulder_pan_joint,elbow_joint,shoulder_lift_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint"
OPPOSITE = "wrist_3_joint,wrist_2_joint,wrist_1_joint,elbow_joint,shoulder_lift_joint,shoulder_pan_joint"
#: What is asked of six joints, among more readings than three have; all else is of three.
WHOLE = ("q.elbow_joint=deg",), ("tau=N_mm",), ("tau=reversed",), ("q=reversed", "tau=reversed")


@pytest.mark.parametrize(
    "said",
    [
        ("tau.elbow_joint=reversed",),
        ("q.shoulder_lift_joint=reversed",),
        ("q.elbow_joint=deg",),
        pytest.param(("tau.elbow_joint=reversed", "tau.wrist_1_joint=reversed"), marks=pytest.mark.slow),
        ("tau=reversed",),
        ("q=reversed", "tau=reversed"),
        ("q.elbow_joint=reversed", "tau.elbow_joint=reversed"),
        ("q=deg",),
        ("q=revolutions",),
        (f"tau=order:{EXCHANGED}",),
        pytest.param((f"q=order:{OPPOSITE}",), marks=pytest.mark.slow),
        ("q=order:elbow_joint,shoulder_lift_joint,shoulder_pan_joint",),  # of three joints
        pytest.param(("q.elbow_joint=plus:shoulder_lift_joint",), marks=pytest.mark.slow),
        ("q.elbow_joint=plus:shoulder_lift_joint", "tau.shoulder_lift_joint=minus:elbow_joint"),
        pytest.param(("q.elbow_joint=quarter_turns:1",), marks=pytest.mark.slow),
        ("q.shoulder_lift_joint=quarter_turns:1", "q.elbow_joint=quarter_turns:3"),
        ("tau=N_mm",),
        pytest.param(("tau=kgf_m",), marks=pytest.mark.slow),
        pytest.param(("q=gear:100", "tau=gear:100"), marks=pytest.mark.slow),
        pytest.param(("time=ms",), marks=pytest.mark.slow),
        ("time=ms", "q=deg"),
        pytest.param(
            ("time=ms", "q=deg", "q.shoulder_lift_joint=reversed", "tau.shoulder_lift_joint=reversed"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_written_otherwise_is_told_as_it_is_declared(ur5, recording, arm, arm_log, said):
    whole = len(said) == 4 or said in WHOLE or "wrist" in str(said)
    robot, log = (ur5, recording) if whole else (arm, arm_log)
    assert told(robot, written(log, *said)) == list(said)


@pytest.mark.slow  # daily beside friction alone
def test_where_joints_count_from_is_told_beside_a_wrist_that_nothing_explains(ur5, recording):
    said = ("q.shoulder_lift_joint=quarter_turns:1", "q.elbow_joint=quarter_turns:3")
    torque = recording.efforts["wrist_3_joint"]
    odd = np.std(torque) * np.sin(np.arange(len(torque)) / 40.0)
    log = replace(recording, efforts={**recording.efforts, "wrist_3_joint": 0.05 * torque + odd})
    assert told(ur5, written(log, *said)) == list(said)


@pytest.mark.slow
def test_gears_are_told_of_efforts_of_which_they_leave_no_more_than_the_noise(arm, arm_log):
    motion = motion_of(arm_log, arm)
    exact = dict(zip(arm.actuated, InMotion.of(arm, motion).rigid.T, strict=True))
    log = written(replace(arm_log.select(motion.rows), efforts=exact), "q=gear:100", "tau=gear:100")
    assert told(arm, replace(log, noise=replace(log.noise, effort=0.3))) == ["q=gear:100", "tau=gear:100"]


@pytest.mark.slow
def test_what_a_motor_of_two_joints_leaves_at_both_is_no_sum_of_efforts(ur5, recording):
    """Its friction cancels in the sum, and with it what no friction of the model explains."""
    motion = motion_of(recording, ur5)
    speed = motion.speed[:, motion.names.index("wrist_3_joint")] - motion.speed[:, motion.names.index("wrist_2_joint")]
    rubs = 1.5 * np.sign(speed) * (1 + 2 * np.exp(-((speed / 0.3) ** 2)))
    log = recording.select(motion.rows)
    felt = {"wrist_3_joint": rubs, "wrist_2_joint": -rubs}
    assert told(ur5, replace(log, efforts={name: tau + felt.get(name, 0.0) for name, tau in log.efforts.items()})) == []


def slow_log(ur5, turned, friction=0.0):
    """A motion of which noise of the positions makes more of the wrists than all that they give, but friction."""
    rng, time = np.random.default_rng(6), np.arange(3000) * 0.004
    home = np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0])
    q = home + 0.15 * np.sin(0.5 * time[:, None] + rng.uniform(0, 6, 6))
    motion = motion_of(Recording(time=time, positions=dict(zip(ur5.actuated, q.T, strict=True))), ur5, ur5.actuated)
    tau = InMotion.of(ur5, motion).rigid + friction * (np.sign(motion.speed) + 20 * motion.speed)
    tau = tau * [-1.0 if name == turned else 1.0 for name in ur5.actuated] + 0.05 * rng.normal(size=tau.shape)
    q = q + 2e-4 * rng.normal(size=q.shape)
    whole = Recording(time=time, positions=dict(zip(ur5.actuated, q.T, strict=True)))
    return replace(whole.select(motion.rows), efforts=dict(zip(ur5.actuated, tau.T, strict=True)))


@pytest.mark.slow  # daily beside friction, which tells which way it is
@pytest.mark.parametrize("turned", ["shoulder_lift_joint", "elbow_joint", None])
def test_a_sign_is_told_of_a_motion_so_slow_and_small_that_most_drives_say_nothing(ur5, turned):
    log = slow_log(ur5, turned)
    assert told(ur5, log) == ([f"tau.{turned}=reversed"] if turned else [])


def rubbing(ur5, recording):
    """The same motion where dry friction is most of what the last wrists need."""
    motion = motion_of(recording, ur5)
    tau = dict(recording.select(motion.rows).efforts)
    for column, name in enumerate(ur5.actuated):
        if name in ("wrist_2_joint", "wrist_3_joint"):
            tau[name] = tau[name] + 6.0 * np.sign(motion.speed[:, column])
    return replace(recording.select(motion.rows), efforts=tau)


def test_friction_takes_energy_and_so_tells_the_sign_of_an_effort(ur5, recording):
    log = rubbing(ur5, recording)
    assert told(ur5, log) == []
    assert told(ur5, written(log, "tau.shoulder_lift_joint=reversed")) == ["tau.shoulder_lift_joint=reversed"]
    assert told(ur5, written(log, "tau.wrist_2_joint=reversed")) == ["tau.wrist_2_joint=reversed"]


def far_from_its_drawing(ur5, recording, turned):
    """A log of a robot whose masses are off by tens of per cent; rotors and friction are most of what drives give."""
    rng, motion = np.random.default_rng(11), motion_of(recording, ur5)
    bodies = [np.exp(0.7 * rng.normal() - 0.7) * body.toDynamicParameters() for body in list(ur5.model.inertias)[1:]]
    tau = np.einsum("njbp,bp->nj", InMotion.of(ur5, motion).regressor, np.array(bodies))
    tau += [15, 25, 15, 5, 4, 3] * np.sign(motion.speed) + [30, 40, 25, 6, 5, 4] * motion.speed
    tau += [12, 15, 8, 1, 0.8, 0.8] * motion.acceleration + 0.1 * rng.normal(size=tau.shape)
    tau *= [-1.0 if name in turned else 1.0 for name in ur5.actuated]
    return replace(recording.select(motion.rows), efforts=dict(zip(ur5.actuated, tau.T, strict=True)))


@pytest.mark.parametrize("turned", [("elbow_joint",), ("shoulder_lift_joint", "wrist_2_joint"), ()])
def test_signs_are_told_of_a_robot_that_is_far_from_its_drawing(ur5, recording, turned):
    assert told(ur5, far_from_its_drawing(ur5, recording, turned)) == [f"tau.{name}=reversed" for name in turned]


@pytest.mark.slow
def test_signs_are_told_beside_a_unit_that_nobody_knows(ur5, recording):
    log = far_from_its_drawing(ur5, recording, ("elbow_joint",))
    amperes = {name: 7 * tau for name, tau in log.efforts.items()}
    log = replace(log, efforts=amperes, tolerances=Tolerances(effort_gain=1.0))
    assert told(ur5, log) == ["tau.elbow_joint=reversed"]


@pytest.mark.slow
def test_of_a_wrist_that_rubs_and_little_else_both_signs_are_told(ur5, recording):
    found = conventions_of_efforts(ur5, far_from_its_drawing(ur5, recording, ("wrist_3_joint",)))
    readings = [[str(item) for item in reading] for reading in (found.conventions, *found.others)]
    assert sorted(readings) == [["q.wrist_3_joint=reversed"], ["tau.wrist_3_joint=reversed"]]


@pytest.mark.slow
def test_of_friction_alone_nobody_can_tell_whether_effort_or_position_is_turned_round(ur5):
    log = slow_log(ur5, "wrist_3_joint", friction=3.0)
    with pytest.raises(InputError, match="Two readings are as good") as told_so:
        read_logs(load("ur5"), log)
    assert all(f"--convention {group}.wrist_3_joint=reversed" in str(told_so.value) for group in ("q", "tau"))


@pytest.mark.slow
@pytest.mark.parametrize("turned", [None, "elbow_joint"])
def test_noise_of_positions_is_not_less_motion_in_another_unit(ur5, turned):
    """In degrees a joint would need next to nothing, and what positions scatter by would be no effort."""
    assert told(ur5, slow_log(ur5, turned, friction=1.0)) == ([f"tau.{turned}=reversed"] if turned else [])


@pytest.mark.slow
def test_nearly_equal_gains_of_all_drives_are_a_unit_that_is_told_once(arm, arm_log):
    """A gain that was read as exact was told again as six other ones, and neither was what the log reports."""
    log = written(arm_log, "tau=gain:0.09")
    readings = EffortReadings.of(arm, log)
    (found,) = readings.found.conventions  # gains that are told beside masses included
    assert str(found).startswith("tau=gain:")
    assert found.argument[0] == pytest.approx(0.09, rel=0.05)
    assert readings.evidence() is None
    declared = replace(log, conventions=(convention_of("tau", "gain:1", joints_of(log)),))
    assert EffortReadings.of(arm, declared).found.conventions == ()  # no unit is looked for
    assert gains_of(InMotion.of(arm, motion_of(log, arm)), {}).gains[:3] == pytest.approx(np.full(3, 0.09), rel=0.05)


@pytest.mark.slow
def test_what_else_is_read_otherwise_is_told_without_the_gain_beside_it(arm, arm_log):
    log = written(arm_log, "tau=gain:0.09", "tau.elbow_joint=reversed")
    readings = EffortReadings.of(arm, log)
    assert {item.word for item in readings.found.conventions} == {"gain", "reversed"}
    found = readings.evidence()
    assert [str(item) for item in found.conventions] == ["tau.elbow_joint=reversed"]
    plain = conventions_of_efforts(arm, written(arm_log, "tau.elbow_joint=reversed"))
    assert found.written == pytest.approx(plain.written, rel=0.05)  # both as they are read in N m


def test_how_far_it_is_off_is_told_with_how_to_declare_it(recording):
    logs = read_logs(load("ur5"), written(recording, "tau.elbow_joint=reversed"))
    (finding,) = logs.findings()
    assert (finding.physics, finding.location) == ("log_convention", "elbow_joint")
    times = finding.evidence["as_written"] / finding.evidence["as_read"]
    assert finding.statement.endswith(
        "tau.elbow_joint with the opposite sign. As it is written, the robot file leaves "
        f"{times:.3g} times as much of efforts as when it is read so"
    )
    assert "--convention tau.elbow_joint=reversed" in finding.remedy  # behind what was found
    assert '"conventions": {"tau.elbow_joint": "reversed"}' in finding.remedy
    assert logs.statements[0].index(finding.statement) < logs.statements[0].index('"conventions"')
    assert finding.evidence["as_read"] < 0.5 * finding.evidence["as_written"]
    np.testing.assert_allclose(logs.recordings[0].efforts["elbow_joint"], recording.efforts["elbow_joint"])


def test_what_is_declared_is_told_no_more(recording):
    log = written(recording, "tau=reversed")
    declared = replace(log, conventions=(convention_of("tau", "reversed", joints_of(log)),))
    logs = read_logs(load("ur5"), declared)
    assert logs.findings() == ()
    np.testing.assert_allclose(logs.recordings[0].efforts["elbow_joint"], recording.efforts["elbow_joint"])


@pytest.mark.slow
def test_a_robot_that_hangs_from_the_ceiling_has_no_sign_turned_round(ur5, recording):
    """Its weight pulls at the shoulder and the elbow as if both efforts were told the other way round."""
    known = InMotion.of(ur5, motion_of(recording, ur5))
    other = dict(zip(known.driven, known.rigid_under(-2 * ur5.gravity).T, strict=True))
    hung = {name: values + other[name] for name, values in recording.efforts.items()}
    assert told(ur5, replace(recording, efforts=hung)) == []
    both = {"shoulder_lift_joint": -1, "wrist_2_joint": -1}
    assert told(ur5, changed(recording, "efforts", both)) == [
        "tau.shoulder_lift_joint=reversed",
        "tau.wrist_2_joint=reversed",
    ]


#: What drives of an arm report in A per N m.
AMPERES = (1 / 12, 1 / 12, 1 / 12, 1 / 8, 1 / 8, 1 / 8)


def test_drives_in_units_of_their_own_are_told_by_their_sizes(ur5, recording):
    (doubt,) = checked(ur5, changed(recording, "efforts", dict(zip(recording.efforts, AMPERES, strict=True))))
    assert "tau.elbow_joint 0.08" in doubt
    assert "are they in per cent or A?" in doubt
    assert '"tolerances": {"effort_gain": 1} in the JSON file' in doubt


@pytest.mark.slow
def test_a_sign_is_told_of_drives_in_units_of_their_own(ur5, recording):
    amperes = dict(zip(recording.efforts, AMPERES, strict=True))
    turned = changed(recording, "efforts", amperes | {"elbow_joint": -1 / 12})
    assert "tau.elbow_joint=reversed" in told(ur5, turned)


@pytest.mark.slow
def test_signs_of_motor_currents_are_told_where_wrists_report_next_to_nothing(ur5, recording):
    """Amperes by constants of either sign; two drives report little but their resolution."""
    constants = dict(zip(ur5.actuated, [0.07, 0.05, -0.11, -0.1, 0.001, 0.001], strict=True))
    currents = changed(recording, "efforts", constants)
    weak = {name: np.round(tau, 3) for name, tau in currents.efforts.items() if abs(constants[name]) < 0.01}
    currents = replace(currents, efforts=currents.efforts | weak)
    assert told(ur5, currents) == ["tau.elbow_joint=reversed", "tau.wrist_1_joint=reversed"]


@pytest.fixture(scope="module")
def sprung(recording):
    """The same motion beside a spring that nothing explains, and with a wrist that does nothing."""
    tau, turn = dict(recording.efforts), recording.positions["shoulder_pan_joint"]
    tau["shoulder_pan_joint"] = tau["shoulder_pan_joint"] - 60.0 * np.cos(turn + 0.15)
    tau["wrist_3_joint"] = np.random.default_rng(1).normal(size=len(turn))
    return recording.with_measurements(efforts=tau)


@pytest.mark.slow
def test_a_spring_and_a_wrist_that_does_nothing_speak_for_no_other_unit(ur5, sprung):
    assert told(ur5, sprung) == []


@pytest.mark.slow  # daily beside friction alone
def test_a_unit_of_all_positions_is_told_beside_a_spring_that_hides_how_little_it_leaves(ur5, sprung):
    """Most joints make sense so."""
    assert told(ur5, changed(sprung, "positions", dict.fromkeys(ur5.actuated, 0.5 / np.pi))) == ["q=revolutions"]


@pytest.mark.slow
def test_positions_of_motors_are_told_by_the_limits_of_the_joints(arm, arm_log):
    names = list(arm_log.positions)
    wrong = changed(arm_log, "positions", dict(zip(names, (77.0, 141.0, 53.0), strict=True)))
    wrong = changed(wrong, "efforts", dict.fromkeys(names, 0.01))
    assert told(arm, wrong) == []
    with pytest.raises(InputError, match=r"reaches \d+.*allows -6\.283 to 6\.283 rad.*motor before its gear"):
        checked(arm, wrong)


def test_a_position_that_never_changes_while_its_speed_does_is_told(ur5, recording):
    positions = dict(recording.positions)
    speed = np.gradient(positions["elbow_joint"], recording.time)
    positions["elbow_joint"] = np.full(len(recording), 1.0)
    wrong = replace(recording, positions=positions, velocities={"elbow_joint": speed})
    with pytest.raises(InputError, match=r"q\.elbow_joint never changes, but qd\.elbow_joint"):
        checked(ur5, wrong)


@pytest.mark.slow
def test_a_larger_effort_added_to_a_noisy_one_leaves_no_less(tmp_path):
    """A faultless arm whose log is late and of few bits: three wrists were told to count together."""
    write(draw_elastic(230000, "ur10"), tmp_path, tmp_path, "arm")
    recording = read_recording(tmp_path / "arm.csv")
    assert told(load("ur10").mechanism, recording) == []


@pytest.mark.slow  # trials of what is daily of friction that this file makes
@pytest.mark.parametrize(("seed", "robot"), [(270002, "ur5"), (290000, "xarm7")])
def test_friction_is_no_other_way_to_write_a_log(tmp_path, seed, robot):
    """A motor that drives both last joints of a wrist; an arm of which everything is off, and shaken: in degrees it
    would hardly move, and a constant is most of what is left."""
    write(draw_elastic(seed, robot), tmp_path, tmp_path, "arm")
    assert told(load(robot).mechanism, read_recording(tmp_path / "arm.csv")) == []


@pytest.fixture(scope="module")
def loaded_log(ur5, recording):
    """The same motion with 4.5 kg in the tool and much friction: what bears a load gives nearly twice as much."""
    rng = np.random.default_rng(8)
    known = InMotion.of(ur5, motion_of(recording, ur5))
    held = known.regressor[:, :, ur5.tool.joint - 1] @ point_mass(4.5, ur5.tool.placement[:3, 3] + [0.01, 0.0, 0.05])
    friction = [9, 9, 7, 1.5, 1.3, 1] * np.tanh(known.motion.speed / 0.01) + [6, 7, 5, 1, 0.8, 0.6] * known.motion.speed
    tau = known.rigid + held + friction + 0.1 * rng.normal(size=held.shape)
    return replace(recording.select(known.motion.rows), efforts=dict(zip(ur5.actuated, tau.T, strict=True)))


@pytest.mark.slow  # daily without a load
@pytest.mark.parametrize("joint", ["shoulder_lift_joint", "elbow_joint"])
def test_a_joint_that_counts_the_other_way_round_is_found_under_a_load(ur5, loaded_log, joint):
    """The load leaves most of the wrists' efforts whichever way columns are read."""
    turned = {f"q.{joint}=reversed", f"tau.{joint}=reversed"}
    columns = [
        {name: (-1 if name == joint else 1) * values for name, values in table.items()}
        for table in (loaded_log.positions, loaded_log.efforts)
    ]
    log = replace(loaded_log, positions=columns[0], efforts=columns[1], velocities={}, accelerations={})
    assert set(told(ur5, log)) == turned


@pytest.mark.slow  # daily with its position turned round as well
@pytest.mark.parametrize("joint", ["elbow_joint", "wrist_1_joint"])
def test_an_effort_that_is_turned_round_is_found_under_a_load(ur5, loaded_log, joint):
    efforts = {name: (-1 if name == joint else 1) * tau for name, tau in loaded_log.efforts.items()}
    assert told(ur5, replace(loaded_log, efforts=efforts)) == [f"tau.{joint}=reversed"]


def test_a_load_in_the_tool_is_no_other_unit_of_all_efforts(ur5, loaded_log):
    at = InMotion.of(ur5, motion_of(loaded_log, ur5))
    rows, motion, efforts_there = sampled(at)
    assert np.median(list(gains_of_efforts(motion, efforts_there, at.rigid[rows]).values())) > 1.6
    assert tool_load_would_do(at, dict.fromkeys(ur5.actuated, 1.8))
    assert checked(ur5, loaded_log) == []
    other = written(loaded_log, "tau=gain:0.1")
    at = InMotion.of(ur5, motion_of(other, ur5))
    assert not tool_load_would_do(at, dict.fromkeys(ur5.actuated, 0.15))


@pytest.mark.slow
def test_nothing_is_told_of_a_log_with_a_load_in_the_tool(ur5, loaded_log):
    assert told(ur5, loaded_log) == []


@pytest.mark.parametrize("gain", [0.03, 0.105, 1.0, 2.0, 1000.0])
def test_what_a_lone_drive_reports_per_newton_is_told_without_the_name_of_a_unit(gain, tmp_path):
    """Currents of a slide were told as positions in inches, or as kilogram-force where they came near."""
    file = RobotFile()
    file.link("carriage", 20.0)
    file.held("slide", "base", "carriage", axis=(1, 0, 0))
    time, rng = np.arange(3000) * 0.005, np.random.default_rng(1)
    rates = rng.uniform(1, 6, (4, 1))
    q = (0.1 / rates * np.sin(rates * time + rng.uniform(0, 6, (4, 1)))).sum(axis=0)
    speed = np.gradient(q, time)
    force = 21 * np.gradient(speed, time) + 3 * speed + 2 * np.sign(speed) + rng.normal(0, 0.3, len(q))
    log = Recording(time=time, positions={"slide": q}, efforts={"slide": gain * force})
    found = conventions_of_efforts(file.load(tmp_path, "carriage").mechanism, log)
    told = found.conventions if found else ()
    assert [item.word for item in told] == ([] if 1 / 3 < gain < 100 else ["gain"])
    assert all(item.argument[0] == pytest.approx(gain, rel=0.1) for item in told)


def test_a_third_of_a_second_at_one_posture_does_not_say_how_it_is_written(ur5):
    """As many rows as there may be tell no more than their band holds; of the same for long the signs are told."""
    rng = np.random.default_rng(4)
    signs = np.array([1.0, -1.0, -1.0, 1.0, 1.0, 1.0])

    def at_rest(lasting):
        time = np.arange(0.0, lasting, 0.01)
        settling = 0.006 * np.exp(-time / 0.04)[:, None]
        q = np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0]) + settling + 1e-5 * rng.normal(size=(len(time), 6))
        silent = Recording(time=time, positions=dict(zip(ur5.actuated, q.T, strict=True)))
        motion = motion_of(silent, ur5, ur5.actuated)
        tau = signs * InMotion.of(ur5, motion).rigid + 0.1 * rng.normal(size=(len(motion), 6))
        return replace(silent.select(motion.rows), efforts=dict(zip(ur5.actuated, tau.T, strict=True)))

    assert told(ur5, at_rest(0.32)) == []
    assert told(ur5, at_rest(6.0)) == ["tau.shoulder_lift_joint=reversed", "tau.elbow_joint=reversed"]


@pytest.mark.slow
def test_drives_in_units_of_their_own_make_more_sense_of_a_log_than_a_zero_elsewhere(tmp_path):
    """Beside a rotor's inertia at the base, which nothing explains before laws do, a quarter of a turn was told."""
    mechanism = load("xarm7").mechanism
    efforts.write(
        efforts.draw_efforts(861051, "xarm7", ["rotor_inertia"], (5.0, 40.0)), tmp_path, tmp_path / "sealed", "device"
    )
    log = read_recording(tmp_path / "device.csv")
    constants = (0.083, 0.08, 0.11, 0.14, 0.12, 0.15, 0.13)
    amperes = changed(log, "efforts", dict(zip(mechanism.actuated, constants, strict=True)))
    assert told(mechanism, amperes) == []


@pytest.fixture(scope="module")
def five_bar(once):
    """A loop in a vertical plane with a faultless log of its motion, and its robot."""

    def drawn(out):
        efforts.write(efforts.draw_efforts(4, "five_bar", [], (5.0, 40.0)), out, out / "sealed", "device")
        return read_recording(out / "device.csv")

    return load(efforts.ROBOTS / "weighty_five_bar" / "weighty_five_bar.urdf").mechanism, once("five_bar_log", drawn)


@pytest.mark.parametrize(
    "said",
    [
        pytest.param((), marks=pytest.mark.slow),
        pytest.param(("q=deg",), marks=pytest.mark.slow),
        pytest.param(("q=gear:50",), marks=pytest.mark.slow),
        pytest.param(("q=order:{1},{0}", "tau=order:{1},{0}"), marks=pytest.mark.slow),
        ("q.{1}=reversed", "tau.{1}=reversed"),
    ],
)
def test_a_loop_that_closes_otherwise_or_not_at_all_is_read_so_that_it_does(five_bar, said):
    mechanism, log = five_bar
    said = [text.format(*mechanism.actuated) for text in said]
    changed_log = written_as(log, [convention_of(*text.split("=", 1), joints_of(log)) for text in said], Drawn())
    mirrored = ["q=reversed", "tau=reversed"] if "order" in "".join(said) else said  # its own mirror image
    assert sorted(told(mechanism, changed_log)) in (sorted(said), mirrored)


def test_a_larger_effort_beside_a_noisy_one_makes_no_log_likelier(ur5, recording):
    """What is left counts in the units and sums in which it was written, not as a share of what was added."""
    log = EffortReadings.of(ur5, recording)
    noisy, large = "wrist_3_joint", "shoulder_lift_joint"
    noise = np.random.default_rng(2).normal(size=len(log.log)) * np.r_[np.ones(len(log.motion)), np.zeros(6)]
    log.log = replace(log.log, efforts=log.log.efforts | {noisy: noise + log.log.efforts[noisy]})
    added = read_as(log.log, [Convention(f"tau.{noisy}", "plus", (large,))], Drawn())
    assert log.unlikely(added).nats > log.unlikely(log.log).nats
    in_other_units = read_as(log.log, [Convention("tau", "gain", (0.1,))], Drawn())
    assert log.unlikely(in_other_units).nats > log.unlikely(log.log).nats


def test_a_joint_that_is_read_to_be_faster_rubs_as_dryly(ur5, recording):
    """Below which speed a joint stands was kept in turns of the motor, and dry friction was none of the joint's."""
    log = written(recording, "q=gear:100")
    read = EffortReadings.of(ur5, log)
    motion, _, _ = read._read(read_as(read.log, [Convention("q", "gear", (100.0,))], Drawn()))
    np.testing.assert_allclose(motion.slow, read.motion.slow / 100, rtol=1e-6)
