"""A place that looks alike is taken back with the wrong weight beside it, or the small law that made up for it."""

from pathlib import Path
from types import SimpleNamespace

import pytest

import prup_pin
from prup_pin.diagnosis import contest, selection
from prup_pin.diagnosis.candidates import candidates
from prup_pin.recordings import LoadProgramme, RandomPoses, TestPlan
from prup_pin.simulation import Simulator, effect_named, inputs_of

from .test_parts import problem_of

ROBOT = Path(__file__).parents[1] / "robots" / "three_rps" / "three_rps.urdf"
BOX = {"z": (0.72, 0.88), "rx": (-0.25, 0.25), "ry": (-0.25, 0.25)}
DRIVE, HINGE = "stiffness_changed at leg2/drive", "stiffness_changed at leg2/hinge (radial)"
WEIGHT, PAYLOAD = "self_weight at robot", "payload at tool (off centre)"
TARGET = "target_misalignment at target"
LAWS = (DRIVE, HINGE, WEIGHT, PAYLOAD, TARGET)


@pytest.fixture(scope="module")
def searched():
    """A 3-RPS that sags, one drive of which is soft: its bearing in series with it carries the leg's weight as well."""
    robot = prup_pin.load(ROBOT)
    plan = TestPlan(
        poses=(RandomPoses(8, BOX),),
        loads=(LoadProgramme((0.0, 1.0, -1.0), random_directions=1, force=300, moment=30),),
        seed=4,
    )
    inputs = plan.inputs(lambda at: robot.pose(**at).actuators)
    faults = (("stiffness_changed", "leg2/drive", "", {"factor": 0.3}), ("self_weight", "robot", "", {"scale": 1.0}))
    effects = [effect_named(*fault, robot.mechanism) for fault in faults]
    simulator = Simulator(robot, inputs_of(inputs, robot))
    problem = problem_of(simulator, effects)
    library = [found for found in candidates(robot.mechanism, simulator.inputs) if found.name in LAWS]
    return selection.Search(problem), {found.name: found for found in library}


@pytest.mark.parametrize("wrong", [(HINGE, PAYLOAD), (WEIGHT, HINGE, TARGET)])
def test_a_place_that_looks_alike_is_tried_with_another_weight_and_with_a_law_less(searched, wrong):
    search, library = searched
    fit = search.problem.first
    for name in wrong:
        _, term, _ = search.problem.quick(fit, fit.terms, library[name])
        fit = search.refine([*fit.terms, term], fit)
    laws = list(library.values())
    rivals = [contest.challengers(search.problem, fit, place, laws) for place in range(len(fit.terms))]
    found = contest.in_pairs(search, fit, rivals)
    assert {term.candidate.name for term in found.terms} == {DRIVE, WEIGHT}
    assert found.chi2 / found.residual.size == pytest.approx(1.0, abs=0.15)


def test_after_a_term_was_replaced_the_next_one_is_asked_before_it_is_asked_again(monkeypatch):
    """A soft joint beside a bias of the sensor, which stands for weight, is the wrong one: weight comes, it goes."""
    better = {
        (("bias", "drive"), 0): ("weight", "drive"),
        (("weight", "drive"), 0): ("payload", "drive"),  # which makes up for the wrong joint as well
        (("weight", "drive"), 1): ("weight", "joint"),
    }

    def judged_rivals(search, fit, index, library):
        terms = better.get((fit.terms, index))
        return [fit.terms[index]], terms and SimpleNamespace(terms=terms)

    monkeypatch.setattr(contest, "judged_rivals", judged_rivals)
    found, _ = contest.challenge_each(SimpleNamespace(over=False), SimpleNamespace(terms=("bias", "drive")), ())
    assert found.terms == ("weight", "joint")
