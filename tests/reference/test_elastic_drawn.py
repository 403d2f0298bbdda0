"""Arms whose gears yield as they are drawn: two masses a joint against an integrator, energy, logs, answers, scores."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt

from prup_pin.recordings import read_recording
from tests.reference.concealed.chain import GRAVITY, Chain, Joint, Link
from tests.reference.concealed.elastic import (
    FINE,
    KINDS,
    SINGLE,
    Drives,
    ElasticArm,
    Log,
    Ripple,
    Run,
    dahl,
    draw_elastic,
    draw_group,
    left_by_joint,
    mass_matrices,
    write,
)
from tests.reference.concealed.excitation import Excitation
from tests.reference.concealed.moving import Moving

ROOT = Path(__file__).parents[2]
MASS, LEVER, OWN = 3.0, 0.4, 0.05  # of the pendulum: kg, m, kg m^2
UR5 = KINDS["ur5"]


def pendulum():
    """Return a pendulum about a horizontal axis that hangs at zero."""
    limits = (-np.inf, np.inf)
    joint = Joint("swing", -1, np.zeros(3), np.eye(3), np.array([0.0, 1.0, 0.0]), False, True, limits, 5.0)
    link = Link("bob", 0, MASS, np.array([0.0, 0.0, -LEVER]), OWN * np.eye(3))
    return Chain((joint,), (link,), {"tip": (0, np.eye(3), np.zeros(3))}, (0,))


def drives(names, **more):
    n = len(names)
    usual = {"rotor": 0.3, "stiffness": 2e3, "damping": 1.5, "coulomb": 0.0, "viscous": 0.8}
    values = {key: np.full(n, float(value)) for key, value in (usual | more).items() if key in usual}
    return Drives(names=names, **values, presliding=2e-3)


SWING = Excitation(np.array([0.1]), np.array([[0.4, 0.0, 0.12]]), np.array([[0.0, 0.2, 0.05]]), 3.0)


def swung(shake=0.0, rows=4000, **more):
    """Return the pendulum's run and its largest distance from the integrated one: links, motors [rad].

    The motor's torque drives two masses, integrated in time with the pendulum's own equation.
    """
    arm = ElasticArm(Moving(pendulum(), "tip"), drives(("swing",), coulomb=0.6), Ripple(np.array([shake])))
    run = arm.run(SWING, 2.0, 3)
    own = drives(("swing",), **({"coulomb": 0.6} | more))
    inertia = MASS * LEVER**2 + OWN
    torque = CubicSpline(run.t, run.motor[:, 0])
    k, d, rotor, dry, damping = (x[0] for x in (own.stiffness, own.damping, own.rotor, own.coulomb, own.viscous))

    def change(t, x):
        theta, q, speed, rate, z = x
        gear = k * (theta - q) + d * (speed - rate)
        pull = (torque(t) - gear - damping * speed - dry * z) / rotor
        turned = (speed - abs(speed) * z) / own.presliding
        return speed, rate, pull, (gear + MASS * GRAVITY[2] * LEVER * np.sin(q)) / inertia, turned

    links = CubicSpline(run.t, run.q[:, 0])
    way = dahl(run.theta[:, 0], own.presliding)
    begin = 400  # friction knows its way by then
    start = (run.theta[begin, 0], run.q[begin, 0], run.speed[begin, 0], links(run.t[begin], 1), way[begin])
    rows = slice(begin, begin + rows)
    found = solve_ivp(change, run.t[rows][[0, -1]], start, "LSODA", run.t[rows], rtol=1e-9, atol=1e-11)
    return run, np.abs(found.y[1] - run.q[rows, 0]).max(), np.abs(found.y[0] - run.theta[rows, 0]).max()


def test_a_pendulum_on_a_gear_that_yields_goes_where_its_motor_torque_drives_it():
    run, links, motors = swung()
    assert max(links, motors) < 1e-6
    assert np.abs(run.theta - run.q).max() > 1e-3


@pytest.mark.parametrize("off", [{"rotor": 0.303}, {"viscous": 0.808}, {"coulomb": 0.606}])
def test_one_per_cent_of_rotor_or_friction_would_show(off):
    assert swung(**off)[1] > 2e-4


def test_one_per_cent_of_the_gear_shows_in_the_deflection():
    assert swung(stiffness=2.02e3)[2] > 2e-5


def test_a_motor_that_vibrates_drives_the_pendulum_as_the_integrator_says():
    run, links, motors = swung(6.0, 1200)
    still = swung(0.0, 2)[0]
    shaken = np.abs(run.theta - still.theta)[:1600].max()
    assert shaken > 2e-4
    assert max(links, motors) < 0.02 * shaken
    assert (run.acceleration - still.acceleration)[2000:].std() == pytest.approx(6.0, rel=0.25)


def energies(chain, t, q, qd, run, own):
    """Return kinetic and potential energy of links, rotors and gears (N,) [J], by bodies one by one."""
    motion = chain.moved(q, qd, np.zeros_like(q))
    total = 0.5 * (own.rotor * run.speed**2).sum(1) + 0.5 * (own.stiffness * (run.theta - run.q) ** 2).sum(1)
    for link in chain.links:
        if link.body < 0 or not link.mass:
            continue
        at, _ = chain.point(motion, link.body, link.centre)
        moves = (chain.jacobian(motion, link.body, at) @ qd[..., None])[..., 0]
        turns = (motion.turn[link.body].swapaxes(-1, -2) @ motion.rates(link.body)[0][..., None])[..., 0]
        total += 0.5 * link.mass * (moves**2).sum(1) + 0.5 * ((turns @ link.inertia) * turns).sum(1)
        total -= link.mass * at @ GRAVITY
    return total


def balance(**off):
    """Return what is missing in the energy balance of a ur5 over the energy that its motors turned over."""
    chain = UR5.chain()
    motion = Excitation(np.array(UR5.centre), np.full((6, 2), 0.25), np.full((6, 2), -0.1), 3.0)
    own = drives(chain.names, coulomb=1.5, stiffness=2e4)
    run = ElasticArm(Moving(chain, "tool0"), own, Ripple(np.zeros(6))).run(motion, 1.5, 1)
    own = replace(own, **{key: getattr(own, key) * value for key, value in off.items()})
    _, qd, _ = motion.at(run.t)
    held = energies(chain, run.t, run.q, qd, run, own)
    way = np.stack([dahl(x, own.presliding) for x in run.theta.T], -1)
    burnt = (own.viscous * run.speed**2 + own.coulomb * way * run.speed + own.damping * (run.speed - qd) ** 2).sum(1)
    given = (run.motor * run.speed).sum(1)
    turned = np.trapezoid(np.abs(given), dx=1 / FINE)
    worst = 0.0
    for end in range(1000, len(run.t), 500):
        lost = np.trapezoid((given - burnt)[: end + 1], dx=1 / FINE) - (held[end] - held[0])
        worst = max(worst, abs(lost) / turned)
    return worst


def test_what_motors_give_is_stored_or_burnt():
    assert balance() < 1e-6


@pytest.mark.parametrize("off", ["rotor", "coulomb", "viscous", "stiffness"])
def test_one_per_cent_would_break_the_balance(off):
    assert balance(**{off: 1.01}) > 4e-6


def test_joints_shake_one_another_by_the_mass_matrix():
    """Only the first motor is pushed; the balance of all links holds, and others move."""
    chain = UR5.chain()
    motion = Excitation(np.array(UR5.centre), np.zeros((6, 1)), np.zeros((6, 1)), 3.0)
    own = drives(chain.names, stiffness=5e3)
    arm = ElasticArm(Moving(chain, "tool0"), own, Ripple(np.array([3.0, 0, 0, 0, 0, 0])))
    run = arm.run(motion, 1.0, 5)
    masses = mass_matrices(chain, motion.centre[None])[0]
    assert np.abs(masses - masses.T).max() < 1e-10
    pull = CubicSpline(run.t, run.q)(run.t, 2)
    weight = chain.efforts(motion.centre[None], np.zeros((1, 6)), np.zeros((1, 6)))
    felt = run.gear - weight
    needed = pull @ masses
    assert np.abs(felt - needed)[100:-100].max() < 2e-2 * np.abs(felt).max()
    assert np.abs(felt - 1.05 * needed)[100:-100].max() > 3e-2 * np.abs(felt).max()
    assert run.theta[:, 1].std() > 0.01 * run.theta[:, 0].std()


def log(n, **more):
    usual = {"rate": 500.0, "noise": np.zeros(n), "reach": np.full(n, 10.0), "delay": np.zeros(n), "gain": np.ones(n),
             "offset": np.zeros(n)}  # fmt: skip
    return Log(**(usual | more))


def test_efforts_come_late_by_filter_and_delay():
    t = np.arange(-2.0, 6.1, 1 / FINE)
    slow = np.sin(2 * np.pi * 0.5 * t)[:, None]
    run = Run(t, slow, slow, slow, slow, 2 * slow, 5 * slow, 0 * slow)
    rng = np.random.default_rng(1)
    for order, corner, delay in ((0, 50.0, 0.004), (1, 20.0, 0.0), (2, 30.0, 0.003)):
        own = log(1, order=order, corner=corner, delay=np.array([delay]))
        told, true = own.record(rng, run, Ripple(np.zeros(1)), 6.0)
        expected = 5 * np.sin(2 * np.pi * 0.5 * (told["time"] - own.late[0]))
        assert np.abs(told["tau"][:, 0] - expected).max() < 5e-3
        assert np.abs(told["tau"][:, 0] - 5 * np.sin(2 * np.pi * 0.5 * (told["time"] - 0.9 * own.late[0]))).max() > 5e-3
        assert (told["tau"] == true["tau"]).all()
    behind, _ = log(1, behind=True).record(rng, run, Ripple(np.zeros(1)), 6.0)
    assert np.abs(behind["tau"][:, 0] - 2 * np.sin(np.pi * behind["time"])).max() < 1e-9


def test_a_log_rounds_jitters_and_has_noise_of_its_size():
    t = np.arange(-2.0, 20.1, 1 / FINE)
    x = np.sin(t)[:, None]
    run = Run(t, x, x, np.cos(t)[:, None], -x, 3 * x, 3 * x, 0 * x)
    own = log(1, noise=np.array([0.2]), white=0.4, bits=8, counts=2.0**12, jitter=4e-4, velocity=1e-3)
    told, true = own.record(np.random.default_rng(2), run, Ripple(np.zeros(1)), 20.0)
    left = told["tau"] - true["tau"]
    assert left.std() == pytest.approx(own.spread[0], rel=0.08)
    assert len(np.unique(told["tau"])) < 2**8
    assert np.abs(told["q"] - true["q"]).max() < np.pi / 2**12 * 1.001
    late = told["time"] - np.arange(len(told["time"])) / 500
    assert 0 <= late.min() < 1e-5
    assert 3.9e-4 < late.max() < 4e-4
    assert np.abs(true["q"][:, 0] - np.sin(told["time"])).max() < 1e-9
    beside, _ = replace(own, told=False).record(np.random.default_rng(2), run, Ripple(np.zeros(1)), 20.0)
    assert np.abs(beside["q"][:, 0] - np.sin(np.arange(len(late)) / 500)).max() < np.pi / 2**12 * 1.001


def test_a_seed_decides_everything():
    first, second, other = (draw_elastic(seed, "xarm7", "everywhere", 1.0) for seed in (3, 3, 4))
    assert first["truth"] == second["truth"]
    assert all((first[part][key] == second[part][key]).all() for part in ("fit", "heldout") for key in first[part])
    assert first["truth"]["scatter"] != other["truth"]["scatter"]


def test_groups_are_drawn_in_their_shares():
    drawn = [draw_group(np.random.default_rng([seed, 51])) for seed in range(600)]
    shares = [np.mean([group == name for group in drawn]) for name in ("faultless", "everywhere", "one")]
    assert shares == pytest.approx([0.25, 0.40, 0.35], abs=0.06)


@pytest.mark.slow
def test_where_everything_is_off_the_truth_tells_it_joint_by_joint_and_a_faultless_arm_is_as_drawn(tmp_path):
    drawn = draw_elastic(5, "ur5", "everywhere", 3.0)
    truth, own = drawn["truth"], drawn["arm"].drives
    kinds = {e["physics"]: e for e in truth["effects"] if e["location"] == "robot"}
    assert set(kinds) == {
        "coulomb_friction",
        "viscous_friction",
        "rotor_inertia",
        "effort_offset",
        "inertial_parameters",
    }
    assert list(kinds["rotor_inertia"]["parameters"]["inertia"].values()) == own.rotor.tolist()
    assert truth["values"]["coulomb_friction"] == dict(zip(own.names, own.coulomb.tolist(), strict=True))
    assert all(0.1 <= abs(x) <= 0.2 for x in truth["scatter"].values())
    write(drawn, tmp_path / "out", tmp_path / "sealed", "device")
    recording = read_recording(tmp_path / "out/device.csv")
    assert list(recording.efforts) == list(own.names)
    about = json.loads((tmp_path / "out/device.json").read_text())
    assert about.keys() - {"robot"} == ({"effort_noise", "tolerances"} if drawn["declared"] else set())
    assert json.loads((tmp_path / "sealed/device.truth.json").read_text())["everywhere"]
    assert (tmp_path / "sealed/device.true.csv").exists()

    clean = draw_elastic(6, "kinova", "faultless", 3.0)
    assert clean["truth"]["effects"] == []
    assert not clean["arm"].drives.coulomb.any()
    if not clean["declared"]:
        assert not any(clean["truth"]["scatter"].values())
    assert max(clean["truth"]["left_by_the_file"][1:3]) < 0.2  # where weight is most of it


@pytest.mark.slow
def test_a_textbook_fit_that_knows_masses_and_lateness_finds_the_friction_and_rotors_of_the_truth():
    """Atkeson, An and Hollerbach 1986, joint by joint, both sides low-passed at 8 Hz: from the log as it is written."""
    drawn = draw_elastic(5, "ur5", "everywhere", 16.0)
    arm, kept, told = drawn["arm"], drawn["log"], drawn["fit"]
    even = np.arange(told["time"][0], told["time"][-1] - 0.1, 1 / kept.rate)
    q = np.stack([np.interp(even, told["time"], x) for x in told["q"].T], -1)
    tau = np.stack([np.interp(even + kept.late[0], told["time"], x) for x in told["tau"].T], -1)
    low = butter(4, 8.0, fs=kept.rate, output="sos")
    slow = make_interp_spline(even, sosfiltfilt(low, q, axis=0), 5)
    speed, pull = slow(even, 1), slow(even, 2)
    left = tau - arm.links.rigid(arm.links.chain.closed(slow(even), speed, pull))
    inner = slice(300, -300)
    for j, name in enumerate(arm.drives.names):
        columns = np.stack([np.tanh(speed[:, j] / 0.01), speed[:, j], pull[:, j], np.ones_like(even)], -1)
        basis, y = (sosfiltfilt(low, x, axis=0)[inner] for x in (columns, left[:, j]))
        dry, damping, rotor, offset = np.linalg.lstsq(basis, y, rcond=None)[0]
        true = {key: values[name] for key, values in drawn["truth"]["values"].items()}
        assert dry + 0.6 * damping == pytest.approx(true["coulomb_friction"] + 0.6 * true["viscous_friction"], rel=0.03)
        assert rotor == pytest.approx(true["rotor_inertia"], rel=0.06)
        assert offset == pytest.approx(true["effort_offset"], abs=0.05 * np.abs(y).max())


@pytest.mark.slow
@pytest.mark.parametrize("physics", SINGLE)
def test_a_single_effect_is_in_the_device_and_has_its_size(physics):
    drawn = draw_elastic(8, "ur5", physics, 2.0)
    (effect,) = drawn["truth"]["effects"]
    own, kept = drawn["arm"].drives, drawn["log"]
    assert (3.0 if physics == "effort_delay" else 4.5) < effect["size"] < 43  # 40 ms is the most
    acts = {
        "payload": "payload" in drawn["arm"].links.links,
        "effort_gain": (kept.gain != 1).any(),
        "coulomb_friction": own.coulomb.any() and not kept.behind,
        "viscous_friction": own.viscous.any() and not kept.behind,
        "transmission_coupling": bool(own.coupled) and not kept.behind,
        "effort_delay": kept.delay.max() > 0,
    }
    assert acts[physics]


def test_what_is_left_is_told_by_joint_and_not_of_standstills():
    t = np.arange(0.0, 10.0, 0.004)
    q = np.column_stack([np.where(t < 7, np.sin(t), np.sin(7.0)), np.sin(t)])
    tau = np.column_stack([8.0 * np.cos(3 * t), np.cos(2 * t)])
    wrong = tau * [0.9, 0.7]
    wrong[t > 8.0] = 0.0
    wrong[100:103] = np.nan
    assert left_by_joint(t, q, tau, wrong) == pytest.approx([0.1, 0.3], rel=0.1)
    assert left_by_joint(t, q, tau, tau * 0.99)[0] == pytest.approx(0.01, rel=0.05)
    assert left_by_joint(t, q, tau, tau * 0.99, [2.0, 2.0])[0] == pytest.approx(0.08 / np.sqrt(2) / 2, rel=0.05)
    fast = tau + 0.5 * np.sin(2 * np.pi * 40 * t)[:, None]
    assert left_by_joint(t, q, tau, fast).max() < 2e-3
    assert np.isnan(left_by_joint(t, q, tau, np.full_like(tau, np.nan))).all()


# ---------------------------------------------------------------------------------------------- scores
@pytest.fixture
def elastic(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import _elastic

    return _elastic


def truth(group="one", effects=(), **more):
    device = {"shake": [1.0, 2.5], "order": 1, "jitter": 0.0, "velocity": None, "counts": None}
    return {"seed": 1, "robot": "ur5", "group": group, "declared": True, "late": False,
            "everywhere": group == "everywhere", "joints": ["a", "b"], "effects": list(effects), "values": {},
            "yielding": [0.2, 0.4], "device": device, "left_by_the_file": [0.4, 0.2],
            "left_by_noise": [4.0, 0.1], "noise": [0.1, 2.0]} | more  # fmt: skip


def finding(physics, location, parameters=None, candidates=(), **more):
    told = {key: {"value": value, "unit": "", "ci95": list(ci)} for key, (value, *ci) in (parameters or {}).items()}
    return {"physics": physics, "location": location, "candidates": [location, *candidates], "parameters": told} | more


def answer(*findings, verdict="explained"):
    return {"verdict": verdict, "findings": list(findings)}


DRY = {"physics": "coulomb_friction", "location": "robot", "places": ["robot", "a", "b"], "size": 9.0,
       "parameters": {"force": {"a": 1.0, "b": 2.0}}, "strength": [9.0, 5.0], "also": []}  # fmt: skip
ONE = DRY | {"location": "a", "places": ["a"], "parameters": {"force": 1.0}}


def test_a_faultless_arm_is_accused_by_any_finding_but_of_efforts_that_do_come_late(elastic):
    late = finding("effort_delay", "robot", {"delay": (0.01, 0.009, 0.011)})
    assert elastic.marks(answer(late), truth("faultless"))["accused"]
    true = truth("faultless", late=True, values={"effort_delay": {"robot": 0.0102}})
    marks = elastic.marks(answer(late), true)
    assert not marks["accused"]
    assert marks["intervals"][0]["inside"]
    assert not elastic.marks(answer(verdict="nothing_missing"), true)["accused"]
    assert elastic.marks(answer(verdict="unexplained"), true)["accused"]
    assert elastic.marks(answer(finding("unknown", "a")), true)["accused"]
    assert elastic.marks(answer(late, finding("cogging", "a")), true)["wrong"] == ["cogging at a"]


def test_one_at_the_robot_counts_for_the_joints_that_its_table_lists(elastic):
    true = truth("everywhere", [DRY], values={"coulomb_friction": {"a": 1.0, "b": 2.0}})
    every = finding("coulomb_friction", "robot", {"a.limit": (1.0, 0.9, 1.1), "b.limit": (2.3, 2.2, 2.4)}, ("a", "b"))
    marks = elastic.marks(answer(every), true)
    assert [item["told"] for item in marks["off"]] == [True, True]
    assert [item["inside"] for item in marks["intervals"]] == [True, False]
    assert marks["wrong"] == []
    part = finding("coulomb_friction", "robot", {"b.limit": (2.0, 1.9, 2.1)}, ("a", "b"))
    assert [item["told"] for item in elastic.marks(answer(part), true)["off"]] == [False, True]
    table = finding("coulomb_friction", "robot", table=[{"joint": "a", "limit": 1.0}])
    assert [item["told"] for item in elastic.marks(answer(table), true)["off"]] == [True, False]
    single = finding("coulomb_friction", "b", {"limit": (2.0, 1.9, 2.1)})
    marks = elastic.marks(answer(single, finding("rotor_inertia", "a")), true)
    assert [item["told"] for item in marks["off"]] == [False, True]
    assert marks["wrong"] == ["rotor_inertia at a"]
    assert marks["intervals"][0]["inside"]


def test_a_single_effect_is_right_at_its_place_alone(elastic):
    (effect,) = elastic.marks(answer(finding("coulomb_friction", "a")), truth("one", [ONE]))["effects"]
    assert effect["right"]
    marks = elastic.marks(answer(finding("coulomb_friction", "b")), truth("one", [ONE]))
    assert not marks["effects"][0]["place"]
    assert marks["effects"][0]["told"] == "coulomb_friction elsewhere"
    assert marks["wrong"] == ["coulomb_friction at b"]
    listed = finding("coulomb_friction", "robot", {"a.limit": (1.0, 0.9, 1.1), "b.limit": (0.0, -1.0, 1.0)})
    assert elastic.marks(answer(listed), truth("one", [ONE | {"places": ["a", "robot"]}]))["effects"][0]["right"]


def test_what_is_missed_is_over_what_the_drawing_leaves(elastic):
    t = np.arange(0.0, 10.0, 0.004)
    true = {"time": t, "q.a": np.sin(t), "q.b": np.cos(t), "tau.a": 3 * np.sin(5 * t), "tau.b": np.sin(4 * t)}
    predicted = {"tau.a": 0.96 * true["tau.a"], "tau.b": 0.98 * true["tau.b"]}
    found = elastic.left(true, predicted, truth())
    assert found["missed"] == pytest.approx(0.1, rel=0.02)
    left = np.array([0.04 * 3 / 0.1, 0.02 / 2.0]) / np.sqrt(2)
    assert found["missed_by_noise"] == pytest.approx(np.hypot(*left) / np.hypot(4.0, 0.1), rel=0.02)
    assert found["by_joint"]["after"] == pytest.approx([0.04, 0.02], rel=0.02)
    assert np.isnan(elastic.left(true, {"tau.a": predicted["tau.a"]}, truth())["missed"])


def test_the_page_counts_what_was_right_and_lists_what_was_not(elastic):
    more = {"before": 0.4, "after": 0.02, "missed": 0.05, "missed_by_noise": 0.03, "seconds": 12.0}
    cases = [
        (answer(verdict="nothing_missing"), truth("faultless")),
        (answer(finding("cogging", "a")), truth("faultless", seed=2)),
        (answer(finding("coulomb_friction", "a")), truth("one", [ONE], seed=3)),
        (answer(finding("coulomb_friction", "robot", {"a.limit": (1, 0, 2)})), truth("everywhere", [DRY], seed=4)),
    ]
    trials = json.loads(json.dumps([elastic.marks(*case) | more for case in cases]))
    text = elastic.summary(trials)
    rows = dict(line.strip("| ").split(" | ")[:2] for line in text.splitlines() if line.count(" | ") > 1)
    assert rows["faultless: accused"] == "50.0 % (1/2; 9.5-90.5 %)"
    assert rows["one effect: … both, in one finding"] == "100.0 % (1/1; 20.7-100.0 %)"
    assert rows["everywhere, 3 x noise or more: coulomb_friction told"] == "50.0 % (1/2; 9.5-90.5 %)"
    assert rows["held out, one: missed, median (90th percentile)"] == "0.05 (0.05)"
    assert "Named though it is not there: cogging 1." in text
    assert "| ur5 2 |" in text
    assert "| ur5 4 |" in text
    assert "| ur5 3 |" not in text
    assert elastic.told(trials[0]).startswith("ok ur5 1: faultless -> nothing")
