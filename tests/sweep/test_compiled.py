"""The same equations as machine code: the same numbers, whatever stands beside a pose."""

import pickle

import numpy as np
import pytest

import prup_pin
from prup_pin import build
from prup_pin.build import urdf_file
from prup_pin.kernel import Columns, Pipeline, Program, Tape, eliminated, largest, least
from prup_pin.sweep.engine import Engine
from prup_pin.sweep.quantities import Asked

from ..build.test_closed_forms import STEWART
from .test_sweep import CASES, FORCE, MOMENT, ROBOTS, asked_singly, drawn, loaded

#: What can be compiled for each robot.
ASKED = {
    "3prup": ["C", "K", "extremes", "extreme_components", "shares", "joints", "eigenvalues", "ksi"],
    "six_ups": ["C", "K", "extremes", "actuators", "position"],
    "ur5": ["C", "K", "extremes", "shares", "q"],
    "five_bar": ["C", "extremes", "shares", "position"],
}


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] if name == "six_ups" else []) for name in ASKED],
)
def compared(request):
    robot, ends = loaded(request.param)
    rows = drawn(ends, 1003, seed=5)
    how = {"poses": rows, "quantities": ASKED[request.param], "force": FORCE, "moment": MOMENT}
    return robot, robot.sweep(**how), robot.sweep(**how, compiled=True), how


def assert_same(values, arrays, names):
    """Values by name agree with arrays where those are there."""
    ok = arrays.ok
    for name in names:
        ours, theirs = (of[name][ok].reshape(ok.sum(), -1) for of in (values, arrays))
        scale = np.abs(theirs).max(axis=1)
        exact = np.full(len(scale), 1e-12)
        if name in ("K", "eigenvalues"):  # an inverse is as exact as C's condition lets it be
            c = arrays["C"][ok]
            side = np.sqrt(np.diagonal(c, axis1=-2, axis2=-1))
            exact = np.maximum(exact, 1e-15 * np.linalg.cond(c / (side[:, :, None] * side[:, None])))
        assert (np.abs(ours - theirs).max(axis=1) <= exact * scale).all(), name


def test_machine_code_agrees_with_arrays(compared):
    _, arrays, compiled, how = compared
    assert not compiled.remarks
    assert (compiled.status == arrays.status).all()
    assert arrays.ok.sum() > 900
    assert_same(compiled, arrays, how["quantities"])


def test_bits_do_not_depend_on_the_company(compared):
    _, _, compiled, how = compared
    for size in (1, 5, 8, 13):
        for start in (0, 3, 700):
            part = compiled._engine.solve(how["poses"][start : start + size])
            for name in how["quantities"]:
                np.testing.assert_array_equal(part.values[name], compiled[name][start : start + size])


def test_numpy_alone_follows_the_same_lines(compared):
    """As it does for many poses; what a pose is told does not depend on its company either."""
    robot, arrays, compiled, how = compared
    written = compiled._engine.written
    engine = Engine(robot.mechanism, compiled._engine.asked, robot._kinematics, straight=True, known=written)
    whole = engine.solve(how["poses"])
    np.testing.assert_array_equal(whole.status == 0, arrays.ok)
    assert_same(whole.values, arrays, how["quantities"])
    part = engine.solve(how["poses"][700:713])
    for name in how["quantities"]:
        np.testing.assert_array_equal(part.values[name], whole.values[name][700:713])


def test_many_poses_are_written_down_without_being_asked():
    robot, ends = loaded("ur5")
    rows = drawn(ends, 5000)
    many, few = robot.sweep(poses=rows, quantities=["C"]), robot.sweep(poses=rows[:100], quantities=["C"])
    assert many._engine.written is not None
    assert few._engine.written is None
    scale = np.abs(few["C"]).max(axis=(1, 2), keepdims=True)
    assert np.abs((many["C"][:100] - few["C"]) / scale).max() < 1e-12


def test_most_poses_are_the_machines_own(compared):
    _, _, compiled, how = compared
    engine = compiled._engine
    assert engine.written.accepted(engine._machine.run(how["poses"])[:, -3:].T).mean() > 0.9


def test_redundant_loops_that_yield_all_over_are_compiled():
    """The hinges of a planar 3-RRR say some things three times; arms and rods yield in all directions."""
    robot = build.three_rrr(base_radius=0.3, platform_radius=0.08, arm=0.2, rod=0.2, motor_stiffness=2e4,
                            arm_diameter=0.03, rod_diameter=0.02)  # fmt: skip
    rows = drawn(np.array([(-0.05, 0.05), (-0.05, 0.05), (-0.2, 0.2)]), 30)
    for names in (["C"], ["C", "shares"]):  # by its legs, and by all modules
        s = robot.sweep(poses=rows, quantities=names, force=FORCE, moment=MOMENT, compiled=True)
        assert not s.remarks
        assert s._engine.written.accepted(s._engine._machine.run(rows)[:, -3:].T).all()
        for row, c in zip(rows, s["C"], strict=True):
            single = asked_singly(robot, row).C
            assert np.abs(c - single).max() <= 1e-12 * np.abs(single).max()


def test_a_loop_drawn_to_seven_digits_is_closed_like_by_arrays(tmp_path):
    """An elbow tilted by what seven digits leave: the loop cannot close, and is taken as drawn, as arrays do."""
    drawing = (ROBOTS / "five_bar" / "five_bar.urdf").read_text()
    axis = '<parent link="right_arm"/><child link="right_rod"/><origin xyz="0.16 0.15 0"'
    assert axis in drawing
    path = tmp_path / "tilted.urdf"
    path.write_text(drawing.replace(axis, axis + ' rpy="2e-7 0 0"'))
    robot = prup_pin.load(str(path), joint_stiffness=1e4)
    rows = drawn(loaded("five_bar")[1], 20)
    a, b = (robot.sweep(poses=rows, quantities=["C", "q"], compiled=compiled) for compiled in (False, True))
    assert (a.status == b.status).all()
    assert a.ok.sum() > 15
    np.testing.assert_allclose(a["C"][a.ok], b["C"][a.ok], rtol=0, atol=1e-12 * np.nanmax(np.abs(a["C"])))
    np.testing.assert_allclose(a["q"][a.ok], b["q"][a.ok], rtol=0, atol=1e-12)


def test_what_is_equal_to_twelve_digits_alone_is_not_taken_as_equal(monkeypatch):
    """Directions and places rounded to twelve digits: legs that turn about nearly the same lines are not one."""
    monkeypatch.setattr(urdf_file, "_words", lambda values: " ".join(f"{round(float(v), 13):.12g}" for v in values))
    robot = build.stewart(**STEWART)
    engine = Engine(robot.mechanism, Asked(("C",)), robot._kinematics, straight=True)
    assert engine.written is not None
    rows = np.array(list(robot.home.coordinates.values())) + drawn(np.array([(-0.05, 0.05)] * 6), 4)
    for row, c in zip(rows, engine.solve(rows).values["C"], strict=True):
        single = asked_singly(robot, row).C
        assert np.abs(c - single).max() <= 1e-12 * np.abs(single).max()


def test_what_cannot_be_compiled_is_said_and_solved_by_arrays():
    motors = {"motor1": 9e3, "motor2": 1e4, "motor3": 1.2e4}
    robot = prup_pin.load(str(ROBOTS / "delta" / "robot.urdf"), tool="centre", joint_stiffness=motors)
    rows = drawn(np.array([(-0.1, 0.1)] * 3), 3)
    s = robot.sweep(poses=rows, quantities=["C"], compiled=True)
    assert "cannot be compiled" in s.remarks[0]
    np.testing.assert_array_equal(s["C"], robot.sweep(poses=rows, quantities=["C"])["C"])


def test_poses_beyond_reach_have_the_same_status():
    robot, _ = loaded("3prup")
    rows = drawn(np.array([(0.05, 0.7), (-1.2, 1.2), (-1.2, 1.2)]), 300)
    arrays, compiled = (robot.sweep(poses=rows, quantities=["C"], compiled=how) for how in (False, True))
    assert (arrays.status == compiled.status).all()
    assert 50 < arrays.ok.sum() < 250


def test_without_llvmlite_the_extra_is_named(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    robot, _ = loaded("3prup")
    with pytest.raises(prup_pin.MissingExtraError, match=r"llvmlite.*compiled"):
        robot.sweep(z=0.3, theta=0.0, phi=0.0, compiled=True)
    assert robot.sweep(z=0.3, theta=0.0, phi=0.0).ok.all()


# -- the kernel's programs ---------------------------------------------------------------------------------------------


def traced(function, count, samples=8, low=-1.0, high=1.0):
    """A program of a function of `count` numbers, and inputs to try it on."""
    generator = np.random.default_rng(1)
    tape = Tape(samples)
    given = tape.inputs(generator.uniform(low, high, (samples, count)))
    return Program(tape, list(function(*given))), generator.uniform(low, high, (count, 50))


def machine_of(program, count, compiled=True):
    """What does nothing but run a program."""
    return Columns(Pipeline(Program.without(count), None, program), compiled=compiled)


def by_numpy(program, inputs):
    """The outputs (m, n) of inputs (k, n)."""
    return machine_of(program, len(inputs), compiled=False).run(inputs.T)[:, :-2].T


FUNCTIONS = {
    "trigonometry": (lambda a, b: (np.sin(a), np.cos(b), np.tan(a * 0.1), np.arctan2(a, b)), 2, (-40.0, 40.0)),
    "turns": (lambda a, b: (np.cos(a), np.sin(a), np.sin(a) * np.cos(a)), 2, (-40.0, 40.0)),
    "roots": (lambda a, b: (np.sqrt(a * a + 1), np.hypot(a, b), 1 / (a + 3), a**3), 2, (-2.0, 2.0)),
    "cases": (lambda a, b: (largest([a, b]), abs(a), np.rint(3 * a), a <= b), 2, (-2.0, 2.0)),
    "conditions": (lambda a, b: (least([a <= b, a <= 1.0]), (a <= b) + (a <= 1.0), -(a <= b)), 2, (-2.0, 2.0)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_program_computes_its_function(name):
    function, count, (low, high) = FUNCTIONS[name]
    program, inputs = traced(function, count, low=low, high=high)
    plain = {
        "trigonometry": lambda a, b: (np.sin(a), np.cos(b), np.tan(a * 0.1), np.arctan2(a, b)),
        "turns": lambda a, b: (np.cos(a), np.sin(a), np.sin(a) * np.cos(a)),
        "roots": lambda a, b: (np.sqrt(a * a + 1), np.hypot(a, b), 1 / (a + 3), a**3),
        "cases": lambda a, b: (np.maximum(a, b), np.abs(a), np.rint(3 * a), (a <= b).astype(float)),
        "conditions": lambda a, b: (1.0 * (a <= np.minimum(b, 1.0)), 1.0 * (a <= b) + (a <= 1.0), -1.0 * (a <= b)),
    }[name]
    expected = np.array(plain(*inputs))
    np.testing.assert_allclose(by_numpy(program, inputs), expected, rtol=1e-15, atol=1e-15)
    assert program.inputs == count
    compiled = machine_of(program, count).run(inputs.T.copy())[:, :-2].T
    np.testing.assert_allclose(compiled, expected, rtol=1e-15, atol=4e-16)


def test_zeros_ones_and_what_is_known_are_left_out():
    program, _ = traced(lambda a, b: (a * 0.0 + b * 1.0, (a + b) - (b + a), a * b - b * a + a), 2)
    assert len(program) == 0
    # sin^2 + cos^2 - 1 is found to be zero: it is at every sample
    program, inputs = traced(lambda a, b: (b * (np.sin(a) ** 2 + np.cos(a) ** 2 - 1.0), a), 2)
    assert len(program) == 0
    np.testing.assert_array_equal(by_numpy(program, inputs)[1], inputs[0])


def test_what_is_the_same_at_the_samples_by_cases_is_not_taken_for_equal():
    """At all samples a is the larger one; elsewhere it is not."""
    tape = Tape(4)
    a, b = tape.inputs(np.array([[1.0, 0.1], [2.0, 0.2], [3.0, 0.3], [1.5, 0.7]]))
    program = Program(tape, [largest([a, b]), abs(b), np.sqrt(largest([a, b])) - np.sqrt(a)])
    np.testing.assert_allclose(by_numpy(program, np.array([[1.0], [-4.0]])), [[1.0], [4.0], [0.0]])
    np.testing.assert_allclose(by_numpy(program, np.array([[1.0], [4.0]])), [[4.0], [4.0], [1.0]])


def test_elimination_solves():
    generator = np.random.default_rng(3)
    tape = Tape(6)
    given = tape.inputs(generator.normal(size=(6, 16)))
    matrix = given.reshape(4, 4).copy()
    matrix[0, 1] = matrix[3, 2] = matrix[2, 0] = tape.constant(0.0)
    solution, pivots = eliminated(matrix, np.eye(4).astype(object))
    assert len(pivots) == 4
    inputs = generator.normal(size=(16, 30))
    found = by_numpy(Program(tape, list(solution.ravel())), inputs).T.reshape(30, 4, 4)
    numbers = inputs.T.reshape(30, 4, 4).copy()
    numbers[:, 0, 1] = numbers[:, 3, 2] = numbers[:, 2, 0] = 0
    np.testing.assert_allclose(found @ numbers, np.broadcast_to(np.eye(4), (30, 4, 4)), atol=1e-9)


def test_elimination_of_a_singular_matrix_is_refused():
    tape = Tape(6)
    a, b = tape.inputs(np.random.default_rng(0).normal(size=(6, 2)))
    with pytest.raises(ZeroDivisionError):
        eliminated(np.array([[a, b], [2.0 * a, 2.0 * b]]), np.eye(2).astype(object))


def test_machines_pickle():
    program, inputs = traced(lambda a, b: (a * b, np.sin(a)), 2)
    machine = machine_of(program, 2)
    again = pickle.loads(pickle.dumps(machine))
    np.testing.assert_array_equal(again.run(inputs.T.copy()), machine.run(inputs.T.copy()))


def test_newtons_steps_stop_pose_by_pose():
    """x = sqrt(c) from near it; far off the steps are too long, and that is told."""
    tape = Tape(4)
    (c,) = tape.inputs(np.array([[1.0], [1.1], [0.9], [1.05]]))
    start = Program(tape, [1.0 + 0.0 * c, ])  # fmt: skip
    start.inputs = 1
    tape = Tape(4)
    y, c = tape.inputs(np.array([[1.0, 1.0], [1.0, 1.1], [1.1, 0.9], [1.05, 1.05]]))
    move = (y * y - c) / (2 * y)
    step = Program(tape, [y - move, move * move])
    final = Program(tape, [y])
    pipeline = Pipeline(start, step, final)
    values = np.array([1.0, 1.15, 0.9, 4.0, 1.01, 0.99, 1.1, 1.2, 1.18])
    for compiled in (False, True):
        out = Columns(pipeline, compiled=compiled).run(values[:, None])
        good = values < 2
        np.testing.assert_allclose(out[good, 0], np.sqrt(values[good]), rtol=1e-15)
        np.testing.assert_array_equal(out[:, 1], np.where(good, 0.0, 1.0))
        np.testing.assert_allclose(out[good, 2], np.abs(np.sqrt(values[good]) - 1), rtol=0.1, atol=1e-12)


def test_cases_are_drawn_where_robots_can_be():
    assert set(ASKED) <= set(CASES)
