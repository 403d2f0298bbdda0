"""Efforts in units of their own: motor currents, per cent of a rating, torque constants that were never measured.

What a drive reports is g tau, tau = Y b + friction, with a gain g of its own at every joint and inertial parameters b
that all joints share. That is bilinear in g and b, and solved under priors: b about the robot file's, ln g about that
of all joints. All gains k times as large and all masses k times smaller are the same efforts: which of them it is, only
the robot file's masses decide (Gautier and Venture 2013).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space, qr
from scipy.optimize import minimize, minimize_scalar

from ...dynamics import InMotion
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...laws.efforts.effort_law import motor_pairs, usual_way
from ...spatial import Array
from ..criteria import (
    AS_GOOD,
    EFFORT_GAINS,
    FAR_LESS,
    FEWEST_NUMBERS,
    FEWEST_OF_KIND,
    FOLDS,
    LITTLE,
    MUCH,
    NEARLY,
    NOTHING,
    ROUNDING,
    SURE,
    UNSEEN,
    WIDEST_LOGARITHM,
    WIDEST_STEP,
)
from .joint_equations import BodyPrior, JointEquations
from .problem import column_blocks, kept_samples

#: Samples that are looked at.
_SAMPLES = 6000
#: Columns of an offset and plain friction, which come first of what is no body's.
_FRICTION = 3


@dataclass(frozen=True, eq=False)
class Gains:
    """Reported per true effort, of each driven joint (k,).

    `common`: the standard deviation of the logarithm of all of them together, which the masses of the robot file
    decide; covariance (k, k): of their logarithms, as far as the efforts tell them; alike: whether the whole robot
    would weigh next to nothing in newtons, so that drives may count alike in another unit; equations, drawn (r,): of
    the bodies' combinations that are told, in multiples of their spreads.
    """

    gains: Array
    common: float
    covariance: Array
    equations: JointEquations
    drawn: Array
    alike: bool = False

    @property
    def deviations(self) -> Array:
        """The standard deviation of the logarithm of each (k,) beside that of all together."""
        return np.sqrt(np.maximum(np.diag(_beside_common(self.covariance)), 0.0))

    def by_masses(self, gains: Array) -> Gains:
        """Return gains (k,) so many times as large, all alike, that the robot file's masses are the likeliest beside
        them, whatever the tool holds. Bodies of no mass at all are as far from the drawing as they can be, and beside
        these gains would be without end: they are as many times as large as before, or much.
        """

        def cost(log: float) -> float:
            own = np.exp(log) * gains
            x, _ = self.equations.likeliest(self.drawn, 1.0, own)
            return float(self.equations.left(x, own).sum() + ((x - self.drawn) ** 2).sum())

        found = minimize_scalar(cost, bounds=(-np.log(MUCH), np.log(MUCH)), method="bounded")
        return replace(self, gains=float(np.exp(found.x)) * gains)

    @property
    def masses(self) -> float:
        """How many times as heavy as drawn the robot's bodies are by these gains."""
        x, _ = self.equations.likeliest(self.drawn, 1.0, self.gains)
        return float(x @ self.drawn) / float(self.drawn @ self.drawn)


def precision_of_gains(of_each: float, of_all: float, count: int) -> Array:
    """Return the inverse covariance (k, k) of so many gains that scatter by `of_each` beside what they have in common.

    of_all: the standard deviation of that.
    """
    return np.asarray(np.linalg.inv(of_each**2 * (np.eye(count) - 1 / count) + of_all**2), float)


def scatter_of_gains(normal: Array, moment: Array, of_all: float, middle: Array) -> float:
    """Return the standard deviation of the logarithms of gains beside what they have in common that is likeliest.

    normal (k, k), moment (k,), middle (k,) as in `likeliest_logs`. Most robots have drives of one kind or two: what a
    hardly moving one reports in is told by the others.
    """

    def unlikely(log: float) -> float:
        prior = precision_of_gains(float(np.exp(log)), of_all, len(middle))
        found, covariance = likeliest_logs(normal, moment, prior, middle)
        change, apart = np.expm1(found), found - middle
        cost = float(change @ (normal @ change - 2 * moment) + apart @ prior @ apart)
        return cost - float(np.linalg.slogdet(prior)[1] + np.linalg.slogdet(covariance)[1])

    # held to scatter by far too little, gains would be likeliest at nothing: the first least value may be that
    tried = np.linspace(np.log(UNSEEN), np.log(EFFORT_GAINS), int(MUCH))
    best = int(np.argmin([unlikely(log) for log in tried]))
    bounds = float(tried[max(best - 1, 0)]), float(tried[min(best + 1, len(tried) - 1)])
    return float(np.exp(minimize_scalar(unlikely, bounds=bounds, method="bounded").x))


def scale_of(gains: Gains | None, count: int) -> Array:
    """Return what is reported per true effort of each of so many driven joints: one where no gains were found."""
    return np.ones(count) if gains is None else gains.gains


def law_of_gains() -> EffortLaw:
    """Return the law of a drive that reports in a unit of its own, which no other law competes with."""
    return next(law for law in EFFORT_LAWS if law.of_gain and not law.competes)


def in_any_unit(tolerances: Mapping[str, float]) -> bool:
    """Return whether drives are declared to report in units of their own, whatever these are."""
    return tolerances.get(law_of_gains().physics, 0.0) > AS_GOOD - 1


def in_newtons(at: InMotion, gains: Array) -> InMotion:
    """Return a motion whose efforts are divided by gains (k,)."""
    return at.measuring(at.motion.efforts / gains)


def gains_of(at: InMotion, tolerances: Mapping[str, float]) -> Gains | None:
    """Return the gains of the drives' efforts, where several are surely others; None where they are as told.

    Declared to be in any unit, they are whatever the efforts are beside the robot file's masses, be it of one drive: of
    that alone free bodies would leave as little, many times as heavy.
    """
    declared = in_any_unit(tolerances)
    if at.motion.standing or len(at.driven) < (1 if declared else 2) or not at.rigid.any():
        return None
    prior = BodyPrior.of(at.mechanism, tolerances)
    if (told := _blocks(at, prior, declared)) is None:
        return None
    basis, drawn = _identified(JointEquations.total(told[0]), prior.drawn)
    blocks, size = [block.among(basis) for block in told[0]], told[1]
    whole = JointEquations.total(blocks)
    start = _first_gains(whole, drawn)
    if start is None:
        return None
    alike, before, after = np.ones(len(start)), [], []  # held out, where all are as told and where each is its own
    for held_out in blocks:
        others = JointEquations.total([block for block in blocks if block is not held_out])
        before.append(float(held_out.left(others.likeliest(drawn, MUCH, alike)[0]).sum()))
        own, log, _ = _solved(others, drawn, MUCH, start)
        after.append(float(held_out.left(own, np.exp(log)).sum()))
    saving = np.array(before) - np.array(after)
    sure = saving.sum() / max(float(np.std(saving, ddof=1)) * np.sqrt(len(saving)), np.finfo(float).tiny)
    if np.sum(after) > MUCH * size and not declared:
        return None
    found, log, covariance = _solved(whole, drawn, 1.0, start)
    much = saving.sum() > FAR_LESS * np.sum(before)
    # drives count otherwise, be it all alike, where only masses of the whole robot that no drawing is so far from
    # would do without; of two drives a load may be so much as well
    light, right = (float(x @ drawn) / float(drawn @ drawn) for x in (whole.likeliest(drawn, 1.0, alike)[0], found))
    unlikely = not 1 / AS_GOOD < light < AS_GOOD and 1 / AS_GOOD < right < AS_GOOD and len(log) >= FEWEST_OF_KIND
    apart = are_apart(log, covariance)
    other = abs(np.median(log)) > np.log(AS_GOOD) and _several(log, covariance)
    unit = unlikely and other and not apart
    if not (declared or (apart and sure > SURE and (much or (unlikely and other))) or unit):
        return None
    common = float(np.sqrt(covariance.mean()))
    return Gains(np.exp(log), common, covariance, whole, drawn, unit)


def likeliest_logs(normal: Array, moment: Array, prior: Array, middle: Array) -> tuple[Array, Array]:
    """Return the likeliest logarithms (k,) of what gains are to be multiplied by, and their covariance (k, k).

    normal (k, k), moment (k,): the normal equations, by data alone, of these factors less one; the logarithms scatter
    about their middle (k,) by the inverse covariance `prior` (k, k). So no factor comes below 0.
    """

    def cost(log: Array) -> tuple[float, Array]:
        if np.abs(log).max(initial=0.0) > WIDEST_LOGARITHM:
            return np.inf, 0 * log  # no number any more: the step is shortened
        change, apart = np.expm1(log), log - middle
        pull = normal @ change - moment
        return float(change @ (pull - moment) + apart @ prior @ apart), 2 * (np.exp(log) * pull + prior @ apart)

    def curvature(log: Array) -> Array:  # Gauss and Newton's, half of which is the inverse covariance
        factor = np.exp(log)
        return 2 * (factor[:, None] * normal * factor + prior)

    options = {"max_trust_radius": WIDEST_STEP, "gtol": NOTHING * float(np.sqrt(np.trace(normal + prior)))}
    log = minimize(cost, np.zeros(len(moment)), jac=True, hess=curvature, method="trust-exact", options=options).x
    return log, np.asarray(np.linalg.inv(curvature(log) / 2), float)


def are_apart(log: Array, covariance: Array) -> bool:
    """Return whether two gains at least are surely and markedly others than most; log (k,): of each, covariance (k, k).

    Whatever all of them are together.
    """
    return _several(log - np.median(log), _beside_common(covariance))


def _beside_common(covariance: Array) -> Array:
    """Return the covariance (k, k) of what logarithms of gains are beside what all have in common."""
    apart = covariance - covariance.mean(axis=0)
    return np.asarray(apart - apart.mean(axis=1, keepdims=True), float)


def _several(log: Array, covariance: Array) -> bool:
    """Return whether at least two gains are surely and markedly others; log (k,): of each."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return int((np.abs(log) > np.maximum(np.log(NEARLY), SURE * deviation)).sum()) > 1


def _identified(equations: JointEquations, drawn: Array) -> tuple[Array, Array]:
    """Return the combinations of bodies' columns that efforts tell (p, r), and these as drawn (r,): the first alone.

    All others stay as drawn whatever is measured.
    """
    sizes, basis = np.linalg.eigh(equations.weighted(np.ones(len(equations.power))))
    basis = basis[:, sizes > ROUNDING * sizes[-1]]
    turn, along = qr((basis.T @ drawn)[:, None])
    return basis @ turn, along[:, 0]


def _blocks(at: InMotion, prior: BodyPrior, declared: bool) -> tuple[Sequence[JointEquations], float] | None:
    """Return the equations of bodies by block of time, freed of each joint's friction, offset and counterbalance, and
    the squares that this is in all; in multiples of what nothing takes away there.

    declared: to be in any unit, which a short motion of one drive is to tell as well.
    """
    motion = at.motion
    rows = kept_samples(at)
    rows = rows[:: max(1, len(rows) // _SAMPLES)]
    if len(rows) < FEWEST_NUMBERS:
        return None
    measured = motion.band(motion.efforts, motion.piece)[rows]
    if not np.isfinite(measured).all():
        return None
    blocks = column_blocks(rows, FOLDS)
    folds = int(blocks.max()) + 1
    if folds < FOLDS and not declared:
        return None
    whole, total = prior.columns(at.regressor), 0.0
    # the robot may stand out of level: gravity pulls across, too
    across = null_space(at.mechanism.gravity[None]).T if at.mechanism.gravity.any() else ()
    pulls = [at.rigid_under(axis) for axis in across]
    values = np.zeros((*measured.shape, 1 + whole.shape[2]))
    for joint, name in enumerate(at.driven):
        low_pass = motion.band.of_joint(joint)
        good = low_pass.settled(motion.piece)[rows]
        if name in motion.names:
            good &= ~motion.still[rows, motion.names.index(name)]
        if good.sum() < FEWEST_NUMBERS:
            return None
        own, borne, bodies = (
            low_pass(each, motion.piece)[rows][good]
            for each in (
                _nuisance_columns(at, name, [pull[:, joint] for pull in pulls]),
                at.rigid[:, joint],
                whole[:, joint],
            )
        )
        if declared and np.linalg.norm(_beside(own, borne)) < LITTLE * np.linalg.norm(borne):
            own = own[:, :_FRICTION]  # of one drive a counterbalance and a rotor are all that its body asks for
        freed = _beside(own, np.column_stack((measured[good, joint], bodies)))
        left = _beside(freed[:, 1:], freed[:, 0], 1e-7)
        sigma2 = float(left @ left) / good.sum()
        if not sigma2 > 0:
            return None
        # neighbours are alike: as many count as would be independent
        alike = float(np.clip(left[1:] @ left[:-1] / (left @ left), 0.0, 0.99))
        total += good.sum() * (1 - alike) / (1 + alike)
        values[good, joint] = freed * np.sqrt((1 - alike) / (1 + alike) / sigma2)
    parts = [values[blocks == block] for block in range(folds)]
    return [JointEquations.of(part[..., 1:], part[..., 0]) for part in parts], total


def _beside(columns: Array, values: Array, rcond: float = 1e-9) -> Array:
    """Return what columns (n, m) leave of values (n, ...)."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=rcond)[0])


def _nuisance_columns(at: InMotion, joint: str, pulls: Sequence[Array]) -> Array:
    """Return what a joint's effort may hold beside bodies (N, m): first an offset and friction, then a rotor, a
    counterbalance, `pulls` (N,) of weight another way, and neighbours.
    """
    ones = np.ones(len(at))
    if joint not in at.motion.names:
        return ones[:, None]
    position, speed = at.position(joint), at.speed(joint)
    turning = at.dragged(joint, usual_way(at, joint))
    size = max(float(np.sqrt(np.mean(speed**2))), np.finfo(float).tiny)
    carried = turning * np.abs(at.rigid[:, at.driven.index(joint)])
    slowly = turning * np.exp(-((speed / (0.25 * size)) ** 2))
    # friction by direction and by load, too
    own = [ones, turning, speed, np.abs(speed), carried, at.acceleration(joint), slowly, position]
    if at.mechanism.joint(joint).turns:
        own += [np.cos(position), np.sin(position)]
    own += pulls
    for other in _coupled(at, joint):
        travels = [at.travel({joint: 1.0, other: sign}) for sign in (1.0, -1.0)]
        both = [travel.direction(usual_way(at, joint)) for travel in travels]
        own += [at.speed(other), at.acceleration(other), *both]
    table = np.column_stack(own)
    return table / np.maximum(np.sqrt((table**2).mean(axis=0)), np.finfo(float).tiny)


def _coupled(at: InMotion, joint: str) -> list[str]:
    """Return the joints whose motors a joint may feel."""
    seen = {name for name in at.driven if at.moves(name)}
    return [other for name, other in motor_pairs(at.mechanism) if name == joint and {name, other} <= seen]


def _first_gains(equations: JointEquations, drawn: Array) -> Array | None:
    """Return logarithms of gains (k,) by the robot file's masses; the others' middle where that tells nothing."""
    size, along = equations.borne(drawn), equations.moment @ drawn
    follows = (size > 0) & (along > 0.5 * np.sqrt(np.maximum(size * equations.power, 0.0)))
    if not follows.any():
        return None
    log = np.log(np.where(follows, along, 1.0) / np.where(follows, size, 1.0))
    return np.where(follows, log, np.median(log[follows]))


def _solved(equations: JointEquations, drawn: Array, width: float, start: Array) -> tuple[Array, Array, Array]:
    """Return the likeliest inertial parameters (r,), logarithms of gains (k,) and the covariance (k, k) of these, under
    the priors of both, gains about the middle of `start` (k,).

    All parameters k times as large are gains k times as large: one scale, which is solved for last. Else bodies that
    weigh next to nothing, all as far from the drawing as heavy ones may be, would be anything. Of given gains the
    combinations of parameters but the first, which as drawn are nothing, are a linear problem, so that only gains are
    looked for.
    """
    level, count = float(np.median(start)), len(start)
    scale = width**2 / float(drawn @ drawn)  # variance of its logarithm
    prior = np.linalg.inv(EFFORT_GAINS**2 * np.eye(count) + scale)

    def inertial(gain: Array) -> tuple[Array, Array]:
        x, normal = equations.less(drawn, gain).without(1).likeliest(0 * drawn[1:], width, gain)
        return np.append(drawn[0], x), normal

    def cost(apart: Array) -> tuple[float, Array]:
        gain = np.exp(level + apart)
        try:
            x, _ = inertial(gain)
        except np.linalg.LinAlgError:  # of gains so far apart that nothing of the bodies is left beside the largest
            return np.inf, np.zeros(count)
        bears, along = gain**2 * equations.borne(x), gain * (equations.moment @ x)
        data = float((bears - 2 * along).sum())
        likely = float(((x - drawn) ** 2).sum()) / width**2 + float(apart @ prior @ apart)
        return data + likely, 2 * (bears - along) + 2 * prior @ apart

    options = {"ftol": 1e-13, "gtol": 1e-6, "maxiter": 500}
    with np.errstate(over="ignore", invalid="ignore"):  # of a step that is too long, and shortened then
        apart = minimize(cost, start - level, jac=True, method="L-BFGS-B", options=options).x
    gain = np.exp(level + apart)
    x, normal = inertial(gain)
    cross = gain**2 * (equations.gram @ x)[:, 1:].T
    own = np.linalg.inv(np.diag(gain**2 * equations.borne(x)) + prior - cross.T @ np.linalg.solve(normal, cross))
    to_masses = scale * prior.sum(axis=0)  # what masses take of all gains together
    kept = np.eye(count) - to_masses
    covariance = kept @ own @ kept.T + scale * (1 - float(to_masses.sum()))
    return np.exp(to_masses @ apart) * x, level + kept @ apart, covariance
