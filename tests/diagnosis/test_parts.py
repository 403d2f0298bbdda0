"""What the diagnosis is made of: fits to first order, the place before any law, what counts as noise."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin.channels import Noise, PoseChannel, Stack, channels_of, whitening
from prup_pin.diagnosis.candidates import Candidate, candidates, under_load
from prup_pin.diagnosis.diagnosis import Finding
from prup_pin.diagnosis.evidence import Rival
from prup_pin.diagnosis.findings import unknown_at
from prup_pin.diagnosis.first_order_fit import FirstOrderFit, Remainder
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.locate import least_left, locate, yieldings
from prup_pin.diagnosis.next_experiment import next_experiment
from prup_pin.diagnosis.noise import is_white, noise_of_the_rest
from prup_pin.diagnosis.problem import Problem, Term
from prup_pin.diagnosis.search import Selection, alternatives_to, other_explanations
from prup_pin.laws import Inputs
from prup_pin.recordings import read_recording
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.spatial import rotation_exp

from ..simulation.bench import inputs

NOISE = Noise(2e-6, 1e-5, 0.0, 0.0, "declared")


@pytest.fixture(scope="module")
def simulator(robot):
    bench = inputs(robot, poses=6, cycle=(0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0))
    return Simulator(robot, inputs_of(bench, robot))


@pytest.fixture(scope="module")
def library(robot, simulator):
    return {candidate.name: candidate for candidate in candidates(robot.mechanism, simulator.inputs)}


def problem_of(simulator, effects, scatter=1.0, seed=0, noise=NOISE):
    """A recording of the robot with these effects, whose sensors scatter by so many times NOISE."""
    run = simulator.run(effects)
    rng = np.random.default_rng(seed)
    shape = run.position.shape
    position = run.position + scatter * NOISE.position * rng.normal(size=shape)
    rotation = rotation_exp(scatter * NOISE.rotation * rng.normal(size=shape)) @ run.rotation
    tool = simulator.robot.mechanism.tool
    pose = PoseChannel(tool, position, rotation, np.ones((len(position), 6), bool))
    return Problem.of(simulator, Stack((pose,)), noise)


def term(library, name, *values):
    candidate = library[name]
    return Term(candidate, candidate.coordinates_of(np.array(values, float)))


# -- fits to first order -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [(-0.3, -0.4, 0.1), (0.5, -0.2, 0.0)])
def test_a_cable_is_found_on_whatever_side_its_anchor_is(robot, simulator, library, side):
    """No step leads from one side of the tool to the other."""
    home = robot.home.placement(robot.mechanism.tool.name)[:3, 3]
    values = {"stiffness": 900.0, "slack_length": 0.97 * float(np.linalg.norm(side))}
    values |= dict(zip("xyz", (home + np.array(side)).tolist(), strict=True))
    problem = problem_of(simulator, [effect_named("slack_cable", "environment", "", values, robot.mechanism)])
    first = problem.first
    chi2, found, _ = FirstOrderFit(Remainder(problem, first, ()), library["slack_cable at environment"]).best(
        thorough=True
    )
    assert first.chi2 > 100 * first.residual.size
    assert chi2 < 3 * first.residual.size
    at = np.array([found.effect.values[axis] for axis in "xyz"]) - home
    assert at @ side > 0.9 * np.linalg.norm(at) * np.linalg.norm(side)


def test_a_fit_may_start_where_the_effect_is_nothing(simulator, library, monkeypatch):
    """There a coordinate is zero, and steps in proportion to it would be nothing too."""
    truth = term(library, "stiffness_changed at leg3/linear_rod", 0.9)
    problem = problem_of(simulator, [truth.effect])
    first = problem.fit_at((), problem.first)
    monkeypatch.setattr(Candidate, "scan", lambda self: [np.zeros(1)])
    chi2, found, _ = FirstOrderFit(Remainder(problem, first, ()), truth.candidate).best()
    assert found.effect.values["factor"] == pytest.approx(0.9, abs=0.01)
    assert chi2 < 1.2 * first.residual.size < 0.5 * first.chi2


def counted(monkeypatch, owner, name):
    """Calls of a method from now on, as they come."""
    calls, method = [], getattr(owner, name)

    def counting(self, *arguments, **named):
        calls.append(arguments)
        return method(self, *arguments, **named)

    monkeypatch.setattr(owner, name, counting)
    return calls


def test_a_fit_that_begins_with_what_another_one_has_is_not_simulated_again(simulator, library, monkeypatch):
    truth = term(library, "stiffness_changed at leg1/linear_rod", 0.7)
    problem = problem_of(simulator, [truth.effect])
    first = problem.fit_at((), problem.first)
    fit = problem.refine([term(library, truth.candidate.name, 0.75)], first)
    assert fit.terms[0].effect.values["factor"] == pytest.approx(0.7, rel=0.01)
    assert fit.chi2 < 1.2 * first.residual.size
    simulations = counted(monkeypatch, Simulator, "run_setup")
    assert problem.refine(fit.terms, fit).chi2 == fit.chi2
    assert not simulations


def test_a_candidate_is_fitted_together_with_what_is_there(simulator, library):
    """An offset of the sensor and of the load look much alike: one of them must give way while the other is fitted."""
    bias = term(library, "wrench_sensor_bias at wrench_sensor", 0.5, -1.5, 3.0, 1.0, 0.2, -0.5)
    turn = term(library, "pose_sensor_misalignment at pose_sensor", 5e-5, 2e-5, 4e-5, 1e-5, 0, 5e-6)
    problem = problem_of(simulator, [bias.effect, turn.effect])
    start = problem.fit_at((), problem.first)
    fit = problem.refine([FirstOrderFit(Remainder(problem, start, ()), bias.candidate).best()[1]], start)
    nuisance = problem.nuisance(fit, [0])
    alone, _, _ = FirstOrderFit(Remainder(problem, fit, fit.terms), turn.candidate).best()
    together, found, change = FirstOrderFit(Remainder(problem, fit, fit.terms, nuisance), turn.candidate).best()
    whole = problem.refine([*fit.terms, found], fit)
    assert together == pytest.approx(whole.chi2, rel=0.02)
    assert together < 0.9 * alone
    assert np.abs(nuisance.basis.T @ change.ravel()).max() < 1e-9 * np.linalg.norm(change)


def test_no_law_of_a_module_beats_its_bound(simulator, library):
    truth = [term(library, "backlash at leg2/ball_nut", 3e-5, 1.0), term(library, "self_weight at robot", 0.3)]
    problem = problem_of(simulator, [item.effect for item in truth])
    first = problem.fit_at((), problem.first)
    bounded = [candidate for candidate in library.values() if candidate.only_module]
    assert len(bounded) > 60
    for candidate in bounded[::7]:
        bound = least_left(problem, first, candidate.only_module, first.residual)
        chi2, _, _ = FirstOrderFit(Remainder(problem, first, ()), candidate).best()
        assert chi2 >= bound * (1 - 1e-9)
    # ... and the bound is worth something: a law elsewhere cannot do what the true one does
    own = least_left(problem, first, "leg2/ball_nut", first.residual)
    other = least_left(problem, first, "leg1/ball_nut", first.residual)
    assert own < 0.8 * other


def test_no_law_of_a_module_beats_its_bound_beside_a_joint_that_resists_it(simulator, library):
    rubs = term(library, "coulomb_friction at leg2/R_theta_P", 2.0, 2e4)
    soft = term(library, "stiffness_changed at leg2/linear_rod", 0.7)
    problem = problem_of(simulator, [rubs.effect, soft.effect], scatter=0.1)
    fit = problem.fit_at([rubs], problem.first)
    bound = least_left(problem, fit, "leg2/linear_rod", fit.residual)
    chi2, _, _ = FirstOrderFit(Remainder(problem, fit, fit.terms), soft.candidate).best()
    assert bound * (1 - 1e-9) <= chi2 < 10.0 < fit.chi2


def test_a_gap_may_close_at_twice_the_load_that_its_module_sees(simulator, library):
    """A bearing's by the resultant across it, one along each axis by the larger of both, like places by the largest."""
    truth = replace(
        term(library, "backlash at leg2/ball_nut", 3e-5, 1.0).effect, values={"half_gap": 3e-5, "closing_load": 20.0}
    )
    problem = problem_of(simulator, [truth], scatter=0.1)
    seen = {candidate.name: candidate for candidate in under_load(list(library.values()), problem.nominal)}
    across = np.abs(problem.nominal.loads("leg1/R_phi")[:, :2])
    nuts = [np.abs(problem.nominal.loads(f"leg{leg}/ball_nut")).max() for leg in (1, 2, 3)]
    for name, load in (
        ("leg2/ball_nut", nuts[1]),
        ("robot (ball_nut)", max(nuts)),
        ("leg1/R_phi (radial)", np.hypot(*across.T).max()),
        ("leg1/R_phi (radial by axis)", across.max()),
    ):
        assert seen[f"backlash at {name}"].quantities[-1].upper == pytest.approx(2 * load, rel=1e-9)
    candidate = seen["backlash at leg2/ball_nut"]
    _, found, _ = FirstOrderFit(Remainder(problem, problem.fit_at((), problem.first), ()), candidate).best()
    assert found.effect.values["closing_load"] == pytest.approx(20.0, rel=0.1)
    assert found.effect.values["half_gap"] == pytest.approx(3e-5, rel=0.1)


def test_what_acts_otherwise_has_no_bound(library):
    assert library["stiffness_changed at leg3/linear_rod"].only_module == "leg3/linear_rod"
    assert library["creep at leg1/R_phi (axial)"].only_module == "leg1/R_phi"
    for name in ("coulomb_friction at leg1/R_phi", "encoder_offset at leg1/motor", "self_weight at robot"):
        assert library[name].only_module is None


# -- the place, before any law -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("physics", "place", "aspect", "values", "module"),
    [
        ("backlash", "leg2/ball_nut", "", {"half_gap": 4e-5, "closing_load": 0.5}, "leg2/ball_nut"),
        ("root_tilt_compliance", "leg3/linear_rod", "", {"root_tilting_stiffness": 5e3}, "leg3/linear_rod"),
        ("stiffness_changed", "leg1/R_lambda", "tilting", {"factor": 0.1}, "leg1/R_lambda"),
    ],
)
def test_the_place_is_found_without_a_law(robot, simulator, physics, place, aspect, values, module):
    problem = problem_of(simulator, [effect_named(physics, place, aspect, values, robot.mechanism)])
    fit = problem.fit_at((), problem.first)
    found = locate(problem, fit)
    assert module in found.candidates
    assert {name.partition("/")[0] for name in found.candidates} == {module.partition("/")[0]}
    assert found.share > 0.7
    best = yieldings(problem, fit)
    signal = fit.chi2 - fit.residual.size
    assert best[0].gain == pytest.approx(signal, rel=0.1)
    elsewhere = max(item.gain for item in best if item.module[:4] != module[:4])
    assert elsewhere < 0.9 * best[0].gain


def test_it_says_what_a_strange_deformation_follows(tmp_path, robot):
    """The drive of leg 1 moves with the load of the drive of leg 2."""
    from tests.reference.concealed.device import Device
    from tests.reference.concealed.draw import NOISE as SENSORS
    from tests.reference.concealed.draw import measure, programme, write_csv

    rng = np.random.default_rng(5)
    effect = {"physics": "alien", "location": "leg1/support_bearing", "kind": "coupling", "of": 2, "coefficient": 4e-6}
    write_csv(tmp_path / "device.csv", measure(Device([effect]), programme(rng, 5, 60.0), rng, SENSORS), False)
    recording = read_recording(tmp_path / "device.csv")
    stack = Stack(channels_of(recording, robot.mechanism))
    problem = Problem.of(Simulator(robot, inputs_of(recording, robot)), stack, NOISE)
    found = locate(problem, problem.fit_at((), problem.first))
    assert "leg1/support_bearing" in found.candidates
    assert all(name.startswith("leg1/") for name in found.candidates)
    variable, share = found.follows
    assert "leg2_slide" in variable.words
    assert "load" in variable.words
    assert not variable.came
    assert share > 0.7 > found.curve.gain / problem.fit_at((), problem.first).chi2


def test_what_a_freed_module_does_is_not_seen(simulator, library):
    """With one module free to deform as it likes, what it does is nothing, and what others do is found right."""
    strange = term(library, "backlash at leg1/ball_nut", 5e-5, 1.0)
    weight = term(library, "self_weight at robot", 1.0)
    problem = problem_of(simulator, [strange.effect, weight.effect])
    first = problem.fit_at((), problem.first)
    freed = problem.freed(Influence(simulator, first.run), "leg1/ball_nut")
    alone = problem_of(simulator, [strange.effect]).freed(Influence(simulator, first.run), "leg1/ball_nut")
    assert alone.fit_at((), alone.first).chi2 < 1.3 * first.residual.size
    fit = freed.refine([term(library, "self_weight at robot", 0.5)], freed.fit_at((), freed.first))
    assert fit.terms[0].effect.values["scale"] == pytest.approx(1.0, abs=0.01)
    assert fit.chi2 < 1.3 * first.residual.size < 0.01 * first.chi2


# -- noise -------------------------------------------------------------------------------------------------------------


def test_noise_is_white_and_structure_is_not(robot, simulator):
    problem = problem_of(simulator, [])
    fit = problem.fit_at((), problem.first)
    blocks = simulator.inputs.blocks[fit.samples]
    assert is_white(problem, fit, blocks)
    weak = effect_named("stiffness_changed", "leg1/R_lambda", "tilting", {"factor": 0.5}, robot.mechanism)
    other = problem_of(simulator, [weak])
    assert not is_white(other, other.fit_at((), other.first), blocks)


def test_what_a_load_does_at_one_position_and_not_at_another_is_no_noise(robot):
    """A foot that gives way, and a cell that takes one force for another, follow no module's load and no position."""
    simulator = Simulator(robot, inputs_of(inputs(robot, poses=16, cycle=(0.0, 1.0, 0.5, -0.5, -1.0)), robot))
    problem = problem_of(simulator, [])
    fit = problem.first
    blocks = simulator.inputs.blocks[fit.samples]
    force, position = simulator.inputs.wrench[fit.samples, 2], simulator.inputs.actuators[fit.samples, 0]
    follows = force * (position - position.mean())
    residual = fit.residual.copy()
    residual[:, 4] += 0.7 * follows / follows.std()
    assert is_white(problem, fit, blocks)
    assert not is_white(problem, replace(fit, residual=residual), blocks)


@pytest.mark.parametrize("of", ["temperature", "time"])
@pytest.mark.parametrize("turned", [False, True])
def test_what_follows_a_recorded_column_is_no_noise(robot, of, turned):
    """What grows or wanders alike everywhere, and what does so along a link that turns with the robot."""
    given = inputs_of(inputs(robot, poses=16, cycle=(0.0, 1.0, 0.5, -0.5, -1.0)), robot)
    course = 20 + 5 * np.cos(np.arange(len(given)) / 7) if of == "temperature" else given.elapsed
    problem = problem_of(Simulator(robot, replace(given, temperature=20 + 5 * np.cos(np.arange(len(given)) / 7))), [])
    fit = problem.first
    blocks, position = given.blocks[fit.samples], given.actuators[fit.samples, 0]
    follows = course[fit.samples] - course[fit.samples].mean()
    follows = follows * (position - position.mean()) if turned else follows
    residual = fit.residual.copy()
    residual[:, 1] += 0.9 * follows / follows.std()
    assert is_white(problem, fit, blocks)
    assert not is_white(problem, replace(fit, residual=residual), blocks)
    blind = Simulator(robot, replace(given, temperature=None))
    if of == "temperature" and turned:
        assert is_white(replace(problem, simulator=blind), replace(fit, residual=residual), blocks)


@pytest.mark.parametrize("scatter", [4.0, 100.0])
def test_noise_that_was_declared_too_small_is_measured(simulator, scatter):
    problem = problem_of(simulator, [], scatter)
    fit = problem.fit_at((), problem.first)
    found = noise_of_the_rest(problem, fit, simulator.inputs.blocks[fit.samples]).noise
    assert found.position == pytest.approx(scatter * NOISE.position, rel=0.15)
    assert found.rotation == pytest.approx(scatter * NOISE.rotation, rel=0.15)
    assert found.source == "estimated"


def test_structure_is_not_taken_for_noise(robot, simulator):
    missing = effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 4e-5, "closing_load": 0.5}, robot.mechanism)
    problem = problem_of(simulator, [missing])
    fit = problem.fit_at((), problem.first)
    assert noise_of_the_rest(problem, fit, simulator.inputs.blocks[fit.samples]) is None
    right = problem_of(simulator, [])
    fit = right.fit_at((), right.first)
    assert noise_of_the_rest(right, fit, simulator.inputs.blocks[fit.samples]) is None


def test_runs_are_kept_when_samples_are_taken(simulator):
    given = simulator.inputs
    assert (given.run_labels() == 0).all()
    labelled = replace(given, runs=np.arange(len(given)) // 5)
    assert isinstance(labelled, Inputs)
    assert labelled.run_labels().max() == (len(given) - 1) // 5


def test_whitening_takes_the_wrench_sensors_noise_along(robot):
    """Residuals of both sensors' noise, through the compliance, become independent and of unit variance."""
    compliance = robot.compliance(robot.pose(z=0.4, theta=0.2, phi=-0.1)).C
    noise = Noise(2e-6, 1e-5, 0.3, 0.02, "declared")
    rng = np.random.default_rng(7)
    n = 20_000
    sensor = rng.normal(size=(n, 6)) * np.repeat([2e-6, 1e-5], 3)
    load = rng.normal(size=(n, 6)) * np.repeat([0.3, 0.02], 3)
    deviation = np.repeat([noise.position, noise.rotation], 3)
    white = whitening(deviation, noise.wrench, np.repeat(compliance[None], n, axis=0), np.ones((n, 6), bool))
    seen = (white @ (sensor + load @ compliance.T)[..., None])[..., 0]
    np.testing.assert_allclose(seen.T @ seen / n, np.eye(6), atol=0.05)
    # ... and the load's share is not small here
    alone = (white @ sensor[..., None])[..., 0]
    assert (alone**2).sum(1).mean() < 4.5


def test_a_channel_that_was_not_measured_weighs_nothing(robot):
    compliance = robot.compliance(robot.pose(z=0.4, theta=0.2, phi=-0.1)).C[None]
    exists = np.array([[True, False, True, True, True, True]])
    white = whitening(np.repeat([NOISE.position, NOISE.rotation], 3), NOISE.wrench, compliance, exists)
    residual = np.array([1e-6, 7.0, 1e-6, 1e-6, 1e-6, 1e-6])
    assert (white[0] @ residual)[1] == 0
    assert np.abs(white[0] @ residual).max() < 10


def test_noise_alone_points_nowhere(simulator):
    """What free numbers remove by chance is not counted as a gain."""
    gains = [
        [item.gain for item in yieldings(problem, problem.fit_at((), problem.first))]
        for problem in (problem_of(simulator, [], seed=seed) for seed in range(4))
    ]
    n = len(simulator.inputs)
    assert abs(np.mean(gains)) < 0.25 * n
    assert np.max(gains) < 5 * np.sqrt(2 * 2 * n)


# -- the next experiment -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_beside_something_unknown_no_experiment_separates_laws_that_nobody_found(simulator, library):
    """Such laws are pieces of what is missing: a test shows more of that, and parts only what was found beside it."""
    ours = term(library, "stiffness_changed at leg3/linear_rod", 0.7)
    problem = problem_of(simulator, [ours.effect])
    fit = problem.fit_at([ours], problem.first)
    other = term(library, "stiffness_changed at leg3/moving_star_branch", 0.7)
    rival = Rival(other, fit.chi2, np.zeros_like(fit.residual))
    selection = Selection(fit, ((rival,),), tuple(library.values()))
    unknown = unknown_at("leg2/ball_nut", "no law explains it")
    found = Finding("stiffness_changed", "leg3/linear_rod", ("leg3/linear_rod",), {}, 0.5, "softer", ours.effect)
    beside, alone = (next_experiment(problem, selection, unknown, laws) for laws in ((found,), ()))
    assert alone["why"] == "the largest deflections, where what is unknown at leg2/ball_nut shows most"
    assert alone["plan"]["poses"]
    assert "separates" not in alone
    assert "stiffness changed at leg3/linear_rod" in beside["why"]


# -- special cases -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("poses", "cycle", "told"), [(6, None, False), (1, (0.0, 1.0, -1.0) * 12, True)])
def test_a_gap_that_no_load_closes_is_no_other_explanation_of_a_softer_spring(robot, poses, cycle, told):
    """It holds the spring as a special case; where all loads are alike a gap that has closed fits as well."""
    bench = inputs(robot, poses=poses, cycle=cycle or (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0))
    simulator = Simulator(robot, inputs_of(bench, robot))
    library = {item.name: item for item in candidates(robot.mechanism, simulator.inputs)}
    ours = term(library, "stiffness_changed at leg1/support_bearing", 0.05)
    problem = problem_of(simulator, [ours.effect])
    fit = problem.refine([ours], problem.first)
    rivals = alternatives_to(problem, fit, 0, [library["backlash at leg1/support_bearing"]])
    assert [rival.term.candidate.law.physics for rival in rivals[1:]] == ["backlash"]
    kept = other_explanations(problem, fit, 0, rivals)
    assert ("backlash" in [rival.term.candidate.law.physics for rival in kept]) == told
    assert kept[0].term is fit.terms[0]


def test_a_homed_lead_beside_an_encoder_offset_is_no_other_explanation(simulator, library):
    ours = term(library, "encoder_offset at leg1/motor", 1e-3)
    problem = problem_of(simulator, [ours.effect])
    fit = problem.refine([ours], problem.first)
    homed = next(item for name, item in library.items() if name.startswith("lead_error at leg1") and "homed" in name)
    rivals = alternatives_to(problem, fit, 0, [homed])
    assert len(rivals) == 2
    assert len(other_explanations(problem, fit, 0, rivals)) == 1
