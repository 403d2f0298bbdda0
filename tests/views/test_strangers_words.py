"""What strangers stumbled over in the words of a diagnosis: each was a sentence that nobody understood."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.calibrate import CalibratedParameter
from prup_pin.diagnosis.candidates import Candidate
from prup_pin.diagnosis.diagnosis import Finding, FittedParameter
from prup_pin.diagnosis.efforts.final_state import FinalState
from prup_pin.diagnosis.next_experiment import _apart
from prup_pin.diagnosis.prepare import _not_simulated, _positions_apart
from prup_pin.diagnosis.prospects import prospects
from prup_pin.errors import InputError
from prup_pin.imports.columns import wrench_lines
from prup_pin.imports.log import Log, Stream
from prup_pin.laws import LAWS, Effect, Place
from prup_pin.laws.deviations import Deviation
from prup_pin.laws.stiffness_changed import StiffnessChanged
from prup_pin.numbers import counted, quantity
from prup_pin.recordings import Convention, Noise, Recording, Tolerances, add_noise
from prup_pin.simulation import effect_named, simulate
from prup_pin.views.text.bench_tests import print_diagnosis, print_failures, print_simulation
from prup_pin.views.text.diagnosis_words import (
    _takes,
    alternative_text,
    corrections,
    cost_text,
    diagnosis_text,
    finding_groups,
    finding_lines,
    finding_text,
    length_of,
    multiple_text,
    noise_text,
    parameter_texts,
    places_text,
    summary_text,
    used_text,
    verdict_text,
)
from prup_pin.views.text.robot_files import _alike
from prup_pin.views.text.terminal import console

from ..as_written import as_written


def test_what_is_left_after_a_log_is_read_otherwise_is_told_as_such(diagnosed):
    _, _, diagnosis = diagnosed
    convention = Convention("q.elbow", "reversed")
    log = Finding("log_convention", "elbow", ("elbow",), {}, 1.0, "x.csv is read reversed", conventions=(convention,))
    found = replace(diagnosis, findings=(log, *diagnosis.findings))
    said = summary_text(found)
    assert said.startswith("x.csv is read reversed. Read this way: The measured position of the tool differs by ")
    assert "(root mean square) from the simulation of the robot file." in said
    assert "account for it: x.csv" not in said
    assert f"log read with {convention}" in verdict_text(found)
    assert "log convention" not in verdict_text(found)
    first, after = said.partition("To do first: ")[2].split(" Then: ")
    assert first == f"{log.remedy}."
    assert after.startswith(diagnosis.findings[0].remedy)
    drives = replace(log, statement="the drives report otherwise")
    assert summary_text(replace(found, findings=(drives, *diagnosis.findings))).startswith("The drives report")
    alone = replace(found, findings=(log,), before=found.after)
    assert "falls" not in verdict_text(alone)


def test_a_noise_is_told_of_what_was_measured_alone(diagnosed):
    _, _, diagnosis = diagnosed
    assert any(text.startswith("rotation") for text in noise_text(diagnosis))
    channels = {name: values for name, values in diagnosis.by_channel.items() if name != "rotation"}
    assert not any(text.startswith("rotation") for text in noise_text(replace(diagnosis, by_channel=channels)))


def test_a_second_finding_that_is_no_fault_is_told_beside_what_accounts_for_it(diagnosed):
    _, _, diagnosis = diagnosed
    moved = Finding("finite_deflection", "robot", ("robot",), {}, 0.1, "loads move it far")
    said = summary_text(replace(diagnosis, findings=(diagnosis.findings[0], moved)))
    assert "One thing accounts for it" in said
    assert "that is no fault" in said
    assert "that is no fault" not in summary_text(replace(diagnosis, findings=(diagnosis.findings[0],)))


def test_what_data_do_not_bound_is_not_nothing():
    rows = parameter_texts({"wrist": FittedParameter(0.0, "rad/(N m)", (0.0, 1.0))})
    assert rows == [("wrist", "not determined by this recording", "any size")]
    seen = parameter_texts({"wrist": FittedParameter(0.0, "rad/(N m)", (0.0, 1e-5))})
    assert "not determined" not in seen[0][1]


def test_an_interval_is_told_with_as_many_digits_as_its_ends_are_apart():
    ((_, value, interval),) = parameter_texts({"tx": FittedParameter(2.10001, "m", (2.1, 2.10002))})
    assert (value, interval) == ("2.10001 m", "2.1 to 2.10002 m")


def test_a_vector_is_told_in_one_unit():
    centre = {
        axis: FittedParameter(value, "m", (value - 1e-3, value + 1e-3))
        for axis, value in zip("xyz", (1.2, 0.0034, -0.05), strict=True)
    }
    mass = {"mass": FittedParameter(2.0, "kg", (1.9, 2.1))}
    assert [value for _, value, _ in parameter_texts(mass | centre)] == ["2 kg", "1.2 m", "0.0034 m", "-0.05 m"]
    small = {axis: replace(fitted, value=1e-2 * fitted.value) for axis, fitted in centre.items()}
    assert [value for _, value, _ in parameter_texts(small)] == ["12 mm", "0.034 mm", "-0.5 mm"]


def test_a_sample_that_cannot_be_simulated_is_told_by_its_row():
    whole = Recording(np.arange(210.0), positions={"elbow": np.zeros(210)}, wrench=np.zeros((210, 6)))
    assert _not_simulated(np.array([7]), 210, whole).startswith("1 of 210 samples could not be simulated (line 9),")
    assert "(lines 2, 3, 4, 5, 6, …)" in _not_simulated(np.arange(9), 210, whole)
    load = np.zeros((210, 6))
    load[7, 0] = np.nan
    lacking = replace(whole, wrench=load)
    assert "could not be simulated (line 9; no number in w.fx), and" in _not_simulated(np.array([7]), 210, lacking)
    assert "(line 10)" in _not_simulated(np.array([8]), 210, lacking)


def test_a_force_is_one_in_other_languages():
    names = ("Kraft X [N]", "Drehmoment Z [Nm]", "fuerza y [N]", "X [mm]")
    log = Log("x.csv", (Stream("table", {name: np.zeros(3) for name in names}),))
    lines = {line.target: line for line in wrench_lines(log, set())}
    assert set(lines) == {"w.fx", "w.mz", "w.fy"}
    assert [bool(line.doubt) for line in lines.values()] == [True, False, False]  # asked once


def test_one_of_a_thing_is_one():
    assert (counted(1, "sample"), counted(2, "sample"), counted(0, "pose")) == ("1 sample", "2 samples", "no poses")


def test_what_is_unknown_is_told_before_what_hardly_matters(diagnosed):
    _, _, diagnosis = diagnosed
    little = Finding("inertial_parameters", "forearm", ("forearm",), {}, 0.02, "the forearm is another")
    unknown = Finding("unknown", "elbow", ("elbow",), {}, 0.0, "something is left at the elbow")
    found = replace(diagnosis, findings=(diagnosis.findings[0], little, unknown), verdict="unexplained")
    assert found.told == (diagnosis.findings[0], unknown, little)
    text = diagnosis_text(found)
    assert text.index("2  unknown at elbow") < text.index("3  inertial parameters at forearm")
    assert replace(found, findings=found.findings[:2]).told == found.findings[:2]


def test_a_fault_is_told_before_what_every_robot_has(diagnosed):
    """The robot's weight takes more of the residual than a nut's play, and a mechanic can do nothing about it."""
    robot, _, diagnosis = diagnosed
    fault = replace(diagnosis.findings[0], heldout_gain=0.4)
    law = next(law for law in LAWS if law.weighs)
    (place, *_), values = law.places(robot.mechanism), {"scale": 1.0}
    weight = replace(fault, physics=law.physics, location="robot", candidates=("robot",), heldout_gain=0.9,
                     statement="the robot sags", effect=Effect(law, place, values))  # fmt: skip
    worse = replace(fault, location="leg9/nut", heldout_gain=0.6)
    found = replace(diagnosis, findings=(weight, fault, worse))
    assert found.told == (worse, fault, weight)
    assert "Explained: with backlash at leg9/nut, " in verdict_text(found)
    assert " and self weight " in verdict_text(found)
    alone = replace(diagnosis, findings=(weight,), verdict="explained")
    assert verdict_text(alone).startswith("Nothing is missing but the robot's own weight: with it ")
    assert "Nothing needs repair: let the simulation carry the weight" in summary_text(alone)
    # nor is it something that was left out of the robot
    assert finding_groups(alone) == {"How to simulate it": [(1, weight)]}
    assert finding_groups(found) == {"Left out": [(1, worse), (2, fault)], "How to simulate it": [(3, weight)]}
    assert cost_text(weight).startswith("without it the residual of a simulation would be ")
    assert f"To do first: {worse.remedy}, or look at leg2: " in summary_text(found)
    little = replace(fault, heldout_gain=0.01)
    assert replace(diagnosis, findings=(weight, little)).told == (weight, little)


def test_what_is_unknown_is_looked_at_before_what_every_robot_has(diagnosed):
    """Nor is what laws take that nobody names put down to those that are findings."""
    robot, _, diagnosis = diagnosed
    fault = diagnosis.findings[0]
    law = next(law for law in LAWS if law.weighs)
    effect = Effect(law, law.places(robot.mechanism)[0], {"scale": 1.0})
    weight = replace(fault, physics=law.physics, location="robot", candidates=("robot", "tool"), effect=effect)
    unknown = Finding("unknown", "leg2/drive", ("leg2/drive",), {}, 0.0, "a part of it is explained by no law")
    found = replace(diagnosis, findings=(weight, unknown), verdict="unexplained", stand_ins=(fault.effect,) * 2)
    assert f"To do first: {unknown.remedy}." in summary_text(found)
    assert f"To do first: {fault.remedy}" in summary_text(replace(found, findings=(weight, fault, unknown)))
    assert " and 2 laws that are no findings the residual falls" in verdict_text(found)
    assert "With it and 2 laws that are no findings in the model" in summary_text(found)


def test_why_not_all_samples_were_used_is_told(diagnosed):
    _, _, diagnosis = diagnosed
    used = len(diagnosis.samples)
    assert used_text(diagnosis, used) == f"{used} used"
    assert used_text(diagnosis, 10000) == f"{used} used, evenly chosen: more would tell hardly more"
    moving = replace(diagnosis, efforts=SimpleNamespace(separate=False))
    assert used_text(moving, 10000) == f"{used} used: filtered, as many as the compared frequencies need"


def test_what_was_taken_for_granted_is_the_first_line(diagnosed, capsys):
    robot, recording, diagnosis = diagnosed
    taken = replace(diagnosis, premises=("No position was recorded of lift (no column q.lift).",))
    assert diagnosis_text(taken).startswith("No position was recorded of lift")
    print_diagnosis(console(), robot, recording, taken)
    assert capsys.readouterr().out.startswith("No position was recorded of lift")
    assert taken.to_dict()["premises"] == list(taken.premises)


def test_no_sentence_has_the_same_words_on_both_sides():
    law, words = StiffnessChanged(), "stiffness changed at leg1/linear_rod"
    stiff = Candidate(law, Place("leg1/linear_rod"), prup_pin.load("3prup").mechanism)
    half, more, same = (stiff.term(stiff.coordinates_of(np.array([factor]))) for factor in (0.5, 1.6, 0.5))
    assert _apart(half, more) == (f"{words} (factor 0.5)", f"{words} (factor 1.6)")
    assert len(set(_apart(half, same))) == 1  # no pair: nothing is said of it
    other = Candidate(law, Place("leg2/linear_rod"), stiff.mechanism).term(half.coordinates)
    assert _apart(half, other) == (words, words.replace("leg1", "leg2"))


@dataclass
class Efforts:
    """What is told of efforts whose noise was not declared."""

    units: tuple[str, ...]
    declared: bool = False
    separate: bool = False
    how: tuple[str, ...] = ("innovations",)
    shares: dict = field(default_factory=lambda: {"all": {"rigid": 0.116, "heldout": 0.021}})


def test_noise_of_newtons_and_newton_metres_is_no_one_number(diagnosed):
    _, _, diagnosis = diagnosed
    noise = replace(diagnosis.noise, effort=1.03, source="estimated")
    both, turning = (replace(diagnosis, noise=noise, efforts=Efforts(units)) for units in (("N", "N m"), ("N m",)))
    assert not any("effort 1.03" in text for text in noise_text(both))
    assert "effort 1.03 N m" in noise_text(turning)
    assert noise_text(both)[-1] == "estimated, of efforts by what their past does not foretell"
    assert "the comparison filters samples, so that less than 1 is normal" in multiple_text(both)
    assert "below" not in multiple_text(replace(both, efforts=Efforts(("N",), separate=True)))
    assert multiple_text(diagnosis) == ""


def test_numbers_of_one_sentence_on_efforts_are_all_before_or_all_after(diagnosed):
    """'11.3 times the noise' was of the drawing, '2.1 % of the efforts' of the corrected model, as if of one thing."""
    _, _, diagnosis = diagnosed
    unknown = Finding("unknown", "elbow", ("elbow",), {}, 0.0, "something is left at the elbow")
    found = replace(
        diagnosis,
        verdict="unexplained",
        findings=(unknown,),
        columns=(),
        efforts=Efforts(("N m",), declared=True),
        before={"fit": 11.3, "heldout": 11.3},
        after={"fit": 2.1, "heldout": 2.15},
    )
    assert verdict_text(found) == (
        "Unexplained: the residual is 11.3 times the noise, 11.6 % of the efforts, and no law of the library explains "
        "it; the corrected model leaves 2.1 % of the efforts, 2.15 times the noise; it is largest in elbow."
    )


def test_rows_without_an_answer_are_lines_of_the_file_as_everywhere(capsys):
    print_failures(console(), {"no input": np.array([1])}, {"no input": "no position"})
    said = " ".join(capsys.readouterr().out.split())
    assert said == "no input 1 row: line 3 line 3: no position"


def test_what_accounts_for_a_part_is_not_said_to_account_for_all(diagnosed):
    _, _, diagnosis = diagnosed
    unknown = Finding("unknown", "lift", ("lift",), {}, 0.0, "it never changes", advice="check the column q.lift")
    said = summary_text(replace(diagnosis, findings=(*diagnosis.findings, unknown), verdict="unexplained"))
    assert "account" in said
    assert "for a part of it: " in said
    assert said.endswith("To do first: check the column q.lift.")
    assert "for it: " in summary_text(diagnosis)


def test_poses_far_off_are_told_with_the_joint_whose_column_is_missing():
    robot = prup_pin.load("ur5", joint_stiffness=1e5, home={"elbow_joint": 1.0})
    rng, names = np.random.default_rng(2), list(robot.mechanism.actuated)
    q = rng.uniform(-1, 1, (40, len(names)))
    poses = [robot.pose_from_actuators(row).base_from_tool for row in q]
    recording = Recording(
        time=np.arange(40.0),
        positions={name: column for name, column in zip(names, q.T, strict=True) if name != "elbow_joint"},
        position=np.array([pose[:3, 3] for pose in poses]),
        tolerances=Tolerances(),
    )
    for ask in (prospects, diagnose):
        with pytest.raises(InputError, match=r"^1 joint without a column q: elbow_joint. Held") as caught:
            ask(robot, recording)
    assert "with the sensor put where it fits" not in str(caught.value)
    # a column of no joint beside a joint of no column may be the same by another name
    renamed = replace(recording, positions=recording.positions | {"J3": q[:, names.index("elbow_joint")]})
    with pytest.raises(
        InputError, match=r"elbow_joint. There is q.J3 of no joint: rename it, where it is q.elbow_joint"
    ):
        diagnose(robot, renamed)


def test_a_place_far_off_is_told_as_the_table_has_it():
    logged, placed, rigid = (np.full((3, 3), value) for value in (1.5, 0.25, 2.0))
    said = str(_positions_apart(placed, logged, rigid, np.arange(3), " of the tool", ""))
    assert "in line 2 it was measured at 1.5 1.5 1.5, which is 0.25 0.25 0.25 with the sensor put where it fits" in said
    assert "with the sensor" not in str(_positions_apart(logged, logged, rigid, np.arange(3), "", ""))


def test_a_residual_that_rises_does_not_fall():
    assert _takes(1.93, 2.16) == "the residual rises from 1.93 to 2.16 times the noise"
    assert _takes(2.16, 1.93) == "the residual falls from 2.16 to 1.93 times the noise"


def test_a_clean_recording_of_the_drawing_under_large_loads_misses_nothing():
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    rng, names = np.random.default_rng(2), robot.mechanism.actuated
    q = rng.uniform(-1, 1, (30, len(names)))
    load = np.column_stack((rng.uniform(-300, 300, (30, 3)), np.zeros((30, 3))))
    drawn = Recording(np.arange(30.0), positions=dict(zip(names, q.T, strict=True)), wrench=load)
    seen = simulate(robot, drawn)
    measured = replace(drawn, position=seen.position, rotation=seen.rotation, noise=Noise(position=1e-5, rotation=3e-5))
    found = diagnose(robot, as_written(add_noise(measured, measured.noise, 3), "q p r wrench"))
    assert {finding.physics for finding in found.findings} == {"finite_deflection"}
    assert found.verdict == "nothing_missing"
    assert verdict_text(found).startswith("Nothing is missing: ")
    assert "in its deformed position" in verdict_text(found)


def test_a_log_of_many_conventions_is_told_by_how_many_columns_each_is_of(diagnosed):
    _, _, diagnosis = diagnosed
    gains = tuple(Convention(f"tau.j{k}", "gain", (0.1 * k,)) for k in range(1, 9))
    log = Finding("log_convention", "robot", ("robot",), {}, 1.0, "the drives report otherwise", conventions=gains)
    found = replace(diagnosis, findings=(log, *diagnosis.findings))
    assert "(the log read with 'gain' for 8 columns)" in verdict_text(found)
    assert "tau.j3" not in verdict_text(found) + summary_text(found)
    assert summary_text(found).startswith("The log is read with 'gain' for 8 columns. Read this way: ")


def test_a_noise_that_is_what_was_left_makes_no_multiples_of_itself(diagnosed):
    _, _, diagnosis = diagnosed
    assert "times the noise" in verdict_text(diagnosis)
    said = verdict_text(replace(diagnosis, noise=replace(diagnosis.noise, source="residual")))
    after = diagnosis.by_channel["position"]["after_um"] * diagnosis.after["heldout"] / diagnosis.after["fit"]
    assert f"to {quantity(1e-6 * after, 'm')} (root mean square, held out); no noise was declared" in said
    assert "times the noise" not in said


def test_of_many_laws_that_fit_as_well_a_few_are_told(diagnosed):
    _, _, diagnosis = diagnosed
    many = replace(diagnosis.findings[0], alternatives=tuple(f"some_law at j{k}" for k in range(20)))
    told = alternative_text(many)[-5:]
    assert told[:2] == ["as good a fit: some law at j0", "or some law at j1"]
    assert told[-2:] == ["or some law at j3", "or 16 more, in diagnosis.json"]


def test_alternatives_are_kept_apart_from_what_else_a_sentence_lists(diagnosed):
    _, _, diagnosis = diagnosed
    first = replace(diagnosis.findings[0], alternatives=("creep at leg2/motor",))
    several = replace(diagnosis, findings=(first, *diagnosis.findings[1:], replace(first, alternatives=())))
    assert " or creep at leg2/motor; " in verdict_text(several)
    assert places_text(["leg3/drive", "platform_3", "robot"]) == "leg3/drive, platform_3, robot"
    assert places_text(["leg1/a", "leg2/a", "robot"]) == "leg1, leg2: a; robot"


def test_laws_that_fit_as_well_stand_in_the_first_line_of_text_and_report(diagnosed):
    _, _, diagnosis = diagnosed
    first, *others = (item for item in diagnosis.told if item.physics != "unknown")
    one, two = (
        replace(diagnosis, findings=(replace(first, alternatives=laws), *others))
        for laws in (("creep at leg2/motor",), ("creep at leg2/motor", "shear at robot"))
    )
    assert f"with either {finding_text(first)} or creep at leg2/motor" in verdict_text(one)
    assert f"{first.statement} or creep at leg2/motor" in summary_text(one)
    assert f"with {finding_text(first)} (2 other laws fit as well)" in verdict_text(two)
    assert "either" not in verdict_text(diagnosis)


def test_what_is_missing_without_a_name_has_its_place_in_the_summary(diagnosed):
    _, _, diagnosis = diagnosed
    unknown = Finding("unknown", "elbow", ("elbow",), {}, 0.0, "something is left at the elbow")
    found = replace(diagnosis, findings=(*diagnosis.findings, unknown), verdict="unexplained")
    assert "something is missing at elbow that no law describes" in summary_text(found)


def test_laws_that_a_motion_cannot_tell_apart_are_told_once_for_all_their_places():
    pairs = [(f"effort_delay at j{k}", f"effort_filter at j{k}") for k in range(3)]
    pairs += [("payload at hand", "effort_gain at j1")]
    assert _alike(pairs) == ["effort delay and effort filter: at j0, j1, j2", "payload at hand and effort gain at j1"]


def test_efforts_of_each_drive_are_told_in_the_unit_in_which_they_are():
    robot = prup_pin.load("ur5")
    drives = robot.mechanism.actuated[:2]
    state = SimpleNamespace(mechanism=robot.mechanism, at=SimpleNamespace(driven=drives), scale=np.array([0.12, 1.02]))
    assert FinalState.units.fget(state) == ("as logged", "N m")


def test_what_other_values_would_make_up_for_beyond_their_tolerances_says_so(diagnosed):
    _, _, diagnosis = diagnosed
    body = replace(diagnosis.findings[0], times=1.0028, strained=14.3)
    told = cost_text(body)
    assert told.endswith("0.28 % larger, and a value of the robot file 14 of its tolerances off")
    assert "tolerances" not in cost_text(replace(body, strained=0.0))


def test_many_effects_of_a_model_are_counted_and_few_are_typed(capsys):
    robot = prup_pin.load("ur5")
    friction = [
        effect_named("viscous_friction", name, "effort", {"damping": 2.0}, robot.mechanism)
        for name in robot.mechanism.actuated
    ]
    gains = [
        effect_named("effort_gain", name, "effort in a unit of its own", {"gain": -0.9}, robot.mechanism)
        for name in robot.mechanism.actuated
    ]
    time = np.arange(0.0, 4.0, 0.01)
    moves = {name: np.sin((1 + k) * time) for k, name in enumerate(robot.mechanism.actuated)}
    recording = Recording(time, positions=moves, efforts=dict.fromkeys(moves, np.zeros(len(time))))
    predicted = simulate(robot, recording, [*friction, *gains])

    def said(effects):
        print_simulation(console(), robot, effects, recording, predicted, source="corrected_model.json")
        return " ".join(capsys.readouterr().out.split())

    assert "viscous friction at 6 places; effort gain at 6 places (12 effects in corrected_model.json)" in said(
        [*friction, *gains]
    )
    assert "as logged" in said([*friction, *gains])
    assert "N m" not in said([*friction, *gains])
    # one drive is enough, and a gain of nearly one is still of newtons
    assert said(gains[:1]).count("as logged") == 1
    near = effect_named("effort_gain", gains[0].place.name, gains[0].place.aspect, {"gain": 0.05}, robot.mechanism)
    assert "as logged" not in said([near])
    assert "viscous_friction@elbow_joint:effort damping=2" in said(friction)
    assert "N m" in said(friction)


def test_runs_whose_clocks_begin_anew_last_as_long_as_all_of_them():
    time, run = np.tile(np.arange(101) * 0.1, 3), np.repeat([0, 1, 2], 101)
    efforts = SimpleNamespace(separate=False)

    class Log(SimpleNamespace):
        def __len__(self):
            return len(self.time)

    recording = Log(time=time, run=run, conventions=(), blocks=lambda: np.arange(303))
    assert length_of(SimpleNamespace(efforts=efforts, conventions=()), recording) == "30 s of motion"
    # by a clock of milliseconds that is declared, or found
    ms, slow = (Convention("time", "ms"),), 1000 * time
    declared = Log(time=slow, run=run, conventions=ms, blocks=lambda: np.arange(303))
    assert length_of(SimpleNamespace(efforts=efforts, conventions=()), declared) == "30 s of motion"
    found = Log(time=slow, run=run, conventions=(), blocks=lambda: np.arange(303))
    assert length_of(SimpleNamespace(efforts=efforts, conventions=(ms,)), found) == "30 s of motion"


def test_rows_in_no_order_are_so_many_states():
    recording = Recording(time=np.arange(30.0), positions={"a": np.linspace(0, 1, 30)})
    assert length_of(SimpleNamespace(efforts=SimpleNamespace(separate=True)), recording) == "30 states"


def test_a_value_at_the_least_of_its_law_is_a_bound():
    """A gap that closes at once: the law's least load was told as a load that was found, and as a lower bound."""
    at_least = FittedParameter(1.286e-5, "N m", (1e-5, 0.0554), least=1e-5)
    assert parameter_texts({"closing_load": at_least}) == [("closing load", "below 0.0554 N m", "0 to 0.0554 N m")]
    stiff = FittedParameter(2e6, "N/m", (1e6, 5e8), least=1e-5)
    assert parameter_texts({"stiffness": stiff})[0][1] == "above 1 N/µm"


def test_radians_are_no_thousands_of_milliradians():
    assert quantity(91.2, "rad/(N m)", 2) == "91 rad/(N m)"
    assert quantity(2e-3, "rad/(N m)", 2) == "2 mrad/(N m)"


def test_what_was_corrected_most_is_told_a_few_of_each_kind_and_not_what_data_do_not_tell():
    def item(name, kind, x, share, relative=True):
        nominal = 70e9 if relative else 0.0
        deviation = Deviation(name, kind, "Pa" if relative else "m", nominal, relative, "", "", lambda value, setup: ())
        tolerance = 0.03 * 70e9 if relative else 5e-5
        return CalibratedParameter(deviation, x, share, nominal + x * tolerance, share * tolerance, tolerance, nominal)

    given = [item(f"leg{k}/rod.youngs_modulus", "bending", 0.5 * k, 0.1) for k in range(1, 5)]
    given += [item("leg1_slide.x", "position", 1.8, 0.2, False), item("leg2_slide.x", "position", 3.0, 2.0, False)]
    assert corrections(given) == [
        "leg4/rod.youngs_modulus +6 %, 2 times its tolerance",
        "leg1_slide.x +90 µm, 1.8 times its tolerance",
        "leg3/rod.youngs_modulus +4.5 %, 1.5 times its tolerance",
    ]


def test_frictions_of_many_joints_are_told_without_a_wall_of_intervals(diagnosed):
    _, _, diagnosis = diagnosed
    pair = {"limit": FittedParameter(2.5, "N m", (2.0, 3.0)), "presliding": FittedParameter(1e-5, "rad", (0.0, 2e-5))}
    joints = [f"joint{k}" for k in range(1, 9)]
    parameters = {f"{joint}.{key}": fitted for joint in joints for key, fitted in pair.items()}
    many = Finding("coulomb_friction", "robot", ("robot", *joints), parameters, 0.5, "dry friction at 8 of 8 drives")
    told = finding_lines(diagnosis, many)
    assert "joint1: limit 2.5 N m, presliding below 20 µrad" in told
    assert "(2 more places and the 95 % intervals are in diagnosis.json)" in told
    assert not any("joint7" in text for text in told)
    assert "joint7: limit 2.5 N m (95 %: 2 to 3 N m)" in " ".join(finding_lines(diagnosis, many, len(parameters)))
