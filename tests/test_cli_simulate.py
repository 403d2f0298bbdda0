"""`prup-pin simulate`, `predict` and `laws`, as a user meets them."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.cli.recorded import parse_effect
from prup_pin.laws import LAWS
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.recordings import Noise, Recording, read_recording, write_plan, write_recording
from prup_pin.simulation import CorrectedModel, effect_named, parts, write_model

from .simulation.bench import NOISE, plan, three_prup

GAP = "backlash@leg2/ball_nut half_gap=60um closing_load=1"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A folder with a plan and the recording simulated from it, with play in a nut."""
    folder = tmp_path_factory.mktemp("simulated")
    noise = type(NOISE)(**{**vars(NOISE), "effort": 0.5})
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_plan(plan(poses=4, cycle=(0, 1, 0, -1), noise=noise), "plan.json")
        done = CliRunner().invoke(app, ["simulate", "--plan", "plan.json", "--out", "bench.csv", "--effect", GAP])
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def bench(run, simulated, tmp_path):
    """The name of that recording, in a folder of the test's own."""
    shutil.copytree(simulated, tmp_path, dirs_exist_ok=True)
    return "bench.csv"


def model(path="model.json", **values):
    given = {"half_gap": 6e-5, "closing_load": 1.0, **values}
    effect = effect_named("backlash", "leg2/ball_nut", "", given, three_prup().mechanism)
    write_model(CorrectedModel("3prup", (effect,)), path)
    return path


def text_of(path):
    return Path(path).read_text(encoding="utf-8")


def json_of(path):
    return json.loads(text_of(path))


def cells(path):
    """Return the header and the rows of a table, as texts."""
    header, *rows = (line.split(",") for line in text_of(path).splitlines())
    return header, rows


def write(path, header, rows):
    Path(path).write_text("".join(",".join(row) + "\n" for row in (header, *rows)), encoding="utf-8")
    return path


def table(path):
    header, rows = cells(path)
    return {name: [row[index] for row in rows] for index, name in enumerate(header)}


def in_noise(output):
    """Return channel -> × noise of the printed table; of efforts by joint, with a share of the effort behind it."""
    row = r"^  (position|rotation|effort \w+|joint\d) .* (?:µm|µrad|N|N m) +\S+ +(\S+)( +\S+)? *$"
    found = re.findall(row, output, re.MULTILINE)
    assert all(bool(share) == channel.startswith(("effort", "joint")) for channel, _, share in found)
    return {channel: float(multiple) for channel, multiple, _ in found}


def refused(done, *texts):
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert done.stderr.startswith("Error: ")
    flat = " ".join(done.stderr.split())
    for text in texts:
        assert text in flat
    return flat


# -- the round trip ----------------------------------------------------------------------------------------------------


def test_efforts_of_a_motion_are_compared_joint_by_joint(run):
    """Of two joints the second is three noises off, and only its line says so; each is in its own unit."""
    robot = prup_pin.load("double_pendulum")
    time, draw = np.arange(0, 4, 0.004), np.random.default_rng(0)
    moves = {"joint1": np.sin(2 * time), "joint2": 0.5 * np.sin(3 * time)}
    nothing = np.zeros(len(time))
    turns = Recording(time, positions=moves, efforts=dict.fromkeys(moves, nothing), noise=Noise(effort=0.1))
    efforts = prup_pin.simulate(robot, turns).efforts
    off = {name: size * draw.standard_normal(len(time)) for name, size in (("joint1", 0.1), ("joint2", 0.3))}
    measured = {name: np.nan_to_num(values) + off[name] for name, values in efforts.items()}
    write_recording(replace(turns, efforts=measured, robot="double_pendulum"), "motion.csv")
    done = run("simulate", "motion.csv", "--out", "p.csv")
    assert done.exit_code == 0, done.output
    found = in_noise(done.stdout)
    assert found == {"joint1": pytest.approx(1, abs=0.1), "joint2": pytest.approx(3, abs=0.3)}
    line = next(line.split() for line in done.stdout.splitlines() if line.startswith("  joint2"))
    size = np.sqrt(np.mean(measured["joint2"] ** 2))
    assert line[2:4] == ["N", "m"]
    assert float(line[-1]) == pytest.approx(100 * float(line[1]) / size, rel=0.01)


def test_plan_to_recording_to_prediction_leaves_the_noise(run, bench):
    read = read_recording(bench)
    assert len(read) == 16
    assert read.robot == "3prup"
    assert read.noise.position == NOISE.position
    assert set(read.efforts) == {"leg1_slide", "leg2_slide", "leg3_slide"}
    done = run("predict", model(), bench, "--out", "pred.csv")
    assert done.exit_code == 0, done.output
    multiples = in_noise(done.stdout)
    assert set(multiples) == {"position", "rotation", *(f"effort leg{leg}_slide" for leg in (1, 2, 3))}
    for value in multiples.values():
        assert value == pytest.approx(1, abs=0.35)
    without = in_noise(run("simulate", bench, "--out", "nominal.csv").stdout)
    assert without["position"] > 2
    columns = table("pred.csv")
    assert list(columns) == [
        "time",
        *(f"{kind}.{axis}" for kind in "pr" for axis in "xyz"),
        *(f"tau.leg{leg}_slide" for leg in (1, 2, 3)),
        "status",
    ]
    assert columns["status"] == ["ok"] * 16
    away = np.array(columns["p.x"], float) - read.position[:, 0]
    assert np.std(away) == pytest.approx(NOISE.position, rel=0.5)


def test_model_and_effect_say_the_same(run, bench):
    for name, arguments in {"a": ("--model", model()), "b": ("--effect", GAP)}.items():
        assert run("simulate", bench, "--out", f"{name}.csv", *arguments).exit_code == 0
    run("predict", "model.json", bench, "--out", "c.csv")
    assert text_of("a.csv") == text_of("b.csv") == text_of("c.csv")


def test_effects_add_to_the_model(run, bench):
    more = "self_weight@robot scale=1"
    done = run("simulate", bench, "--out", "a.csv", "--model", model(), "--effect", more)
    assert "backlash@leg2/ball_nut half_gap=6e-5 closing_load=1; self_weight@robot scale=1" in done.stdout


def test_the_same_seed_gives_the_same_recording(run, bench):
    before = text_of(bench)
    run("simulate", "--plan", "plan.json", "--out", "again.csv", "--effect", GAP)
    assert text_of("again.csv") == before


def test_several_processes_write_the_same_file(run, bench, monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 8)
    one = run("simulate", bench, "--out", "one.csv")
    two = run("simulate", bench, "--out", "two.csv", "--workers", "2")
    assert two.exit_code == 0, two.output
    assert text_of("one.csv") == text_of("two.csv")
    assert two.stdout.replace("two", "one") == one.stdout


def test_runs_and_markers_are_kept(run, bench):
    header, rows = cells(bench)
    rows = [[*row, "day 1" if index < 8 else "day 2", "0"] for index, row in enumerate(rows)]
    write("more.csv", [*header, "run", "p.leg1_rod_tip.x"], rows)
    done = run("simulate", "more.csv", "--robot", "3prup", "--out", "pred.csv")
    assert done.exit_code == 0, done.output
    assert "marker leg1_rod_tip" in done.stdout
    columns = table("pred.csv")
    assert columns["run"] == ["day 1"] * 8 + ["day 2"] * 8
    assert 0.15 < float(columns["p.leg1_rod_tip.x"][0]) < 0.21


# -- the summary -------------------------------------------------------------------------------------------------------


def damaged(bench):
    """Empty one load, put one actuator out of reach; say nothing of noise or robot."""
    names, rows = cells(bench)
    rows[2][names.index("w.fz")] = ""
    for row in (5, 9):
        rows[row][names.index("q.leg1_slide")] = "0.75"
    return write("damaged.csv", names, rows)


def test_failing_rows_are_counted_and_the_run_goes_on(run, bench):
    done = run("simulate", damaged(bench), "--robot", "3prup", "--out", "pred.csv")
    assert done.exit_code == 0, done.output
    flat = " ".join(done.stdout.split())
    assert "16, 13 predicted" in flat
    assert "no input 1 row: line 4" in flat
    assert "unreachable 2 rows: lines 7, 11" in flat
    assert "line 7: '3prup' cannot reach" in flat
    assert "not declared" in flat
    columns = table("pred.csv")
    assert [columns["status"][row] for row in (2, 5, 9)] == ["no input", "unreachable", "unreachable"]
    assert columns["p.x"][2] == columns["r.z"][5] == ""
    assert columns["status"].count("ok") == 13


def test_stopping_keeps_the_rows_before(run, bench):
    done = run("simulate", damaged(bench), "--robot", "3prup", "--out", "pred.csv", "--stop")
    refused(done, "line 4 of the table", "no input", "2 rows before it are in pred.csv")
    assert table("pred.csv")["status"] == ["ok", "ok"]


def test_no_row_with_an_answer_is_an_error(run, bench):
    names, rows = cells(bench)
    for row in rows:
        row[names.index("q.leg2_slide")] = "2.0"
    write("far.csv", names, rows)
    refused(run("simulate", "far.csv", "--robot", "3prup", "--out", "p.csv"), "none of 16 rows", "leg2_slide")


def test_suspicions_and_remarks_are_printed(run, bench):
    names, rows = cells(bench)
    names[names.index("r.x")] = "extra"
    write("odd.csv", [*names, "temperature"], [[*row, "293.15"] for row in rows])
    grow = "thermal_growth@leg2/ball_screw expansion=1e-5"
    flat = " ".join(run("simulate", "odd.csv", "--robot", "3prup", "--out", "p.csv", "--effect", grow).stdout.split())
    assert "kelvin" in flat
    assert "unknown column 'extra'" in flat


def test_a_model_of_another_robot_is_remarked(run, bench):
    Path("bench.json").write_text(json.dumps({**json_of("bench.json"), "robot": "ur5"}))
    done = run("predict", model(), bench, "--out", "p.csv")
    assert done.exit_code == 0, done.output
    assert "The recording says that it is of 'ur5', the model is of '3prup'." in done.stdout


# -- what is refused ---------------------------------------------------------------------------------------------------


def test_recording_or_plan(run, bench):
    refused(run("simulate", "--out", "x.csv"), "either a recording, RECORDING.csv, or a test plan")
    refused(run("simulate", bench, "--plan", "plan.json", "--out", "x.csv"), "either a recording")
    refused(run("simulate", "gone.csv", "--out", "x.csv"), "file not found", "bench.csv")
    refused(run("simulate", "--plan", "gone.json", "--out", "x.csv"), "file not found", "plan.json")


def test_where_it_is_written(run, bench):
    refused(run("simulate", bench, "--out", bench), "is the recording itself")
    refused(run("simulate", bench, "--out", "x.json"), "give a .csv file")
    refused(run("predict", model(), bench, "--out", "nowhere/x.csv"), "no folder 'nowhere'")
    assert run("simulate", bench).exit_code == 2


def test_which_robot(run, bench):
    Path("bench.json").write_text("{}")
    refused(run("simulate", bench, "--out", "x.csv"), "which robot?", "--robot 3prup")
    refused(run("simulate", bench, "--robot", "3prupp", "--out", "x.csv"), "'3prup'")
    refused(run("simulate", bench, "--robot", "ur5", "--tool", "tool0", "--out", "x.csv"), "q.shoulder_pan_joint")


@pytest.mark.parametrize(
    ("effect", "text"),
    [
        ("backlash", "expected 'physics@place"),
        ("backlash leg2/ball_nut", "expected 'physics@place"),
        ("backlsh@leg2/ball_nut half_gap=1e-5", "'backlash'"),
        ("backlash@leg2/ball_nutt half_gap=1e-5 closing_load=1", "'leg2/ball_nut'"),
        ("backlash@leg2/R_phi half_gap=1e-5 closing_load=1", "radial by axis; say which: backlash@leg2/R_phi:radial"),
        ("backlash@leg2/R_phi:tilting half_gap=1e-5 closing_load=1", "radial, axial"),
        ("shear@robot", "missing scale (> 0 and <= 50; a fit starts at 1)"),
        ("backlash@leg2/ball_nut half_gap=1e-5", "missing closing_load (> 0.02 and <= 1e+06 N; a fit starts at 1)"),
        ("backlash@leg2/ball_nut gap=1e-5 closing_load=1", "Valid: half_gap, closing_load"),
        ("backlash@leg2/ball_nut half_gap=1 closing_load=1", "half_gap = 1.0 m: expected > 0 and <= 0.005 m"),
        ("backlash@leg2/ball_nut half_gap=1deg closing_load=1", "expected a length"),
        ("backlash@leg2/ball_nut half_gap=1e-5 half_gap=2e-5 closing_load=1", "half_gap is given twice"),
    ],
)
def test_effects(run, bench, effect, text):
    refused(run("simulate", bench, "--out", "x.csv", "--effect", effect), "--effect", text)


def test_all_effects_without_effect_are_told(run, bench, tmp_path):
    rubs = [f"coulomb_friction@leg{leg}_slide:effort limit=3 presliding=1e-5" for leg in (1, 2)]
    said = "coulomb_friction at leg1_slide", "coulomb_friction at leg2_slide"
    refused(run("simulate", bench, "--out", tmp_path / "x.csv", *(f"--effect={each}" for each in rubs)), *said)


def test_what_changes_nothing_at_a_value_need_not_be_typed_beside_its_like(capsys):
    mechanism = prup_pin.load("3prup").mechanism
    turned = parse_effect("pose_sensor_misalignment@pose_sensor rz=1mrad", mechanism)
    assert turned.values["rz"] == 1e-3
    assert not any(value for name, value in turned.values.items() if name != "rz")
    assert "not given, so without effect: " in capsys.readouterr().err


def test_an_optional_parameter_need_not_be_typed():
    rubs = "coulomb_friction@leg2_slide:effort limit=3 presliding=1e-5"
    assert parse_effect(rubs, prup_pin.load("3prup").mechanism).values == {"limit": 3.0, "presliding": 1e-5}


@pytest.mark.parametrize("robot", ["3prup", "arm.urdf", "models/arm.xml"])
def test_laws_of_a_robot_are_asked_for_with_an_option(run, robot):
    refused(run("laws", robot), f"--robot {robot}")


def test_aspects_with_blanks(run, bench):
    gain = "wrench_sensor_gain@wrench_sensor:all channels gain=1.02"
    done = run("simulate", bench, "--out", "x.csv", "--effect", gain)
    assert done.exit_code == 0, done.output
    assert gain in done.stdout


def test_a_model_with_problems(run, bench):
    value = json_of(model())
    value["effects"][0]["parameters"]["half_gap"]["unit"] = "mm"
    value["effects"][0]["location"] = "leg2/ball_nutt"
    Path("bad.json").write_text(json.dumps(value))
    refused(run("predict", "bad.json", bench, "--out", "x.csv"), "effects[0].location", "'leg2/ball_nut'")
    refused(run("predict", "plan.json", bench, "--out", "x.csv"), "format", "prup_pin corrected model")


def test_a_plan_beyond_the_robot(run, bench):
    value = json_of("plan.json")
    value["poses"] = [{"at": {"z": 2.0, "theta": 0, "phi": 0}}]
    Path("far.json").write_text(json.dumps(value))
    refused(run("simulate", "--plan", "far.json", "--out", "x.csv"), "poses[0].at", "Nearest feasible")


# -- laws --------------------------------------------------------------------------------------------------------------


def test_laws_are_listed_with_places_and_parameters(run):
    done = run("laws")
    assert done.exit_code == 0
    for law in (*LAWS, *EFFORT_LAWS):
        assert law.physics in done.stdout
        for quantity in law.quantities:
            assert quantity.name in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 110


def test_one_law(run):
    text = run("laws", "stiffness_changed").stdout
    assert text.startswith("stiffness_changed\n")
    flat = " ".join(text.split())
    assert "leg1|leg2|leg3/R_lambda:radial|axial|tilting" in flat
    assert "factor 1 > 0, <= 100" in flat
    assert "backlash" not in text
    assert "columns qd.<joint>" in run("laws", "encoder_delay").stdout
    refused(run("laws", "stifness_changed"), "'stiffness_changed'")
    refused(run("laws", "frictoin"), "Did you mean 'coulomb_friction' or 'stribeck_friction' or 'viscous_friction'?")


def test_laws_of_another_robot(run):
    text = run("laws", "stiffness_changed", "--robot", "ur5", "--joint-stiffness", "1e4", "--tool", "tool0").stdout
    assert "elbow_joint" in text
    assert "none on 'ur5" in run("laws", "geometric_offset", "--robot", "ur5").stdout


@pytest.mark.parametrize(
    ("word", "name"),
    [("Backlash", "backlash"), ("torque ripple", "cogging"), ("a hose", "external_spring"),
     ("stribeck friction", "stribeck_friction"), ("sticks and slips", "coulomb_friction")],
)  # fmt: skip
def test_a_law_is_found_by_the_word_that_verdicts_and_people_use(run, word, name):
    text = run("laws", word).stdout
    assert text.startswith(name)
    assert "parameter" in text


def test_a_word_of_two_laws_lists_both(run):
    text = run("laws", "play").stdout
    assert "backlash: play" in text
    assert "guide_play" in text


def test_a_word_of_several_laws_lists_them(run):
    text = run("laws", "friction").stdout
    assert all(f"{name}: " in text for name in ("coulomb_friction", "viscous_friction", "stribeck_friction"))
    assert "backlash: " not in text


def test_laws_of_efforts_are_shown_with_their_joints(run):
    text = run("laws", "stribeck_friction", "--robot", "ur5").stdout
    assert text.startswith("stribeck_friction, in efforts")
    assert "shoulder_pan_joint" in text
    both = run("laws", "coulomb_friction").stdout
    assert both.index("\ncoulomb_friction, in efforts") > both.index("coulomb_friction\n")
    refused(run("laws", "stribek_friction"), "'stribeck_friction'")


def test_model_and_recording_exchanged_are_told_their_order(run, bench):
    done = run("predict", bench, "model.json", "--out", "p.csv")
    assert done.exit_code == 2
    assert f"the model comes first: prup-pin predict model.json {bench} --out p.csv" in " ".join(done.stderr.split())


def test_an_effect_that_changes_nothing_is_refused_with_the_one_that_does(run, bench, tmp_path):
    write_plan(plan(poses=4, cycle=(0, 1), noise=NOISE), tmp_path / "poses.json")
    words = ["simulate", "--plan", str(tmp_path / "poses.json"), "--out", "again.csv", "--effect"]
    done = run(*words, "encoder_offset@leg1_slide:effort offset=0.2mm")
    assert done.exit_code == 2
    assert "encoder_offset at leg1_slide (effort) has no effect" in " ".join(done.stderr.split())
    assert "encoder_offset@leg1/motor" in done.stderr.replace("\n ", "")
    time = np.arange(600) * 0.01
    arm = prup_pin.load("ur5")
    q = {name: 0.3 * np.sin(1.3 * time + place) for place, name in enumerate(arm.mechanism.actuated)}
    tau = {name: np.full(len(time), np.nan) for name in q}
    write_recording(Recording(time=time, positions=q, efforts=tau, robot="ur5"), tmp_path / "moves.csv")
    words = ["simulate", str(tmp_path / "moves.csv"), "--out", "efforts.csv", "--effect"]
    done = run(*words, "payload@tool0 mass=1.5")
    assert done.exit_code == 2
    assert "payload@tool0:effort" in done.stderr.replace("\n ", "")


def test_a_model_of_which_something_is_unexplained_is_valid_near_its_data_alone(run, tmp_path, bench):
    """The report said so, and the command that uses the model did not."""
    for verdict, said in (("unexplained", 1), ("explained", 0)):
        write_model(CorrectedModel("3prup", verdict=verdict), tmp_path / "m.json")
        done = run("predict", "m.json", bench, "--out", "pred.csv")
        assert done.exit_code == 0, done.output
        assert " ".join(done.stderr.split()).count("valid only near the data of that diagnosis") == said
