"""The command line, as a user at a terminal or a script meets it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.cli.typed import parse_assignments, parse_list, parse_quantity
from prup_pin.errors import InputError
from prup_pin.modules import KINDS
from prup_pin.numbers import fixed

POSE = "z=0.4,theta=25deg,phi=15deg"
SI_POSE = {"z": 0.4, "theta": np.radians(25), "phi": np.radians(15)}
WRENCH = np.array([300, 0, 0, 0, 0, 100.0])


@pytest.fixture
def run(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    runner = CliRunner()
    return lambda *arguments: runner.invoke(app, list(arguments))


@pytest.fixture(scope="module")
def compliance():
    robot = prup_pin.load("3prup")
    return robot.compliance(robot.pose(**SI_POSE))


def answer_as_json(run, *arguments):
    done = run("stiffness", *arguments, "--json", "-")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def shell(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "prup_pin", *arguments],
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, "COLUMNS": "80", "PYTHONIOENCODING": "utf-8", **environment},
    )


@pytest.mark.parametrize("module", ["prup_pin.cli", "numpy", "pinocchio", "typer", "prup_pin.views.text.terminal"])
def test_an_interrupt_while_it_starts_prints_no_traceback(module):
    code = f"""
import os, runpy, signal, sys
class Interrupts:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupts())
sys.argv = ["prup-pin", "robots"]
runpy.run_module("prup_pin", run_name="__main__")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode != 0
    assert not done.stderr


def test_the_package_loads_nothing_before_the_command_is_in_charge_of_interrupts():
    code = f"""
import sys
sys.path.insert(0, {str(Path(prup_pin.__file__).parents[1])!r})
before = set(sys.modules)
import prup_pin
print(sorted(set(sys.modules) - before))
"""
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True)
    assert done.stdout == "['prup_pin']\n", done.stderr


# -- stiffness: text -------------------------------------------------------------------------------------------------


def test_a_pose_given_in_part_says_that_the_rest_is_at_home_and_how_far_a_joint_is_beyond_its_limits(run):
    done = run("stiffness", "ur5_limited", "--joint-stiffness", "1e4", "--at", "elbow_joint=900deg")
    text = " ".join(done.stdout.split())
    assert "Pose (by --at; what it does not name is at home)" in text
    assert "stand at 15.708 rad (900 deg, 2.5 turns), outside its limits -3.14159 … 3.14159 rad" in text
    assert "degrees meant" not in text


def test_stiffness_prints_pose_matrices_shares_sag_and_assumptions(run, compliance):
    done = run("stiffness", "--at", POSE, "--wrench", "fx=300,mz=100")
    assert done.exit_code == 0, done.output
    text = done.stdout
    assert "z 400 mm   theta 25 deg   phi 15 deg" in text
    assert re.search(r"leg1_slide 352\.66\d mm", text)
    first = next(line for line in text.splitlines() if line.strip().startswith("fx N "))
    shown = [float(word) for word in re.findall(r"-?\d+\.?\d*", first)]
    np.testing.assert_allclose(shown, compliance.K[0] / 1e3, rtol=5e-3, atol=0.05)
    softest = max(compliance.shares(WRENCH).items(), key=lambda item: item[1])
    assert re.search(rf"{softest[0]} +█+ +{100 * softest[1]:.2f} ", text)
    for word in (
        "N/mm",
        "µm/N",
        "Deflection under fx 300 N, mz 100 N m",
        "by leg",
        "bodies",
        "Sag",
        "Assumed",
        "frictionless",
    ):
        assert word in text
    for module in compliance.names:
        assert module in text


def test_printed_shares_sum_to_the_whole(run, compliance):
    text = run("stiffness", "--at", POSE, "--wrench", "fx=300,mz=100").stdout
    rows = [line.split() for line in text.splitlines() if re.match(r"  leg\d/", line)]
    below = re.search(r"below 0.01((?: +leg\d/\w+,?\n?)+)", text).group(1).split()
    assert len(rows) + len(below) == 30
    percent = sum(0.0 if row[-2].startswith("<") else float(row[-2]) for row in rows)
    moved = sum(float(row[-1]) for row in rows)
    assert percent == pytest.approx(100, abs=0.2)
    assert moved == pytest.approx(1e3 * np.linalg.norm((compliance.C @ WRENCH)[:3]), abs=0.02)


def test_without_pose_the_home_is_taken_and_said(run):
    done = run("stiffness")
    assert done.exit_code == 0
    assert "the robot's home" in done.stdout
    assert "softest translation" in done.stdout


def test_actuators_and_task_coordinates_agree(run):
    by_task = answer_as_json(run, "--at", POSE)
    positions = ",".join(repr(value) for value in by_task["pose"]["actuators"].values())
    by_actuators = answer_as_json(run, "--actuators", positions)
    np.testing.assert_allclose(by_actuators["C"], by_task["C"], rtol=1e-7, atol=1e-14)
    named = ",".join(f"{name}={value * 1e3!r}mm" for name, value in reversed(by_task["pose"]["actuators"].items()))
    np.testing.assert_allclose(answer_as_json(run, "--actuators", named)["C"], by_task["C"], rtol=1e-7, atol=1e-14)


def test_what_a_load_does_in_the_deformed_position_is_told_where_it_is_another_answer(run):
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=np.radians(25), phi=np.radians(15))
    want = robot.equilibrium(pose, WRENCH).displacement
    text = run("stiffness", "--at", POSE, "--wrench", "fx=300,mz=100").stdout
    row = next(line for line in text.splitlines() if line.startswith("  deformed "))
    np.testing.assert_allclose([float(word) for word in row.split()[1:4]], want[:3] * 1e3, atol=0.0051)
    assert "off the linear deflection. All else here is linear" in " ".join(text.split())
    assert "deformed" not in run("stiffness", "--at", POSE, "--wrench", "fx=3").stdout
    assert "deformed" not in run("stiffness", "--at", POSE).stdout
    told = answer_as_json(run, "--at", POSE, "--wrench", "fx=300,mz=100")
    np.testing.assert_allclose(told["deformed"]["tool"], want, rtol=1e-6, atol=1e-12)


BEYOND = ("--at", POSE, "--wrench", "fz=-3e4")


def test_a_load_under_which_it_gives_way_has_an_answer_all_the_same(run):
    told = answer_as_json(run, *BEYOND)
    assert told["deformed"] is None
    assert "could be followed to" in told["no_equilibrium"]


@pytest.mark.slow
def test_a_load_under_which_it_gives_way_is_told_beside_what_to_stiffen(run):
    done = run("stiffness", *BEYOND, "--sensitivity")
    text = " ".join(done.stdout.split())
    assert done.exit_code == 0
    assert "In the deformed position no equilibrium was found" in text
    assert "Stiffen this first: not told, as no equilibrium was found under the load" in text
    told = answer_as_json(run, *BEYOND, "--sensitivity")
    assert told["deformed"] is told["sensitivity"] is None
    assert "could be followed to" in told["no_equilibrium"]


def test_another_frame(run, compliance):
    done = run("stiffness", "--at", POSE, "--wrench", "fx=300,mz=100", "--frame", "leg1_rod_tip")
    row = next(line for line in done.stdout.splitlines() if line.strip().startswith("leg1_rod_tip"))
    want = compliance.deflection(WRENCH, frame="leg1_rod_tip")[:3] * 1e3
    assert "dx mm" in done.stdout
    np.testing.assert_allclose([float(word) for word in row.split()[1:4]], want, atol=0.00051)


def test_rigid_directions_are_named_and_c_is_printed(run):
    done = run("stiffness", "double_pendulum", "--joint-stiffness", "1e4")
    assert done.exit_code == 0, done.output
    assert "K does not exist" in done.stdout
    assert "Compliance C" in done.stdout
    document = answer_as_json(run, "double_pendulum", "--joint-stiffness", "joint1=1e4,joint2=2e4")
    assert document["K"] is None
    assert len(document["rigid_directions"]) == 4
    assert document["sag"]["link2"][3] is not None


def test_serial_arm_with_joints_in_degrees(run):
    at = (
        "shoulder_pan_joint=10deg,shoulder_lift_joint=-60deg,elbow_joint=80deg,"
        "wrist_1_joint=5deg,wrist_2_joint=40deg,wrist_3_joint=0"
    )
    document = answer_as_json(run, "ur5", "--joint-stiffness", "1e4", "--tool", "tool0", "--at", at)
    assert document["pose"]["joints"]["elbow_joint"] == pytest.approx(np.radians(80))
    assert document["K"] is not None


def test_changes_locks_and_variants(run):
    base = answer_as_json(run, "--at", POSE)
    stiffer = answer_as_json(run, "--at", POSE, "--set", "leg*/linear_rod.diameter=22mm", "--lock", "leg1_branch")
    assert stiffer["robot"]["changed_parameters"] == dict.fromkeys(
        [f"leg{leg}/linear_rod.diameter" for leg in (1, 2, 3)], pytest.approx(0.022)
    )
    assert stiffer["robot"]["locked"] == ["leg1_branch"]
    assert np.all(np.diag(stiffer["C"]) < np.diag(base["C"]))
    by_option = answer_as_json(run, "--at", POSE, "--variant", "as_published")
    by_name = answer_as_json(run, "3prup_as_published", "--at", POSE)
    assert by_option["C"] == by_name["C"] != base["C"]


def test_stiffness_along_a_load_is_told_beside_k(run, compliance):
    """K's diagonal, all other directions held, is larger than what somebody measures who pulls at the tool."""
    at = ("stiffness", "--at", POSE, "--wrench", "fx=300")
    pulled = 300 / compliance.deflection({"fx": 300})[0]
    assert pulled < 0.999 * compliance.K[0, 0]
    flat = " ".join(run(*at).stdout.split())
    assert "The diagonal of K is the stiffness in each direction while the other five are held" in flat
    told = re.search(r"Stiffness along the load: ([\d.]+) N/mm; load over the displacement", flat)
    assert float(told[1]) == pytest.approx(pulled / 1e3, rel=1e-3)
    found = answer_as_json(run, *at[1:])["stiffness_along_load"]
    assert found == {"force": pytest.approx(pulled), "moment": None}
    turned = 1 / compliance.C[5, 5]
    found = answer_as_json(run, "--at", POSE, "--wrench", "fx=300,mz=-4")["stiffness_along_load"]
    assert found == {"force": pytest.approx(pulled), "moment": pytest.approx(turned)}
    both = " ".join(run("stiffness", "--at", POSE, "--wrench", "fx=300,mz=-4").stdout.split())
    assert "Stiffness along the force alone" in both
    assert "Stiffness about the moment's axis alone" in both


def test_stiffness_says_what_to_stiffen_first(run):
    at = ("--at", POSE, "--wrench", "fx=300")
    text = run("stiffness", *at, "--sensitivity").stdout
    assert "Stiffen this first" not in run("stiffness", *at).stdout
    found = answer_as_json(run, *at, "--sensitivity")["sensitivity"]
    first = found["stiffen_first"][0]
    assert "% per kg" in text
    assert text.index("Stiffen this first") < text.index(first["parameter"], text.index("Stiffen this first"))
    robot = prup_pin.load("3prup")
    pose = robot.pose(**SI_POSE)
    slopes = robot.sensitivity(pose, {"fx": 300})
    assert first["percent"] == slopes.stiffen_first[0].percent
    assert found["parameters"][first["parameter"]]["C"] == slopes.compliance[first["parameter"]].tolist()
    # a little more of it, and the deflection along the load changes in proportion
    stronger = robot.with_parameters({first["parameter"]: 1.001 * robot.parameters[first["parameter"]].value})
    after, before = (each.compliance(each.pose(**SI_POSE)).C[0, 0] for each in (stronger, robot))
    assert (after / before - 1) / 0.001 == pytest.approx(first["percent"], rel=0.1)


# -- stiffness: JSON -------------------------------------------------------------------------------------------------


def test_json_agrees_with_the_library(run, compliance):
    document = answer_as_json(run, "--at", POSE, "--wrench", "fx=0.3kN,mz=100Nm", "--frame", "star_2")
    np.testing.assert_allclose(document["C"], compliance.C, rtol=1e-12)
    np.testing.assert_allclose(document["K"], compliance.K, rtol=1e-9, atol=1e-6)
    assert document["load"] == {"wrench": WRENCH.tolist(), "source": "given"}
    shares = {name: module["share"] for name, module in document["modules"].items()}
    assert shares == pytest.approx(compliance.shares(WRENCH))
    np.testing.assert_allclose(
        sum(np.array(module["C"]) for module in document["modules"].values()), compliance.C, rtol=1e-9, atol=1e-18
    )
    assert sum(leg["share"] for leg in document["legs"].values()) == pytest.approx(1)
    assert document["bodies"]["share"] + document["joints"]["share"] == pytest.approx(1)
    np.testing.assert_allclose(
        document["deflection"]["star_2"], compliance.deflection(WRENCH, frame="star_2"), rtol=1e-12
    )
    np.testing.assert_allclose(document["sag"]["tool"], compliance.sag(), rtol=1e-12)
    assert document["units"]["task_coordinates"] == {"z": "m", "theta": "rad", "phi": "rad"}


def test_json_to_a_file_keeps_the_text(run, tmp_path):
    path = tmp_path / "answer.json"
    done = run("stiffness", "--json", str(path))
    assert done.exit_code == 0
    assert "Stiffness K" in done.stdout
    assert json.loads(path.read_text(encoding="utf-8"))["pose"]["source"] == "home"
    refused = run("stiffness", "--json", str(tmp_path / "none" / "answer.json"))
    assert refused.exit_code == 2
    assert "cannot write" in refused.stderr


def test_documented_json_keys_are_the_ones_written(run):
    from pathlib import Path

    documented = Path(__file__).parent.parent / "docs" / "command_line.md"
    keys = set(re.findall(r"^\| `([a-zA-Z_]+)`", documented.read_text(encoding="utf-8"), re.MULTILINE))
    assert keys == set(answer_as_json(run))


def test_info_is_told_as_json_too(run, tmp_path):
    done = run("info", "3prup", "--tolerances", "typical", "--json", "-")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    robot = prup_pin.load("3prup")
    assert told["gravity"] == robot.mechanism.gravity.tolist()
    assert told["joints"]["leg1_slide"] == {
        "unit": "m", "actuated": True, "type": "prismatic", "limits": [0.101, 0.609],
    }  # fmt: skip
    assert told["home"]["mobility"] == 3
    assert told["home"]["actuators"] == pytest.approx(robot.home.actuators)
    assert set(told["parameters"]) == set(robot.parameters)
    assert told["parameters"]["leg1/linear_rod.diameter"]["value"] == 0.02
    path = tmp_path / "info.json"
    beside = run("info", "3prup", "--json", str(path))
    assert "Compliant modules" in beside.stdout
    assert json.loads(path.read_text(encoding="utf-8"))["robot"] == "3prup"


def test_what_the_paper_prints_wrongly_is_told_where_it_is_used(run):
    plain, printed = run("stiffness", "3prup").stdout, run("stiffness", "3prup_as_published").stdout
    assert "Eq. (90)" not in plain
    assert "15 and 12.5 mm" not in " ".join(plain.split())
    assert "the sign of Eq. (90)" in " ".join(printed.split())
    info = " ".join(run("info", "3prup").stdout.split())
    assert "as_published: as the paper prints it: the sign of Eq. (90)" in info
    assert "Table 1, A_r: of 15 mm; the paper calls both" in info


# -- the other commands ----------------------------------------------------------------------------------------------


def test_info_names_joints_loops_mobility_modules_and_variants(run):
    text = run("info").stdout
    for word in (
        "leg2_R_theta",
        "prismatic",
        "actuated",
        "passive",
        "leg3_closure",
        "rank 12 of 12",
        "Table 1, D_LR",
        "as_published",
    ):
        assert word in text
    assert re.search(r"torsional_stiffness +6875.5 +N m/rad +Appendix D.5", text)


def test_info_of_a_robot_without_tool_still_answers(run):
    done = run("info", "allegro_left_hand")
    assert done.exit_code == 0, done.output
    assert "--tool" in done.stdout


def test_info_shows_sprung_joints(run):
    assert "sprung" in run("info", "double_pendulum", "--joint-stiffness", "1e4").stdout


@pytest.mark.parametrize(
    ("typed", "value"),
    [("2e4", 2e4), ("2e4 N m/rad", 2e4), ("2e7 Nmm/rad", 2e4), ("20kNm/rad", 2e4), ("350Nm/deg", 350 * 180 / np.pi)],
)
def test_a_stiffness_may_be_typed_with_its_unit(run, typed, value):
    name = "elbow_joint.stiffness"
    at = (
        "ur5",
        "--joint-stiffness",
        "1e4",
        "--actuators",
        "0,-1,1,0,1,0",
        "--wrench",
        "fx=10",
        "--set",
        f"{name}={typed}",
    )
    assert answer_as_json(run, *at)["robot"]["changed_parameters"] == {name: pytest.approx(value)}
    sprung = run("info", "ur5", "--joint-stiffness", f"elbow_joint={typed}", "--json", "-")
    assert sprung.exit_code == 0, sprung.output


def test_a_stiffness_in_a_unit_that_its_joint_has_not_is_refused(run):
    springs = ("info", "ur5", "--joint-stiffness")
    flat = " ".join(run(*springs, "elbow_joint=2e6N/m").stderr.split())
    assert "'N/m' is a unit of a stiffness; expected an angular stiffness in Nm/rad, Nm/mrad, Nm/deg" in flat
    assert "--joint-stiffness of shoulder_pan_joint: 'N/mm' is a unit of a stiffness" in " ".join(
        run(*springs, "2 N/mm").stderr.split()
    )
    gantry = str(Path(__file__).parents[1] / "examples" / "gantry.urdf")
    flat = " ".join(run("stiffness", gantry, "--set", "left/belt.stiffness=3Nm/rad").stderr.split())
    assert "'Nm/rad' is a unit of an angular stiffness; expected a stiffness in N/m, N/mm, N/µm" in flat


def test_a_springs_stiffness_has_the_unit_of_its_joint():
    gantry = prup_pin.load(Path(__file__).parents[1] / "examples" / "gantry.urdf")
    assert gantry.parameters["left/belt.stiffness"].unit == "N/m"
    assert prup_pin.load("ur5", joint_stiffness=1e4).parameters["elbow_joint.stiffness"].unit == "N m/rad"


def test_robots_and_kinds(run):
    text = run("robots").stdout
    assert "3prup_as_published" in text
    assert "ur5_robot.urdf" in text
    text = run("kinds").stdout
    for kind in KINDS:
        assert f"\n{kind.kind}\n" in f"\n{text}"
    one = run("kinds", "beam").stdout
    assert "youngs_modulus" in one
    assert "required" in one
    assert "section_beam" not in one
    assert "'ball_nut'" in run("kinds", "bal_nut").stderr


# -- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--at", "z=0,4,theta=25deg,phi=0"], ["decimal point", "character 4"]),
        (["--at", "z=0.4,theta=25dgr,phi=0"], ["'dgr'", "character 15", "'deg'"]),
        (["--at", "z=0.4,teta=25deg,phi=0"], ["'teta'", "'theta'", "character 7"]),
        (["--at", "z=25deg,theta=0,phi=0"], ["angle", "mm", "character 5"]),
        (["--at", "z=0.4,theta=25,phi=0"], ["25deg"]),
        (["--actuators", "350,0.51,0.36"], ["350 would be 350 m", "write 350mm", "character 1"]),
        (["ur5", "--joint-stiffness", "1e4", "--actuators", "1,2,3,40,5,6"], ["40 rad", "write 40deg", "character 7"]),
        (["ur5", "--actuators", "elbow_joint=-90"], ["write elbow_joint=-90deg, or elbow_joint=-90rad"]),
        (["--set", "leg1/linear_rod.diameter=22"], ["write leg1/linear_rod.diameter=22mm"]),
        (["--at", ""], ["nothing"]),
        (["--at", "z=0.4,theta=nan,phi=0"], ["'nan'"]),
        (["--at", "z=0.4,z=0.4,theta=0,phi=0"], ["twice"]),
        (["--at", "leg1_slide=0.3,theta=0"], ["no coordinate named", "go to --actuators leg1_slide=0.3,…"]),
        (["--at", "z=5,theta=0,phi=0"], ["cannot reach", "Nearest"]),
        (["--at", POSE, "--actuators", "1,2,3"], ["one of them"]),
        (["--actuators", "0,35,0,51,0,36"], ["decimal"]),
        (["--actuators", "0.35,0.51"], ["3 values", "leg3_slide"]),
        (["--wrench", "fx=300,mq=1"], ["'mq'", "mz"]),
        (["--wrench", "mz=100N"], ["Nm"]),
        (["--wrench", "fx"], ["component=value"]),
        (["--at-load"], ["--wrench"]),
        (["--set", "leg1/linear_rod.diametr=20mm"], ["no parameter named", "leg1/linear_rod.diameter"]),
        (["--set", "leg1/linear_rod.diameter=-2mm"], ["> 0 m"]),
        (["--set", "leg9*=1"], ["leg9*"]),
        (["--set", "leg1/linear_rod.diameter"], ["NAME=VALUE"]),
        (["--lock", "leg1_brunch"], ["'leg1_branch'"]),
        (["--frame", "star2"], ["'star_2'"]),
        (["--variant", "published"], ["as_published"]),
        (["--joint-stiffness", "stiff"], ["not a number"]),
        (["3prp"], ["'3prup'"]),
        (["no/such/robot.urdf"], ["robot.urdf"]),
        (["ur5"], ["--joint-stiffness"]),
        (["allegro_left_hand", "--joint-stiffness", "1"], ["--tool"]),
    ],
)
def test_errors_are_one_message_and_exit_code_two(run, arguments, words):
    done = run("stiffness", *arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("Error: ")
    message = " ".join(done.stderr.split())
    assert "Traceback" not in message
    assert "load(" not in message
    for word in words:
        assert word in message
    assert all(len(line) <= 80 for line in done.stderr.splitlines())


def test_bugs_keep_their_traceback(monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("prup_pin.loading.load", broken)
    assert isinstance(CliRunner().invoke(app, ["info"]).exception, ZeroDivisionError)


# -- in a pipe -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ["stiffness", "--at", POSE, "--wrench", "fx=300,my=-20", "--frame", "leg1_rod_tip"],
        pytest.param(["info", "panda"], marks=pytest.mark.slow),
        *(
            pytest.param(words.split(), marks=pytest.mark.slow)
            for words in ("stiffness kinova --joint-stiffness 1e4", "info", "robots", "kinds", "--help")
        ),
        ["stiffness", "--help"],
    ],
)
def test_a_pipe_gets_80_columns_without_colour(arguments):
    done = shell(*arguments)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    assert "…" not in re.sub(r"[,=]\S*…|…,", "", done.stdout) or "--help" in arguments


def test_json_on_stdout_is_alone_and_version_is_printed(run):
    done = shell("stiffness", "--json", "-", PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout)["robot"]["name"] == "3prup"
    assert done.stderr == ""
    assert run("--version").stdout == f"prup_pin {prup_pin.__version__}\n"


def test_a_terminal_without_unicode_is_served():
    done = shell("stiffness", PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr


def test_error_in_a_shell():
    done = shell("stiffness", "--at", "z=0.4,theta=25dgr,phi=0")
    assert done.returncode == 2
    assert done.stdout == ""
    caret = done.stderr.splitlines()[-1]
    assert done.stderr.splitlines()[-2][caret.index("^") :].startswith("dgr")


def test_pictures_are_written(run, tmp_path):
    done = run("stiffness", "--at", POSE, "--wrench", "fx=300", "--pictures", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    for name in ("pose.png", "shares.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
        assert name in done.stdout


# -- quantities ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("0.4", "length", 0.4),
        (" 400 mm", "length", 0.4),
        ("-2e2um", "length", -2e-4),
        ("180°", "angle", np.pi),
        ("+.5rad", "angle", 0.5),
        ("1.5kN", "force", 1500),
        ("3 N m", "moment", 3),
        ("3N*m", "moment", 3),
    ],
)
def test_quantities(text, dimension, value):
    assert parse_quantity(text, dimension, "--at") == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "inf", "nan", "1_000", "0x10", "1e999", "1,5", "--1", "1 2"])
def test_what_is_no_quantity(text):
    with pytest.raises(InputError, match="--at"):
        parse_quantity(text, "length", "--at")


def test_lists_and_assignments():
    assert parse_list("1, 20mm;3", ["length"] * 3, "abc", "--x") == [1, 0.02, 3]
    assert parse_assignments("a = 1 ; b=2mm", {"a": "number", "b": "length"}, "--x", "name") == {"a": 1, "b": 0.002}
    with pytest.raises(InputError, match=r"1\^|\^"):
        parse_assignments("x" * 200 + "=1", {"a": "number"}, "--x", "name")


def test_fixed_keeps_decimals_alike():
    assert fixed([123.4, 0.5, 1e-9]) == ["123.4", "0.5", "0"]
    assert fixed([0, 0]) == ["0", "0"]


def test_a_packaged_robot_on_which_nothing_yields_is_not_said_to_have_modules(run):
    listed = run("robots").stdout
    first, _, rest = listed.partition("Packaged without compliant modules")
    assert "3prup" in first
    assert "ball_screw_axis" not in first
    assert "ball_screw_axis" in rest
