"""Tolerances that were declared too narrow."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.criteria import BEYOND
from prup_pin.diagnosis.evidence import factors_of_kinds
from prup_pin.diagnosis.search import _relieves_strain, strain_of
from prup_pin.recordings import read_recording

from ..reference.concealed.scattered import draw_scattered, write

ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"
KINDS = ["stiffness"] * 30 + ["position"] * 30 + ["mass"] * 4
FREE = ["stiffness", "position", "mass"]


def seen(seed, factors=None):
    """Return J^T J and J^T r of 400 numbers that tell most of the parameters well; some kinds off by other amounts."""
    rng = np.random.default_rng(seed)
    columns = 5 * rng.normal(size=(400, len(KINDS))) * np.exp(rng.uniform(-4, 0, len(KINDS)))
    off = rng.normal(size=len(KINDS)) * [(factors or {}).get(kind, 1.0) for kind in KINDS]
    return columns.T @ columns, columns.T @ (columns @ off + rng.normal(size=400))


def test_kinds_as_declared_are_left_alone():
    assert sum(bool(factors_of_kinds(*seen(seed), KINDS, FREE)) for seed in range(30)) <= 1


def test_a_kind_that_is_off_by_more_is_found_with_its_size():
    factor = 2.0
    found = [factors_of_kinds(*seen(seed, {"position": factor}), KINDS, FREE) for seed in range(20)]
    assert sum(set(each) == {"position"} for each in found) >= 18
    sizes = [each["position"] for each in found if "position" in each]
    assert np.mean(sizes) == pytest.approx(factor, rel=0.1)


def test_two_kinds_at_once():
    found = factors_of_kinds(*seen(1, {"position": 2.5, "stiffness": 2.5}), KINDS, FREE)
    assert set(found) == {"position", "stiffness"}


def test_one_part_far_off_is_no_matter_of_its_kind():
    """Its leg is: all tolerances of that kind three times as wide would hide it."""
    rng = np.random.default_rng(5)
    columns = 5 * rng.normal(size=(400, len(KINDS)))
    off = np.where(np.arange(len(KINDS)) == 7, 9.0, 0.5 * rng.normal(size=len(KINDS)))
    target = columns @ off + rng.normal(size=400)
    normal, right = columns.T @ columns, columns.T @ target
    assert not factors_of_kinds(normal, right, KINDS, FREE)
    off[20:26] = 6.0, -5.0, 4.0, -5.0, 4.0, 6.0
    right = columns.T @ (columns @ off + rng.normal(size=400))
    assert set(factors_of_kinds(normal, right, KINDS, FREE)) == {"stiffness"}


def test_what_may_not_be_misjudged_is_not():
    assert not factors_of_kinds(*seen(1, {"position": 2.5}), KINDS, ["stiffness", "mass"]).get("position")


def test_nothing_is_off_by_more_than_a_tolerance_can_be_misjudged():
    assert factors_of_kinds(*seen(2, {"position": 30.0}), KINDS, FREE)["position"] == BEYOND


def test_a_kind_that_is_off_by_less_is_left_alone():
    assert not factors_of_kinds(*seen(3, {"position": 0.3}), KINDS, FREE)


@pytest.mark.slow
def test_joints_farther_off_than_declared_are_no_findings(tmp_path):
    """At a third of the tolerance two of six joints would be findings."""
    write(draw_scattered(1, "elastic_arm", poses=(8, 2)), tmp_path, tmp_path / "sealed", "device")
    recording = read_recording(tmp_path / "device.csv")
    declared = recording.tolerances
    narrow = replace(declared, position=declared.position / 3, stiffness=declared.stiffness / 3)
    found = diagnose(prup_pin.load(ARM), replace(recording, tolerances=narrow))
    assert {finding.physics for finding in found.findings} == {"self_weight"}
    assert any("position 2.7 times as far as declared. These tolerances were taken" in text for text in found.remarks)


def test_a_law_enters_for_the_strain_that_it_takes_from_many_parameters():
    """None is beyond tolerance, and held-out samples are as good without it; where all are off, more is asked."""
    held = np.vstack((100 * np.eye(60), np.zeros((20, 60))))

    def fit(size):
        return SimpleNamespace(x=np.full(60, size), per_tolerance=held)

    assert _relieves_strain(fit(1.2), fit(1.0), 20.0)  # 26.4 saved
    assert not _relieves_strain(fit(1.2), fit(1.0), 27.0)
    assert not _relieves_strain(fit(2.1), fit(2.0), 20.0)  # 24.6 saved, but what is off is so by twice what is declared
    assert strain_of(fit(2.0)) == pytest.approx(4.0, rel=1e-3)
    assert strain_of(fit(0.5)) == 1.0
