"""Our simulation with a law against the independent simulator of a 3-PRUP, which shares no code with it.

Same poses, same loads, same effect: the difference is compared with a pose sensor's noise (2 um, 10 urad). The device
is followed as it is built; where two readings of one physics exist, the case says which.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin import laws
from prup_pin.laws import LAWS, Effect, Inputs, Place
from prup_pin.simulation import Simulator, effect_named
from prup_pin.spatial import rotation_exp, rotation_log
from tests.reference.concealed.device import Device
from tests.reference.concealed.draw import programme

NOISE = np.array([2e-6] * 3 + [1e-5] * 3)
ROBOT = prup_pin.load("3prup")
RUN = programme(np.random.default_rng(3), 3, 80.0, warm=True, directions=2)
POSE_CHANGES = np.cumsum(np.r_[False, np.abs(np.diff(RUN.q, axis=0)).max(1) > 1e-6])
NOTHING: list = []


def effect(law, place, aspect="", **values):
    found = next(item for item in LAWS if type(item) is law)
    return Effect(found, Place(place, aspect), values).checked(ROBOT.mechanism)


@cache
def without_any(wrench: bytes):
    """Our simulation under what the sensor reports, and its run without any law: that of most devices."""
    reported = np.frombuffer(wrench).reshape(RUN.w.shape)
    simulator = Simulator(ROBOT, Inputs(RUN.time, RUN.q, reported, POSE_CHANGES, RUN.temperature))
    return simulator, simulator.run(NOTHING)


def apart(device_effects, *each):
    """Return for each list of our effects the largest difference of the poses in multiples of noise."""
    device = Device(device_effects)
    simulator, nominal = without_any(device.report_wrench(RUN.w).tobytes())
    seen = device.simulate(RUN.q, RUN.w, RUN.temperature, RUN.time)
    assert seen.residual.max() < 0.2
    for effects in each:
        run = simulator.run(effects) if effects else nominal
        assert run.solved.all()
        turned = rotation_log(run.rotation @ rotation_exp(seen.r).swapaxes(1, 2))
        yield np.abs(np.hstack([run.position - seen.p, turned]) / NOISE).max()


def case(name, physics, location, sizes, *ours, within=0.05, beyond=3.0, **marks):
    device = {"physics": physics, "location": location, **sizes}
    return pytest.param(device, list(ours), within, beyond, id=name, **marks)


def stiffness(module, parameter, factor, aspect="", beyond=3.0):
    name = f"stiffness of {module} {aspect}".strip()
    ours = effect(laws.StiffnessChanged, module, aspect, factor=factor)
    return case(name, "stiffness_changed", module, {"parameter": parameter, "factor": factor}, ours, beyond=beyond)


def play(module, direction, aspect=""):
    ours = effect(laws.Backlash, module, aspect, half_gap=3e-5, closing_load=0.5)
    sizes = {"direction": direction, "half_gap": 3e-5, "smooth": 0.5}
    return case(f"play of {module} {direction}", "backlash", module, sizes, ours, within=0.08)


def friction(module, joint, place, limit=0.5, **marks):
    ours = effect(laws.CoulombFriction, place, limit=limit, presliding_stiffness=limit / 1.2e-4)
    sizes = {"joint": joint, "limit": limit, "presliding": 1.2e-4}
    return case(f"friction of {joint}", "coulomb_friction", module, sizes, ours, **marks)


def creep(module, direction, aspect="", within=0.05, **marks):
    ours = effect(laws.CreepLaw, module, aspect, share=20.0, time_constant=5.0)
    sizes = {"direction": direction, "ratio": 20.0, "time_constant": 5.0}
    return case(f"creep of {module} {direction}", "creep", module, sizes, ours, within=within, beyond=1.0, **marks)


#: Laws that other tests compare with trees that have such joints, by their word and place.
ELSEWHERE = {"GuidePlay", "UnevenJointCompliance", "StraightnessError", "GuideTwist", "LinkGrowth", "PitchError"}
#: A rod on an actuator that is off: the device's is as long as it stands, ours as long as the encoder says.
AS_LONG_AS_TOLD = 0.12

CASES = [
    stiffness("leg1/linear_rod", "E", 0.5),
    stiffness("leg2/moving_star_branch", "E", 0.5),
    stiffness("leg1/R_lambda", "tilting", 0.3, "tilting"),
    stiffness("leg1/R_lambda", "axial", 0.02, "axial"),
    stiffness("leg3/R_lambda", "radial", 0.02, "radial"),
    stiffness("leg2/R_phi", "axial", 0.02, "axial"),
    stiffness("leg3/R_phi", "radial", 0.02, "radial"),
    stiffness("leg2/R_theta_P", "radial", 0.05, "radial"),
    stiffness("leg3/ball_screw", "E", 0.02),
    stiffness("leg3/ball_nut", "axial", 0.002),
    stiffness("leg3/support_bearing", "axial", 0.02),
    stiffness("leg2/timing_belt", "stiffness", 0.0005, beyond=1.0),
    stiffness("leg2/motor", "torsional", 0.005),
    play("leg2/ball_nut", "axial"),
    play("leg1/R_lambda", "axial", "axial"),
    play("leg1/R_phi", "axial", "axial"),
    play("leg2/R_theta_P", "radial", "radial"),
    case("play along each axis", "backlash", "leg2/R_theta_P",
         {"direction": "radial", "half_gap": 3e-5, "smooth": 0.5, "by_axis": True},
         effect(laws.BacklashByAxis, "leg2/R_theta_P", "radial by axis", half_gap_x=3e-5, half_gap_y=3e-5,
                closing_load=0.5), within=0.08),
    case("a hose", "external_spring", "environment", {"stiffness": 1500.0, "rest": [0.02, -0.05, 0.43]},
         effect(laws.ExternalSpring, "environment", stiffness=1500.0, x=0.02, y=-0.05, z=0.43)),
    case("soft ground", "base_compliance", "base", {"translation": [1e-8, 3e-8, 2e-8], "rotation": [2e-6, 1e-6, 3e-6]},
         effect(laws.UnevenBaseCompliance, "base", "by axis", translation_x=1e-8, translation_y=3e-8,
                translation_z=2e-8, rotation_x=2e-6, rotation_y=1e-6, rotation_z=3e-6)),
    case("ground that tilts about a point", "base_compliance", "base",
         {"rotation": [2e-6, 1e-6, 3e-6], "point": [0.1, -0.05, -0.3]},
         effect(laws.BaseTilt, "base", "about a point", rotation_x=2e-6, rotation_y=1e-6, rotation_z=3e-6,
                x=0.1, y=-0.05, z=-0.3)),
    case("a column", "base_compliance", "base",
         {"translation": [1e-8, 3e-8, 2e-8], "rotation": [2e-6, 1e-6, 3e-6], "point": [0.0, 0.0, -0.3]},
         effect(laws.UnevenBaseAtPoint, "base", "by axis, about a point", translation_x=1e-8, translation_y=3e-8,
                translation_z=2e-8, rotation_x=2e-6, rotation_y=1e-6, rotation_z=3e-6, x=0.0, y=0.0, z=-0.3)),
    case("contact", "hertzian_contact", "leg3/R_theta_P", {"f0": 3.0, "f_ref": 2e5},
         effect(laws.HertzianContact, "leg3/R_theta_P", "radial", preload=3.0, reference_load=2e5)),
    # The device's secant reading, k ((F + F_0) / F_r)^(1/3) = F / x, is ours with F_r / 1.5^3 but for loads near F_0.
    case("contact's secant", "hertzian_contact", "leg3/R_theta_P", {"f0": 0.3, "f_ref": 2e5, "secant": True},
         effect(laws.HertzianContact, "leg3/R_theta_P", "radial", preload=0.3, reference_load=2e5 / 1.5**3),
         within=0.15),
    friction("leg1/R_theta_P", "theta", "leg1/R_theta_P", marks=pytest.mark.slow),
    friction("leg1/R_phi", "phi", "leg1/R_phi"),
    friction("leg1/R_lambda", "lambda", "leg1/R_lambda", marks=pytest.mark.slow),
    friction("leg1/R_theta_P", "slide", "leg1/moving_star_branch", limit=5.0, marks=pytest.mark.slow),
    case("damper in phi", "viscous_friction", "leg1/R_phi", {"joint": "phi", "damping": 500.0},
         effect(laws.ViscousFriction, "leg1/R_phi", damping=500.0), marks=pytest.mark.slow),
    case("damper in the slide", "viscous_friction", "leg1/R_theta_P", {"joint": "slide", "damping": 5e4},
         effect(laws.ViscousFriction, "leg1/moving_star_branch", damping=5e4)),
    case("weight with the star's at P", "self_weight", "robot", {"branches": "hub"},
         effect(laws.SelfWeight, "robot", scale=1.0), within=0.15),
    case("weight along the branches", "self_weight", "robot", {},
         effect(laws.SpreadSelfWeight, "robot", "spread", scale=1.0), within=0.05),
    case("shear", "shear", "robot", {}, effect(laws.Shear, "robot", scale=0.886 / 0.9), beyond=1.0),
    case("clamp of a rod", "root_tilt_compliance", "leg3/linear_rod", {"stiffness": 8e3},
         effect(laws.RootTiltCompliance, "leg3/linear_rod", root_tilting_stiffness=8e3)),
    case("clamp of a branch", "hub_root_compliance", "leg3/moving_star_branch", {"stiffness": 8e3},
         effect(laws.HubRootCompliance, "leg3/moving_star_branch", root_tilting_stiffness=8e3)),
    case("growth of a screw", "thermal_growth", "leg2/ball_screw", {"coefficient": 3e-5},
         effect(laws.ThermalGrowth, "leg2/ball_screw", expansion=3e-5), within=AS_LONG_AS_TOLD),
    case("growth of all screws", "thermal_growth", "robot", {"coefficient": 3e-5, "module": "ball_screw"},
         effect_named("thermal_growth", "robot", "ball_screw", {"expansion": 3e-5}, ROBOT.mechanism),
         within=AS_LONG_AS_TOLD),
    case("growth of a rod", "thermal_growth", "leg2/linear_rod", {"coefficient": 3e-5},
         effect(laws.ThermalGrowth, "leg2/linear_rod", expansion=3e-5), within=AS_LONG_AS_TOLD),
    case("lead", "lead_error", "leg2/ball_screw", {"kind": "proportional", "ratio": 1e-4},
         effect(laws.LeadError, "leg2/ball_screw", "proportional", relative=1e-4), within=AS_LONG_AS_TOLD),
    case("lead once a turn", "lead_error", "leg2/ball_screw", {"kind": "periodic", "amplitude": 5e-5, "phase": 0.7},
         effect(laws.PeriodicLeadError, "leg2/ball_screw", "periodic",
                sine=5e-5 * np.cos(0.7), cosine=5e-5 * np.sin(0.7)), within=AS_LONG_AS_TOLD),
    case("encoder twice a turn", "eccentric_encoder", "leg2/motor", {"amplitude": 5e-5, "phase": 0.7, "waves": 2},
         effect(laws.OvalEncoder, "leg2/motor", "twice a turn",
                sine=5e-5 * np.cos(0.7), cosine=5e-5 * np.sin(0.7)), within=AS_LONG_AS_TOLD),
    case("base", "geometric_offset", "leg1/base", {"radial": -4e-4, "tangential": 3e-4, "height": 1e-4},
         effect(laws.GeometricOffset, "leg1/base", radius=-4e-4, tangential=3e-4, height=1e-4)),
    case("yoke", "geometric_offset", "leg1/R_lambda", {"offset": 5e-5},
         effect(laws.GeometricOffset, "leg1/R_lambda", offset=5e-5), within=AS_LONG_AS_TOLD),
    case("encoder", "encoder_offset", "leg1/ball_screw", {"offset": 5e-5},
         effect(laws.EncoderOffset, "leg1/motor", offset=5e-5), within=AS_LONG_AS_TOLD),
    case("a gripper", "tool_compliance", "moving_star", {"translation": 2e-7, "rotation": 1e-5},
         effect(laws.ToolCompliance, "moving_star", translation=2e-7, rotation=1e-5)),
    case("a stem", "tool_compliance", "moving_star",
         {"translation": [3e-7, 4e-7, 1e-8], "rotation": [1e-5, 2e-5, 3e-5]},
         effect(laws.UnevenToolCompliance, "moving_star", "by axis", translation_x=3e-7, translation_y=4e-7,
                translation_z=1e-8, rotation_x=1e-5, rotation_y=2e-5, rotation_z=3e-5)),
    case("payload", "payload", "moving_star", {"mass": 2.0}, effect(laws.Payload, "moving_star", mass=2.0)),
    case("payload off centre", "payload", "moving_star", {"mass": 2.0, "lever": [0.03, 0.02, 0.01]},
         effect(laws.OffCentrePayload, "moving_star", "off centre", mass=2.0, x=0.03, y=0.02, z=0.01), within=0.1),
    case("pose sensor", "pose_sensor_misalignment", "pose_sensor",
         {"rotation": [1e-3, 2e-3, -3e-3], "translation": [1e-4, 2e-4, 3e-4]},
         effect(laws.PoseSensorMisalignment, "pose_sensor", rx=1e-3, ry=2e-3, rz=-3e-3, tx=1e-4, ty=2e-4, tz=3e-4)),
    case("pose sensor's scale", "pose_sensor_scale", "pose_sensor", {"error": 8e-4},
         effect(laws.PoseSensorScale, "pose_sensor", error=8e-4)),
    case("wrench sensor turned", "wrench_sensor_misalignment", "wrench_sensor", {"rotation": [0.02, -0.01, 0.03]},
         effect(laws.WrenchSensorMisalignment, "wrench_sensor", rx=-0.02, ry=0.01, rz=-0.03)),
    case("wrench sensor's channels", "wrench_sensor_gain", "wrench_sensor", {"gain": [1.1, 1.0, 0.8, 1.25, 1.0, 1.0]},
         effect(laws.WrenchSensorGain, "wrench_sensor", fx=1 / 1.1, fy=1.0, fz=1.25, mx=0.8, my=1.0, mz=1.0)),
    case("wrench sensor's amplifier", "wrench_sensor_gain", "wrench_sensor", {"gain": 1.25},
         effect(laws.WrenchSensorCommonGain, "wrench_sensor", "all channels", gain=0.8)),
    case("a force in the channel of another", "wrench_sensor_crosstalk", "wrench_sensor",
         {"channel": "fx", "of": "fz", "share": 0.1},
         effect(laws.WrenchSensorCrosstalk, "wrench_sensor", "fx by fz", share=0.1)),
    case("a moment in the channel of another", "wrench_sensor_crosstalk", "wrench_sensor",
         {"channel": "my", "of": "mx", "share": -0.1},
         effect(laws.WrenchSensorCrosstalk, "wrench_sensor", "my by mx", share=-0.1)),
    case("wrench sensor at rest", "wrench_sensor_bias", "wrench_sensor", {"bias": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]},
         effect(laws.WrenchSensorBias, "wrench_sensor", fx=1.0, fy=2.0, fz=3.0, mx=0.1, my=0.2, mz=0.3)),
    creep("leg2/R_theta_P", "radial", "radial", within=0.2),
    creep("leg2/support_bearing", "axial", marks=pytest.mark.slow),
    creep("leg2/R_lambda", "axial", "axial", marks=pytest.mark.slow),
    creep("leg1/R_lambda", "tilting", "tilting", within=0.3),
]  # fmt: skip


def half(effect):
    """Return an effect with half of its size: a law that is wrong in that."""
    neutral = effect.law.neutral_at(effect.place, ROBOT.mechanism)
    named = effect.law.neutral
    values = {
        name: (value + neutral[name]) / 2 if name in named or not named else value
        for name, value in effect.values.items()
    }
    return Effect(effect.law, effect.place, values)


@pytest.mark.parametrize(("device", "ours", "within", "beyond"), CASES)
def test_a_law_is_what_the_device_does(device, ours, within, beyond):
    without, there, wrong = apart([device], NOTHING, ours, [half(effect) for effect in ours])
    assert without > beyond
    assert there < within < wrong


def test_a_screw_that_is_homed_elsewhere_has_another_lead_and_another_zero():
    """What the device does with both, and the home of its robot file is 0.4 m from where the encoder reads zero."""
    both = (
        {"physics": "lead_error", "location": "leg2/ball_screw", "kind": "proportional", "ratio": 2e-4},
        {"physics": "encoder_offset", "location": "leg2/ball_screw", "offset": -6e-5},
    )
    place = "leg2/ball_screw", "homed elsewhere"
    ours = effect(laws.HomedLeadError, *place, relative=2e-4, offset=2e-4 * 0.4 - 6e-5)
    other = effect(laws.HomedLeadError, *place, relative=2e-4, offset=-6e-5)
    without, there, wrong = apart(both, NOTHING, [ours], [other])
    assert without > 3.0
    assert there < AS_LONG_AS_TOLD < wrong


def test_every_law_of_poses_is_compared_with_an_equation_or_a_device():
    folder = Path(__file__).parent
    texts = [path.read_text(encoding="utf-8") for path in folder.glob("test_*.py") if path.name != "test_contract.py"]
    named = set(re.findall(r"\b[A-Z]\w+\b", "".join(texts)))
    assert {type(law).__name__ for law in LAWS} - named - ELSEWHERE == set()


def test_encoders_that_report_late():
    """The device's encoders report q - delay dq/dt; ours stand at q + delay dq/dt."""
    speeds = np.linspace(-0.02, 0.02, 3 * len(RUN.q)).reshape(-1, 3)
    device = Device([{"physics": "encoder_delay", "location": "leg2/motor", "delay": 0.01}])
    told = device.report_position(RUN.q, speeds)
    seen = device.simulate(RUN.q, RUN.w, RUN.temperature, RUN.time)
    given = Inputs(RUN.time, told, RUN.w, POSE_CHANGES, RUN.temperature, speeds)
    run = Simulator(ROBOT, given).run([effect(laws.EncoderDelay, "leg2/motor", delay=0.01)])
    assert np.abs((run.position - seen.p) / NOISE[:3]).max() < AS_LONG_AS_TOLD
    assert np.abs(told - RUN.q).max() == pytest.approx(2e-4, rel=0.05)


def test_without_any_effect():
    (alike,) = apart(NOTHING, NOTHING)
    assert alike < 0.01


FRICTION = {
    "physics": "coulomb_friction",
    "location": "leg1/R_theta_P",
    "joint": "theta",
    "limit": 0.5,
    "presliding": 1.2e-4,
}


@pytest.mark.parametrize(
    ("device", "other"),
    [
        pytest.param({"physics": "payload", "location": "moving_star", "mass": 2.0},
         effect(laws.Payload, "moving_star", mass=2.0), marks=pytest.mark.slow),
        pytest.param({"physics": "encoder_offset", "location": "leg1/ball_screw", "offset": 5e-5},
         effect(laws.EncoderOffset, "leg1/motor", offset=5e-5), marks=pytest.mark.slow),
        pytest.param({"physics": "geometric_offset", "location": "leg1/base", "radial": -4e-4},
         effect(laws.GeometricOffset, "leg1/base", radius=-4e-4, tangential=0.0, height=0.0), marks=pytest.mark.slow),
        pytest.param({"physics": "stiffness_changed", "location": "leg1/moving_star_branch",
                      "parameter": "E", "factor": 0.5},
         effect(laws.StiffnessChanged, "leg1/moving_star_branch", factor=0.5), marks=pytest.mark.slow),
        ({"physics": "hub_root_compliance", "location": "leg1/moving_star_branch", "stiffness": 8e3},
         effect(laws.HubRootCompliance, "leg1/moving_star_branch", root_tilting_stiffness=8e3)),
    ],
    ids=lambda value: value["physics"] if isinstance(value, dict) else "",
)  # fmt: skip
def test_friction_beside_another_effect(device, other):
    """A joint relaxes where the other effect has taken it, not where the bare geometry has it."""
    ours = effect(laws.CoulombFriction, "leg1/R_theta_P", limit=0.5, presliding_stiffness=0.5 / 1.2e-4)
    alone, first, last = apart([FRICTION, device], [ours], [other, ours], [ours, other])
    assert alone > 1.0
    assert max(first, last) < 0.2
