"""The benchmark of concealed devices: what an answer gets right, and devices that go out and come back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
TRUTH = {
    "effects": [
        {
            "physics": "backlash",
            "location": "leg1/drive",
            "places": ["leg1/drive", "leg1_slide"],
            "size": 5.0,
            "strength": [1.0, 2.0, 0.1, 0.1, 0.1, 0.1],
        }
    ],
    "misjudged": False,
    "beyond": [],
    "scatter": {"leg1/drive.stiffness": 0.1, "leg1_slide.encoder_offset": 2e-5, "hub.mass": 0.3},
}
RIGHT = {"physics": "backlash", "location": "leg1_slide", "candidates": ["leg1_slide (axial)"], "heldout_gain": 0.2}
FALSE = {"physics": "payload", "location": "platform", "candidates": ["platform"], "heldout_gain": 0.5}
KNOWN = {"physics": "self_weight", "location": "robot", "candidates": ["robot"], "heldout_gain": 0.9}


@pytest.fixture
def benchmark_module(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import _benchmark

    return _benchmark


def test_a_place_counts_by_any_of_its_names_and_a_false_one_beside_it_is_seen(benchmark_module):
    (effect,) = benchmark_module.marks({"findings": [KNOWN, RIGHT]}, TRUTH)["effects"]
    assert effect["right"]
    assert effect["alone"]
    (effect,) = benchmark_module.marks({"findings": [RIGHT, FALSE]}, TRUTH)["effects"]
    assert effect["right"]
    assert not effect["alone"]
    twin = FALSE | {"alternatives": ["backlash at leg1/drive"]}
    (effect,) = benchmark_module.marks({"findings": [twin]}, TRUTH)["effects"]
    assert effect["among"]
    assert not effect["named"]
    (effect,) = benchmark_module.marks({"findings": [FALSE]}, TRUTH)["effects"]
    assert not effect["among"]
    assert not any(effect[key] for key in ("place", "named", "right"))
    assert effect["told"] == "payload"


def test_intervals_are_judged_where_nothing_but_scatter_acts(benchmark_module):
    calibration = [
        {"parameter": "leg1/drive.stiffness", "nominal": 2e7, "value": 2.21e7, "sd": 1e5},
        {"parameter": "leg1_slide.encoder_offset", "nominal": 0.0, "value": 5e-5, "sd": 1e-5},
        {"parameter": "hub.mass", "nominal": 4.0, "value": 4.0, "sd": 1e-3},
    ]
    answer = {"findings": [], "calibration": calibration}
    assert benchmark_module.marks(answer, TRUTH | {"effects": []})["inside"] == [True, False]
    assert benchmark_module.marks(answer, TRUTH)["inside"] == []


def test_devices_go_out_and_their_answers_come_back(benchmark_module, tmp_path, capsys):
    how = {"seed": 3, "robot": "elastic_arm", "effects": [], "misjudged": False, "poses": (2, 2)}
    robots = {"elastic_arm": ROOT / "tests/robots/elastic_arm/elastic_arm.urdf"}
    benchmark_module.export(tmp_path, [("a", how), ("b", how | {"seed": 4})], robots)
    about = json.loads((tmp_path / "recordings/a.json").read_text())
    assert (tmp_path / "recordings" / about["robot"]).resolve().exists()
    answer = tmp_path / "answers/a"
    answer.mkdir(parents=True)
    (answer / "diagnosis.json").write_text(json.dumps({"verdict": "nothing_missing", "findings": []}))
    measured = (tmp_path / "recordings/a.heldout.csv").read_text().splitlines()
    head = measured[0].split(",")
    off = head.index("p.x")
    rows = [line.split(",") for line in measured[1:]]
    for row in rows:
        row[off] = repr(float(row[off]) + 3 * about["position_noise"])
    (answer / "heldout.csv").write_text("\n".join([measured[0], *map(",".join, rows)]) + "\n")
    (result,) = benchmark_module.read_answers(tmp_path)
    assert "b: no answer" in capsys.readouterr().out
    assert result["group"] == "clean"
    assert result["after"] == pytest.approx(np.sqrt(9 / 6), rel=1e-4)
    table = benchmark_module.table({"ours": [result]})
    assert "| scatter alone: something found | 0.0 % (0/1;" in table
