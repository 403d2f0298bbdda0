"""`prup-pin sweep` as a user meets it."""

import errno
from pathlib import Path

import numpy as np
import pytest

import prup_pin

GRID = ["--over", "z=300mm", "--over", "theta=-20deg..20deg:5", "--over", "phi=-0.2..0.2:3"]
BOX = ["--force", "300", "--moment", "100"]


def test_the_summary_tells_how_numbers_spread(run):
    done = run("sweep", "3prup", *GRID, *BOX)
    assert done.exit_code == 0, done.output
    angles = np.linspace(-np.radians(20), np.radians(20), 5)
    s = prup_pin.load("3prup").sweep(
        z=0.3, theta=angles, phi=[-0.2, 0.0, 0.2], quantities=["extremes"], force=300, moment=100
    )
    line = next(line for line in done.output.splitlines() if "extremes translation" in line)
    assert f"{1e3 * s['extremes'][..., 0].min():.3f}" in line
    assert "mm" in line
    assert "15 ok" in done.output
    assert "forces up to 300 N, moments up to 100 N m" in done.output


def test_the_table_is_written_and_a_sweep_of_draws_says_what_failed(run, tmp_path):
    import pandas

    out = tmp_path / "s.parquet"
    done = run("sweep", "--over", "z=0.3", "--over", "theta=-1.4..1.4", "--over", "phi=-1.4..1.4", "--draws", "40",
               "--quantities", "C,ksi", "--out", str(out))  # fmt: skip
    assert done.exit_code == 0, done.output
    table = pandas.read_parquet(out)
    assert len(table) == 40
    ok = (table["status"] == "ok").sum()
    assert 0 < ok < 40
    assert f"{ok} ok" in done.output
    assert "a joint stands beyond its limits" in done.output
    assert str(out) in done.output.replace("\n", "")


def test_several_processes_give_the_same_table(run, tmp_path, monkeypatch):
    paths = [tmp_path / "one.parquet", tmp_path / "two.parquet"]
    for path, workers in zip(paths, ("1", "2"), strict=True):
        done = run("sweep", "3prup", *GRID, *BOX, "--workers", workers, "--out", str(path))
        assert done.exit_code == 0, done.output
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_robot_of_joints_and_changed_parameters(run):
    joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
    rest = ["wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
    over = [word for name in joints for word in ("--over", f"{name}=10deg..20deg:2")]
    over += [word for name in rest for word in ("--over", f"{name}=30deg")]
    done = run(
        "sweep", "ur5", "--joint-stiffness", "1e4", *over, "--quantities", "directional", "--direction", "tool z"
    )
    assert done.exit_code == 0, done.output
    assert "8 ok" in done.output


def test_the_summary_says_where_in_words_and_in_per_cent(run, tmp_path):
    import csv

    done = run("sweep", "3prup", *GRID, "--wrench", "fx=300", "--quantities", "translational,deflection",
               "--out", str(tmp_path / "s.csv"))  # fmt: skip
    assert done.exit_code == 0, done.output
    with (tmp_path / "s.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 15
    for name, title in (("translational.1", "translational 1, softest"), ("deflection.dx", "deflection dx")):
        by_size = sorted(rows, key=lambda row, name=name: float(row[name]))
        line = [line for line in done.output.splitlines() if title in line][-1]
        ends = [(float(row["theta"]), float(row["phi"])) for row in (by_size[0], by_size[-1])]
        words = [f"theta {np.degrees(theta):.4g}°, phi {np.degrees(phi):.4g}°" for theta, phi in ends]
        assert line.index(words[0]) < line.rindex(words[1])
    path = Path(__file__).parents[1] / "examples" / "five_bar.urdf"
    shared = run(
        "sweep", str(path), "--over", "x=0..0.05:2", "--over", "y=0.35", "--wrench", "fx=300", "--quantities", "shares"
    )
    mean = prup_pin.load(path).sweep(x=[0, 0.05], y=0.35, wrench=[300, 0, 0, 0, 0, 0], quantities=["shares"])
    (line,) = (line for line in shared.output.splitlines() if "shares left/arm" in line and "%" in line)
    arm = [module.name for module in mean.mechanism.modules].index("left/arm")
    assert abs(float(line.split()[3]) - 100 * mean["shares"][:, arm].mean()) < 0.01


def test_a_load_that_nothing_makes_use_of_is_told(run):
    done = run("sweep", "3prup", *GRID, "--wrench", "fx=300", "--quantities", "translational")
    said = " ".join(done.output.split())
    assert "--wrench is not used by translational: ask for shares, deflection, buckling_margin as well" in said
    assert "deflection dx" in run("sweep", "3prup", *GRID, "--wrench", "fx=300").output


def test_what_can_be_asked_is_listed(run):
    done = run("sweep", "--quantities", "help")
    assert done.exit_code == 0
    for name in prup_pin.sweep.QUANTITIES:
        assert name in done.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "which poses?"),
        (["--over", "z"], "expected NAME=VALUE"),
        (["--over", "z=0.3", "--over", "z=0.4"], "given twice"),
        (["--over", "teta=0.3"], "Did you mean 'theta'"),
        (["--over", "theta=5..1:3"], "reversed"),
        (["--over", "theta=0..1"], "how many"),
        (["--over", "theta=0..1:9999999999"], "expected at most 100000000 values on one axis"),
        (["--over", "theta=0..1:" + "9" * 5000], "expected at most 100000000 values on one axis"),
        (["--over", "theta=-10deg:10deg:5"], "two dots between the ends: -10deg..10deg:5"),
        (["--over", "theta=0..1:3", "--draws", "4"], "without ':3'"),
        (["--over", "theta=0..30:3"], "30deg"),
        (["--over", "z=300"], "z=300mm"),
        ([*GRID, "--quantities", "extremes"], "--force 300 --moment 100"),
        ([*GRID, "--quantities", "D"], "no quantity named 'D'"),
        ([*GRID, *BOX, "--out", "nowhere/s.parquet"], "no folder"),
        ([*GRID, "--quantities", "buckling_margin"], "--wrench"),
    ],
)
def test_what_cannot_be_meant_is_one_message(run, arguments, said):
    rest = {"z": "z=0.3", "theta": "theta=0", "phi": "phi=0"}
    given = " ".join(arguments)
    if arguments and "GRID" not in given and "teta" not in given:
        for name, value in rest.items():
            if f"{name}" not in given:
                arguments = [*arguments, "--over", value]
    if "--force" not in arguments and arguments != GRID and "--quantities" not in arguments:
        arguments = [*arguments, *BOX]
    done = run("sweep", *arguments)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())
    assert "Traceback" not in done.output


def test_maps_are_drawn_beside_the_table(run, tmp_path):
    maps = tmp_path / "maps"
    done = run("sweep", "3prup", *GRID, *BOX, "--quantities", "extremes,shares", "--plots", str(maps))
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in maps.iterdir()) == ["extremes.png", "extremes.svg", "shares.png", "shares.svg"]
    assert "extremes translation [mm]" in (maps / "extremes.svg").read_text(encoding="utf-8")
    pytest.importorskip("pyarrow")
    out = tmp_path / "s.parquet"
    again = run(
        "sweep", "3prup", *GRID, *BOX, "--quantities", "extremes", "--out", str(out), "--plots", str(tmp_path / "b")
    )
    assert again.exit_code == 0, again.output
    assert (tmp_path / "b/extremes.svg").read_bytes() == (maps / "extremes.svg").read_bytes()
    (tmp_path / "file").touch()
    refused = run("sweep", "3prup", *GRID, *BOX, "--plots", str(tmp_path / "file"))
    assert refused.exit_code == 2
    assert refused.stdout == ""
    assert "is a file; give a folder" in " ".join(refused.stderr.split())


def test_where_pictures_cannot_be_written_nothing_is_printed_and_none_is_left(run, tmp_path, monkeypatch):
    """A disk that fills up at the second picture."""
    real, opened = Path.open, []

    def full(path, *mode, **how):
        if path.name.endswith(".part") and len(opened.append(path) or opened) > 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(path, *mode, **how)

    monkeypatch.setattr(Path, "open", full)
    done = run("sweep", "3prup", *GRID, "--plots", str(tmp_path / "maps"))
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "--plots: cannot write" in done.stderr
    assert "No space left on device" in " ".join(done.stderr.split())
    assert list((tmp_path / "maps").iterdir()) == []


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--over", "z=0.3", "--over", "theta=0..0.1", "--over", "phi=0", "--draws", "3"], "scattered poses"),
        (["--over", "z=0.3", "--over", "theta=0", "--over", "phi=0"], "or one alone, have no map"),
        ([*GRID, "--quantities", "C,K"], "nothing of C, K can be drawn"),
    ],
)
def test_what_has_no_picture_is_refused_before_anything_is_computed(run, tmp_path, monkeypatch, asked, said):
    monkeypatch.setattr(prup_pin.Robot, "sweep", None)
    done = run("sweep", "3prup", *asked, "--plots", str(tmp_path / "maps"))
    assert done.exit_code == 2
    assert done.stdout == ""
    assert said in " ".join(done.stderr.split())


def test_a_planar_robot_is_swept_by_default_quantities(run):
    path = str(Path(__file__).parent / "robots" / "five_bar" / "five_bar.urdf")
    over = ["--over", "x=-20mm..20mm:3", "--over", "y=360mm..380mm:2"]
    done = run("sweep", path, "--joint-stiffness", "2e4", *over)
    assert done.exit_code == 0, done.output
    assert "6 ok" in done.output
    assert "translational 1" in done.output
    rows = [line.split() for line in done.output.splitlines() if line.strip().startswith("K_task ")][:3]
    found = (
        prup_pin.load(path, joint_stiffness=2e4)
        .sweep(x=np.linspace(-0.02, 0.02, 3), y=np.linspace(0.36, 0.38, 2), quantities=["K_task"])["K_task"]
        .reshape(-1, 2, 2)
    )
    assert [row[1:3] for row in rows] == [["x", "x"], ["x", "y"], ["y", "y"]]
    assert {row[-1] for row in rows} == {"N/mm"}
    for row, (i, j) in zip(rows, ((0, 0), (0, 1), (1, 1)), strict=True):
        entry = found[:, i, j] / 1e3
        want = [entry.min(), entry.mean(), np.percentile(entry, 95), entry.max()]
        np.testing.assert_allclose([float(word) for word in row[3:7]], want, rtol=1e-3, atol=0.02)
    done = run("sweep", path, "--joint-stiffness", "2e4", *over, "--quantities", "homogenised_ksi")
    assert done.exit_code == 0, done.output
    assert "6 no stiffness" in done.output
    assert "K_yielding, or K_task" in " ".join(done.output.split())


def test_an_arm_without_task_coordinates_is_never_told_of_those(run):
    """K_task is nothing that it has; by default it gets what it has, wherever home stands."""
    one = ["double_pendulum", "--joint-stiffness", "1e4", "--over", "joint1=0..1:3"]
    done = run("sweep", *one)
    assert done.exit_code == 0, done.output
    assert "3 ok" in done.output
    assert "translational" in done.output
    assert "K_task" not in done.output
    done = run("sweep", *one, "--quantities", "K")
    assert "3 no stiffness" in done.output
    assert "K_yielding" in done.output
    assert "K_task" not in done.output
    stretched = ["ur5", "--joint-stiffness", "1e4", "--over", "shoulder_lift_joint=-1", "--over", "elbow_joint=1",
                 "--over", "wrist_2_joint=1"]  # fmt: skip
    done = run("sweep", *stretched)
    assert "1 ok" in done.output
    assert "homogenised_ksi" in done.output


def test_a_matrix_too_large_for_lines_is_named_and_rounding_is_zero(run):
    level = ["--over", "z=0.38..0.4:3", "--over", "theta=0", "--over", "phi=0"]
    done = run("sweep", "3prup", *level, "--quantities", "K_task,C")
    assert done.exit_code == 0, done.output
    assert "in --out    C: of each pose more than 8 numbers, not listed here" in done.output
    cross = next(line for line in done.output.splitlines() if line.strip().startswith("K_task z theta"))
    assert cross.split()[3:] == ["0", "0", "0", "0", "N/rad"]


def test_a_table_of_another_ending_is_refused_by_its_option_and_before_any_folder_is_made(run, tmp_path):
    done = run(
        "sweep", "--over", "z=0.3", "--out", str(tmp_path / "s.xlsx"), "--plots", str(tmp_path / "maps" / "deep")
    )
    assert done.exit_code == 2
    said = "".join(done.stderr.split())
    assert "Error:--out:" in said
    assert "s.csv'" in said
    assert not list(tmp_path.iterdir())


def test_maps_go_into_a_folder_that_is_made_for_them(run, tmp_path):
    done = run("sweep", "--over", "z=0.3..0.4:3", "--quantities", "ksi", "--plots", str(tmp_path / "maps" / "deep"))
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in (tmp_path / "maps" / "deep").iterdir()) == ["ksi.png", "ksi.svg"]
