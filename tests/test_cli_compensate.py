"""`prup-pin compensate`, as a user meets it."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.compensation import read_path
from prup_pin.recordings import read_recording
from prup_pin.simulation import CorrectedModel, effect_named, read_model, simulate, write_model
from prup_pin.spatial import rotation_exp

ROWS = [
    (0.0, 0.40, 0.10, -0.05, 120.0, -60.0, 15.0),
    (0.5, 0.41, 0.12, 0.00, -80.0, -60.0, 5.0),
    (1.0, 0.42, 0.10, 0.05, 40.0, 90.0, -10.0),
]
HEADER = "time,z,theta,phi,w.fx,w.fz,w.mz"


def table(*rows, header=HEADER, name="path.csv"):
    Path(name).write_text("".join(f"{line}\n" for line in (header, *rows)), encoding="utf-8")
    return name


def whole():
    return table(*(",".join(f"{value:g}" for value in row) for row in ROWS))


@pytest.fixture
def model(run):
    mechanism = prup_pin.load("3prup").mechanism
    effects = (
        effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 6e-5, "closing_load": 1.0}, mechanism),
        effect_named("encoder_offset", "leg1/motor", "", {"offset": 2e-4}, mechanism),
    )
    write_model(CorrectedModel("3prup", effects), "corrected_model.json")
    return "corrected_model.json"


def refused(done, *texts):
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    flat = " ".join(done.stderr.split())
    for text in texts:
        assert text in flat
    assert not Path("commands.csv").exists()


def test_the_corrected_model_under_the_commands_is_where_it_was_wanted(run, model):
    done = run("compensate", whole(), "--model", model, "--out", "commands.csv", "--plots", "plots")
    assert done.exit_code == 0, done.output
    assert done.stderr == ""  # no bar off a terminal
    assert "3, all compensated" in done.stdout
    assert "backlash@leg2/ball_nut" in done.stdout
    header, *_ = Path("commands.csv").read_text(encoding="utf-8").splitlines()
    assert header == "time,q.leg1_slide,q.leg2_slide,q.leg3_slide,w.fx,w.fz,w.mz,status"
    commands = read_recording("commands.csv")
    assert commands.robot == "3prup"
    seen = simulate(prup_pin.load("3prup"), commands, read_model(model).effects)
    turned = rotation_exp(seen.rotation)
    at = np.column_stack(
        (seen.position[:, 2], np.arctan2(-turned[:, 1, 2], turned[:, 2, 2]), np.arcsin(turned[:, 0, 2]))
    )
    np.testing.assert_allclose(at, np.array(ROWS)[:, 1:4], atol=2e-8)  # nine digits
    for kind in ("png", "svg"):
        assert Path(f"plots/path.{kind}").stat().st_size > 10_000
    first = Path("plots/path.svg").read_bytes()
    assert b">theta [" in first  # words are words
    run("compensate", "path.csv", "--model", model, "--out", "commands.csv", "--plots", "plots")
    assert Path("plots/path.svg").read_bytes() == first


def test_the_robot_may_stand_beside_the_path(run):
    whole()
    refused(run("compensate", "path.csv", "--out", "commands.csv"), "which robot? 'path.csv' does not say")
    Path("path.json").write_text('{"robot": "3prup"}')
    assert run("compensate", "path.csv", "--out", "commands.csv").exit_code == 0
    plain = Path("commands.csv").read_bytes()
    effect = "self_weight@robot scale=1"
    assert run("compensate", "path.csv", "--out", "commands.csv", "--effect", effect).exit_code == 0
    assert Path("commands.csv").read_bytes() != plain


def test_positions_of_actuators_name_places_too(run):
    pose = prup_pin.load("3prup").pose(z=0.4, theta=0.1, phi=-0.05)
    cells = ",".join(f"{value:.15g}" for value in pose.actuators.values())
    header = "time," + ",".join(f"q.{name}" for name in pose.actuators) + ",w.fx"
    name = table(f"0,{cells},120", header=header)
    assert run("compensate", name, "--robot", "3prup", "--out", "a.csv").exit_code == 0
    table("0,0.4,0.1,-0.05,120", header="time,z,theta,phi,w.fx")
    assert run("compensate", name, "--robot", "3prup", "--out", "b.csv").exit_code == 0
    for one, other in zip(*(read_recording(file).positions.values() for file in ("a.csv", "b.csv")), strict=True):
        np.testing.assert_allclose(one, other, atol=3e-9)


@pytest.mark.parametrize(
    ("rows", "header", "says"),
    [
        (["0,0.4,15,0,1"], None, "path.csv:2: column 'theta': 15 rad: is it in degrees? Expected rad, which would be"),
        (["0,0.4,0,0,1", "1,400,0,0,1"], None, "path.csv:3: column 'z': 400 m: is it in mm? Expected m, which would"),
        (["0,1e300,0,0,1"], None, "path.csv:2: column 'z': 1e+300 is too large; expected at most 1e+09, in m or rad"),
        (["0,0.4,x,0,1"], None, "path.csv:2: column 'theta': 'x' is not a number"),
        (["0,0.4,0,,1"], None, "path.csv:2: column 'phi': is empty; every row of a path needs it"),
        (["0,0.4,0,0,"], None, "path.csv:2: column 'w.fx': is empty; every row of a path needs it; write 0"),
        (["0,0.4,0,0"], None, "path.csv:2: column 'w.fx': the row has 4 cells, 5 expected"),
        (["1,0.4,0,0,1", "1,0.4,0,0,1"], None, "path.csv:3: column 'time': 1 s after 1 s"),
        (["0,0.4,0,0,1"], "time,z,theta,fi,w.fx", "path.csv:1: column 'phi': is missing beside z, theta"),
        (["0,0.4,0,0,1"], "time,z,theta,phi [deg],w.fx", "Is it column 'phi [deg]'? Expected 'phi' in rad"),
        (
            ["0,1"],
            "time,w.fx",
            "column 'z': no column says where the tool shall be: expected z, theta, phi",
        ),
        (["0.4,0,0,1"], "z,theta,phi,w.fx", "path.csv:1: column 'time': is missing"),
        ([], None, "path.csv:1: holds a header but no rows"),
    ],
)
def test_what_is_wrong_with_a_path_is_said_with_row_and_column(run, rows, header, says):
    table(*rows, header=header or "time,z,theta,phi,w.fx")
    refused(run("compensate", "path.csv", "--robot", "3prup", "--out", "commands.csv"), says)


def test_files_are_refused_before_anything_is_computed(run, model):
    whole()
    refused(run("compensate", "nope.csv", "--model", model, "--out", "commands.csv"), "nope.csv: file not found")
    refused(run("compensate", "path.csv", "--model", model, "--out", "no/commands.csv"), "there is no folder 'no'")
    refused(run("compensate", "path.csv", "--model", model, "--out", "path.csv"), "is the path itself")
    Path("file").touch()
    done = run("compensate", "path.csv", "--model", model, "--out", "commands.csv", "--plots", "file")
    refused(done, "--plots: 'file' is a file; give a folder")


def test_rows_without_a_command_are_listed(run):
    table("0,0.4,0,0,1", "1,0.7,0,0,1", header="time,z,theta,phi,w.fx")
    done = run("compensate", "path.csv", "--robot", "3prup", "--out", "commands.csv")
    assert done.exit_code == 0
    flat = " ".join(done.stdout.split())
    assert "2, 1 compensated" in flat
    assert "unreachable 1 row: line 3" in flat
    assert Path("commands.csv").read_text().splitlines()[2] == "1,,,,1,unreachable"
    table("1,0.7,0,0,1", header="time,z,theta,phi,w.fx")
    Path("commands.csv").unlink()
    refused(run("compensate", "path.csv", "--robot", "3prup", "--out", "commands.csv"), "none of 1 rows has a command")


def test_unknown_columns_are_remarks(run):
    table("0,0.4,0,0,1,5", header="time,z,theta,phi,w.fx,speed")
    read = read_path(prup_pin.load("3prup"), "path.csv")
    assert any("'speed' is ignored" in text for text in read.recording.remarks)
    assert repr(read) == "<ToolPath of 1 rows by z, theta, phi>"
