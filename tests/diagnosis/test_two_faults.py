"""Several single faults of a hexapod whose file is taken at its word: each by its name, and weight is not forgotten."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose, load_conventions
from prup_pin.diagnosis.load_conventions import conventions_of_loads
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate
from prup_pin.spatial import rotation_exp, rotation_log

FACTORS = [0.0, 1.0, 0.0, -1.0, 0.0]


@pytest.fixture(scope="module")
def hexapod(tmp_path_factory):
    path = tmp_path_factory.mktemp("hexapod") / "hexapod.urdf"
    prup_pin.build.stewart(
        base_radius=0.5, platform_radius=0.25, height=0.7, drive_stiffness=2e7, platform_mass=40
    ).save(path)
    return prup_pin.load(path)


def bench_of(robot, *effects):
    """What a tracker sees of a robot in six poses under cycles of loads while it weighs and effects (…) act."""
    rng, actuated = np.random.default_rng(11), robot.mechanism.actuated
    place = np.array([0.0, 0.0, 0.72]) + rng.uniform(-0.05, 0.05, (6, 3))
    turn = rng.uniform(-0.1, 0.1, (6, 3))
    names = ("x", "y", "z", "rx", "ry", "rz")
    poses = [robot.pose(**dict(zip(names, row, strict=True))) for row in np.hstack((place, turn)).tolist()]
    q = {name: np.repeat([pose.joints[name] for pose in poses], len(FACTORS)) for name in actuated}
    loads = np.repeat(rng.normal(size=(6, 6)) * np.repeat([400.0, 40.0], 3), len(FACTORS), axis=0)
    wrench = loads * np.tile(FACTORS, 6)[:, None]
    count = 6 * len(FACTORS)
    recording = Recording(
        np.arange(float(count)), positions=q, wrench=wrench, noise=Noise(position=2e-6, rotation=8e-6)
    )
    weight = ("self_weight", "robot", "", {"scale": 1.0})
    seen = simulate(robot, recording, [effect_named(*each, robot.mechanism) for each in (weight, *effects)])
    position = seen.position + rng.normal(0, 2e-6, (count, 3))
    rotation = rotation_log(rotation_exp(rng.normal(0, 8e-6, (count, 3))) @ rotation_exp(seen.rotation))
    return replace(recording, position=position, rotation=rotation)


@pytest.mark.slow
def test_weight_is_told_beside_a_hose_that_could_take_its_place(hexapod):
    hose = {"stiffness": 4000.0, "x": 0.4, "y": 0.2, "z": 0.5}
    found = diagnose(hexapod, bench_of(hexapod, ("external_spring", "environment", "", hose)))
    told = {finding.physics: finding for finding in found.findings}
    assert {"external_spring", "self_weight"} <= set(told)
    for name, value in hose.items():
        low, high = told["external_spring"].parameters[name].interval
        assert low - 0.2 * (high - low) <= value <= high + 0.2 * (high - low), name
    # what is known of masses beforehand is counted, though a hose tells nothing of them
    low, high = told["self_weight"].parameters["scale"].interval
    assert 0.9 < low < 1.0 < high < 1.1


@pytest.mark.slow
def test_two_single_faults_are_told_by_their_names(hexapod):
    legs = list(hexapod.mechanism.actuated)
    drives = [module.name for module in hexapod.mechanism.modules if "drive" in module.name]
    faults = (
        ("encoder_offset", legs[0], "", {"offset": 1e-4}),
        ("stiffness_changed", drives[2], "", {"factor": 0.5}),
    )
    found = diagnose(hexapod, bench_of(hexapod, *faults))
    assert found.verdict == "explained"
    told = {(finding.physics, finding.location): finding for finding in found.findings}
    assert {(physics, place) for physics, place, *_ in faults} <= set(told)
    for physics, place, _, values in faults:
        for name, value in values.items():
            low, high = told[physics, place].parameters[name].interval
            assert low - 0.5 * (high - low) < value < high + 0.5 * (high - low)
            assert high - low < 0.1 * abs(value)
    assert not any("everything is off at once" in remark for remark in found.remarks)


@pytest.mark.slow
def test_a_lead_that_is_right_in_the_middle_of_the_travel_is_told(hexapod):
    leg = hexapod.mechanism.actuated[1]
    homed = float(hexapod.home.joints[leg])
    faults = (
        ("lead_error", "leg2/drive", "proportional", {"relative": 1e-3}),
        ("encoder_offset", leg, "", {"offset": -1e-3 * homed}),
    )
    found = diagnose(hexapod, bench_of(hexapod, *faults))
    assert found.verdict == "explained"
    told = {finding.physics: finding for finding in found.findings}
    assert told.keys() == {"lead_error", "self_weight"}
    low, high = told["lead_error"].parameters["relative"].interval
    assert low < 1e-3 < high < 1.3 * low


@pytest.mark.parametrize(("written", "words"), [(1.0, []), (-1.0, ["wrench=reaction"])])
def test_a_play_hides_no_other_way_to_write_wrenches(hexapod, written, words):
    """Its weight holds the platform on one side of the gap, until a load turns it over."""
    play = ("backlash", "leg2/drive", "", {"half_gap": 2e-5, "closing_load": 2.0})
    recording = bench_of(hexapod, play)
    found = conventions_of_loads(hexapod, replace(recording, wrench=written * recording.wrench))
    assert [str(each) for each in (found.conventions if found else ())] == words


def test_a_play_is_what_it_is_only_where_it_explains_nearly_all_of_a_log():
    """Forces written in kN seem to do nothing: the base, soft and with a play, leaves a third of what there is."""
    as_read = load_conventions._Left(softened=4700.0, yielding=2.0, play=True)
    written = load_conventions._Left(softened=18800.0, yielding=6200.0, play=True)
    assert as_read.tells_against(written)
    assert not as_read.tells_against(written._replace(yielding=1800.0))


def test_what_moves_by_rounding_alone_is_none_of_what_yields():
    """A direction in which a place carries nothing is not made as large as the others; numbers of 1e-27 beside 1e2 are
    what singular values of a matrix do not converge for, on some processors.
    """
    columns = np.column_stack((np.full(6, 2.0), np.full(6, 1e-16), np.zeros(6)))
    assert load_conventions._scale(columns, 2.0 * np.sqrt(6)) == pytest.approx([2.0 * np.sqrt(6), np.inf, np.inf])


@pytest.mark.parametrize("rows", [[0], *(pytest.param(rows, marks=pytest.mark.slow) for rows in ([0, 1], [0, 5, 10]))])
def test_of_too_few_samples_nothing_is_told(hexapod, rows):
    recording = bench_of(hexapod, ("encoder_offset", hexapod.mechanism.actuated[0], "", {"offset": 1e-3}))
    found = diagnose(hexapod, recording.select(np.array(rows)))
    (finding,) = found.findings
    assert (found.verdict, finding.physics, finding.location) == ("unexplained", "unknown", "robot")
    assert f"{6 * len(rows)} numbers of poses are too few" in finding.statement
    assert "a dozen loads" in finding.advice
