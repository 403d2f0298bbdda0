"""An encoder that errs as it turns, told from one whose zero or ratio is off where the joint turns far enough."""

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.criteria import PARAMETER_COST
from prup_pin.diagnosis.evidence import implausible
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import inputs_of

ARM = """<robot name="two hinges">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
  <joint name="swing" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="bend" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="end" type="fixed"><parent link="fore"/><child link="hand"/><origin xyz="0.3 0 0"/></joint>
</robot>
"""
NOISE = 5e-5


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    file = tmp_path_factory.mktemp("arm") / "arm.urdf"
    file.write_text(ARM, encoding="utf-8")
    return prup_pin.load(file)


def seen(travel, error, count=50):
    """Return where the hand was seen, in closed form; the joint `bend` stands `error(q)` beside its encoder."""
    draw = np.random.default_rng(8)
    swing, bend = travel * draw.uniform(-1, 1, (2, count))
    true = bend + error(bend)
    out = 0.4 + 0.3 * np.cos(true)
    hand = np.column_stack([out * np.cos(swing), out * np.sin(swing), -0.3 * np.sin(true)])
    return Recording(
        np.arange(float(count)),
        positions={"swing": swing, "bend": bend},
        markers={"hand": hand + NOISE * draw.normal(size=hand.shape)},
        noise=Noise(position=NOISE),
    )


def test_an_encoder_that_errs_once_a_turn_is_named(arm):
    found = diagnose(arm, seen(2.5, lambda q: 2e-3 * np.sin(q + 0.6)))
    (finding,) = found.findings
    assert (found.verdict, finding.physics, finding.candidates) == ("explained", "eccentric_encoder", ("bend",))
    assert finding.effect.place.aspect == "once a turn"
    assert not finding.alternatives
    for name, value in (("sine", 2e-3 * np.cos(0.6)), ("cosine", 2e-3 * np.sin(0.6))):
        low, high = finding.parameters[name].interval
        assert abs(value - (low + high) / 2) < 0.75 * (high - low)
        assert high - low < 3e-4


def test_where_the_joint_turns_little_a_wave_and_a_ratio_are_told_together(arm):
    found = diagnose(arm, seen(0.25, lambda q: 2e-3 * np.sin(q)))
    (finding,) = found.findings
    assert finding.physics == "lead_error"  # the simpler one
    assert "eccentric_encoder at bend (once a turn)" in finding.alternatives


def test_a_disc_hardly_sits_a_millimetre_beside_its_axis(arm):
    """An offset of the zero as large is nothing rare: where data cannot tell the two, it is that."""
    library = {item.name: item for item in candidates(arm.mechanism, inputs_of(seen(1.0, np.zeros_like, 4), arm))}
    runout = library["eccentric_encoder at bend (once a turn)"].term(np.array([0.0, 0.04]))
    offset = library["encoder_offset at bend"].term(np.array([0.04]))
    assert implausible(runout) > implausible(offset) + PARAMETER_COST
