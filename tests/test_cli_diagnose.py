"""`prup-pin diagnose` from end to end: what it writes, what it says, what it refuses."""

import csv
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from prup_pin.cli import app
from prup_pin.recordings import read_plan, read_recording
from prup_pin.simulation import read_model
from prup_pin.spatial import rotation_exp, rotation_log

FILES = {"diagnosis.json", "corrected_model.json", "report.html", "next_experiment.json"}


def table(path):
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    return rows[0], rows[1:]


def changed(bench, folder, change, name="other", beside=True):
    """The recording of `bench` with its cells (rows of text, by column) changed."""
    head, rows = table(bench.path)
    columns = dict(zip(head, map(list, zip(*rows, strict=True)), strict=True))
    columns = change(columns) or columns
    path = folder / f"{name}.csv"
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if beside:
        path.with_suffix(".json").write_text(bench.path.with_suffix(".json").read_text(encoding="utf-8"))
    return path


def read_json(path):
    return json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


# -- what it writes ----------------------------------------------------------------------------------------------------


def test_it_writes_four_files_and_nothing_else(answer):
    folder, stdout = answer.folder, answer.stdout
    assert {path.name for path in folder.iterdir()} == FILES
    for name in FILES:
        assert str(folder / name) in stdout.replace("\n         ", " ")


def test_the_verdict_has_the_documented_keys(answer, bench):
    document = read_json(answer.folder / "diagnosis.json")
    assert document["verdict"] == "explained"
    assert document["noise"]["source"] == "declared"
    for name, value in bench.noise.items():
        assert document["noise"][name] == value
    residual = document["residual"]
    assert residual["unit"] == "multiples of the noise (RMS of whitened residual)"
    assert residual["before"]["heldout"] > 5 > 1.3 > residual["after"]["heldout"]
    assert set(residual["by_channel"]) == {"position", "rotation"}
    keys = {"physics", "location", "candidates", "parameters", "heldout_gain", "statement", "alternatives"}
    gains = [finding["heldout_gain"] for finding in document["findings"]]
    assert gains == sorted(gains, reverse=True)
    for finding in document["findings"]:
        assert keys <= set(finding)
        assert finding["location"] in finding["candidates"]
        for fitted in finding["parameters"].values():
            assert fitted["ci95"][0] <= fitted["value"] <= fitted["ci95"][1]
            assert fitted["unit"]
    for item in document["not_detectable"]:
        assert {"physics", "location", "smallest", "unit", "reason"} <= set(item)
    assert set(document["next_experiment"]) == {"why", "plan"}


def test_it_finds_what_is_different(answer, bench):
    document = read_json(answer.folder / "diagnosis.json")
    true, found = bench.truth["effects"][0], document["findings"][0]
    assert found["physics"] == true["physics"]
    assert true["location"] in found["candidates"]
    assert found["parameters"]["half_gap"]["value"] == pytest.approx(true["parameters"]["half_gap"], rel=0.05)


def test_the_corrected_model_predicts_what_was_held_out(answer, bench, run, tmp_path):
    predicted = tmp_path / "predicted.csv"
    done = run("predict", answer.folder / "corrected_model.json", bench.held_out, "--out", predicted)
    assert done.exit_code == 0, done.output
    head, rows = table(predicted)
    values = {name: np.array(cells) for name, cells in zip(head, zip(*rows, strict=True), strict=True)}
    assert set(values["status"]) == {"ok"}
    p, r = (np.array([values[f"{kind}.{axis}"] for axis in "xyz"], float).T for kind in "pr")
    measured = read_recording(bench.held_out)
    moved = np.sqrt(np.mean((measured.position - p) ** 2))
    turn = rotation_log(rotation_exp(measured.rotation) @ rotation_exp(r).mT)
    assert moved < 1.1 * bench.noise["position"]
    assert np.sqrt(np.mean(turn**2)) < 1.1 * bench.noise["rotation"]


def test_the_next_experiment_is_a_plan_that_can_be_simulated(answer, run, tmp_path):
    plan = read_plan(answer.folder / "next_experiment.json")
    assert plan.robot == "3prup"
    assert plan.pose_count >= 1
    document = read_json(answer.folder / "diagnosis.json")
    again = tmp_path / "plan.json"
    again.write_text(json.dumps(document["next_experiment"]["plan"]))
    assert read_plan(again) == plan
    done = run("simulate", "--plan", answer.folder / "next_experiment.json", "--out", tmp_path / "next.csv")
    assert done.exit_code == 0, done.output
    recording = read_recording(tmp_path / "next.csv")
    assert recording.noise.position is not None
    assert np.isfinite(recording.position).all()


def test_the_text_says_place_class_and_size(answer):
    text = " ".join(answer.stdout.split())
    parts = "Explained: with backlash at leg", "half gap", "µm (95 %:", "times the noise", "× noise", "cannot tell"
    for part in parts:
        assert part in text
    assert not answer.stdout.startswith("\n")


# -- other recordings --------------------------------------------------------------------------------------------------


def test_nothing_missing(clean_bench, diagnosed_clean, run, monkeypatch, tmp_path):
    monkeypatch.setattr("prup_pin.diagnosis.diagnose", lambda *_, **__: diagnosed_clean[2])
    (tmp_path / "report.html").write_text("of an earlier diagnosis")
    done = run("diagnose", clean_bench.path, "--out", tmp_path, "--no-report")
    assert done.exit_code == 0, done.output
    document = read_json(tmp_path / "diagnosis.json")
    assert (document["verdict"], document["findings"]) == ("nothing_missing", [])
    assert "Nothing is missing" in done.stdout
    assert "What would have been seen" in done.stdout
    assert "encoder_offset" in {item["physics"] for item in document["seen"]}
    assert read_model(tmp_path / "corrected_model.json").effects == ()
    assert not (tmp_path / "report.html").exists(), "the report of another recording stayed"


def test_what_no_law_explains_has_a_curve(answer_strange):
    document = read_json(answer_strange.folder / "diagnosis.json")
    assert document["verdict"] == "unexplained"
    unknown = document["findings"][-1] if len(document["findings"]) == 1 else next(
        item for item in document["findings"] if item["physics"] == "unknown"
    )  # fmt: skip
    curve = unknown["curve"]
    assert len(curve["load"]) == len(curve["deformation"]) == len(curve["deviation"]) > 2
    assert set(curve["units"]) == {"load", "deformation"}
    assert "Unexplained" in answer_strange.stdout
    head, _, *rows = answer_strange.stdout.partition("load [N")[2].splitlines()
    assert "deformation [µ" in head
    assert all(re.fullmatch(r"\s+\S+\s+\S+ ± \S+", row) for row in rows[: len(curve["load"])]), rows


def without_load(columns):
    return {name: ["0"] * len(cells) if name.startswith("w.") else cells for name, cells in columns.items()}


def one_pose(columns):
    first = {name: cells[0] for name, cells in columns.items() if name.startswith("q.")}
    rows = [i for i in range(len(columns["time"])) if all(columns[name][i] == value for name, value in first.items())]
    return {name: [cells[i] for i in rows] for name, cells in columns.items()}


def without_rotation(columns):
    return {name: cells for name, cells in columns.items() if not name.startswith("r.")}


def empty_column(columns):
    columns["p.y"] = ["nan"] * len(columns["p.y"])


def doubled(columns):
    n = len(columns["time"])
    columns = {name: cells[: n // 2] * 2 for name, cells in columns.items()}
    columns["time"] = [str(float(i)) for i in range(len(columns["time"]))]
    return columns


def poor(columns):
    empty_column(columns)
    return doubled(without_rotation(columns))


@pytest.mark.parametrize(
    ("change", "remarks"),
    [
        pytest.param(one_pose, ["one pose only"], marks=pytest.mark.slow),
        (poor, ["no rotation was measured", "p.y", "repeat an earlier row"]),
    ],
)
def test_poor_recordings_are_diagnosed_with_a_remark(clean_bench, run, tmp_path, change, remarks):
    path = changed(clean_bench, tmp_path, change)
    done = run("diagnose", path, "--out", tmp_path / "out", *(["--no-report"] if change is poor else []))
    assert done.exit_code == 0, done.output
    document = read_json(tmp_path / "out" / "diagnosis.json")
    assert document["verdict"] == "nothing_missing"
    for remark in remarks:
        assert any(remark in text for text in document["remarks"]), document["remarks"]
        assert remark in " ".join(done.stdout.split())


@pytest.mark.slow
def test_without_load_nothing_is_missing(run, tmp_path, clean_bench):
    """Poses measured by a good robot that nobody loads."""
    import prup_pin
    from prup_pin.recordings import add_noise, write_recording

    recording = read_recording(clean_bench.path)
    free = recording.select(slice(None)).with_measurements()
    object.__setattr__(free, "wrench", np.zeros((len(free), 6)))
    predicted = prup_pin.simulate(prup_pin.load("3prup"), free)
    measured = free.with_measurements(position=predicted.position, rotation=predicted.rotation)
    path = tmp_path / "free.csv"
    write_recording(add_noise(measured, recording.noise, 3), path)
    path = changed(type(clean_bench)(path, path, {}, {}), tmp_path, without_load, "unloaded")
    done = run("diagnose", path, "--out", tmp_path / "out", "--no-report")
    assert done.exit_code == 0, done.output
    document = read_json(tmp_path / "out" / "diagnosis.json")
    assert document["verdict"] == "nothing_missing"
    assert any("no load was applied" in text for text in document["remarks"])


# -- what it refuses ---------------------------------------------------------------------------------------------------


def refused(done, folder, *parts):
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    text = " ".join(done.stderr.split())
    for part in parts:
        assert part in text
    assert not folder.exists(), "it left something behind"


def test_without_any_pose_or_effort_there_is_nothing_to_compare(clean_bench, run, tmp_path):
    def blind(columns):
        return {name.replace("p.", "place."): cells for name, cells in columns.items() if name[0] != "r"}

    path = changed(clean_bench, tmp_path, blind)
    said = "no measured pose", "(columns p.x … r.z)", "no effort (columns tau.<joint>)", "Not used were place.x"
    refused(run("diagnose", path, "--out", tmp_path / "out"), tmp_path / "out", *said)
    refused(run("check", path), tmp_path / "out", *said)


def test_another_robots_actuators(clean_bench, run, tmp_path):
    def renamed(columns):
        return {name.replace("q.leg1_slide", "q.leg9_slide"): cells for name, cells in columns.items()}

    path = changed(clean_bench, tmp_path, renamed)
    refused(run("diagnose", path, "--out", tmp_path / "out"), tmp_path / "out", "q.leg1_slide")


def test_a_recording_that_names_no_robot(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, lambda columns: columns, beside=False)
    refused(run("diagnose", path, "--out", tmp_path / "out"), tmp_path / "out", "--robot 3prup")


def test_a_file_that_is_not_there(run, tmp_path):
    refused(
        run("diagnose", tmp_path / "no.csv", "--out", tmp_path / "out", "--robot", "3prup"), tmp_path / "out", "no.csv"
    )


def test_a_folder_that_cannot_be(clean_bench, run, tmp_path):
    (tmp_path / "file").write_text("")
    done = run("diagnose", clean_bench.path, "--out", tmp_path / "file" / "out")
    refused(done, tmp_path / "file" / "out", "is a file; give a folder")
    if os.geteuid():
        closed = tmp_path / "closed"
        closed.mkdir(mode=0o500)
        refused(run("diagnose", clean_bench.path, "--out", closed / "out"), closed / "out", "cannot write")


def test_a_recording_whose_own_json_would_be_replaced(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, lambda columns: columns, "diagnosis")
    before = path.with_suffix(".json").read_text()
    done = run("diagnose", path, "--out", tmp_path)
    assert done.exit_code == 2
    assert "replace the recording's JSON file" in " ".join(done.stderr.split())
    assert path.with_suffix(".json").read_text() == before


def times(prefix, factor):
    def change(columns):
        return {
            name: [repr(factor * float(cell)) for cell in cells] if name.startswith(prefix) else cells
            for name, cells in columns.items()
        }

    return change


@pytest.mark.parametrize(
    ("prefix", "factor", "columns", "said"),
    [
        pytest.param("p.", 1e3, "p", "mm", marks=pytest.mark.slow),
        pytest.param("r.", 180 / np.pi, "r", "deg", marks=pytest.mark.slow),
        pytest.param("q.", 1e3, "q", "mm", marks=pytest.mark.slow),
        pytest.param("w.f", 1e-3, "force", "kN", marks=pytest.mark.slow),
        pytest.param("w.m", 1e3, "moment", "N_mm", marks=pytest.mark.slow),
        ("w.", -1.0, "wrench", "reaction"),
    ],
)
def test_a_log_in_another_convention_is_read_so_and_told_first(
    clean_bench, run, tmp_path, prefix, factor, columns, said
):
    path = changed(clean_bench, tmp_path, times(prefix, factor))
    done = run("diagnose", path, "--out", tmp_path / "out", "--no-report")
    assert done.exit_code == 0, done.output
    document = read_json(tmp_path / "out" / "diagnosis.json")
    first, *others = document["findings"]
    assert document["verdict"] == "explained"
    assert first["physics"] == "log_convention"
    assert first["conventions"] == {columns: said}
    assert f"--convention {columns}={said}" in first["remedy"]
    assert {item["physics"] for item in others} <= {"finite_deflection", "self_weight"}
    # the model reads the next log so, and predicts it as it is written
    model = tmp_path / "out" / "corrected_model.json"
    assert read_json(model)["conventions"] == {columns: said}
    done = run("predict", model, path, "--out", tmp_path / "predicted.csv")
    assert done.exit_code == 0, done.output
    (head, rows), (predicted, told) = table(path), table(tmp_path / "predicted.csv")
    for name in ("p.x", "p.z", "r.x"):
        measured, wanted = (
            np.array([float(row[names.index(name)]) for row in cells])
            for names, cells in ((head, rows), (predicted, told))
        )
        np.testing.assert_allclose(measured, wanted, atol=2e-3 * np.ptp(measured))  # five times the noise


@pytest.mark.slow
def test_a_convention_that_is_typed_is_told_no_more(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, times("w.", -1.0))
    out = tmp_path / "out"
    done = run("diagnose", path, "--out", out, "--no-report", "--convention", "wrench=reaction")
    assert done.exit_code == 0, done.output
    assert read_json(out / "diagnosis.json")["verdict"] == "nothing_missing"
    assert read_json(out / "corrected_model.json")["conventions"] == {"wrench": "reaction"}


def test_a_convention_that_is_misspelt_is_refused_with_the_nearest(clean_bench, run, tmp_path):
    path = clean_bench.path
    refused(
        run("diagnose", path, "--out", tmp_path / "no", "--convention", "wrench=reacton"),
        tmp_path / "no",
        "--convention wrench=reacton",
        "Did you mean 'reaction'",
    )


@pytest.mark.slow
def test_check_tells_how_a_log_is_written(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, times("w.", -1.0))
    done = run("check", path)
    assert done.exit_code == 0, done.output
    text = " ".join(done.stdout.split())
    assert "Written otherwise than it says" in text
    assert "--convention wrench=reaction" in text
    assert text.index("Written otherwise") < text.index("What these data could not show")
    assert "Written otherwise" not in run("check", clean_bench.path).stdout


@pytest.mark.parametrize("column", ["q.leg2_slide", "w.fx"])
def test_a_column_without_any_number(bench, run, tmp_path, column):
    path = changed(bench, tmp_path, lambda columns: {**columns, column: [""] * len(columns[column])})
    told = f"other.csv': column {column} is empty in every row"
    refused(run("diagnose", path, "--out", tmp_path / "out"), tmp_path / "out", told)


def test_what_a_log_misspells_or_has_of_another_robot_is_said_first(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, lambda columns: {**columns, "tau.rail": ["1"] * len(columns["w.fx"])})
    declare(path, postition_noise=1e-5)
    done = run("check", path)
    assert done.exit_code == 0, done.output
    text = " ".join(done.stderr.split())
    assert "the unknown key 'postition_noise' is ignored. Did you mean 'position_noise'?" in text
    assert "has columns of rail, which '3prup' has no joint of: not used. Is it a log of another robot?" in text


def declare(path, **noise):
    beside = path.with_suffix(".json")
    beside.write_text(json.dumps({**json.loads(beside.read_text()), **noise}))


@pytest.mark.slow
def test_noise_declared_far_too_small(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, lambda columns: columns)
    declare(path, position_noise=2e-8)
    done = run("diagnose", path, "--out", tmp_path / "out", "--no-report")
    assert done.exit_code == 0, done.output
    document = read_json(tmp_path / "out" / "diagnosis.json")
    assert document["verdict"] == "nothing_missing"
    assert document["noise"]["source"] == "estimated"
    assert document["noise"]["position"] == pytest.approx(2e-6, rel=0.15)
    assert any("what is left is noise, and larger than declared" in text for text in document["remarks"])


@pytest.mark.slow
def test_noise_declared_far_too_large(clean_bench, run, tmp_path):
    path = changed(clean_bench, tmp_path, lambda columns: columns)
    declare(path, position_noise=2e-4, rotation_noise=1e-3)
    done = run("diagnose", path, "--out", tmp_path / "out", "--no-report")
    assert done.exit_code == 0, done.output
    remarks = read_json(tmp_path / "out" / "diagnosis.json")["remarks"]
    assert sum("repeats of a load scatter" in text for text in remarks) == 2


def test_without_out_the_folder_is_called_after_the_recording(monkeypatch, tmp_path, bench):
    """Nothing is diagnosed: what cannot be written is told before."""
    monkeypatch.chdir(tmp_path)
    Path("bench_diagnosis").write_text("a file", encoding="utf-8")
    done = CliRunner().invoke(app, ["diagnose", str(bench.path)])
    assert done.exit_code == 2
    assert "--out: 'bench_diagnosis' is a file; give a folder" in " ".join(done.stderr.split())
