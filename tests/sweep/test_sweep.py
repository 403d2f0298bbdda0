"""A sweep says of every pose what a single question says, wherever the pose stands among others."""

import pickle
from itertools import product
from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError
from prup_pin.kernel import Tree

ROBOTS = Path(__file__).parents[1] / "robots"
#: Robot, options, ends of the coordinates between which poses are drawn.
CASES = {
    "3prup": ("3prup", {}, [(0.25, 0.5), (-0.6, 0.6), (-0.6, 0.6)]),
    "five_bar": (ROBOTS / "five_bar" / "five_bar.urdf", {"joint_stiffness": 1e4}, [(-0.1, 0.14), (0.3, 0.45)]),
    "six_ups": (ROBOTS / "six_ups" / "six_ups.urdf", {}, [(-0.1, 0.1)] * 2 + [(0.65, 0.8)] + [(-0.2, 0.2)] * 3),
    "ur5": ("ur5", {"joint_stiffness": 1e4}, [(-3.0, 3.0)] * 6),
}
FORCE, MOMENT = 300.0, 100.0


def loaded(name):
    path, options, ends = CASES[name]
    return prup_pin.load(str(path), **options), np.array(ends)


def drawn(ends, count, seed=7):
    return np.random.default_rng(seed).uniform(*ends.T, (count, len(ends)))


def asked_singly(robot, row):
    if robot.mechanism.tasks:
        return robot.compliance(robot.pose(**dict(zip(robot.task_coordinates, row, strict=True))))
    return robot.compliance(robot.pose_from_actuators(row))


@pytest.mark.parametrize("name", CASES)
def test_every_pose_is_answered_like_a_single_question(name):
    robot, ends = loaded(name)
    rows = drawn(ends, 1000)
    stiff = name != "five_bar"
    s = robot.sweep(poses=rows, quantities=["C", "K"] if stiff else ["C"])
    assert s["C"].shape == (1000, 6, 6)
    reached = 0
    for row, c, k, word in zip(rows, s["C"], s["K"] if stiff else s["C"], s.status, strict=True):
        try:
            single = asked_singly(robot, row)
        except prup_pin.UnreachablePoseError:
            assert word != "ok"
            assert np.isnan(c).all()
            continue
        assert word == "ok"
        reached += 1
        assert np.abs(c - single.C).max() <= 1e-12 * np.abs(single.C).max()
        if stiff:
            # An inverse is as exact as C's condition lets it be: an arm is nearly singular now and then.
            scale = np.sqrt(np.diagonal(single.C))
            exact = max(1e-12, 1e-15 * np.linalg.cond(single.C / np.outer(scale, scale)))
            assert np.abs((k - single.K) * np.outer(scale, scale)).max() <= exact * np.linalg.norm(
                single.K * np.outer(scale, scale), 2
            )
    assert reached > 900


def test_the_extremes_are_those_of_all_729_states(robot):
    s = robot.sweep(z=0.3, theta=[-0.3, 0.1], phi=[0.0, 0.4], quantities=["C", "extremes", "extreme_components"],
                    force=FORCE, moment=MOMENT)  # fmt: skip
    states = np.array(list(product((-1, 0, 1), repeat=6))) * ([FORCE] * 3 + [MOMENT] * 3)
    assert len(states) == 729
    for index in np.ndindex(2, 2):
        moved = states @ s["C"][index]
        norms = np.linalg.norm(moved[:, :3], axis=1).max(), np.linalg.norm(moved[:, 3:], axis=1).max()
        np.testing.assert_allclose(s["extremes"][index], norms, rtol=1e-12)
        np.testing.assert_allclose(s["extreme_components"][index], np.abs(moved).max(axis=0), rtol=1e-12)


def test_the_deflection_is_that_under_the_load_by_arrays_and_by_straight_lines(robot):
    load = [300.0, -20.0, 5.0, 1.0, 2.0, 3.0]
    where = {"z": 0.3, "theta": [-0.3, 0.1], "phi": [0.0, 0.4], "quantities": ["deflection"], "wrench": load}
    s = robot.sweep(**where)
    assert not s.remarks
    single = robot.compliance(robot.pose(z=0.3, theta=0.1, phi=0.4)).deflection(load)
    np.testing.assert_allclose(s["deflection"][1, 1], single, rtol=1e-9)
    compiled = robot.sweep(**where, compiled=True)
    assert not compiled.remarks
    np.testing.assert_allclose(compiled["deflection"], s["deflection"], rtol=1e-9, atol=1e-15)


def test_a_box_of_forces_alone_has_no_moments(robot):
    alone, slight, whole = (
        robot.sweep(z=0.3, theta=0.1, phi=0.2, quantities=["extremes"], force=100.0, **moment)["extremes"]
        for moment in ({}, {"moment": 1e-9}, {"moment": 10.0})
    )
    np.testing.assert_allclose(alone, slight, rtol=1e-9)
    assert (whole > 1.01 * alone).all()
    with pytest.raises(prup_pin.InputError, match="half the side of the box of wrenches, above 0"):
        robot.sweep(z=0.3, theta=0.1, phi=0.2, quantities=["extremes"], force=0.0)


def test_the_papers_lower_ends_of_the_error_range():
    """GCER at z = 0.3 m, Section 6: 4.47 mm and 1.85 degrees."""
    robot = prup_pin.load("3prup").with_variant("as_published")
    angles = np.linspace(-0.5, 0.5, 21)
    s = robot.sweep(z=0.3, theta=angles, phi=angles, quantities=["extremes"], force=FORCE, moment=MOMENT)
    lower = s["extremes"].min(axis=(0, 1))
    assert round(1e3 * lower[0], 2) == 4.47
    assert round(np.degrees(lower[1]), 2) == 1.85
    np.testing.assert_array_equal(s["extremes"][10, 10], lower)


def test_axes_stand_in_the_order_given_and_numbers_are_fixed(robot):
    phi, theta = np.linspace(-0.3, 0.3, 3), np.array([0.0, 0.2])
    s = robot.sweep(phi=phi, z=0.4, theta=theta, quantities=["C", "extremes", "ksi"], force=FORCE, moment=MOMENT)
    assert s.dims == ("phi", "theta")
    assert s["C"].shape == (3, 2, 6, 6)
    assert s["extremes"].shape == (3, 2, 2)
    assert s["ksi"].shape == s.status.shape == (3, 2)
    assert s.fixed == {"z": 0.4}
    single = asked_singly(robot, (0.4, 0.2, -0.3))
    np.testing.assert_allclose(s["C"][0, 1], single.C, rtol=1e-10, atol=1e-18)
    np.testing.assert_array_equal(s.coordinates[0, 1], (0.4, 0.2, -0.3))
    assert list(s) == ["C", "extremes", "ksi"]


def test_one_pose_has_no_axis(robot):
    s = robot.sweep(z=0.4, theta=0.1, phi=0.0, quantities=["C"])
    assert s["C"].shape == (6, 6)
    assert s.status.shape == ()
    assert s.status[()] == "ok"


@pytest.mark.parametrize("name", CASES)
def test_no_pose_knows_of_its_company(name):
    robot, ends = loaded(name)
    rows = drawn(1.5 * ends if name == "3prup" else ends, 120)
    if name == "3prup":
        rows[:, 0] /= 1.5
    names = ["C", "q"] if name == "five_bar" else ["C", "K", "q", "eigenvalues", "shares", "extremes"]
    how = {"quantities": names, "force": FORCE, "moment": MOMENT}
    whole = robot.sweep(poses=rows, **how)
    for size in (1, 2, 3, 7, 50):
        for start in range(0, len(rows) - size, 23):
            part = robot.sweep(poses=rows[start : start + size], **how)
            for quantity in names:
                np.testing.assert_array_equal(part[quantity], whole[quantity][start : start + size])
            assert (part.status == whole.status[start : start + size]).all()
    backwards = robot.sweep(poses=rows[::-1], **how)
    np.testing.assert_array_equal(backwards["C"][::-1], whole["C"])


def test_shares_sum_to_one_and_are_those_of_a_single_question(robot):
    wrench = [100.0, -50.0, 200.0, 10.0, 20.0, -5.0]
    s = robot.sweep(z=0.4, theta=[0.0, 0.3], phi=0.1, quantities=["shares"], wrench=wrench)
    single = asked_singly(robot, (0.4, 0.3, 0.1)).shares(wrench)
    np.testing.assert_allclose(s["shares"][1], list(single.values()), rtol=1e-10)
    box = robot.sweep(z=0.4, theta=[0.0, 0.3], phi=0.1, quantities=["shares", "C"], force=FORCE, moment=MOMENT)
    np.testing.assert_allclose(box["shares"].sum(axis=-1), 1.0)
    corners = np.array(list(product((-1, 1), repeat=6))) * ([FORCE] * 3 + [MOMENT] * 3)
    compliance = asked_singly(robot, (0.4, 0.3, 0.1))
    parts = [compliance.parts[name] for name in compliance.names]
    works = np.array([np.einsum("ki,ij,kj->k", corners, part, corners).mean() for part in parts])
    np.testing.assert_allclose(box["shares"][1], works / works.sum(), rtol=1e-9)


def test_joints_and_actuators_are_those_of_the_pose(robot):
    s = robot.sweep(poses=[(0.4, 0.2, -0.1)], quantities=["q", "joints", "actuators", "position"])
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    np.testing.assert_allclose(s["q"][0], pose.q, atol=1e-12)
    np.testing.assert_allclose(s["joints"][0], list(pose.joints.values()), atol=1e-12)
    np.testing.assert_allclose(s["actuators"][0], list(pose.actuators.values()), atol=1e-12)
    np.testing.assert_allclose(s["position"][0], pose.base_from_tool[:3, 3], atol=1e-12)


def test_nothing_is_nan_but_where_the_status_says_so(robot):
    s = robot.sweep(z=[0.05, 0.3, 0.9], theta=np.linspace(-1.4, 1.4, 9), phi=np.linspace(-1.4, 1.4, 9),
                    quantities=["C", "K", "extremes", "q"], force=FORCE, moment=MOMENT)  # fmt: skip
    assert 0 < s.ok.sum() < s.ok.size
    for values in s.values():
        missing = np.isnan(values).reshape(*s.shape, -1)
        assert not missing[s.ok].any()
        assert missing[~s.ok].all()
    assert len(s.counts) > 1
    assert set(s.reasons) == set(s.counts)
    for index in np.argwhere(~s.ok)[::40]:
        z, theta, phi = s.coordinates[tuple(index)]
        with pytest.raises(prup_pin.UnreachablePoseError) as caught:
            robot.compliance(robot.pose(z=z, theta=theta, phi=phi))
        assert s.reason(*index) == str(caught.value)


def test_a_robot_with_rigid_directions_has_c_but_no_k():
    robot = prup_pin.load("double_pendulum", joint_stiffness=1e4)
    rows = [[0.3, 0.4], [0.5, -1.0]]
    assert (robot.sweep(poses=rows, quantities=["C"]).status == "ok").all()
    s = robot.sweep(poses=rows, quantities=["C", "K"])
    assert (s.status == "no stiffness").all()
    assert np.isnan(s["K"]).all()
    np.testing.assert_allclose(s["C"][1], asked_singly(robot, rows[1]).C, rtol=1e-12, atol=1e-20)
    assert "no K" in s.reason(0)


def test_endless_joints():
    robot = prup_pin.load("kinova", joint_stiffness=1e4)
    rows = drawn(np.array([(-2.0, 2.0)] * 6), 20)
    s = robot.sweep(poses=rows, quantities=["C"])
    for row, c in zip(rows, s["C"], strict=True):
        with catch_warnings():
            simplefilter("ignore", prup_pin.JointLimitWarning)
            single = asked_singly(robot, row)
        np.testing.assert_allclose(c, single.C, rtol=1e-10, atol=1e-16)


def test_passive_joints_of_a_loop_may_be_endless(tmp_path):
    """A reader without limits is told to write "continuous", and then sweeps."""
    text = (ROBOTS / "five_bar" / "five_bar.urdf").read_text(encoding="utf-8")
    for joint in ("left_elbow", "right_elbow"):
        text = text.replace(f'<joint name="{joint}" type="revolute">', f'<joint name="{joint}" type="continuous">')
    path = tmp_path / "endless.urdf"
    path.write_text(text, encoding="utf-8")
    limited, ends = loaded("five_bar")
    poses = drawn(ends, 12)
    endless = prup_pin.load(str(path), joint_stiffness=1e4).sweep(poses=poses, quantities=["C"])
    assert endless.ok.all()
    np.testing.assert_allclose(endless["C"], limited.sweep(poses=poses, quantities=["C"])["C"], rtol=1e-9, atol=1e-18)


def test_what_arrays_cannot_follow_is_asked_pose_by_pose(robot, monkeypatch):
    rows = drawn(1.4 * np.array(CASES["3prup"][2]), 40)
    names = ["C", "K", "joints"]
    together = robot.sweep(poses=rows, quantities=names)
    monkeypatch.setattr(Tree, "follows", lambda mechanism: False)
    alone = robot.sweep(poses=rows, quantities=names)
    assert (alone.status == together.status).all()
    assert 10 < together.ok.sum() < 40
    for name in names:
        np.testing.assert_allclose(alone[name], together[name], rtol=1e-9, atol=1e-9 * np.nanmax(np.abs(alone[name])))


def test_a_tree_follows_slides_and_turns_alone(tmp_path):
    from ..mechanism.test_names import URDF

    path = tmp_path / "table.urdf"
    path.write_text(URDF)
    assert not Tree.follows(prup_pin.load(path).mechanism)
    assert Tree.follows(prup_pin.load("kinova").mechanism)


def test_a_process_that_may_take_less_memory_than_there_is_says_how_large_the_sweep_is(robot, monkeypatch):
    from prup_pin.sweep.engine import Engine

    def full(self, count):
        raise MemoryError

    monkeypatch.setattr(Engine, "unwritten", full)
    each = 8 * 2 * 36 + 1
    with pytest.raises(InputError, match=rf"1000 poses of {each} bytes each are 0.000577 GB.*Give out='FILE.parquet'"):
        robot.sweep(z=np.linspace(0.3, 0.4, 1000), theta=0.0, phi=0.0)


def test_draws_are_the_same_for_the_same_seed(robot):
    ends = {"z": (0.3, 0.4), "theta": (-0.3, 0.3), "phi": 0.0}
    a = robot.sweep(draws=20, seed=3, quantities=["C"], **ends)
    b = robot.sweep(draws=20, seed=3, quantities=["C"], **ends)
    np.testing.assert_array_equal(a.coordinates, b.coordinates)
    np.testing.assert_array_equal(a["C"], b["C"])
    assert (a.coordinates[:, 2] == 0).all()
    assert np.ptp(a.coordinates[:, 0]) > 0.05


def test_poses_may_be_rows_mappings_or_a_generator(robot):
    rows = [(0.3, 0.1, 0.0), (0.4, 0.0, 0.2)]
    a = robot.sweep(poses=np.array(rows), quantities=["C"])
    b = robot.sweep(poses=(dict(zip(("phi", "theta", "z"), row[::-1], strict=True)) for row in rows), quantities=["C"])
    np.testing.assert_array_equal(a["C"], b["C"])


def test_progress_tells_how_many_poses_are_done(robot):
    told = []
    robot.sweep(poses=drawn(np.array(CASES["3prup"][2]), 5), quantities=["q"], progress=lambda *at: told.append(at))
    assert told == [(0, 5), (5, 5)]


def test_a_result_is_a_dataset_and_a_table(robot):
    s = robot.sweep(z=0.3, theta=[-0.3, 0.1], phi=[0.0, 0.2, 1.5], quantities=["C", "extremes"], force=300, moment=100)
    data = s.to_xarray()
    assert data["C"].dims == ("theta", "phi", "C_row", "C_of")
    assert data["C"].attrs["units"]
    at = data["extremes"].sel(theta=0.1, phi=0.2, extremes_of="translation")
    assert float(at) == s["extremes"][1, 1, 0]
    assert float(data["z"]) == 0.3
    table = s.to_dataframe()
    assert len(table) == 6
    assert list(table.columns[:4]) == ["z", "theta", "phi", "status"]
    assert table["C.dx.my"][4] == s["C"][1, 1, 0, 4]
    assert "C.ry.fx" not in table.columns
    assert table["status"][2] == s.status[0, 2] != "ok"


def test_a_table_is_written_whole(robot, tmp_path):
    import pandas

    s = robot.sweep(z=0.3, theta=[-0.3, 0.1], phi=[0.0, 0.2], quantities=["extremes"], force=300, moment=100)
    s.to_parquet(tmp_path / "s.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["s.parquet"]
    table = pandas.read_parquet(tmp_path / "s.parquet")
    np.testing.assert_array_equal(table["extremes.rotation"], s["extremes"][..., 1].ravel())
    with pytest.raises(prup_pin.InputError, match="cannot write"):
        s.to_parquet(tmp_path / "nowhere" / "s.parquet")


BAD = [
    ({"z": 0.3, "theta": np.linspace(-25, 25, 5), "phi": 0.0}, "25 rad.*Degrees.*np.radians"),
    ({"z": 300, "theta": 0.0, "phi": 0.0}, "300 m.*Millimetres"),
    ({"z": 0.3, "theta": [], "phi": 0.0}, "theta is empty"),
    ({"z": 0.3, "theta": [0.5, -0.5], "phi": 0.0}, "reversed"),
    ({"z": 0.3, "theta": [[0.1]], "phi": 0.0}, "shape"),
    ({"z": 0.3, "teta": 0.1, "phi": 0.0}, "Did you mean 'theta'"),
    ({"z": 0.3, "theta": np.nan, "phi": 0.0}, "finite"),
    ({"z": 0.3, "theta": "high", "phi": 0.0}, "expected numbers"),
    ({"z": (0.3, 0.2), "theta": 0.0, "phi": 0.0, "draws": 5}, "no range"),
    ({"z": (0.3, 0.4), "theta": 0.0, "phi": 0.0, "draws": 0}, "positive number"),
    ({"z": (0.3, 0.4), "theta": 0.0, "phi": 0.0, "draws": 10**12}, "draws=1000000000000: expected at most 100000000"),
    ({"poses": np.zeros((2, 4))}, r"shape \(N, 3\)"),
    ({"poses": np.zeros((0, 3))}, "poses is empty"),
    ({"poses": 5}, "expected an array"),
    ({"poses": [(0.3, 0.1)]}, "pose 0: expected z, theta, phi"),
    ({"poses": np.zeros((1, 3)), "z": 0.3}, "leave out z"),
    ({"z": 0.3, "theta": 0.1, "phi": 0.0, "quantities": ["D"]}, "no quantity named 'D'"),
    ({"z": 0.3, "theta": 0.1, "phi": 0.0, "quantities": "C"}, 'quantities=."C".'),
    ({"z": 0.3, "theta": 0.1, "phi": 0.0, "quantities": []}, "empty"),
    ({"z": 0.3, "theta": 0.1, "phi": 0.0, "quantities": ["extremes"]}, "force=300, moment=100"),
    ({"z": 0.3, "theta": 0.1, "phi": 0.0, "force": -300}, "above 0"),
    ({name: np.linspace(0.2, 0.4, 10_000) for name in ("z", "theta", "phi")}, "GB of free memory"),
]  # fmt: skip


@pytest.mark.parametrize(("asked", "said"), BAD, ids=[said for _, said in BAD])
def test_what_cannot_be_meant_is_refused(robot, asked, said):
    with pytest.raises(prup_pin.InputError, match=said):
        robot.sweep(**asked)


def test_what_is_not_named_stays_at_home_as_in_a_single_pose(robot):
    part = robot.sweep(theta=[0.0, 0.3], quantities=["C"])
    np.testing.assert_array_equal(part["C"], robot.sweep(z=0.4, theta=[0.0, 0.3], phi=0.0, quantities=["C"])["C"])
    assert part.fixed == {"z": 0.4, "phi": 0.0}
    np.testing.assert_allclose(part["C"][1], robot.compliance(robot.pose(theta=0.3)).C, rtol=1e-9, atol=1e-18)
    scattered = robot.sweep(poses=[{"theta": 0.3}, {"z": 0.4, "phi": 0.0, "theta": 0.0}], quantities=["C"])
    np.testing.assert_array_equal(scattered["C"][::-1], part["C"])
    drawn = robot.sweep(theta=(0.0, 0.3), draws=5, quantities=["position"])
    assert np.ptp(drawn.coordinates[:, 1]) > 0
    assert (drawn.coordinates[:, [0, 2]] == [0.4, 0.0]).all()
    arm = prup_pin.load("ur5", joint_stiffness=1e4)
    there = arm.sweep(elbow_joint=0.7, quantities=["position"])["position"]
    np.testing.assert_allclose(there, arm.pose(elbow_joint=0.7).base_from_tool[:3, 3], atol=1e-12)


def test_without_a_declared_home_all_coordinates_are_needed():
    five = prup_pin.load(str(CASES["five_bar"][0]))
    with pytest.raises(prup_pin.InputError, match="missing task coordinate: y"):
        five.sweep(x=[0.0, 0.05], quantities=["q"])
    with pytest.raises(prup_pin.InputError, match="pose 0 lacks y"):
        five.sweep(poses=[{"x": 0.0}], quantities=["q"])


def test_a_robot_without_modules_still_has_poses():
    robot = prup_pin.load(str(CASES["five_bar"][0]))
    s = robot.sweep(x=[0.0, 0.05], y=0.38, quantities=["q", "position"])
    assert s.ok.all()
    with pytest.raises(prup_pin.PrupPinError, match="no compliant module"):
        robot.sweep(x=[0.0, 0.05], y=0.38, quantities=["C"])


def test_results_pickle(robot):
    s = robot.sweep(z=0.3, theta=[-0.3, 0.1], phi=[0.0, 0.2], quantities=["C"])
    again = pickle.loads(pickle.dumps(s))
    np.testing.assert_array_equal(again["C"], s["C"])
    assert again.reason(0, 0) == s.reason(0, 0)
    with pytest.raises(prup_pin.UnknownNameError, match="Ask for it"):
        again["K"]
