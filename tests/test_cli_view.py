"""`prup-pin view` and `prup-pin report`, as a user at a terminal meets them."""

import base64
import gzip
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

import prup_pin
from prup_pin.cli.files import file_name, write
from prup_pin.errors import InputError

POSE = "z=0.4,theta=25deg,phi=15deg"


@pytest.mark.usefixtures("without_pictures")
def test_report_writes_one_page_and_says_where(run, tmp_path):
    done = run(
        "report", "--at", POSE, "--wrench", "fx=300,mz=100", "--out", "out.html", "--set", "leg*/motor.*stiff*=7e3"
    )
    assert done.exit_code == 0, done.output
    assert re.search(r"Written: out\.html \(\d\.\d MB\)", done.stdout)
    page = (tmp_path / "out.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    for word in ("theta 25°", "fx 300 N, mz 100 N m", "leg1/motor.torsional_stiffness = 7 N m/mrad", "rank 12 of 12"):
        assert word in page
    assert os.listdir(tmp_path) == ["out.html"]


@pytest.mark.usefixtures("without_pictures")
def test_view_writes_a_page_named_like_the_robot(run, tmp_path):
    done = run("view", "--at", POSE, "--wrench", "fx=300", "--scale", "50")
    assert done.exit_code == 0, done.output
    assert "Written: 3prup.html" in done.stdout
    page = (tmp_path / "3prup.html").read_text(encoding="utf-8")
    assert b"drawn 50 times larger" in gzip.decompress(base64.b64decode(re.search(r'bytes\("([^"]+)"\)', page)[1]))
    assert run("report").exit_code == 0
    assert sorted(os.listdir(tmp_path)) == ["3prup.html", "3prup_report.html"]


@pytest.mark.slow
def test_view_shows_a_robot_without_any_compliance(run):
    done = run("view", "panda", "--tool", "panda_hand", "--html", "panda.html")
    assert done.exit_code == 0, done.output
    assert Path("panda.html").stat().st_size > 1e5


@pytest.mark.usefixtures("without_pictures")
def test_the_browser_opens_only_when_asked(run, monkeypatch, tmp_path):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    run("view")
    assert opened == []
    run("view", "--open")
    run("report", "--open", "--out", "r.html")
    assert opened == [(tmp_path / "3prup.html").as_uri(), (tmp_path / "r.html").as_uri()]


def test_all_three_commands_take_the_same_question(run):
    options = {
        command: set(re.findall(r"--[a-z-]+", run(command, "--help").stdout))
        for command in ("stiffness", "view", "report")
    }
    shared = set.intersection(*options.values()) - {"--help"}
    for option in ("--at", "--actuators", "--wrench", "--at-load", "--set", "--lock", "--variant", "--tool"):
        assert option in shared
    assert options["view"] - shared >= {"--scale", "--html", "--serve", "--open"}
    assert "--json" in options["stiffness"] - shared
    assert "--out" in options["report"] - shared


@pytest.mark.parametrize("command", ["view", "report"])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--at", "z=5,theta=0,phi=0"], ["cannot reach"]),
        (["--wrench", "fx=1", "--scale", "-1"], ["scale"]),
        (["ur5", "--wrench", "fx=1"], ["--joint-stiffness"]),
        (["allegro_left_hand", "--joint-stiffness", "1"], ["--tool"]),
    ],
)
def test_errors_are_one_message_and_no_file(run, tmp_path, command, arguments, words):
    done = run(command, *arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert done.stderr.startswith("Error: ")
    message = " ".join(done.stderr.split())
    assert "Traceback" not in message
    assert "load(" not in message
    for word in words:
        assert word in message
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("command", "option"), [("view", "--html"), ("report", "--out"), ("stiffness", "--json")])
def test_a_place_that_cannot_be_written_is_named(run, tmp_path, command, option):
    missing = run(command, option, "no/such/page.html")
    assert missing.exit_code == 2
    assert f"{option}: cannot write 'no/such/page.html': there is no folder 'no/such'" in " ".join(
        missing.stderr.split()
    )
    (tmp_path / "folder").mkdir()
    folder = run(command, option, "folder")
    assert folder.exit_code == 2
    assert "is a folder" in folder.stderr
    assert os.listdir(tmp_path) == ["folder"]
    assert os.listdir(tmp_path / "folder") == []


def test_who_asks_for_a_picture_is_told_the_command_that_draws(run):
    done = run("view", "3prup", "--png", "a.png")
    assert done.exit_code == 2
    assert "Pictures come from prup-pin stiffness --pictures DIR" in " ".join(done.output.replace("│", "").split())


def test_serve_and_a_file_exclude_each_other(run):
    done = run("view", "--serve", "--html", "a.html")
    assert done.exit_code == 2
    assert "exclude each other" in done.stderr


# -- serving -----------------------------------------------------------------------------------------------------------


def test_serve_serves_this_machine_until_interrupted(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "prup_pin", "view", "--wrench", "fx=300", "--serve"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        # where the tests run in the background, the shell has them ignore interrupts
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        line = process.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:\d+\S*", line)
        assert address, line
        with urllib.request.urlopen(address[0], timeout=600) as answer:
            assert b"meshcat" in answer.read().lower()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=600)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "Stopped" in rest
    assert errors == ""
    assert os.listdir(tmp_path) == []


# -- files -------------------------------------------------------------------------------------------------------------


def test_what_is_there_stays_until_the_new_file_is_complete(tmp_path):
    path = tmp_path / "page.html"
    path.write_text("old")
    with pytest.raises(InputError, match="half a character"):
        write(path, "new \ud800", "--out")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["page.html"]
    write(path, "new µ", "--out")
    assert path.read_text(encoding="utf-8") == "new µ"
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


def test_links_are_followed_and_devices_are_not_replaced(tmp_path):
    (tmp_path / "real.html").write_text("old")
    (tmp_path / "link.html").symlink_to("real.html")
    write(tmp_path / "link.html", "new", "--out")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "real.html").read_text() == "new"
    write(Path(os.devnull), "new", "--out")
    assert Path(os.devnull).is_char_device()


def test_a_folder_without_permission(tmp_path, monkeypatch):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(InputError, match=r"--out: cannot write .* Permission denied"):
        write(tmp_path / "page.html", "new", "--out")


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("3prup", "3prup"),
        ("../../etc/passwd", "passwd"),
        ("a b<c>", "a_b_c"),
        ("...", "robot"),
        ("", "robot"),
        ("x" * 300, "x" * 80),
    ],
)
def test_a_robots_name_as_a_file(name, file):
    assert file_name(name) == file


def test_prup_pin_has_a_template_in_its_package():
    assert (Path(prup_pin.__file__).parent / "views" / "report" / "report_page.html").is_file()


@pytest.mark.parametrize("command", ["view", "report", "stiffness"])
def test_a_load_that_no_number_holds_is_refused_with_the_bound(run, tmp_path, command):
    out = {"view": ["--html", str(tmp_path / "a.html")], "report": ["--out", str(tmp_path / "a.html")]}
    done = run(command, "3prup", "--wrench", "fx=1e155", *out.get(command, []))
    assert done.exit_code == 2
    assert "wrench: fx is 1e+155; expected at most 1e+12 [N]" in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())


def test_a_deflection_is_drawn_no_larger_than_a_picture_holds(run, tmp_path):
    done = run("view", "3prup", "--wrench", "fx=300", "--scale", "1e300", "--html", str(tmp_path / "a.html"))
    assert done.exit_code == 2
    assert "it would leave the picture. Expected at most" in " ".join(done.stderr.split())


@pytest.mark.usefixtures("without_pictures")
def test_either_word_says_where_a_page_is_written(run, tmp_path):
    assert run("view", "--out", "seen.html").exit_code == 0
    assert run("report", "--html", "told.html").exit_code == 0
    assert sorted(os.listdir(tmp_path)) == ["seen.html", "told.html"]


@pytest.mark.parametrize("command", ["view", "report", "stiffness"])
def test_what_a_diagnosis_left_is_no_robot_but_told_where_it_goes(run, tmp_path, command):
    folder = tmp_path / "found"
    folder.mkdir()
    (folder / "diagnosis.json").write_text("{}", encoding="utf-8")
    (folder / "corrected_model.json").write_text("{}", encoding="utf-8")
    for name in ("found", str(folder)):
        said = " ".join(run(command, name).stderr.split())
        assert "holds a diagnosis; expected a robot. Its page is" in said
        assert "goes to prup-pin predict" in said
    said = " ".join(run(command, "found/corrected_model.json").stderr.split())
    assert "A corrected model? It goes to prup-pin predict" in said
