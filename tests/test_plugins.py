"""What files and packages bring takes part wherever the package's own does; what cannot is refused in one sentence."""

import json
import os
import pickle
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin import plugins
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.errors import PluginError, RecordingFileError, UnknownNameError
from prup_pin.imports import read_log
from prup_pin.imports.log import readers
from prup_pin.laws import LAWS, brought_laws
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.modules import KINDS
from prup_pin.plugins import WITH, along
from prup_pin.recordings import Recording
from prup_pin.robots import brought_robots
from prup_pin.simulation import effect_named

from .plugged import HOSE, install

ROOT = Path(__file__).resolve().parents[1]
MOUNT = (ROOT / "examples/workshop_physics/workshop_physics/rubber_mount.py").read_text()
TABLE = (ROOT / "examples/workshop_physics/workshop_physics/mounted_table.urdf").read_text()


@pytest.fixture
def file(tmp_path):
    """A function that writes a file with a text and returns its path."""

    def written(text, name="mine.py"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


@pytest.fixture
def run(monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    runner = CliRunner()
    return lambda *arguments: runner.invoke(app, [str(argument) for argument in arguments])


def words():
    return [law.physics for law in EFFORT_LAWS]


def name_of(law):
    return law.physics


def test_a_law_takes_part_while_its_file_does(file):
    assert "pulling_hose" not in words()
    with along(file(HOSE)):
        assert words()[-1] == "pulling_hose"
        assert "pulling_hose" not in {law.physics for law in LAWS}
        assert [found.source.name for found in brought_laws()] == ["mine.py"]
        with along(file("LAWS = []", "none.py")):
            assert words().count("pulling_hose") == 1
    assert "pulling_hose" not in words()
    assert WITH not in os.environ


def test_threads_and_worker_processes_see_the_same(file):
    with along(file(HOSE)):
        (law,) = (found.thing for found in brought_laws())
        with ThreadPoolExecutor(4) as threads:
            assert {id(item) for item in threads.map(lambda _: list(EFFORT_LAWS)[-1], range(8))} == {id(law)}
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as workers:
            assert workers.submit(name_of, law).result() == "pulling_hose"


def test_a_file_that_was_rewritten_is_read_anew(file):
    path = file(HOSE)
    with along(path):
        assert words()[-1] == "pulling_hose"
    with along(file(HOSE.replace('"pulling_hose"', '"other_hose"'))):
        assert words()[-1] == "other_hose"
    with along(file(HOSE)):
        assert words()[-1] == "pulling_hose"


def test_a_file_that_changes_while_it_is_in_use_is_refused(file):
    path = file(HOSE + "# first\n")
    with along(path):
        path.write_text(HOSE + "# second\n")
        with pytest.raises(PluginError, match=r"mine\.py .* was changed while it was in use; start again"):
            words()


def test_the_environment_names_files_as_well(file, monkeypatch):
    paths = file(HOSE), file(MOUNT + "\n\nMODULES = [RubberMount]\n", "mount.py")
    monkeypatch.setenv(WITH, os.pathsep.join(map(str, paths)))
    assert words()[-1] == "pulling_hose"
    assert list(KINDS)[-1].kind == "rubber_mount"


def test_what_a_brought_law_did_is_found_and_told(file):
    robot = prup_pin.load("ball_screw_axis")
    time = np.arange(5000) * 0.004
    position = 0.1 * np.sin(1.1 * time) + 0.05 * np.sin(2.9 * time + 1)
    motion = Recording(time=time, positions={"carriage": position}, efforts={"carriage": 0 * time})
    with along(file(HOSE)):
        truth = effect_named("pulling_hose", "carriage", "effort", {"cubic": 5e4}, robot.mechanism)
        efforts = prup_pin.simulate(robot, motion, [truth]).efforts["carriage"]
        efforts += np.random.default_rng(3).normal(scale=0.5, size=len(time))
        found = diagnose(robot, Recording(time=time, positions={"carriage": position}, efforts={"carriage": efforts}))
        assert "led in a wider loop" not in found.findings[0].remedy
        assert found.findings[0].remedy == "lead the hose at carriage in a wider loop"
    assert (found.verdict, found.findings[0].physics) == ("explained", "pulling_hose")
    assert found.findings[0].parameters["cubic"].value == pytest.approx(5e4, rel=0.01)
    (told,) = (remark for remark in found.remarks if "Brought along" in remark)
    assert told.startswith("Brought along by mine.py (sha256 ")
    assert told.endswith("): law pulling_hose.")


def test_a_module_a_reader_and_a_robot_of_one_file(file, tmp_path, run):
    reader = (
        "def read(path):\n    return Log(str(path), (Stream('s', frozen({'time': [0.0, 1.0], 'q': [0.0, 2.0]})),))\n"
    )
    lists = "MODULES = [RubberMount]\nREADERS = {'.Two': read}\nROBOTS = {'mounted': 'mounted.urdf'}\n"
    head, _, rest = MOUNT.partition("import numpy as np\n")
    text = (
        f"{head}import numpy as np\nfrom prup_pin.imports.log import Log, Stream, frozen\n{rest}\n\n{reader}\n\n{lists}"
    )
    path = file(text)
    file(TABLE, "mounted.urdf")
    file("", "log.two")
    with along(path):
        robot = prup_pin.load("mounted")
        assert robot.mechanism.modules[0].kind.kind == "rubber_mount"
        assert read_log(tmp_path / "log.two").streams[0].columns["q"].tolist() == [0.0, 2.0]
    with pytest.raises(UnknownNameError, match="no robot named 'mounted'"):
        prup_pin.load("mounted")
    with pytest.raises(RecordingFileError, match=r"has the ending '\.two'"):
        read_log(tmp_path / "log.two")
    assert "brought by  mine.py (sha256" in run("kinds", "rubber_mount", "--with", path).stdout
    assert "Brought by mine.py (sha256" in run("robots", "--with", path).stdout


def test_every_command_takes_files(file, run):
    path = file(HOSE)
    assert "brought by  mine.py (sha256" in run("laws", "pulling_hose", "--with", path).stdout
    assert run("laws", "pulling_hose").exit_code == 2
    for command in (
        "stiffness",
        "diagnose",
        "predict",
        "simulate",
        "import",
        "report",
        "check",
        "compensate",
        "export",
    ):
        assert "--with" in run(command, "--help").stdout


def law(**changed):
    """Return the hose's file with other lines for its attributes."""
    text = HOSE
    for name, line in changed.items():
        (old,) = (each for each in text.splitlines() if each.strip().startswith(f"{name} = "))
        text = text.replace(old, f"    {name} = {line}")
    return text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = 1\n1 / 0", r"the file cannot be used: ZeroDivisionError: division by zero \(mine\.py, line 2\)"),
        ("from .deeds import Deed", "A file of yours imports by full names, as in 'from prup_pin"),
        ("def", r"the file cannot be used: SyntaxError: .*mine\.py, line 1"),
        ("import sys\nsys.exit(1)", r"the file cannot be used: SystemExit: 1 \(mine\.py, line 2\)"),
        ("a = 1", "brings nothing: expected one of the lists LAWS, MODULES, READERS, ROBOTS"),
        ("LAWS = 3", r"LAWS is 3; expected a list, LAWS = \[\.\.\.\]"),
        ("LAWS = [3]", "3: is no Law; expected a class that derives from it, or one of its instances"),
        ("class A: pass\nLAWS = [A]", "A: is no Law"),
        ("from prup_pin.laws import Law\nclass A(Law): pass\nLAWS = [A]", "A cannot be used: TypeError: .*abstract"),
        (law(physics='"Hose 2"'), "Hose: physics is 'Hose 2'; expected a word of lower-case letters, digits and _"),
        (law(physics='"payload"'), "'payload' is a name of prup_pin itself already: choose another"),
        (law(summary='""'), "Hose: summary is ''; expected a text"),
        (law(quantities="()", neutral="{'a': 1.0, 'b': None}"), "Hose: neutral is .*expected values"),
        (law(quantities="[1]"), r"Hose: quantities is \[1\]; expected a tuple of Quantity"),
        (law(quantities='(Quantity("cubic", "N", "effort"),)'), "quantity 'cubic' has no start: expected Quantity"),
        (law(quantities='(Quantity("cubic", None, "effort", 1.0),)'), "Hose: unit of quantity 'cubic' is None"),
        (law(quantities='(Quantity("cubic", "N", "", 1.0),)'), "Hose: description of quantity 'cubic' is ''"),
        (law(quantities='(Quantity("cubic", "N", "effort", 9.0, upper=5.0),)'), "starts at 9.0; expected > 0 and <= 5"),
        (law(neutral="{}"), "Hose: neutral is {}; expected values at which it changes nothing"),
        (law(neutral='{"square": 0.0}'), "Hose: neutral names square; its quantities are cubic"),
    ],
)  # fmt: skip
def test_a_law_that_cannot_be_used_is_refused_in_one_sentence(file, text, said, run):
    done = run("laws", "--with", file(text))
    assert done.exit_code == 2
    assert "Traceback" not in done.output
    with along(file(text)), pytest.raises(PluginError, match=rf"^mine\.py \(sha256 \w{{12}}\): .*({said})"):
        list(LAWS)


def everything():
    return list(KINDS), readers(), brought_robots()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("READERS = {'.csv': print}", r"'\.csv' is a name of prup_pin itself already"),
        ("READERS = {'a/b': print}", "'a/b' is no ending of files"),
        ("READERS = {'.two': 3}", r"the reader of \.two is 3; expected a function"),
        ("ROBOTS = {'3prup': __file__}", "'3prup' is a name of prup_pin itself already"),
        ("ROBOTS = {'3prup_x': __file__}", "'3prup_x' reads as a variant of a packaged robot"),
        ("ROBOTS = {'x': 'nowhere.urdf'}", "robot 'x': 'nowhere.urdf' is no file; expected a path, from "),
        ("ROBOTS = ['x.urdf']", "'' is no name of a robot"),
        (MOUNT + "\nRubberMount.kind = 'beam'\nMODULES = [RubberMount]", "'beam' is a name of prup_pin itself already"),
        (MOUNT + "\nMODULES = [RubberMount, RubberMount]", r"'rubber_mount' is a name of mine\.py \(.*\) already"),
        (
            MOUNT + "\nRubberMount.quantities = 1\nMODULES = [RubberMount]",
            "quantities is 1; expected a tuple of Quantity",
        ),
    ],
)
def test_so_is_anything_else_that_is_brought(file, text, said):
    with along(file(text)), pytest.raises(PluginError, match=said):
        everything()


def test_a_copy_of_a_file_is_that_file(file, tmp_path):
    (tmp_path / "copy").mkdir()
    with along(file(HOSE), file(HOSE), file(HOSE, "copy/mine.py")):
        assert words().count("pulling_hose") == 1


def test_two_files_may_not_bring_one_name(file):
    two = file(HOSE), file(HOSE + "# another\n", "other.py")
    with along(*two), pytest.raises(PluginError, match=r"^other\.py .*'pulling_hose' is a name of mine\.py .* already"):
        words()


def test_a_file_that_is_not_there_is_named(tmp_path, run):
    done = run("kinds", "--with", tmp_path / "nowhere.py")
    assert done.exit_code == 2
    assert "nowhere.py: cannot be read: No such file or directory" in " ".join(done.output.split())


def test_what_fails_while_it_is_used_is_told_with_file_and_line(file, run):
    text = HOSE.replace("return in_units(self.quantities", "return in_units(self.nothing")
    done = run("laws", "pulling_hose", "--robot", "ball_screw_axis", "--with", file(text))
    assert done.exit_code == 2
    assert "mine.py (sha256" in done.output
    assert (
        "'Hose' object has no attribute 'nothing' (mine.py, line 19). Repair it, or leave --with mine.py out"
        in " ".join(done.output.split())
    )


def test_what_is_slow_to_import_is_named(file, monkeypatch):
    monkeypatch.setattr(plugins, "SLOW", 0.0)
    with (
        along(file(HOSE + "# slow\n")),
        pytest.warns(UserWarning, match=r"^mine\.py .* took .* s to be imported; what"),
    ):
        words()


def test_nothing_is_asked_for_before_it_is_needed(tmp_path):
    """So a package may import any room of this one: it is never asked for while it is half imported."""
    rooms = "cli, diagnosis, testing, views.report, imports, compensation, export, design, build, review, loading"
    asked = "import prup_pin.plugins as p; p._declared = None; "
    asked += "; ".join(f"import prup_pin.{room}" for room in rooms.split(", "))
    done = python(tmp_path, "-c", asked)
    assert done.returncode == 0, done.stderr


def test_a_law_of_a_file_is_pickled_by_its_content(file):
    with along(file(HOSE)):
        (found,) = brought_laws()
        assert type(pickle.loads(pickle.dumps(found.thing))) is type(found.thing)


# -- packages ----------------------------------------------------------------------------------------------------------


def python(folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)]), "COLUMNS": "1000"}
    command = [sys.executable, "-B", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def example(tmp_path):
    """The example package's folder, installed."""
    tomllib = pytest.importorskip("tomllib")
    example = ROOT / "examples" / "workshop_physics"
    project = tomllib.loads((example / "pyproject.toml").read_text())["project"]
    install(tmp_path, project["name"], project["version"], project["entry-points"], {})
    (tmp_path / "workshop_physics").symlink_to(example / "workshop_physics")
    return example


def test_the_example_package_brings_what_it_says_and_passes_its_own_tests(example, tmp_path):
    done = python(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, str(example / "tests"))
    assert "5 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.slow
def test_a_diagnosis_names_the_law_of_the_example_package_and_draws_it_as_its_readme_says(example, tmp_path):
    text = (example / "README.md").read_text(encoding="utf-8")
    write, commands, told = re.findall(r"```(?:python|bash|text)\n(.*?)```", text, re.DOTALL)
    assert not python(tmp_path, "-c", write).stderr
    for command in commands.splitlines():
        done = python(tmp_path, "-m", *command.replace("prup-pin", "prup_pin").split())
        assert done.returncode == 0, done.stderr
    assert " ".join(told.split()) in " ".join(done.stdout.split())
    page = (tmp_path / "run_diagnosis/report.html").read_text(encoding="utf-8")
    assert "quadratic drag at turntable: what the recording asks for, and what the law gives" in page
    needs = json.loads((tmp_path / "run_diagnosis/corrected_model.json").read_text(encoding="utf-8"))["needs"]
    assert [item["package"] for item in needs] == ["workshop-physics"]


def test_a_package_that_cannot_be_used_is_named_and_so_is_what_it_shadows(tmp_path):
    for name, text, said in (
        (
            "broken-laws",
            "\nimport nothing_of_the_kind",
            "No module named 'nothing_of_the_kind' (broken_laws.py, line 2)",
        ),
        ("rude-laws", law(physics='"cogging"'), ": 'cogging' is a name of prup_pin itself already: choose another"),
    ):
        module = name.replace("-", "_")
        install(tmp_path / name, name, "2.1", {"prup_pin.laws": {"pulling_hose": f"{module}:Hose"}}, {module: text})
        done = python(tmp_path / name, "-m", "prup_pin", "laws")
        assert done.returncode == 2
        assert done.stderr.startswith(f"Error: {name} 2.1: ")
        assert said.partition(": ")[2] in done.stderr
        assert "Traceback" not in done.stderr
