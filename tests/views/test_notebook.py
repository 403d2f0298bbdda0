"""Objects in a notebook: what a cell shows, what becomes a table or plain data, what completion offers."""

import importlib.resources
import inspect
import json
import subprocess
import sys
import typing
from html.parser import HTMLParser

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import Noise
from prup_pin.diagnosis import Diagnosis, Finding
from prup_pin.diagnosis.diagnosis import FittedParameter

WRENCH = {"fx": 300, "mz": 20}


@pytest.fixture(scope="module")
def compliance(robot):
    return robot.compliance(robot.pose(z=0.4, theta=0.436, phi=0.262))


@pytest.fixture
def diagnosis():
    """One finding of two parameters and one that no law explains."""
    size = FittedParameter(4.1e-5, "m", (3.9e-5, 4.3e-5))
    load = FittedParameter(0.8, "N", (1.2, 0.5))
    found = (
        Finding("backlash", "leg2/<b>", ("leg2/<b>",), {"half_gap": size, "closing_load": load}, 0.97, "play"),
        Finding("unknown", "robot", (), {}, 0.0, "something is left"),
    )
    rms = {"fit": 3.0, "heldout": 3.5}
    return Diagnosis(
        verdict="unexplained", noise=Noise("declared", 2e-6, 1e-5, 0, 0), before=rms, after=rms, within={},
        calibration=(), by_channel={}, findings=found, not_detectable=(), next_experiment={}, remarks=("a <i>remark",),
        unused_columns=(), effects=(), samples=np.arange(3), columns=(), residual_before=np.zeros((3, 6)),
        residual_after=np.zeros((3, 6)),
    )  # fmt: skip


def words(page):
    """Return the text of a page and its tags."""
    texts, tags = [], []
    parser = HTMLParser()
    parser.handle_data = lambda data: texts.append(data.strip())
    parser.handle_starttag = lambda tag, attributes: tags.append(tag)
    parser.feed(page)
    return " ".join(" ".join(texts).split()), tags  # spaces that do not break are spaces


# -- cells -------------------------------------------------------------------------------------------------------------


def test_a_robot_shows_what_it_consists_of(robot):
    text, tags = words(robot._repr_html_())
    for part in ("3prup", "15, of which 3 actuated: leg1_slide", "z 400 mm", "3 × ball nut", robot.assumptions[0]):
        assert part in text
    assert "script" not in tags


def test_a_robot_without_anything_shows_that(robot):
    text, _ = words(prup_pin.load("allegro_left_hand")._repr_html_())
    assert "none; load(..., tool=…)" in text
    assert "no module is compliant" in text


def test_a_compliance_shows_k_c_and_what_yields(compliance):
    text, _ = words(compliance._repr_html_())
    assert f"{compliance.K[2, 2] * 1e-3:.1f}" in text
    assert f"{compliance.C[0, 0] * 1e6:.2f}" in text
    values, vectors = np.linalg.eigh(compliance.C[:3, :3])
    assert f"the tool moves {values[-1] * 1e6:.3g} µm" in text
    shares = compliance.shares([*vectors[:, -1], 0, 0, 0])
    best = max(shares, key=shares.get)
    assert f"{best} {100 * shares[best]:.2f} %" in text
    assert text.index(best) < text.index("24 others")


def test_a_rigid_direction_is_said_in_the_cell():
    robot = prup_pin.load("double_pendulum", joint_stiffness=1e4)
    text, _ = words(robot.compliance(robot.home)._repr_html_())
    assert "K does not exist no module yields under" in text
    assert "Stiffness K" not in text


def test_a_diagnosis_shows_verdict_findings_and_intervals(diagnosis):
    text, tags = words(diagnosis._repr_html_())
    assert text.startswith("Diagnosis Unexplained: with backlash at leg2/<b>")
    for part in (
        "half gap 41 µm 39 to 43 µm",
        "closing load 0.8 N 0.5 to 1.2 N",
        "all, held out 3.5 3.5",
        "a <i>remark",
    ):
        assert part in text
    assert not {"b", "i"} & set(tags)


# -- tables and plain data ---------------------------------------------------------------------------------------------


def test_a_compliance_as_a_table_adds_up(compliance):
    pytest.importorskip("pandas")
    table = compliance.to_dataframe(WRENCH)
    assert list(table.index) == list(compliance.names)
    assert table["share"].sum() == pytest.approx(1, abs=1e-12)
    total = table[["dx", "dy", "dz", "rx", "ry", "rz"]].sum().to_numpy()
    np.testing.assert_allclose(total, compliance.deflection(WRENCH), rtol=1e-9)
    assert table.loc["leg2/ball_nut", "kind"] == "ball_nut"
    alone = compliance.to_dataframe()
    np.testing.assert_allclose(alone.filter(like="/").sum().to_numpy(), np.diag(compliance.C), rtol=1e-9)


def test_a_robot_as_a_table_holds_all_parameters(robot):
    pytest.importorskip("pandas")
    table = robot.with_parameters({"leg1/linear_rod.diameter": 0.022}).to_dataframe()
    assert list(table.index) == list(robot.parameters)
    row = table.loc["leg1/linear_rod.diameter"]
    assert (row["value"], row["unit"], row["kind"], row["source"]) == (0.022, "m", "beam", "changed by the user")


def test_a_diagnosis_as_a_table_has_a_row_for_each_parameter(diagnosis):
    pytest.importorskip("pandas")
    table = diagnosis.to_dataframe()
    assert table["physics"].tolist() == ["backlash", "backlash", "unknown"]
    assert table["low"].tolist()[:2] == [3.9e-5, 0.5]
    assert table["high"].tolist()[:2] == [4.3e-5, 1.2]
    assert table["finding"].tolist() == [1, 1, 2]


def test_objects_become_json_and_back(robot, compliance, diagnosis):
    document = json.loads(json.dumps(compliance.to_dict(WRENCH), allow_nan=False))
    np.testing.assert_array_equal(document["C"], compliance.C)
    np.testing.assert_array_equal(document["K"], compliance.K)
    np.testing.assert_array_equal(document["deflection"], compliance.deflection(WRENCH))
    assert document["modules"]["leg2/linear_rod"]["share"] == compliance.shares(WRENCH)["leg2/linear_rod"]
    assert compliance.to_dict()["deflection"] is None
    described = json.loads(json.dumps(robot.to_dict(), allow_nan=False))
    assert described["parameters"]["leg1/linear_rod.diameter"]["value"] == 0.02
    assert described["joints"]["leg1_slide"] == {"unit": "m", "actuated": True}
    assert len(described["loops"]) == 2
    told = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))
    assert told["verdict"] == "unexplained"
    assert told["findings"][0]["parameters"]["half_gap"]["value"] == 4.1e-5
    rigid = prup_pin.load("double_pendulum", joint_stiffness=1e4)
    assert rigid.compliance(rigid.home).to_dict()["K"] is None


def test_without_pandas_the_message_says_what_to_install(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(prup_pin.MissingExtraError, match="pip install pandas") as caught:
        robot.to_dataframe()
    assert caught.value.extra == "tables"


# -- completion --------------------------------------------------------------------------------------------------------


def test_view_tells_its_options():
    hints = typing.get_type_hints(
        prup_pin.Robot.view, localns=vars(importlib.import_module("prup_pin.views.meshcat.view"))
    )
    assert "mode 1" in str(hints["motion"])
    assert typing.get_args(hints["ellipsoids"]) == ("beside", "tool", "none")
    for name in list(inspect.signature(prup_pin.Robot.view).parameters)[1:]:
        assert f"{name}" in inspect.getdoc(prup_pin.Robot.view), name


def test_parts_complete_their_keys(compliance):
    assert "leg1/linear_rod" in compliance.parts._ipython_key_completions_()
    assert set(compliance.wrench_jacobians._ipython_key_completions_()) == set(compliance.names)


def test_types_are_shipped():
    assert (importlib.resources.files("prup_pin") / "py.typed").is_file()
    assert "diagnose" in prup_pin.__all__


def test_pandas_is_loaded_only_for_a_table():
    code = (
        "import sys, prup_pin; r = prup_pin.load('3prup'); r.compliance(r.home).to_dict(); r._repr_html_()\n"
        "print([name for name in 'pandas matplotlib meshcat IPython'.split() if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
