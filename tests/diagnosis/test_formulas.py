"""From a curve to a formula: what is proposed for an axis whose efforts are known, and what another recording says."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from prup_pin import load
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.problem import DesignMatrix
from prup_pin.diagnosis.proposal import proposed_files
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.errors import InputError
from prup_pin.laws import Effect
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.formulas import library, tried
from prup_pin.plugins import along
from prup_pin.recordings import Recording, read_recording, write_recording
from prup_pin.simulation import simulate
from prup_pin.simulation.model_file import effect_named
from prup_pin.testing import check_law
from prup_pin.views.drawing.diagnosis_figures import formula_figure
from prup_pin.views.text.diagnosis_words import no_proposal_text, proposal_lines
from tests.reference.concealed import draw

from .test_efforts import AXIS

NOISE = 0.5


def recorded(effort, n=3000, seed=1, faster=1.0, noise=NOISE, wide=1.0, about=0.0):
    """Return a recording of the ball-screw axis whose carriage needs an effort [N] by its position, speed and time."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.004
    slow, fast = 1.1 * faster, 2.9 * faster
    q = 0.1 * np.sin(slow * time + seed) + 0.05 * np.sin(fast * time + 1)
    v = 0.1 * slow * np.cos(slow * time + seed) + 0.05 * fast * np.cos(fast * time + 1)
    a = -0.1 * slow**2 * np.sin(slow * time + seed) - 0.05 * fast**2 * np.sin(fast * time + 1)
    q, v, a = about + wide * q, wide * v, wide * a
    tau = 95 * a + 40 * v + effort(q, v, time) + noise * rng.normal(size=n)
    return Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau})


def bumped(q, v, time):
    return 30.0 * np.exp(-(((q - 0.03) / 0.02) ** 2))


def turning(q, way):
    """Return the direction of a friction that turns round on a way (Dahl 1968), step by step."""
    out, z = [], 0.0
    for step in np.diff(q, prepend=q[0]).tolist():
        z = np.sign(step) + (z - np.sign(step)) * np.exp(-abs(step) / way)
        out.append(z)
    return np.array(out)


@pytest.fixture(scope="module")
def found(carriage, once):
    return once("bumped", lambda _: diagnose(carriage, recorded(bumped), propose=True))


def test_a_bump_is_found_with_its_place_its_width_and_their_intervals(found):
    (proposal,) = found.proposals
    assert proposal.law.equation == "coefficient exp(-((q - centre) / width)^2)"
    for name, truth, unit in (("coefficient", 30.0, "N"), ("centre", 0.03, "m"), ("width", 0.02, "m")):
        fitted = proposal.parameters[name]
        assert fitted.unit == unit
        assert fitted.value == pytest.approx(truth, rel=0.01)
        assert fitted.interval[0] < truth < fitted.interval[1]
        assert np.ptp(fitted.interval) < 0.15 * truth
    assert proposal.share > proposal.of_curve > 0.5


def test_it_is_told_with_what_it_was_seen_in_and_drawn_over_what_the_efforts_ask_for(found):
    (proposal,) = found.proposals
    lines = proposal_lines(proposal)
    assert lines[0].startswith("tau = 30")
    assert any("position of carriage -0.1" in line for line in lines)
    axes = formula_figure(proposal, proposal.curve).axes[0]
    (drawn,) = (line for line in axes.lines if str(line.get_label()).startswith("tau = "))
    assert np.ptp(drawn.get_ydata()) == pytest.approx(30.0, abs=6.0)  # means of neighbours round its peak off


def test_its_file_keeps_the_contract_and_explains_the_recording(found, carriage, tmp_path):
    ((word, text),) = proposed_files(found.proposals, [tmp_path / "bench.csv"])
    assert 'source = "proposed from bench.csv"' in text
    path = tmp_path / f"{word}.py"
    path.write_text(text)
    with along(path):
        again = diagnose(carriage, recorded(bumped))
        (law,) = {item.effect.law for item in again.findings if item.physics == word}
        check_law(law, carriage)
        assert again.verdict == "explained"
        assert [item.word for item in again.judged] == ["confirmed"]


@pytest.mark.parametrize(
    ("effort", "word"),
    [
        pytest.param(bumped, "confirmed", marks=pytest.mark.slow),  # as the command says
        pytest.param(lambda q, v, t: 0.0 * q, "refuted", marks=pytest.mark.slow),  # daily where a third is missing
        (lambda q, v, t: 0.7 * bumped(q, v, t), "refuted"),
        pytest.param(
            lambda q, v, t: 0.5 * bumped(q, v, t) + 0.5 * bumped(q + 0.08, v, t), "refuted", marks=pytest.mark.slow
        ),
    ],
)
def test_a_second_recording_confirms_or_refutes_it(found, carriage, tmp_path, effort, word):
    ((name, text),) = proposed_files(found.proposals, [tmp_path / "bench.csv"])
    path = tmp_path / f"{name}.py"
    path.write_text(text)
    with along(path):
        (told,) = diagnose(carriage, recorded(effort, seed=2)).judged
    assert told.word == word
    assert str(told).startswith(f"{name} is {word}: ")


@pytest.mark.slow
def test_a_motion_that_does_not_tell_it_from_an_offset_neither_confirms_nor_refutes_it(found, carriage, tmp_path):
    ((name, text),) = proposed_files(found.proposals, [tmp_path / "bench.csv"])
    path = tmp_path / f"{name}.py"
    path.write_text(text)
    with along(path):
        (told,) = diagnose(carriage, recorded(bumped, seed=2, wide=0.005, about=0.03)).judged
    assert told.word == "neither"


@pytest.mark.parametrize("there", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_motion_in_which_more_is_left_beside_it_refutes_it_however_little_is_told_of_its_size(
    found, carriage, tmp_path, there
):
    ((name, text),) = proposed_files(found.proposals, [tmp_path / "bench.csv"])
    path = tmp_path / f"{name}.py"
    path.write_text(text)

    def effort(q, v, time):
        return there * bumped(q, v, time) + 300.0 * np.sign(np.sin(1.9 * time**1.5))

    with along(path):
        (told,) = diagnose(carriage, recorded(effort, seed=2)).judged
    assert told.word == "refuted"
    assert "beside it more is left" in told.why


@pytest.mark.slow
def test_friction_along_a_rail_turns_round_on_the_way_that_it_does(carriage):
    waved = recorded(lambda q, v, time: 15.0 * (1 + 0.9 * np.sin(40.0 * q)) * turning(q, 3e-4))
    (proposal,) = diagnose(carriage, waved, propose=True).proposals
    assert [(term.times.name, term.shape) for term in proposal.law.terms] == [("direction", "wave")]
    way = proposal.parameters["presliding"]
    assert way.unit == "m"
    assert way.interval[0] < 3e-4 < way.interval[1]
    assert np.ptp(way.interval) < 0.2 * 3e-4
    assert way.value == pytest.approx(3e-4, rel=0.05)


@pytest.mark.slow
def test_a_formula_has_the_place_of_a_law_beside_which_it_is_found_and_says_so(carriage):
    found = diagnose(carriage, recorded(lambda q, v, t: 300.0 * np.abs(q + 0.02)), propose=True)
    assert "viscous_friction" in {item.physics for item in found.findings}
    (proposal,) = found.proposals
    assert [term.factor.name for term in proposal.law.terms] == ["position"]
    assert "in the place of viscous friction" in proposal.instead
    assert proposal.instead in proposal_lines(proposal)


@pytest.mark.slow
def test_of_what_a_law_explains_no_formula_is_proposed(carriage):
    """A square about a place on the way is a spring whose stiffness changes along it."""
    found = diagnose(carriage, recorded(lambda q, v, t: 900.0 * (q + 0.3) ** 2), propose=True)
    assert found.verdict == "explained"
    assert "counterbalance" in {item.physics for item in found.findings}
    assert not found.proposals


@pytest.mark.slow
def test_a_law_of_the_library_keeps_its_place(carriage):
    found = diagnose(carriage, recorded(lambda q, v, t: 400.0 * (q - 0.02)), propose=True)
    assert {item.physics for item in found.findings} == {"counterbalance", "viscous_friction"}
    assert not found.proposals


@pytest.mark.slow
def test_a_step_is_found_wherever_it_stands(carriage):
    (proposal,) = diagnose(
        carriage, recorded(lambda q, v, t: np.where(q > 0.033, 8.0 + 300.0 * (q - 0.033), 0.0)), propose=True
    ).proposals
    assert [term.shape for term in proposal.law.terms] == ["stop_above"]
    assert proposal.parameters["start"].value == pytest.approx(0.033, abs=0.001)


def raised_cosine(q, v, time):
    return 20.0 * (1 + np.cos(np.pi * np.clip((q - 0.03) / 0.05, -1, 1)))


@pytest.mark.slow
def test_what_the_shape_of_a_formula_leaves_is_a_curve_beside_it_and_in_its_file(carriage, tmp_path):
    (proposal,) = diagnose(carriage, recorded(raised_cosine), propose=True).proposals
    assert [term.shape for term in proposal.law.terms] == ["bump"]
    assert proposal.parameters["coefficient"].value == pytest.approx(40.0, rel=0.05)
    (curve,) = (effect for effect in proposal.effects if effect.law.physics == "unknown")
    assert curve.place.aspect == "effort against position, finely"
    # a file of the corrected model knows it by name
    named = effect_named("unknown", "carriage", curve.place.aspect, curve.values, carriage.mechanism)
    assert named.place == curve.place
    assert named.law == curve.law
    other, clean = recorded(raised_cosine, seed=2), recorded(raised_cosine, seed=2, noise=0.0)
    errors = []
    for left_out in ((), ("unknown",)):
        kept = [effect for effect in proposal.effects if effect.law.physics not in left_out]
        predicted = simulate(carriage, other, kept).efforts["carriage"]
        errors.append(np.sqrt(np.nanmean((predicted - clean.efforts["carriage"]) ** 2)))
    assert errors[0] < 0.6 * errors[1]
    # its file gives what both of them do, and another motion asks for no more
    ((word, text),) = proposed_files([proposal], [tmp_path / "bench.csv"])
    path = tmp_path / f"{word}.py"
    path.write_text(text)
    with along(path):
        again = diagnose(carriage, other)
        (law,) = (law for law in EFFORT_LAWS if law.physics == word)
        check_law(law, carriage)
        values = {q.name: q.default for q in law.quantities}
        both = [effect for effect in proposal.effects if effect.law in (proposal.law, curve.law)]
        alone = [Effect(law, law.places(carriage.mechanism)[0], values)]
        efforts = [simulate(carriage, other, effects).efforts["carriage"] for effects in ([], both, alone)]
        np.testing.assert_allclose(efforts[2] - efforts[0], efforts[1] - efforts[0], atol=1e-3)
    assert [item.word for item in again.judged] == ["confirmed"]
    assert again.verdict == "explained"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 2))])
def test_of_noise_nothing_is_proposed_and_terms_are_never_fitted_beside_each_other(carriage, monkeypatch, seed):
    recording, sizes, add = recorded(lambda q, v, t: 0.0 * q, n=1500, seed=seed), [], DesignMatrix.add
    monkeypatch.setattr(
        DesignMatrix, "add", lambda self, *parts, **after: (add(self, *parts, **after), sizes.append(self.size))[0]
    )
    assert not diagnose(carriage, recording, propose=["carriage"]).proposals
    at = InMotion.of(carriage.mechanism, motion_of(recording, carriage.mechanism))
    assert max(sizes) < sum(len(list(tried(term, at, "carriage"))) for term in library(at, "carriage"))


@pytest.mark.parametrize("n", [10, 40])
def test_a_few_samples_are_refused_in_a_sentence(carriage, n):
    with pytest.raises(InputError, match="long"):
        diagnose(carriage, recorded(bumped, n=n), propose=True)


def test_of_a_joint_that_never_moved_nothing_is_proposed(carriage):
    still = recorded(bumped, n=1500)
    still = Recording(time=still.time, positions={"carriage": 0 * still.time + 0.01}, efforts=still.efforts)
    found = diagnose(carriage, still, propose=["carriage"])
    assert not found.proposals
    assert no_proposal_text(found).startswith("No formula is proposed: the joints stand in every row")


@pytest.mark.slow
def test_friction_that_gives_energy_to_the_motion_is_told(carriage):
    pushes = recorded(lambda q, v, t: -40.0 * v - 150.0 * v * np.abs(v))
    (proposal,) = diagnose(carriage, pushes, propose=["carriage"]).proposals
    assert any("gives energy to the motion" in text for text in proposal.doubts)


def test_the_command_writes_a_file_that_with_takes(found, tmp_path, monkeypatch):
    """What it proposes of the first recording is diagnosed for all tests of this file at once."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "prup_pin.diagnosis.diagnose",
        lambda *given, propose=False, **more: found if propose else diagnose(*given, **more),
    )

    def run(*words):
        done = CliRunner().invoke(app, [*words, "--robot", str(AXIS), "--no-report"])
        assert done.exit_code == 0, done.output
        return " ".join(done.output.split())

    write_recording(recorded(bumped), tmp_path / "bench.csv")
    write_recording(recorded(bumped, seed=2), tmp_path / "second.csv")
    said = run("diagnose", "bench.csv", "--out", "found", "--propose", "proposed")
    assert "A formula for what is left at carriage tau = 30" in said
    document = json.loads((tmp_path / "found/diagnosis.json").read_text())
    assert document["proposals"][0]["equation"] == "coefficient exp(-((q - centre) / width)^2)"
    (path,) = (tmp_path / "proposed").iterdir()
    assert "carriage_by_position is confirmed" in run("diagnose", "second.csv", "--out", "again", "--with", str(path))
    document = json.loads((tmp_path / "again/diagnosis.json").read_text())
    assert document["judged"][0]["word"] == "confirmed"


@pytest.mark.slow
def test_a_belt_that_gives_more_the_more_it_is_pulled_is_a_formula_of_its_load(tmp_path, monkeypatch):
    robot = load("3prup")
    monkeypatch.setattr(draw, "ALIENS", {"quadratic": draw.ALIENS["quadratic"]})
    draw.write(draw.draw(1, ["alien"], (8.0, 30.0)), tmp_path, tmp_path, "it", True)
    found = diagnose(robot, read_recording(tmp_path / "it.csv"), propose=True)
    (proposal,) = found.proposals
    assert proposal.law.equation == "coefficient |load| load"
    (truth,) = json.loads((tmp_path / "it.truth.json").read_text())["effects"]
    fitted = proposal.parameters["coefficient"]
    assert fitted.value == pytest.approx(truth["parameters"]["coefficient"], rel=0.01)
    assert fitted.interval[0] < truth["parameters"]["coefficient"] < fitted.interval[1]
    assert fitted.unit == "m/N^2"
    ((word, text),) = proposed_files(found.proposals, [tmp_path / "it.csv"])
    path = tmp_path / f"{word}.py"
    path.write_text(text)
    with along(path):
        again = diagnose(robot, read_recording(tmp_path / "it.heldout.csv"))
    assert [item.word for item in again.judged] == ["confirmed"]
    assert word in {item.physics for item in again.findings}


@pytest.mark.slow
def test_of_ten_poses_no_formula_is_proposed(tmp_path, monkeypatch):
    monkeypatch.setattr(draw, "ALIENS", {"quadratic": draw.ALIENS["quadratic"]})
    draw.write(draw.draw(1, ["alien"], (8.0, 30.0)), tmp_path, tmp_path, "it", True)
    few = read_recording(tmp_path / "it.csv").select(slice(10))
    assert not diagnose(load("3prup"), few, propose=True).proposals
