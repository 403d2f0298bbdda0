"""The same recording gives the same verdict and the same numbers, however busy the machine is."""

import ast
import json
import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import prup_pin
from prup_pin.diagnosis import diagnose, search
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.criteria import MOST_FITS
from prup_pin.diagnosis.search import select
from prup_pin.recordings import read_recording
from prup_pin.simulation import Simulator, inputs_of
from prup_pin.views.report.as_json import diagnosis_as_json

from ..elsewhere import PRACTICE, needs_practice
from ..simulation.bench import inputs
from .test_named_again import recorded, robot
from .test_parts import problem_of, term

CLOCKS = ("time", "perf_counter", "process_time", "monotonic", "thread_time")
DEVICES = [*(f"p{number:02}" for number in range(1, 11)), *(f"ups{number}" for number in range(1, 5))]


def everything(diagnosis, robot):
    """All that a diagnosis says, to the last bit: NaN equals itself, and -0 is not 0."""
    arrays = [diagnosis.residual_before, diagnosis.residual_after, diagnosis.final.position, diagnosis.final.rotation]
    return json.dumps(diagnosis_as_json(diagnosis, robot)), [array.tobytes() for array in arrays]


@pytest.fixture
def hurried(monkeypatch):
    """Makes all clocks run ten times too fast, as they seem to on a machine that does other work."""

    def hurry():
        for name in CLOCKS:
            clock = getattr(time, name)
            begin = clock()
            monkeypatch.setattr(time, name, lambda clock=clock, begin=begin: begin + 10 * (clock() - begin))

    return hurry


def test_clocks_and_threads_decide_nothing(hurried):
    recording = recorded("five_bar", ("geometric_offset", "right_elbow", "position", {"x": 1e-4, "y": 0.0}), poses=12)
    before = diagnose(robot("five_bar"), recording)
    hurried()
    robot.cache_clear()
    with threadpool_limits(2, user_api="blas"):
        again = diagnose(robot("five_bar"), recording)
    assert before.findings
    assert everything(again, robot("five_bar")) == everything(before, robot("five_bar"))


@pytest.mark.slow
def test_clocks_and_threads_decide_nothing_of_what_no_law_explains(diagnosed_strange, strange_bench, hurried):
    robot, _, before = diagnosed_strange
    hurried()
    with threadpool_limits(2, user_api="blas"):
        again = diagnose(prup_pin.load("3prup"), read_recording(strange_bench.path))
    assert everything(again, robot) == everything(before, robot)


def test_no_clock_is_read():
    folder = Path(search.__file__).parent
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            assert not {"time", "datetime", "timeit"} & {*names, getattr(node, "module", None)}, path.name


@pytest.mark.slow
@needs_practice
@pytest.mark.parametrize("name", DEVICES)
def test_practice_devices_hurried(name, hurried):
    beside = json.loads((PRACTICE / f"{name}.json").read_text())["robot"]
    robot = prup_pin.load(PRACTICE / beside if beside.endswith(".urdf") else beside)
    recording = read_recording(PRACTICE / f"{name}.csv")
    before = diagnose(robot, recording)
    hurried()
    assert everything(diagnose(robot, recording), robot) == everything(before, robot)


# -- budgets -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small():
    """(problem, library, blocks): two effects, and few laws that may compete for them."""
    robot = prup_pin.load("3prup")
    simulator = Simulator(robot, inputs_of(inputs(robot, poses=5, cycle=(0.0, 0.5, 1.0, 0.0, -0.5, -1.0)), robot))
    library = {candidate.name: candidate for candidate in candidates(robot.mechanism, simulator.inputs)}
    truth = [
        term(library, "backlash at leg2/ball_nut", 3e-5, 1.0),
        term(library, "stiffness_changed at leg1/R_lambda (tilting)", 0.2),
    ]
    names = [item.candidate.name for item in truth] + [
        "coulomb_friction at leg1/R_phi",
        "root_tilt_compliance at leg3/linear_rod",
        "payload at moving_star",
        "creep at leg1/R_phi (axial)",
    ]
    known = [library[name] for name in names if name in library]
    return problem_of(simulator, [item.effect for item in truth]), known, simulator.inputs.blocks


def test_a_search_ends_when_its_budget_is_spent(small):
    problem, library, blocks = small
    first = problem.first
    whole = select(problem, library, blocks, first)
    assert len(whole.last.terms) == 2
    assert whole.fits < MOST_FITS
    short = select(problem, library, blocks, first, most=1)
    assert len(short.last.terms) <= 1
    assert 0 < short.fits < whole.fits
    plenty = select(problem, library, blocks, first, most=2 * whole.fits)
    assert plenty.fits == whole.fits
    np.testing.assert_array_equal(plenty.last.residual, whole.last.residual)
