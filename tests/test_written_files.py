"""Files that commands write: links, pipes, devices and modes stay what they are."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from prup_pin import load
from prup_pin.cli import app
from prup_pin.errors import InputError
from prup_pin.files import write_folder, write_whole
from prup_pin.recordings import Noise, write_plan
from prup_pin.simulation import CorrectedModel, read_model, write_model
from prup_pin.views.report.diagnosis_files import write_diagnosis

from .simulation.bench import plan

OLD, NEW = {"first": "old\n", "second": "old\n"}, {"first": ("new\n",), "second": ("new\n",)}


@pytest.fixture
def run(monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(done, *words):
    assert done.exit_code == 2, (done.output, done.exception)
    for word in words:
        assert word in " ".join(done.stderr.split())


def filled(folder):
    folder.mkdir()
    for name, text in OLD.items():
        (folder / name).write_text(text)
    return folder


def texts(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


# -- one file ----------------------------------------------------------------------------------------------------------


def test_a_file_keeps_its_mode_and_a_link_stays_a_link(tmp_path):
    real, link = tmp_path / "real.csv", tmp_path / "link.csv"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to("real.csv")
    write_whole({link: ("new",)})
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert sorted(os.listdir(tmp_path)) == ["link.csv", "real.csv"]


@pytest.mark.parametrize("through_a_link", [False, True])
def test_a_pipe_is_not_replaced(run, tmp_path, through_a_link):
    os.mkfifo("pipe.csv")
    out = "pipe.csv"
    if through_a_link:
        os.symlink("pipe.csv", "link.csv")
        out = "link.csv"
    write_plan(plan(), "plan.json")
    refused(run("simulate", "--plan", "plan.json", "--out", out), "a pipe or a device")
    assert stat.S_ISFIFO(os.lstat("pipe.csv").st_mode)
    with pytest.raises(InputError, match="a pipe or a device"):
        write_whole({tmp_path / out: ("new",)})


@pytest.mark.skipif(not os.path.exists("/dev/fd"), reason="needs /dev/fd")
def test_a_pipe_that_has_no_path_is_told_as_a_pipe():
    """What /dev/stdout leads to where the output is piped."""
    ends = os.pipe()
    try:
        with pytest.raises(InputError, match=r"^cannot write /dev/fd/\d+: it is a pipe or a device"):
            write_whole({Path(f"/dev/fd/{ends[1]}"): ("new",)})
    finally:
        for end in ends:
            os.close(end)


def test_a_pipe_where_the_json_beside_goes_is_refused_before_anything_is_computed(run):
    os.mkfifo("bench.json")
    write_plan(plan(), "plan.json")
    refused(run("simulate", "--plan", "plan.json", "--out", "bench.csv"), "bench.json", "a pipe or a device")
    assert not os.path.exists("bench.csv")


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder in which nobody can make a file")
@pytest.mark.parametrize(
    "line",
    [
        "diagnose no.csv --robot 3prup --out /proc/x",
        "diagnose no.csv --robot 3prup --out out --propose /proc/x",
        "follow no.csv --out /proc/x",
        "calibrate no.csv --out /proc/x.json",
        "predict no.json no.csv --out /proc/x.csv",
        "export no.json --to /proc/x.urdf",
        "import no.log --out /proc/x.csv",
        "sweep no.urdf --out /proc/x.csv",
        "view no.urdf --html /proc/x.html",
        "report no.urdf --out /proc/x.html",
        "stiffness no.urdf --json /proc/x.json",
        "stiffness no.urdf --pictures /proc/x",
    ],
)
def test_a_folder_that_takes_no_files_is_told_before_anything_is_read(run, line):
    """It says that it may be written to, and root may write everywhere: only trying tells."""
    refused(run(*line.split()), "cannot write to '/proc'")


def test_names_longer_than_any_file_are_refused(run):
    long = "a" * 300
    write_plan(plan(), "plan.json")
    refused(run("simulate", "--plan", "plan.json", "--out", f"{long}.csv"), "File name too long")
    refused(run("simulate", f"{long}.csv", "--out", "x.csv"), "File name too long")
    refused(run("stiffness", "--json", long), "File name too long")
    refused(run("view", "--html", f"{long}.html"), "File name too long")
    refused(run("info", long), "no robot named")
    refused(run("info", "--actuated", "nope"), "no movable joint named 'nope'")
    refused(run("info", "~nobody_of_that_name/x.urdf"), "file not found")
    refused(run("diagnose", f"{long}.csv", "--out", long), "File name too long")
    refused(run("stiffness", "--json", "a\0b"), "--json")


def test_half_a_character_is_an_error_and_nothing_is_written(tmp_path):
    with pytest.raises(InputError, match="half a character"):
        write_whole({tmp_path / "a": ("good",), tmp_path / "b": ("\ud800",)})
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a full device")
def test_a_full_device_is_one_message():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "prup_pin", "robots"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr == "Error: cannot write to standard output: No space left on device\n"


# -- a folder ----------------------------------------------------------------------------------------------------------


def test_of_a_folder_nothing_is_replaced_until_all_is_written(tmp_path):
    folder = filled(tmp_path / "out")
    before = texts(folder)
    with pytest.raises(InputError, match="half a character"):
        write_folder(folder, {"first": ("\ud800",), "second": ("new\n",)}, OLD)
    assert texts(folder) == before
    write_folder(folder, NEW, NEW)
    assert texts(folder) == {"first": "new\n", "second": "new\n"}


def test_what_is_no_longer_written_goes_and_the_rest_stays(tmp_path):
    folder = filled(tmp_path / "out")
    (folder / "mine").write_text("mine")
    write_folder(folder, {"first": ("new\n",)}, NEW)
    assert texts(folder) == {"first": "new\n", "mine": "mine"}


def test_a_folder_where_a_file_should_be_changes_nothing(diagnosed, tmp_path):
    robot, recording, diagnosis = diagnosed
    out = tmp_path / "out"
    write_diagnosis(diagnosis, robot, recording, out, robot_name="3prup", report=False)
    (out / "report.html").mkdir()
    before = texts(out)
    (out / "diagnosis.json").write_text("old")
    with pytest.raises(InputError, match=r"report\.html: it is a folder"):
        write_diagnosis(diagnosis, robot, recording, out, robot_name="3prup", report=False)
    assert texts(out) == {**before, "diagnosis.json": "old"}


# -- noise -------------------------------------------------------------------------------------------------------------


def test_the_model_of_a_diagnosis_knows_the_noise(answer, bench):
    found = read_model(answer.folder / "corrected_model.json").noise
    assert found == Noise(**bench.noise)


def test_predict_takes_the_models_noise_where_the_recording_declares_none(answer, bench, run, tmp_path):
    plain = tmp_path / "plain.csv"
    plain.write_text("\n".join(bench.held_out.read_text().splitlines()[:30]) + "\n")
    done = run("predict", answer.folder / "corrected_model.json", plain, "--out", "predicted.csv")
    assert done.exit_code == 0, done.output
    assert "not declared" not in done.stdout.split("Remarks")[0]
    assert "is that with which the model was found" in " ".join(done.stdout.split())


def test_a_models_noise_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "model.json"
    write_model(CorrectedModel("3prup", noise=Noise(position=2e-6, moment=0.1)), path)
    assert json.loads(path.read_text())["noise"] == {"position_noise": 2e-6, "moment_noise": 0.1}
    assert read_model(path).noise == Noise(position=2e-6, moment=0.1)
    assert "noise" not in json.loads(_written(CorrectedModel("3prup"), path))


def _written(model, path):
    write_model(model, path)
    return path.read_text()


def test_springs_that_no_number_can_hold_are_refused():
    with pytest.raises(InputError, match="expected a size from 1e-50 to 1e"):
        load("ur5", joint_stiffness=1e-308)
