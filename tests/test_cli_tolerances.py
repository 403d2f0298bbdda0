"""Tolerances on the command line: what `info` shows, what `--tolerances` hands on, what it refuses."""

import json
import re

import pytest

import prup_pin.diagnosis
from prup_pin.errors import PrupPinError
from prup_pin.recordings import KINDS_OF_TOLERANCE, TYPICAL, Tolerances
from prup_pin.robots import packaged_folder


@pytest.fixture
def bench(tmp_path):
    """The path of a small recording that declares tolerances."""
    (tmp_path / "bench.csv").write_text("time,q.leg1_slide,q.leg2_slide,q.leg3_slide,p.x\n0,0.4,0.4,0.4,0\n")
    (tmp_path / "bench.json").write_text(json.dumps({"robot": "3prup", "tolerances": {"stiffness": 0.2, "mass": 0.3}}))
    return tmp_path / "bench.csv"


@pytest.fixture
def asked(monkeypatch):
    """The recordings that reach the diagnosis, which then stops."""
    found = []

    def stop(robot, recordings, **options):
        found.extend(recordings)
        raise PrupPinError("stopped here")

    monkeypatch.setattr(prup_pin.diagnosis, "diagnose", stop)
    return found


@pytest.fixture
def own(tmp_path):
    """The path of a 3-PRUP whose file declares tolerances."""
    text = (packaged_folder() / "3prup.urdf").read_text()
    for old, new in (
        ('value="6268.45" unit="N m/rad"', 'value="6268.45" unit="N m/rad" tolerance="25%"'),
        ('value="0.181" unit="m"', 'value="0.181" unit="m" tolerance="8e-5"'),
    ):
        assert text.count(old) == 3
        text = text.replace(old, new, 1)
    path = tmp_path / "own.urdf"
    path.write_text(text)
    return path


def test_info_says_nothing_of_tolerances_where_none_are_declared(run):
    assert "tolerance" not in run("info", "3prup").stdout.lower().replace("with their tolerances", "")


def test_info_shows_those_of_the_robot_file(run, own):
    text = run("info", own).stdout
    assert re.search(r"tilting_stiffness +6268.45 +N m/rad +25 % +Appendix", text)
    assert re.search(r"leg1/base.radius +0.181 +m +8e-5 +Table 1, a", text)
    assert re.search(r"leg2/base.radius +0.181 +m +Table 1, a", text)
    # a part with a tolerance of its own is no longer listed with its like
    assert re.search(r"^ *leg1/R_lambda *$", text, re.M)
    assert re.search(r"^ *leg2/R_lambda, leg3/R_lambda *$", text, re.M)


def test_info_shows_what_a_set_would_mean_for_a_robot(run, own):
    text = run("info", own, "--tolerances", "typical").stdout
    assert re.search(r"tilting_stiffness +6268.45 +N m/rad +25 % +Appendix", text)
    assert re.search(r"tilting_stiffness +6268.45 +N m/rad +10 % +Appendix", text)
    assert re.search(r"youngs_modulus +2.01e11 +Pa +3 % +Table 1, E_LR", text)
    for kind in KINDS_OF_TOLERANCE:
        assert re.search(rf"^ *{kind.name} ", text, re.M), kind.name
    assert "none: the drawing is taken at its word" in run("info", "3prup", "--tolerances", "none").stdout


def test_diagnose_takes_those_beside_the_recording(run, bench, asked, tmp_path):
    assert run("diagnose", bench, "--out", tmp_path / "out", "--no-report").exit_code == 2
    assert asked[0].tolerances == Tolerances(stiffness=0.2, mass=0.3)
    assert not [remark for remark in asked[0].remarks if "give way" in remark]


def test_diagnose_takes_a_named_set_or_a_file_instead(run, bench, asked, tmp_path):
    (tmp_path / "shop.json").write_text('{"stiffness": 0.15}')
    for name, expected in (
        ("typical", TYPICAL),
        ("none", Tolerances()),
        (tmp_path / "shop.json", Tolerances(stiffness=0.15)),
        (bench.with_suffix(".json"), Tolerances(stiffness=0.2, mass=0.3)),
    ):
        done = run("diagnose", bench, "--out", tmp_path / "out", "--no-report", "--tolerances", name)
        assert "stopped here" in done.output
        assert asked[-1].tolerances == expected
    remarks = ["give way" in " ".join(recording.remarks) for recording in asked]
    assert remarks == [True, True, True, False]
    assert "The declared tolerances of stiffness, mass give way to --tolerances typical." in asked[0].remarks


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("typcal", None, "--tolerances 'typcal': expected typical, arm, none or a JSON file. Did you mean 'typical'?"),
        (
            "stiffness=0.1",
            None,
            'Write {"stiffness": 0.1} into a file tolerances.json, and --tolerances tolerances.json',
        ),
        ("10%", None, 'expected typical, arm, none or a JSON file. Write {"stiffness": 10e-2}'),
        ("shop.json", None, "shop.json: file not found"),
        (
            "shop.json",
            '{"stifness": 0.1}',
            "shop.json: stifness: no tolerance has this name. Did you mean 'stiffness'?",
        ),
    ],
)
@pytest.mark.parametrize("command", ["info", "diagnose"])
def test_what_cannot_be_meant_is_refused(run, bench, asked, tmp_path, command, name, content, expected):
    where = name
    if name.endswith(".json"):
        where = tmp_path / name
    if content is not None:
        where.write_text(content)
    before = ("info", "3prup") if command == "info" else ("diagnose", bench, "--out", tmp_path / "out", "--no-report")
    done = run(*before, "--tolerances", where)
    assert done.exit_code == 2
    assert expected in re.sub(r"\s+", " ", done.output)
    assert not asked
