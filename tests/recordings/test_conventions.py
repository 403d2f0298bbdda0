"""Ways to write a log are read by their own arithmetic, written back to the last digit, and refused where unknown."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prup_pin.errors import InputError, RecordingFileError
from prup_pin.recordings import WORDS, Drawn, Recording, convention_of, read_as, read_recording, written_as
from prup_pin.recordings.conventions import as_json
from prup_pin.spatial import rotation_exp

JOINTS = {"q": ("a", "b", "c"), "tau": ("a", "b", "c")}
ARGUMENTS = {
    "": "",
    "number": ":2.5",
    "turns": ":3",
    "point": ":0.1,0.2,0.3",
    "axes": ":y,-x,z",
    "joint": ":b",
    "joints": ":c,a,b",
}
EVERY = [(group, word) for word in WORDS for group in word.groups]


@pytest.fixture(scope="module")
def turns():
    return Rotation.from_rotvec(np.random.default_rng(1).normal(size=(40, 3)))


@pytest.fixture(scope="module")
def log(turns):
    rng, n = np.random.default_rng(2), 40

    def column():
        return {name: rng.normal(size=n) for name in "abc"}

    return Recording(
        time=np.arange(n, dtype=float),
        positions=column(),
        velocities=column(),
        accelerations=column(),
        efforts=column(),
        wrench=rng.normal(size=(n, 6)),
        position=rng.normal(size=(n, 3)),
        rotation=turns.as_rotvec(),
        markers={"tip": rng.normal(size=(n, 3))},
        marker_rotations={"tip": 0.4 * rng.normal(size=(n, 3))},
        gravity=rng.normal(size=(n, 3)),
    )


@pytest.fixture(scope="module")
def drawn(turns):
    tool = np.tile(np.eye(4), (40, 1, 1))
    tool[:, :3, :3], tool[:, :3, 3] = turns.as_matrix(), [0.3, -0.2, 0.9]
    return Drawn(frozenset("c"), lambda recording: tool)


def declared(text):
    columns, _, said = text.partition("=")
    return convention_of(columns, said, JOINTS)


@pytest.mark.parametrize(("group", "word"), EVERY, ids=[f"{group}={word.name}" for group, word in EVERY])
def test_every_way_to_write_is_read_back(log, drawn, group, word):
    one = ".a" if word.name in ("plus", "minus", "wrapped") else ""
    convention = declared(f"{group}{one}={word.name}{ARGUMENTS[word.takes]}")
    assert declared(str(convention)) == convention
    written = written_as(log, [convention], drawn)
    read = read_as(written, [convention], drawn)
    for name in ("time", "wrench", "position", "gravity"):
        np.testing.assert_allclose(getattr(read, name), getattr(log, name), atol=1e-12)
    for first, second in ((read.rotation, log.rotation), (read.marker_rotations["tip"], log.marker_rotations["tip"])):
        np.testing.assert_allclose(rotation_exp(np.array(first)), rotation_exp(np.array(second)), atol=1e-7)
    for group_of in ("positions", "velocities", "accelerations", "efforts"):
        for name in "abc":
            apart = getattr(read, group_of)[name] - getattr(log, group_of)[name]
            whole = 2 * np.pi * np.round(apart / (2 * np.pi)) if word.name == "wrapped" else 0.0
            np.testing.assert_allclose(apart, whole, atol=1e-12)


@pytest.mark.parametrize(
    ("said", "written"),
    [
        ("euler_xyz", lambda turns: turns.as_euler("xyz")),
        ("euler_ZYX_deg", lambda turns: turns.as_euler("ZYX", degrees=True)),
        ("angles_YXZ", lambda turns: turns.as_euler("YXZ")[:, [1, 0, 2]]),
        ("inverse", lambda turns: turns.inv().as_rotvec()),
        ("deg", lambda turns: np.degrees(turns.as_rotvec())),
        ("quaternion", lambda turns: turns.as_quat(canonical=True)[:, :3]),
        ("wxyz_as_xyzw", lambda turns: Rotation.from_quat(np.roll(turns.as_quat(), 1, axis=1)).as_rotvec()),
        ("xyzw_as_wxyz", lambda turns: Rotation.from_quat(np.roll(turns.as_quat(), -1, axis=1)).as_rotvec()),
        ("base_axes:y,-x,z", lambda turns: (Rotation.from_euler("z", -90, degrees=True) * turns).as_rotvec()),
        ("tool_axes:y,-x,z", lambda turns: (turns * Rotation.from_euler("z", 90, degrees=True)).as_rotvec()),
    ],
)
def test_orientations_are_what_scipy_makes_of_them(log, turns, drawn, said, written):
    from dataclasses import replace

    other = replace(log, rotation=written(turns))
    read = read_as(other, [declared(f"r={said}")], drawn)
    np.testing.assert_allclose(rotation_exp(np.array(read.rotation)), turns.as_matrix(), atol=1e-9)


def test_a_moment_about_another_point_is_carried_to_the_tool_point(log, turns, drawn):
    point = turns.apply([0.1, 0.2, 0.3])
    written = written_as(log, [declared("wrench=about:0.1,0.2,0.3")], drawn)
    np.testing.assert_allclose(
        written.wrench[:, 3:], log.wrench[:, 3:] - np.cross(point, log.wrench[:, :3]), atol=1e-12
    )


def test_units_of_joints_are_for_those_that_have_them(log, drawn):
    read = read_as(log, [declared("q=deg"), declared("q=mm")], drawn)
    np.testing.assert_allclose(read.positions["a"], np.radians(log.positions["a"]))
    np.testing.assert_allclose(read.velocities["c"], 1e-3 * log.velocities["c"])


def test_an_order_says_whose_columns_they_are(log, drawn):
    read = read_as(log, [declared("q=order:b,c,a")], drawn)
    np.testing.assert_array_equal(read.positions["b"], log.positions["a"])
    np.testing.assert_array_equal(read.efforts["b"], log.efforts["b"])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("wrench=reacton", "Did you mean 'reaction'"),
        ("wrenc=reaction", "Did you mean 'wrench'"),
        ("q.d=deg", "no group of columns named 'q.d'"),
        ("q.a=order:a,b,c", "expected all of q"),
        ("q=plus:b", "expected q.<joint>, one joint"),
        ("tau=gain", "takes one number above 0"),
        ("wrench=about:1,2", "takes three numbers"),
        ("p=axes:x,x,z", "takes the base's axes"),
        ("r=base_axes:-x,y,z", "mirrored"),
        ("r=inverse:2", "takes nothing behind a colon"),
        ("q.a=plus:e", "no joint with a column named 'e'"),
    ],
)
def test_what_the_table_does_not_have_is_refused_with_what_it_has(text, told):
    with pytest.raises(InputError, match=told):
        declared(text)


def test_conventions_stand_in_the_json_beside_a_log(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text("time,q.a,q.b,w.fx\n0,1,2,3\n1,2,3,4\n")
    beside = path.with_suffix(".json")
    beside.write_text(json.dumps({"conventions": {"wrench": ["reaction", "tool_frame"], "q.a": "deg"}}))
    read = read_recording(path)
    assert [str(item) for item in read.conventions] == ["wrench=reaction", "wrench=tool_frame", "q.a=deg"]
    assert as_json(read.conventions) == {"wrench": ["reaction", "tool_frame"], "q.a": "deg"}
    beside.write_text(json.dumps({"conventions": {"wrench": "reacton", "q.c": "deg", "p": 3}}))
    with pytest.raises(RecordingFileError) as caught:
        read_recording(path)
    told = str(caught.value)
    assert "bench.json: conventions.wrench: no convention of wrench named 'reacton'. Did you mean 'reaction'" in told
    assert "conventions.q.c" in told
    assert "conventions.p: is the number 3; expected a text" in told


def test_the_page_lists_every_word():
    page = (Path(__file__).parents[2] / "docs" / "recording_file.md").read_text(encoding="utf-8")
    for word in WORDS:
        orders = word.name.startswith("euler_") or word.name.endswith("_deg")
        assert orders or f"`{word.name}" in page, word.name


def test_angles_count_from_quarter_turns_elsewhere_and_lengths_do_not(log, drawn):
    read = read_as(log, [declared("q=quarter_turns:3")], drawn)
    for name, values in log.positions.items():
        turned = 0.0 if name in drawn.slides else 3 * np.pi / 2
        np.testing.assert_array_equal(read.positions[name], values - turned)
    with pytest.raises(InputError, match="takes 1, 2 or 3"):
        declared("q.a=quarter_turns:90")
