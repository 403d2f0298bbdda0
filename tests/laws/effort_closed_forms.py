"""What each law of the effort channel adds, written a second time: by NumPy and Pinocchio, without the package.

A form gets (law, place, values, at) and returns efforts (N, k); NaN where it does not know, as where a joint turns
round. A law of the library has one; it says by which values it is tried where those of a search would not show it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio
from scipy.interpolate import CubicSpline

from prup_pin.dynamics import INERTIAL
from prup_pin.laws.efforts.backlash import LostLoad
from prup_pin.laws.efforts.clock import AnotherClock
from prup_pin.laws.efforts.cogging import Cogging, CoggingOfFewPeriods
from prup_pin.laws.efforts.coulomb_friction import LoadedFriction, SlidingFriction
from prup_pin.laws.efforts.counterbalance import (
    Counterbalance,
    CounterbalanceHardening,
    CounterbalanceSpring,
    CounterbalanceStrut,
)
from prup_pin.laws.efforts.effort_filter import EffortFilter, EffortsFilter
from prup_pin.laws.efforts.effort_sensor import (
    CrossTalk,
    EffortDelay,
    EffortGain,
    EffortOffset,
    EffortsDelay,
    EffortUnit,
)
from prup_pin.laws.efforts.encoder import DelayedEncoder, DelayedEncoders, OffsetEncoder
from prup_pin.laws.efforts.external_pull import ElasticPull, EvenPull
from prup_pin.laws.efforts.gain_by_temperature import GainByTemperature
from prup_pin.laws.efforts.inertial_parameters import InertialParameters, ScaledInertia
from prup_pin.laws.efforts.joint_compliance import YieldingGear
from prup_pin.laws.efforts.joint_coupling import FeltMotion, FeltPosition, SpringAcross
from prup_pin.laws.efforts.mounting import Mounting
from prup_pin.laws.efforts.payload import HeldBody, HeldMeanwhile
from prup_pin.laws.efforts.rotor_inertia import RotorInertia
from prup_pin.laws.efforts.stribeck_friction import StribeckFriction
from prup_pin.laws.efforts.transmission_coupling import TransmissionCoupling
from prup_pin.laws.efforts.viscous_friction import Damping, DirectedViscousFriction
from prup_pin.laws.efforts.warming_up import (
    ColdDamping,
    ColdFriction,
    DriftingByTemperature,
    DriftingZero,
    ThinnedDamping,
    ThinnedFriction,
)


@dataclass(frozen=True)
class Form:
    """A closed form, by how much of the largest effort it may be off, and values by which it is tried."""

    of: Callable
    tolerance: float = 1e-7
    values: Mapping[str, float] = field(default_factory=dict)

    def __call__(self, law, place, values, at):
        return self.of(law, place, values, at)


def _held_meanwhile(law, place, x, at):
    held = of_body(_held)(law, place, x, at)
    held[(at.motion.time < x["moment"]) | (at.motion.time >= x["until"])] = 0.0
    return held


def _thinned(j, x):
    return np.exp((x["reference"] - j.temperature) / x["kelvin"])


def _warm_gain(law, place, x, at):
    reported = every(place, at) if place.name == "robot" else single(place, at)
    return x["per_kelvin"] * (at.motion.temperature - x["reference"])[:, None] * reported


def _strut(j, x):
    """By the energy F0 L + k L^2 / 2 of a strut between points at distances 1 and b of the joint's axis."""
    e, step = x["slenderness"], 1e-6
    b = (1 - np.sqrt(1 - e * e)) / e
    pull, stiffness = x["force"] * np.hypot(1, b) / b, x["spring"] / b

    def energy(q):
        ends = np.stack([b * np.cos(q - x["dead_centre"]), b * np.sin(q - x["dead_centre"])])
        length = np.linalg.norm(ends - np.array([[1.0], [0.0]]), axis=0)
        return pull * length + stiffness * length**2 / 2

    return (energy(j.q + step) - energy(j.q - step)) / (2 * step)


def _pulled(law, place, x, at):
    """By the energy of the pull, U = -f p + (p - home) K (p - home) / 2: drives give its rise along their joints."""
    model, tool, step = at.mechanism.model, at.mechanism.tool, 1e-6
    data, mechanism = model.createData(), at.mechanism
    force = np.array([x["fx"], x["fy"], x["fz"]])
    stiffness = np.array([[x.get("k" + "".join(sorted(a + b)), 0.0) for a in "xyz"] for b in "xyz"])

    def energy(q):
        pinocchio.forwardKinematics(model, data, q)
        p = data.oMi[tool.joint].act(tool.placement[:3, 3])
        return -force @ p + 0.5 * (p - home) @ stiffness @ (p - home)

    pinocchio.forwardKinematics(model, data, mechanism.home_configuration())
    home = data.oMi[tool.joint].act(tool.placement[:3, 3])
    out = np.empty((len(at), len(at.driven)))
    for row, q in enumerate(at.trajectory.q):
        for column, dof in enumerate(at.trajectory.dofs):
            way = step * np.eye(model.nv)[dof]
            ends = [energy(pinocchio.integrate(model, q, sign * way)) for sign in (1, -1)]
            out[row, column] = (ends[0] - ends[1]) / (2 * step)
    return out


def form_of(law):
    """Return the form of a law, or of the one that it derives from."""
    return next(CLOSED_FORMS[cls] for cls in type(law).__mro__ if cls in CLOSED_FORMS)


class Joint:
    """A joint's motion: q, v, a (N,), t (N,) and its sign of motion, NaN beside where it turns round."""

    def __init__(self, at, name):
        column = at.motion.names.index(name)
        self.q, self.v, self.a = (x[:, column] for x in (at.motion.position, at.motion.speed, at.motion.acceleration))
        self.t, self.temperature = at.motion.time, at.motion.temperature
        self.sign = signs(self.v)


def signs(v):
    sign = np.sign(v)
    turns = np.flatnonzero(np.diff(sign))
    sign[np.unique(np.clip([turns - 1, turns, turns + 1, turns + 2], 0, len(v) - 1))] = np.nan
    return sign


def of_joint(at, name, effort):
    """Return an effort (N,) of one drive as efforts of all (N, k)."""
    return np.where(np.array(at.driven) == name, effort[:, None], 0.0)


def own(form):
    """Return the form of a law of one joint, from its effort (N,) by the joint's motion and the law's values."""

    def of(law, place, values, at):
        return of_joint(at, place.name, form(Joint(at, place.name), values))

    return of


def efforts_of(at, model=None, moved=(0.0, 0.0, 0.0), column=0):
    """Return a rigid robot's efforts (N, k), with one joint moved by (N,) of position, speed and acceleration."""
    model = at.mechanism.model if model is None else model
    data, out = model.createData(), []
    tables = [x.copy() for x in (at.motion.position, at.motion.speed, at.motion.acceleration)]
    for table, by in zip(tables, moved, strict=True):
        table[:, column] += by
    order = [model.joints[at.mechanism.joint_id(name)].idx_v for name in at.motion.names]
    for row in range(len(at)):
        state = [np.zeros(model.nv) for _ in range(3)]
        for vector, table in zip(state, tables, strict=True):
            vector[order] = table[row]
        out.append(pinocchio.rnea(model, data, *state)[[order[at.motion.names.index(name)] for name in at.driven]])
    return np.array(out)


def of_body(change):
    """Return the form of a law that changes inertias: `change(model, place, values, at)` does."""

    def of(law, place, values, at):
        model = at.mechanism.model.copy()
        change(model, place, values, at)
        return efforts_of(at, model) - efforts_of(at)

    return of


def _held(model, place, values, at):
    tool = at.mechanism.need_tool()
    mass = values["mass"]
    numbers = [mass, *(mass * values[axis] for axis in "xyz"), *(values[name] for name in INERTIAL[4:])]
    held = pinocchio.Inertia.FromDynamicParameters(np.array(numbers))
    model.inertias[tool.joint] = model.inertias[tool.joint] + pinocchio.SE3(tool.placement).act(held)


def _another(model, place, values, at):
    joint = at.mechanism.frame(place.name).joint
    change = np.array([values[name] for name in INERTIAL])
    drawn = model.inertias[joint].toDynamicParameters()
    model.inertias[joint] = pinocchio.Inertia.FromDynamicParameters(drawn + change)


def _scaled(model, place, values, at):
    joint = at.mechanism.frame(place.name).joint
    drawn = model.inertias[joint].toDynamicParameters()
    model.inertias[joint] = pinocchio.Inertia.FromDynamicParameters((1 + values["share"]) * drawn)


def _hung(model, place, values, at):
    model.gravity.linear = model.gravity.linear + np.array([values[name] for name in ("gx", "gy", "gz")])


def _slope(at, column, rates, step=1e-6):
    ends = [efforts_of(at, None, [way * step * rate for rate in rates], column) for way in (1, -1)]
    return (ends[0] - ends[1]) / (2 * step)


def _offset(law, place, values, at):
    one, zero = np.ones(len(at)), np.zeros(len(at))
    return values["offset"] * _slope(at, at.motion.names.index(place.name), (one, zero, zero))


def _late_encoder(law, place, values, at):
    joint = Joint(at, place.name)
    jerk = np.gradient(joint.a, joint.t, edge_order=2)
    out = values["delay"] * _slope(at, at.motion.names.index(place.name), (joint.v, joint.a, jerk))
    out[[0, -1]] = np.nan  # where rates have one side
    return out


def _yielding(law, place, values, at):
    """Return it to first order: links behind the motor by the compliance times what they ask of the gear."""
    column = at.motion.names.index(place.name)
    rates = [-efforts_of(at)[:, at.driven.index(place.name)]]
    rates += [np.gradient(rates[0], at.motion.time)]
    rates += [np.gradient(rates[1], at.motion.time)]
    out = values["compliance"] * _slope(at, column, rates, 1e-8)
    out[[*range(4), *range(-4, 0)]] = np.nan  # where rates have one side, once or twice
    return out


def later(sign, of):
    """Return the form of signals of one sample ago (+1) or ahead (-1): `of(place, at)` (N, k)."""

    def form(law, place, values, at):
        samples = round(values["delay"] * at.motion.rate)
        signal = of(place, at)
        out = np.roll(signal, sign * samples, axis=0) - signal
        out[slice(0, samples) if sign > 0 else slice(-samples, None)] = np.nan
        return out

    return form


def _by_another_clock(law, place, x, at):
    time, signal = at.motion.time, every(place, at)
    share = np.arange(len(time)) / (at.motion.rate * x["lasting"])
    ago = time - (1 - share) * x["early"] - share * x["late"]
    out = CubicSpline(time, signal)(ago) - signal
    out[(ago < time[0]) | (ago > time[-1])] = np.nan
    return out


def filtered(of):
    """Return the form of signals behind a low-pass filter, by many small steps: `of(place, at)` (N, k)."""

    def form(law, place, values, at):
        signal, time, finer = of(place, at), at.motion.time, 400
        fine = np.linspace(time[0], time[-1], finer * (len(time) - 1) + 1)
        entering, answer = CubicSpline(time, signal)(fine), np.empty((len(fine), signal.shape[1]))
        answer[0] = signal[0]
        kept = np.exp(-(fine[1] - fine[0]) / values["time_constant"])
        for row in range(1, len(fine)):
            answer[row] = kept * answer[row - 1] + (1 - kept) * (entering[row] + entering[row - 1]) / 2
        return answer[::finer] - signal

    return form


def every(place, at):
    return at.rigid


def single(place, at):
    return of_joint(at, place.name, at.rigid[:, at.driven.index(place.name)])


def _lost(law, place, values, at):
    """Return the load that is lost while the motor turns alone: it stands between the flanks that drag the links."""
    joint, half = Joint(at, place.name), values["gap"] / 2
    links = joint.q[0] - half * np.sign(joint.q[1] - joint.q[0])
    alone = np.zeros(len(at))
    for row, q in enumerate(joint.q):
        links = np.clip(links, q - half, q + half)
        alone[row] = abs(q - links) < half * (1 - 1e-9)
    return -values["share"] * alone[:, None] * single(place, at)


def _coupled(law, place, values, at):
    one, other, r = Joint(at, place.name), Joint(at, law.same_places(place, at.mechanism)[0]), values["ratio"]
    v, a = one.v + r * other.v, one.a + r * other.a
    dry = signs(v) * np.tanh(np.abs(v) / values["smoothing"])
    motor = values["limit"] * dry + values["damping"] * v + values["inertia"] * a
    return of_joint(at, place.name, motor) + of_joint(at, law.same_places(place, at.mechanism)[0], r * motor)


def _felt(law, place, values, at):
    other = Joint(at, law.other(place))
    told = values["limit"] * other.sign + values["damping"] * other.v + values["inertia"] * other.a
    return of_joint(at, place.name, told)


def _felt_position(law, place, values, at):
    return of_joint(at, place.name, values["stiffness"] * Joint(at, law.other(place)).q + values["preload"])


def _spring_across(law, place, values, at):
    one, other, r = Joint(at, place.name), Joint(at, law.other(place)), values["ratio"]
    pull = values["stiffness"] * (one.q + r * other.q) + values["preload"]
    return of_joint(at, place.name, pull) + of_joint(at, law.other(place), r * pull)


def _loaded(law, place, values, at):
    load = np.abs(at.rigid[:, at.driven.index(place.name)])
    return of_joint(at, place.name, (values["limit"] + values["share_of_load"] * load) * Joint(at, place.name).sign)


def _wave(j, x):
    return x["cosine"] * np.cos(2 * np.pi * j.q / x["period"]) + x["sine"] * np.sin(2 * np.pi * j.q / x["period"])


CLOSED_FORMS: dict[type, Form] = {
    Damping: Form(own(lambda j, x: x["damping"] * j.v)),
    DirectedViscousFriction: Form(
        own(lambda j, x: np.where(j.v > 0, x["damping_forwards"], x["damping_backwards"]) * j.v)
    ),
    SlidingFriction: Form(
        own(lambda j, x: x["limit"] * j.sign * np.tanh(np.abs(j.v) / x["smoothing"])), values={"smoothing": 0.3}
    ),
    LoadedFriction: Form(_loaded),
    ColdDamping: Form(own(lambda j, x: (x["damping"] + x["cold"] * np.exp(-(j.t - x["start"]) / x["time"])) * j.v)),
    ColdFriction: Form(own(lambda j, x: (x["limit"] + x["cold"] * np.exp(-(j.t - x["start"]) / x["time"])) * j.sign)),
    ThinnedDamping: Form(own(lambda j, x: (x["damping"] + x["cold"] * _thinned(j, x)) * j.v)),
    ThinnedFriction: Form(own(lambda j, x: (x["limit"] + x["cold"] * _thinned(j, x)) * j.sign)),
    DriftingZero: Form(own(lambda j, x: x["cold"] * np.exp(-(j.t - x["start"]) / x["time"]))),
    DriftingByTemperature: Form(own(lambda j, x: x["cold"] * _thinned(j, x))),
    StribeckFriction: Form(
        own(
            lambda j, x: (
                (x["limit"] + x["extra"] * np.exp(-((j.v / x["speed"]) ** 2)))
                * j.sign
                * np.tanh(np.abs(j.v) / x["smoothing"])
            )
        ),
        values={"speed": 0.5, "smoothing": 0.3},
    ),
    RotorInertia: Form(own(lambda j, x: x["inertia"] * j.a)),
    YieldingGear: Form(_yielding, 5e-3, {"compliance": 1e-6}),
    TransmissionCoupling: Form(_coupled, values={"ratio": 0.7, "smoothing": 0.3}),
    FeltMotion: Form(_felt),
    FeltPosition: Form(_felt_position),
    SpringAcross: Form(_spring_across, values={"ratio": 0.7}),
    HeldBody: Form(of_body(_held)),
    HeldMeanwhile: Form(_held_meanwhile, values={"moment": 1.0, "until": 2.5}),
    EvenPull: Form(_pulled, 1e-6),
    ElasticPull: Form(_pulled, 1e-6),
    ScaledInertia: Form(of_body(_scaled)),
    InertialParameters: Form(of_body(_another)),
    Counterbalance: Form(own(lambda j, x: x["cosine"] * np.cos(j.q) + x["sine"] * np.sin(j.q))),
    CounterbalanceSpring: Form(own(lambda j, x: x["stiffness"] * j.q + x["preload"])),
    CounterbalanceHardening: Form(
        own(
            lambda j, x: (
                x["preload"]
                + (j.q - x["middle"])
                * (x["stiffness"] + (j.q - x["middle"]) * (x["change"] + (j.q - x["middle"]) * x["hardening"]))
            )
        ),
        values={"middle": 0.2},
    ),
    CounterbalanceStrut: Form(own(_strut), values={"dead_centre": -2.0, "slenderness": 0.8}),
    Mounting: Form(of_body(_hung)),
    EffortOffset: Form(own(lambda j, x: np.full(len(j.q), x["offset"]))),
    CrossTalk: Form(
        lambda law, place, x, at: of_joint(
            at, place.name, x["share"] * efforts_of(at)[:, at.driven.index(law.other(place))]
        )
    ),
    EffortGain: Form(lambda law, place, x, at: x["gain"] * single(place, at)),
    GainByTemperature: Form(_warm_gain),
    EffortUnit: Form(lambda law, place, x, at: x["gain"] * single(place, at)),
    EffortDelay: Form(later(1, single), values={"delay": 0.04}),
    AnotherClock: Form(_by_another_clock, 1e-3, {"early": 0.04, "late": 0.02}),
    EffortsDelay: Form(later(1, every), values={"delay": 0.04}),
    OffsetEncoder: Form(_offset, 1e-5),
    DelayedEncoder: Form(_late_encoder, 5e-3, {"delay": 0.02}),
    DelayedEncoders: Form(later(-1, every), values={"delay": 0.04}),
    EffortFilter: Form(filtered(single), 1e-4, {"time_constant": 0.05}),
    EffortsFilter: Form(filtered(every), 1e-4, {"time_constant": 0.05}),
    Cogging: Form(own(_wave), values={"period": 0.3}),
    CoggingOfFewPeriods: Form(own(_wave), values={"period": 1.5}),
    LostLoad: Form(_lost, values={"gap": 0.3}),
}
