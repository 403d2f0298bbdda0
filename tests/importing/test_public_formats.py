"""Tables as cameras, trackers, controllers and data sets write them: from the file to the recording."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import prup_pin
from prup_pin.errors import RecordingFileError
from prup_pin.imports import convert, guess, read_log, read_logs, read_map
from prup_pin.imports.log import told_apart

from ..reference.concealed.markers import ARMS
from ..reference.concealed.sagging import Sagging
from . import logs
from .logs import assert_motion, converted

T = logs.T[:400]
Q, QD, TAU = logs.motion(T)
AS_PUBLISHED = [2, 1, 0, 3, 4, 5]  # of the joints, by a driver's joint_states


def imported(tmp_path, mechanism, *paths, doubts=0):
    """Return the recording that the guessed map makes of logs."""
    log = read_logs(paths)
    made = guess(log, mechanism, "robot")
    assert len(made.doubts) == doubts, made.doubts
    return converted(tmp_path, made.text, log, mechanism)


# ---- controllers ------------------------------------------------------------------------------------------------
def in_order(form, values, order=AS_PUBLISHED):
    return {form.format(k): values[:, joint] for k, joint in enumerate(order)}


@pytest.mark.parametrize("name", ["name_{}", "field.name{}"])
def test_joints_that_a_column_of_words_calls_by_number_are_these_joints(tmp_path, ur5, name):
    """The driver's order is not the robot's: numbers alone would exchange shoulder and elbow without a word."""
    dot = name.replace("name", "{}").rpartition("{}")[0]
    columns = {"time": T} | {name.format(k): [logs.JOINTS[j]] * len(T) for k, j in enumerate(AS_PUBLISHED)}
    for kind, values in (("position", Q), ("velocity", QD), ("effort", TAU)):
        columns |= in_order(dot.format(kind) + "{}", values)
    path = logs.csv(tmp_path / "joint_states.csv", columns)
    assert_motion(imported(tmp_path, ur5, path).recording, "q", "qd", "tau")


GERMAN = {"Zeit [ms]": 1e3 * T} | logs.numbered("Achse {} Istposition [°]", np.degrees(Q))
GERMAN |= logs.numbered("Achse {} Sollposition [°]", np.degrees(Q) + 1) | logs.numbered("Achse {} Drehmoment [Nm]", TAU)
KUKA = {"IPOC": 1e3 * T} | logs.numbered("ASPos.A{} [deg]", np.degrees(Q) + 1)
KUKA |= logs.numbered("AIPos.A{} [deg]", np.degrees(Q)) | logs.numbered("Torque.A{}", TAU)
NIST = {"ROBOT_TIME": 90 + T} | logs.numbered("ROBOT_TARGET_JOINT_POSITIONS (J{})", Q + 1)
NIST |= logs.numbered("ROBOT_ACTUAL_JOINT_POSITIONS (J{})", Q) | logs.numbered("ROBOT_ACTUAL_JOINT_TORQUES (J{})", TAU)


@pytest.mark.parametrize("columns", [GERMAN, KUKA, NIST], ids=["German", "KUKA RSI", "NIST UR5"])
def test_what_is_measured_is_told_from_what_was_wanted(tmp_path, ur5, columns):
    path = logs.csv(tmp_path / "log.csv", columns, separator=";", decimal=",")
    assert_motion(imported(tmp_path, ur5, path).recording, "q", "tau")


def test_a_frame_of_pandas_with_names_of_two_levels(tmp_path, ur5):
    first, second = [""], [""]
    for kind in ("q", "dq", "tau"):
        first += [kind] * 6
        second += logs.JOINTS
    lines = [",".join(first), ",".join(second), "time" + "," * 18]
    lines += [",".join(f"{x:.10g}" for x in row) for row in np.column_stack([T, Q, QD, TAU])]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    assert_motion(imported(tmp_path, ur5, tmp_path / "log.csv").recording, "q", "qd", "tau")


def test_a_table_without_names_is_blocks_of_joints(tmp_path, ur5):
    np.savetxt(tmp_path / "log.csv", np.column_stack([T, Q, QD, TAU]), "%.10g", ",")
    done = imported(tmp_path, ur5, tmp_path / "log.csv", doubts=18)
    assert "the columns have no names: taken as q, qd, tau of 6 joints each" in (tmp_path / "map.yaml").read_text()
    assert_motion(done.recording, "q", "qd", "tau")


@pytest.mark.parametrize(
    ("wrists", "doubts"), [(("wristA", "wristB", "wristC"), 6), (("wrist1", "wrist2", "wrist3"), 3)]
)
def test_joints_that_the_log_calls_otherwise_go_in_order_and_say_so(tmp_path, ur5, wrists, doubts):
    called = ("base", "shoulder", "elbow", *wrists)
    columns = {"t": T} | {f"actual {name} position": Q[:, k] for k, name in enumerate(called)}
    columns |= {f"target {name} position": 2 * Q[:, k] for k, name in enumerate(called)}
    done = imported(tmp_path, ur5, logs.csv(tmp_path / "log.csv", columns), doubts=doubts)
    assert "which the log calls otherwise" in (tmp_path / "map.yaml").read_text()
    assert_motion(done.recording, "q")


def test_a_floating_base_has_no_column(tmp_path):
    link = "<link name='{}'/>"
    joint = "<joint name='{0}' type='{1}'><parent link='{2}'/><child link='{3}'/>{4}</joint>"
    limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>"
    parts = [*(link.format(name) for name in "wbcd"), joint.format("free", "floating", "w", "b", "")]
    parts += [joint.format("one", "revolute", "b", "c", limit), joint.format("two", "revolute", "c", "d", limit)]
    (tmp_path / "robot.urdf").write_text(f"<robot name='r'>{''.join(parts)}</robot>")
    robot = prup_pin.load(tmp_path / "robot.urdf").mechanism
    path = logs.csv(tmp_path / "log.csv", {"t": T, "q1": 0.1 * T, "q2": 0.2 * T})
    assert list(imported(tmp_path, robot, path).recording.positions) == ["one", "two"]


def test_lists_in_brackets_are_taken_apart(tmp_path, ur5):
    def lists(values, comma):
        return ['"[' + comma.join(f"{x:.9g}" for x in row) + ']"' for row in values]

    columns = {"t": T, "joint_positions": lists(Q, ", "), "torques": lists(TAU, " "), "mode": ["auto"] * len(T)}
    columns["torques"][7] = ""
    done = imported(tmp_path, ur5, logs.csv(tmp_path / "log.csv", columns))
    assert np.isnan(done.recording.efforts["elbow_joint"]).nonzero()[0].tolist() == [7]
    assert np.nanmax(np.abs(done.recording.efforts["elbow_joint"] - TAU[:, 2])) < 1e-6
    assert_motion(done.recording, "q")


# ---- clocks -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "form",
    ["%Y-%m-%dT%H:%M:%S.%fZ", "%d.%m.%Y %H:%M:%S,%f", "%m/%d/%Y %H:%M:%S.%f", "%H:%M:%S.%f", "%Y-%m-%d %I:%M:%S.%f %p"],
)
def test_dates_and_times_of_day_past_midnight(tmp_path, ur5, form):
    begin = datetime(2024, 2, 28, 23, 59, 59)
    stamps = [(begin + timedelta(milliseconds=4 * k)).strftime(form) for k in range(len(T))]
    path = logs.csv(tmp_path / "log.csv", {"stamp": stamps} | logs.numbered("q{}", Q), separator=";")
    recording = imported(tmp_path, ur5, path).recording
    assert np.abs(recording.time - T).max() < 1e-6
    assert_motion(recording, "q")


def test_rows_that_came_late_are_put_in_their_place_and_a_clock_that_starts_again_begins_a_run(tmp_path, ur5):
    swapped = np.arange(400)
    swapped[[100, 101]] = [101, 100]
    path = logs.csv(tmp_path / "late.csv", {"t": T[swapped]} | logs.numbered("q{}", Q[swapped]))
    late = imported(tmp_path, ur5, path)
    assert "1 rows came late" in late.remarks[0]
    assert_motion(late.recording, "q")
    path = logs.csv(tmp_path / "again.csv", {"t": np.r_[T[:150], 7 + T[:250]] % 7} | logs.numbered("q{}", Q))
    again = imported(tmp_path, ur5, path)
    assert "starts again 1 times: 2 runs" in again.remarks[0]
    assert again.recording.run.tolist() == [0] * 150 + [1] * 250
    assert np.abs(again.recording.time - np.r_[T[:150], T[:250]]).max() < 1e-9
    assert_motion(again.recording, "q")


def test_a_log_without_a_time_takes_a_rate(tmp_path, ur5):
    path = logs.csv(tmp_path / "log.csv", {"Point": np.arange(400)} | logs.numbered("q{}", Q))
    assert np.array_equal(imported(tmp_path, ur5, path, doubts=1).recording.time, np.arange(400))
    text = (tmp_path / "map.yaml").read_text()
    assert "rate: 1}  # CHECK: no column is a time" in text
    log = read_log(path)
    (tmp_path / "map.yaml").write_text(text.replace("rate: 1", "rate: 250"))
    done = convert(log, read_map(tmp_path / "map.yaml", log, ur5), ur5)
    assert np.abs(done.recording.time - T).max() < 1e-12
    (tmp_path / "map.yaml").write_text(text.replace("rate: 1", "rate: 0"))
    with pytest.raises(RecordingFileError, match="time: table: rate: expected a number of rows a second, above 0"):
        read_map(tmp_path / "map.yaml", log, ur5)


def test_cells_as_spreadsheets_leave_them_are_empty(tmp_path):
    (tmp_path / "log.csv").write_text("t,q1\n0,1\n1,#N/A\n2,#DIV/0!\n3,-nan(ind)\n4,5\n")
    (stream,) = read_log(tmp_path / "log.csv").streams
    assert np.array_equal(stream.columns["q1"], [1, np.nan, np.nan, np.nan, 5], equal_nan=True)


# ---- cameras and trackers ---------------------------------------------------------------------------------------
HALL = Rotation.from_euler("xyz", [-1.6, 0.1, 0.4])


def seen(t=T, marker="tool0"):
    """Return a frame's place (N, 3) [m] in the camera's axes, by kinematics that share no code with the package."""
    place = Sagging(ARMS["ur5"].chain(), "tool0").seen(logs.motion(t)[0], (marker,), t)
    return HALL.apply(place.reshape(len(t), 3)) + np.array([0.3, 1.2, -0.4])


def body():
    """Return the orientations of the tool's frame in the camera's axes, from three targets beside it."""
    arms = (Sagging(ARMS["ur5"].chain(), "tool0", (), {f"tool0.t{axis}": 0.1}) for axis in "xyz")
    axes = [arm.seen(Q, ("tool0",), T).reshape(-1, 3) for arm in arms]
    home = HALL.inv().apply(seen() - np.array([0.3, 1.2, -0.4]))
    return HALL * Rotation.from_matrix(np.stack([end - home for end in axes], axis=2) / 0.1)


def motive(path, unit="Meters", scale=1.0, drawn=(0, 0, 0)):
    kinds = ["Rigid Body"] * 8 + ["Rigid Body Marker"] * 3
    lines = [
        f"Format Version,1.23,Take Name,Take 1,Take Notes,,Capture Frame Rate,250.0,Export Frame Rate,250.0,"
        f"Total Exported Frames,{len(T)},Rotation Type,Quaternion,Length Units,{unit},Coordinate Space,Global",
        "",
        ",Type," + ",".join(kinds),
        ",Name," + ",".join(["tool0"] * 8 + ["tool0:Marker1"] * 3),
        ",ID," + ",".join(["6BF4"] * 11),
        ",," + ",".join(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 3),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z",
    ]
    flips = np.where(np.arange(len(T)) % 7 == 0, -1.0, 1.0)[:, None]  # of quaternions: the same orientation
    rows = np.column_stack(
        [
            flips * (body() * Rotation.from_rotvec(drawn)).as_quat(),
            scale * seen(),
            2e-4 * np.ones(len(T)),
            scale * seen() + 0.01,
        ]
    )
    for k, row in enumerate(rows):
        cells = [""] * 11 if 50 <= k < 60 else [f"{x:.8f}" for x in row]
        lines.append(f"{k},{T[k]:.6f}," + ",".join(cells))
    return write(path, lines)


def vicon(path, *_):
    lines = [
        "Trajectories",
        "250",
        ",,ur5:tool0,,,ur5:forearm_link",
        "Frame,Sub Frame,X,Y,Z,X,Y,Z",
        ",,mm,mm,mm,mm,mm,mm",
    ]
    rows = 1e3 * np.column_stack([seen(), seen(marker="forearm_link")])
    lines += [f"{k + 1},0," + ",".join(f"{x:.5f}" for x in row) for k, row in enumerate(rows)]
    return write(path, [*lines, "", "Devices", "1000", "a,b,c"])


def qualisys(path, kind="6D"):
    bodies = "BODY_NAMES\ttool0" if kind == "6D" else "MARKER_NAMES\ttool0\tforearm_link"
    count = "BODIES\t1" if kind == "6D" else "MARKERS\t2"
    lines = [f"NO_OF_FRAMES\t{len(T)}", "NO_OF_CAMERAS\t8", f"NO_OF_{count}", "FREQUENCY\t250", "DESCRIPTION\t--",
             "TIME_STAMP\t2020-01-22, 17:47:17\t22107.99", f"DATA_INCLUDED\t{kind}", bodies]  # fmt: skip
    if kind == "6D":
        cells = [
            "Frame",
            "Time",
            "tool0 X",
            "Y",
            "Z",
            "Roll",
            "Pitch",
            "Yaw",
            "Residual",
            *(f"Rot[{k}]" for k in range(9)),
        ]
        lines.append("\t".join(cells))
        angles, matrices = body().as_euler("XYZ", degrees=True), body().as_matrix().transpose(0, 2, 1).reshape(-1, 9)
        rows = np.column_stack([1 + np.arange(len(T)), T, 1e3 * seen(), angles, 0.4 * np.ones(len(T)), matrices])
        rows[50:60, 2:] = 0
    else:
        rows = 1e3 * np.column_stack([seen(), seen(marker="forearm_link")])
        rows[50:60, :3] = 0
    return write(path, [*lines, *("\t".join(f"{x:.6f}" for x in row) for row in rows)])


def write(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


CAMERAS = {
    "Motive in m": (motive, "csv", ()),
    "Motive in mm": (motive, "csv", ("Millimeters", 1e3)),
    "Vicon": (vicon, "csv", ()),
    "Qualisys 6D": (qualisys, "tsv", ()),
    "Qualisys 3D": (qualisys, "tsv", ("3D",)),
}


@pytest.mark.parametrize("camera", CAMERAS)
def test_what_a_camera_saw_comes_to_the_joints_of_another_log_by_their_motion(tmp_path, ur5, camera):
    writer, ending, given = CAMERAS[camera]
    t = np.arange(0.0, 3.0, 0.002)  # begins 0.7 s earlier, and its clock counts from the controller's start
    q, qd, _ = logs.motion(t - 0.7)
    robot = {"timestamp": 812.0 + t} | logs.numbered("actual_q_{}", q, 0) | logs.numbered("actual_qd_{}", qd, 0)
    robot = logs.csv(tmp_path / "robot.csv", robot)
    done = imported(tmp_path, ur5, robot, writer(tmp_path / f"camera.{ending}", *given))
    recording = done.recording
    place = recording.markers["tool0"]
    lost = np.isnan(place[:, 0])
    assert np.flatnonzero(lost).tolist() == ([] if camera == "Vicon" else list(range(50, 60)))
    assert np.abs(place - seen())[~lost].max() < 1e-6
    joints = np.column_stack([recording.positions[name] for name in logs.JOINTS])
    assert np.abs(joints - Q).max() < 2e-5  # 20 us at 1 rad/s
    assert recording.tolerances.frame_position == 10
    if camera.startswith(("Motive", "Qualisys 6D")):
        turned = Rotation.from_rotvec(recording.marker_rotations["tool0"][~lost])
        assert (turned * body()[~lost].inv()).magnitude().max() < 1e-5
    else:
        assert np.abs(recording.markers["forearm_link"] - seen(marker="forearm_link")).max() < 1e-6


def test_axes_that_were_drawn_in_the_cameras_program_are_not_the_frames(tmp_path, ur5):
    camera = motive(tmp_path / "camera.csv", "Meters", 1.0, (0.3, 0, 0.4))
    robot = logs.csv(tmp_path / "robot.csv", {"timestamp": 812.0 + T} | logs.numbered("actual_q_{}", Q, 0))
    made = guess(read_logs([robot, camera]), ur5)
    assert "# r.tool0: {from: [tool0.Rotation.X" in made.text
    assert "not used: the body's axes are turned by 29 deg against the frame's" in made.text


def test_where_a_robot_rests_often_what_it_does_in_between_is_left_out(tmp_path, ur5):
    t = np.arange(0.0, 12.0, 0.02)
    part = np.clip((t % 1.0) / 0.4, 0, 1)
    way = np.floor(t) + part**3 * (10 - 15 * part + 6 * part**2)  # rests of 0.6 s
    q = np.sin(np.outer(way, 0.7 + 0.21 * np.arange(6)))
    place = Sagging(ARMS["ur5"].chain(), "tool0").seen(q, ("tool0",), t).reshape(-1, 3)
    robot = logs.csv(tmp_path / "robot.csv", {"time": t} | logs.numbered("q{}", q))
    columns = {"Time": t[40:] - 0.5} | {f"tool0.{axis} [m]": HALL.apply(place)[40:, k] for k, axis in enumerate("XYZ")}
    done = imported(tmp_path, ur5, robot, logs.csv(tmp_path / "camera.csv", columns))
    assert "12 rests: while joints move" in (tmp_path / "map.yaml").read_text()
    assert "12 rests remain" in done.remarks[-1]
    moving = (done.recording.time + 0.8) % 1.0 < 0.4
    assert not moving.any()
    assert len(done.recording) > 100


def test_points_of_a_tracker_beside_a_list_of_joints_go_row_by_row(tmp_path, ur5):
    joints = logs.csv(tmp_path / "joints.csv", logs.numbered("J{} [deg]", np.degrees(Q)))
    points = dict(zip(("X (mm)", "Y (mm)", "Z (mm)"), 1e3 * seen().T, strict=True))
    tracker = logs.csv(tmp_path / "tracker.txt", {"Name": [f"P{k}" for k in range(len(T))]} | points, separator="\t")
    recording = imported(tmp_path, ur5, joints, tracker, doubts=1).recording  # of which part of the robot?
    assert np.abs(recording.position - seen()).max() < 1e-9
    assert_motion(recording, "q")
    assert "like: joints}  # row by row, and the places agree with the joints" in (tmp_path / "map.yaml").read_text()
    points = {name[0]: values for name, values in points.items()}  # X, Y, Z without a unit
    tracker = logs.csv(tmp_path / "tracker.txt", points, separator="\t")
    plain = logs.csv(tmp_path / "plain.csv", logs.numbered("J{}", np.degrees(Q)))
    again = imported(tmp_path, ur5, plain, tracker, doubts=1)  # degrees are proven
    assert_motion(again.recording, "q")
    other = logs.csv(tmp_path / "other.csv", logs.numbered("J{} [deg]", np.degrees(np.cos(7 * Q))))
    made = guess(read_logs([other, tracker]), ur5)
    assert "time of tracker: these places do not agree with the joints row by row" in made.doubts
    short = logs.csv(tmp_path / "short.txt", {name: values[:9] for name, values in points.items()})
    made = guess(read_logs([joints, short]), ur5)
    assert any("9 rows, but 400 of the joints" in text for text in made.doubts)


def test_places_beside_the_joints_in_one_table_prove_these_and_where_they_were_seen_from(ur5):
    """Poses of a calibration, in any order: no other rows' places go with them."""
    rows = np.random.default_rng(0).permutation(len(T))[:60]
    joints = logs.numbered("J{}", np.degrees(Q))
    places = dict(zip(("x", "y", "z"), seen().T, strict=True))
    at_base = dict(zip(("x", "y", "z"), HALL.inv().apply(seen() - np.array([0.3, 1.2, -0.4])).T, strict=True))

    def made(columns, rows):
        return guess(logs.log_of({name: values[rows] for name, values in columns.items()}), ur5)

    first = made(joints | places, rows)
    assert first.doubts == (
        "p.x: goes with the joints, seen from elsewhere than the base: is it the tool point? Else p.<frame>",
    )
    assert "tolerances: {frame_position: 10, frame_rotation: 3, target_position: 0.05}" in first.text
    assert "\ntolerances" not in made(joints | at_base, rows).text  # only asked about
    exchanged = {name: np.roll(values, 40) for name, values in places.items()}
    assert sum("so not rad" in doubt for doubt in made(joints | exchanged, rows).doubts) == 6
    motion = made(joints | places, slice(None)).doubts
    assert len(motion) == 2
    assert "no column is a time" in motion[0]  # at which rate it was logged, places do not tell


@pytest.mark.parametrize("time", [T, np.round(1e3 * np.arange(len(T)) / 30)], ids=["even", "rounded"])
def test_two_runs_are_not_two_sensors(tmp_path, time):
    paths = [logs.csv(tmp_path / f"{name}.csv", {"t": time} | logs.numbered("q{}", Q)) for name in ("first", "second")]
    with pytest.raises(RecordingFileError, match=r"these are two recordings; import each by the same map"):
        read_logs(paths)


def test_joints_and_places_of_a_table_without_names_are_found_by_the_robot(tmp_path, ur5):
    """Number of the pose, places in mm, joints in degrees: there is no other way round."""
    rows = np.random.default_rng(0).permutation(len(T))[:60]
    np.savetxt(
        tmp_path / "poses.txt", np.column_stack([np.arange(60), 1e3 * seen()[rows], np.degrees(Q[rows])]), "%.6f"
    )
    recording = imported(tmp_path, ur5, tmp_path / "poses.txt", doubts=1).recording
    assert np.abs(recording.position - seen()[rows]).max() < 1e-8
    assert np.abs(np.column_stack([recording.positions[name] for name in logs.JOINTS]) - Q[rows]).max() < 1e-7
    np.savetxt(tmp_path / "joints.txt", np.degrees(Q[rows]), "%.6f")
    np.savetxt(tmp_path / "tracker.txt", seen()[rows], "%.6f")
    again = imported(tmp_path, ur5, tmp_path / "joints.txt", tmp_path / "tracker.txt", doubts=1).recording
    assert np.abs(again.position - seen()[rows]).max() < 1e-6
    np.savetxt(tmp_path / "others.txt", np.column_stack([np.degrees(Q[rows]), seen()[np.roll(rows, 7)]]), "%.6f")
    assert "p.x" not in guess(read_logs([tmp_path / "others.txt"]), ur5).text


@pytest.mark.parametrize("form", ["{}_run7.csv", "{}/log.csv"])
def test_files_of_one_joint_each_that_share_their_stamps_are_one_motion(tmp_path, ur5, form):
    """Their columns are the same; two runs never come at the same jittering times."""
    stamps = np.cumsum(np.random.default_rng(0).integers(3, 6, len(T)))
    q, _, tau = logs.motion(1e-3 * stamps)
    paths = [tmp_path / form.format(name.removesuffix("_joint")) for name in logs.JOINTS]
    for k, path in enumerate(paths):
        path.parent.mkdir(exist_ok=True)
        logs.csv(path, {"time_ms": stamps, "angle [deg]": np.degrees(q[:, k]), "torque [Nm]": tau[:, k]})
    log = read_logs(paths[::-1])
    assert len(log.streams) == 1
    assert "angle (wrist_3)" in log.names
    first = guess(log, ur5)
    assert first.doubts == ()
    (tmp_path / "map.yaml").write_text(first.text)
    recording = convert(log, read_map(tmp_path / "map.yaml", log, ur5), ur5).recording
    for k, name in enumerate(logs.JOINTS):
        assert np.abs(recording.positions[name] - q[:, k]).max() < 1e-6
        assert np.abs(recording.efforts[name] - tau[:, k]).max() < 1e-6


def test_bodies_that_no_frame_is_called_like_are_asked_about(tmp_path, ur5):
    joints = logs.csv(tmp_path / "joints.csv", {"time": T} | logs.numbered("q{}", Q))
    columns = {"time": T}
    for body in ("RigidBody 1", "RigidBody 2"):
        columns |= {f"{body}.{axis} [mm]": 1e3 * values for axis, values in zip("XYZ", seen().T, strict=True)}
    made = guess(read_logs([joints, logs.csv(tmp_path / "camera.csv", columns)]), ur5)
    assert "seen were RigidBody 1, RigidBody 2, and no frame of the robot is called like one" in made.doubts[0]
    assert "# p.FRAME.y: {from: 'RigidBody 2.Y [mm]', unit: mm}" in made.text


def test_names_of_files_are_what_tells_them_apart(tmp_path, ur5):
    """So that the map of one run does for the next."""
    for run in ("run1", "run2"):
        logs.csv(tmp_path / f"{run}_position.csv", {"t": T} | logs.numbered("q{}", Q))
        logs.csv(tmp_path / f"{run}_effort.csv", {"t": T} | logs.numbered("tau{}", TAU))
    first, second = (read_logs([tmp_path / f"{run}_{what}.csv" for what in ("position", "effort")]) for run in
                     ("run1", "run2"))  # fmt: skip
    assert [stream.name for stream in first.streams] == ["position", "effort"]
    (tmp_path / "map.yaml").write_text(guess(first, ur5, "ur5").text)
    assert_motion(convert(second, read_map(tmp_path / "map.yaml", second, ur5), ur5).recording, "q", "tau")
    assert told_apart(["a_b", "a"]) == ["a_b", "a"]
    assert told_apart(["left.run", "right.run"]) == ["left", "right"]


def test_another_motion_tells_no_delay(tmp_path, ur5):
    robot = {"timestamp": 812.0 + T} | logs.numbered("actual_q_{}", np.cos(3 * Q), 0)
    robot = logs.csv(tmp_path / "robot.csv", robot)
    made = guess(read_logs([robot, motive(tmp_path / "camera.csv")]), ur5)
    assert made.doubts == ("time of camera: another clock: taken as begun together with the joints'",)
    assert "delay: -812}" in made.text
