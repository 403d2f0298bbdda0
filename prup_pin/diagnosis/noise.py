"""How large is the noise, and is what is left nothing else?

Before anything is fitted, by repeats of a load, where a recording does not declare it; of what a fit leaves, by tests
whether it follows time, pose or any module's load.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from ..channels import Linear, Noise, PoseChannel, Stack
from ..laws import Inputs
from ..recordings import Recording
from ..spatial import Array, turn_between
from .chances import chi2_sf, normal_cdf, normal_pdf, normal_sf, robust_deviation
from .criteria import (
    BLOCKS,
    FEWEST_IN_BLOCK,
    FEWEST_NUMBERS,
    GAIN,
    INDISTINCT,
    LITTLE,
    ROUNDING,
    STRUCTURE_CHANCE,
    SURE,
    USUAL_POSITION_NOISE,
    USUAL_ROTATION_NOISE,
    chance_bound,
)
from .locate import curves_of_modules
from .problem import Fit, Problem

# -- what the sensors scatter by ---------------------------------------------------------------------------------------


#: What is left of the variance of normal numbers without the outliers.
_CLIPPED = 1 - 2 * SURE * normal_pdf(SURE) / (2 * normal_cdf(SURE) - 1)


def estimate_noise(recording: Recording, stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray) -> Noise:
    """Return the declared noise, and that which repeats show where the recording declares none.

    here (N,): which samples of the stack are the recording's. What was not measured needs no declaration. Where nothing
    is declared and nothing repeats it is that of a good sensor, and its source "assumed".
    """
    declared = recording.noise
    position, rotation = declared.position, declared.rotation
    given = {"m": position, "rad": rotation}
    measured = {unit for _, unit, where in stack.groups() if stack.exists[here][:, where].any()}
    estimated = any(given[unit] is None for unit in measured) if measured else None in given.values()
    source = "estimated" if estimated else "declared"
    if position is None or rotation is None:
        seen = scatter_of_repeats(stack, linear, inputs, here)
        repeated = {"m": seen[0], "rad": seen[1]}
        if measured and all(given[unit] is None and repeated[unit] is None for unit in measured):
            source = "assumed"
        position = position if position is not None else seen[0] or USUAL_POSITION_NOISE
        rotation = rotation if rotation is not None else seen[1] or USUAL_ROTATION_NOISE
    assert position is not None
    assert rotation is not None
    force = declared.force if declared.force is not None else 0.0
    moment = declared.moment if declared.moment is not None else 0.0
    return Noise(position, rotation, force, moment, source)


def scatter_of_repeats(
    stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray
) -> tuple[float | None, float | None]:
    """Return the noise of position [m] and rotation [rad] by samples of one block under the same wrench.

    here (N,): the samples that are looked at. Their difference, less what the small difference of their wrenches
    explains, is noise times sqrt(2). None where too few repeat. Tool and markers are seen by one sensor.
    """
    first, second = repeats(inputs, here)
    wrench = inputs.wrench
    moved: list[Array] = []
    turned: list[Array] = []
    for measured in stack.channels:
        both = measured.exists[first] & measured.exists[second]
        if not isinstance(measured, PoseChannel) or not both.any():
            continue
        apart = turn_between(measured.rotation[second], measured.rotation[first])
        change = np.concatenate((measured.position[first] - measured.position[second], apart), axis=1)
        compliance = np.nan_to_num(linear.compliance(measured.frame))
        change -= (compliance[first] @ (wrench[first] - wrench[second])[..., None])[..., 0]
        moved.append(change[:, :3][both[:, :3]])
        turned.append(change[:, 3:][both[:, 3:]])
    return _scatter(np.concatenate([np.zeros(0), *moved])), _scatter(np.concatenate([np.zeros(0), *turned]))


def _scatter(values: Array) -> float | None:
    """Return the standard deviation of either of two numbers with these differences, outliers left out."""
    if len(values) < FEWEST_NUMBERS:
        return None
    robust = robust_deviation(values)
    for _ in range(5):  # a mean of squares without outliers says more than the median
        inside = np.abs(values) <= SURE * robust
        robust = float(np.sqrt((values[inside] ** 2).mean() / _CLIPPED)) if inside.any() else robust
    return robust / np.sqrt(2) if robust > 0 else None


def repeats(inputs: Inputs, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of samples of one block under wrenches that are one load, but for GAIN of the largest.

    And under one gravity: a base that is tilted is no repeat.
    """
    wrench, blocks = inputs.wrench[here], inputs.blocks
    size = np.abs(wrench[:, :3]).max(initial=0.0), np.abs(wrench[:, 3:]).max(initial=0.0)
    scale = np.array(3 * [max(size[0], 1e-9)] + 3 * [max(size[1], 1e-9)])
    first, second = [], []
    loads = inputs.wrench / scale
    if inputs.gravity is not None:
        heaviest = max(float(np.nan_to_num(np.abs(inputs.gravity)).max(initial=0.0)), 1e-9)
        loads = np.concatenate((loads, inputs.gravity / heaviest), axis=1)
    for block in np.unique(blocks[here]):
        members = np.flatnonzero((blocks == block) & here)
        free = np.ones(len(members), bool)
        for place, member in enumerate(members):
            near = (np.abs(loads[members[place + 1 :]] - loads[member]).max(axis=1) < GAIN) & free[place + 1 :]
            if free[place] and near.any():
                other = place + 1 + int(np.argmax(near))
                first.append(member)
                second.append(members[other])
                free[other] = False
    return np.array(first, int), np.array(second, int)


# -- is what is left noise? --------------------------------------------------------------------------------------------


def is_white(problem: Problem, fit: Fit, blocks: np.ndarray) -> bool:
    """Return True where a whitened residual follows neither time, nor temperature, nor pose, nor any load.

    blocks (n,): labels of the fit's samples between two moves of the actuators.
    """
    channels = [column for column in fit.residual.T if np.any(column)]
    if not channels:
        return True
    actuators = problem.simulator.inputs.actuators[fit.samples]
    neighbours = _neighbours(actuators, blocks)
    slopes = list(_slopes_of_each(problem, fit, actuators))
    together = blocks[1:] == blocks[:-1]
    tests: list[float] = []
    for column in channels:
        if together.any():
            tests.append(_chance_of_products((column[1:] * column[:-1])[together]))
        names, means = _means(column, blocks)
        if len(names) > 1:
            tests.append(chi2_sf((means**2).sum(), len(names)))
        if len(neighbours):
            tests.append(_chance_of_products(means[neighbours[:, 0]] * means[neighbours[:, 1]]))
        tests += [chi2_sf(((each.T @ column) ** 2).sum(), each.shape[1]) for each in slopes if each.shape[1]]
    tests += [chi2_sf(curve.gain, curve.degrees) for curve in curves_of_modules(problem, fit)]
    return bool(tests) and min(tests) * len(tests) > STRUCTURE_CHANCE


def _slopes_of_each(problem: Problem, fit: Fit, actuators: Array) -> Iterator[Array]:
    """Yield orthonormal columns (n, k) over each recording's samples: what is off in one of them is no noise of all.

    By position, and by loads, time and temperature, which do at each position something else: so does whatever yields,
    wanders or grows.
    """
    inputs = problem.simulator.inputs
    sources = np.zeros(len(actuators), int) if inputs.sources is None else inputs.sources[fit.samples]
    recorded = [inputs.wrench, inputs.elapsed[:, None], inputs.warming[:, None]]
    for place in np.unique(sources):
        here = sources == place
        by_position, others = _slopes(actuators[here]), []
        for column, values in enumerate(each[fit.samples][here] for each in recorded):
            alone = _orthonormal(values - values.mean(axis=0) if column else values)
            of_both = _orthonormal((alone[:, :, None] * by_position[:, None]).reshape(len(alone), -1))
            others += [alone, of_both]
        # few samples follow whatever has as many columns
        for own in (by_position, *(each for each in others if 2 * each.shape[1] <= len(each))):
            slopes = np.zeros((len(here), own.shape[1]))
            slopes[here] = own
            yield slopes


def could_show_structure(blocks: np.ndarray) -> bool:
    """Return True where samples are enough, in one pose or in many, for `is_white` to mean something."""
    followers = int((blocks[1:] == blocks[:-1]).sum())
    return followers >= FEWEST_IN_BLOCK or len(np.unique(blocks)) >= BLOCKS


def _means(column: Array, blocks: np.ndarray) -> tuple[np.ndarray, Array]:
    """Return the blocks' labels and their means, each a number of variance 1 where the column is noise."""
    names, which, counts = np.unique(blocks, return_inverse=True, return_counts=True)
    return names, np.bincount(which, column) / np.sqrt(counts)


def _chance_of_products(products: Array) -> float:
    """Return the chance of a sum of products of independent numbers: one has the variance of its square."""
    size = float(np.sqrt((products**2).sum()))
    return 2 * normal_sf(abs(products.sum()) / max(size, 1e-300))


def _neighbours(actuators: Array, blocks: np.ndarray) -> np.ndarray:
    """Return pairs (m, 2) of blocks, by their places among the labels, that are nearest neighbours; none twice."""
    _, first = np.unique(blocks, return_index=True)
    if len(first) < BLOCKS:
        return np.zeros((0, 2), int)
    places = actuators[first] / np.maximum(np.ptp(actuators, axis=0), 1e-12)
    pairs = cKDTree(places).query(places, k=2)[1]
    pairs = pairs[(pairs < len(first)).all(axis=1)]
    return np.unique(np.sort(pairs, axis=1)[pairs[:, 0] != pairs[:, 1]], axis=0)


def _slopes(actuators: Array) -> Array:
    """Return orthonormal columns (n, k) of a constant and the actuators' positions."""
    return _orthonormal(np.column_stack((np.ones(len(actuators)), actuators - actuators.mean(axis=0))))


def _orthonormal(columns: Array) -> Array:
    """Return orthonormal columns (n, r) of the same span as some columns (n, k), all of them of equal weight."""
    sizes = np.linalg.norm(columns, axis=0)
    basis, found, _ = np.linalg.svd(columns / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
    return basis[:, found > ROUNDING]


def noise_of_the_rest(problem: Problem, fit: Fit, blocks: np.ndarray) -> Problem | None:
    """Return the problem with the noise that a fit's residual has where it is noise alone but not of the size assumed.

    None where it is of that size, or more than noise. It is the pose sensor's, or has come in part through the robot
    from a wrench sensor whose noise nobody declared, as is likelier. blocks (n,): labels of the fit's samples.
    """
    exists = problem.compared(fit.run)
    raw = problem.stack.residual(fit.run)[fit.samples]
    count = int(exists.sum())
    if not count or fit.chi2 / count < chance_bound(count) ** 2:
        return None
    of_poses: list[Noise] = []
    of_both: list[Noise] = []
    by_wrench = problem.stack.seen(fit.influence.first.by_wrench)
    for noise, rows in problem.noise.parts(fit.samples):
        if noise.source == "declared" and not could_show_structure(blocks[rows]):
            of_poses.append(noise)
            of_both.append(noise)
            continue
        residual = _Residual(problem.stack, raw[rows], exists[rows], by_wrench[rows])
        of_poses.append(residual.noise_of_poses(noise))
        of_both.append(of_poses[-1])
        if not noise.wrench.any():
            loads = np.abs(problem.simulator.inputs.wrench[fit.samples][rows])
            likelier = residual.noise_of_both(of_poses[-1], loads)
            saved = residual.minus_2_log_likelihood(of_poses[-1]) - residual.minus_2_log_likelihood(likelier)
            if saved > INDISTINCT:
                of_both[-1] = likelier
    if all(noise is old for noise, (old, _) in zip(of_poses, problem.noise.parts(fit.samples), strict=True)):
        return None
    several = problem.noise.which
    for found, through in ((of_both, by_wrench), (of_poses, None)):
        noise = found[0] if several is None else Noise.of_several(found, several)
        again = replace(problem, noise=noise, by_wrench=through if noise.wrench.any() else None)
        if is_white(again, again.fit_at(fit.terms, fit), blocks):
            return again
    return None


@dataclass(frozen=True)
class _Residual:
    """What a fit leaves of a recording (n, K), and how the wrench's noise reaches it, (n, K, 6)."""

    stack: Stack
    raw: Array
    exists: np.ndarray
    by_wrench: Array

    def noise_of_poses(self, noise: Noise) -> Noise:
        """Return the noise of a pose sensor that has made all of it."""
        lengths, turns = _columns(self.stack, "m"), _columns(self.stack, "rad")
        return replace(
            noise,
            position=_size(self.raw[:, lengths], self.exists[:, lengths], noise.position),
            rotation=_size(self.raw[:, turns], self.exists[:, turns], noise.rotation),
            source="estimated",
        )

    def noise_of_both(self, noise: Noise, loads: Array) -> Noise:
        """Return the likeliest noise of pose and wrench sensors together; `noise` is that of poses alone.

        loads (n, 6): sizes of the wrenches. A wrench sensor scatters less than by what makes another load of one.
        """
        size = np.array([loads[:, :3].max(initial=0.0), loads[:, 3:].max(initial=0.0)])
        most = np.array([noise.position, noise.rotation, *(GAIN * size)])
        seen = [self.exists[:, _columns(self.stack, unit)].any() for unit in ("m", "rad")]
        free = np.flatnonzero(np.append(seen, size > 0))

        def of(logarithms: Array) -> Noise:
            values = most.copy()
            values[free] = most[free] * np.exp(logarithms)
            position, rotation, force, moment = values.tolist()
            return replace(noise, position=position, rotation=rotation, force=force, moment=moment)

        within = [(np.log(LITTLE**2), 0.0)] * len(free)
        begin = np.full(len(free), np.log(0.5))
        return of(minimize(lambda x: self.minus_2_log_likelihood(of(x)), begin, bounds=within, method="L-BFGS-B").x)

    def minus_2_log_likelihood(self, noise: Noise) -> float:
        """Return -2 log of the likelihood that this noise has made it, less a constant."""
        white = self.stack.whiteners(noise, self.by_wrench, self.exists)
        left = (white @ np.where(self.exists, self.raw, 0.0)[..., None])[..., 0]
        return float((left**2).sum() - 2 * np.log(np.einsum("nkk->nk", white)[self.exists]).sum())


def _columns(stack: Stack, unit: str) -> list[int]:
    """Return the columns of one unit."""
    return [column for _, own, where in stack.groups() if own == unit for column in range(where.start, where.stop)]


def _size(raw: Array, exists: np.ndarray, fallback: float) -> float:
    return float(np.sqrt((raw[exists] ** 2).mean())) if exists.any() else fallback
