"""What does a sample of the loaded robot cost? Engine, memory laws, growth with rows, next to a plain Newton.

    python scripts/bench_loaded.py

One job: 14 poses x 27 loads of the 3-PRUP at up to about 200 N. The peer is a plain Newton on the same equations,
sample by sample, its derivative by finite differences; both run here, so the ratio means something on any machine.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import numpy as np

import prup_pin
from prup_pin.laws import Effect, Inputs, Place, law_at
from prup_pin.loaded import Conditions, FirstOrder, chain_of
from prup_pin.recordings import Recording
from prup_pin.robot import random_poses
from prup_pin.simulation import Simulator

TARGET, MEMORY_TARGET = 3.0, 10.0  # ms a sample
SLOPES_TARGET = 10.0  # ms a parameter of all samples


def job(robot, copies: int = 1) -> Inputs:
    """Return the inputs of 14 x copies poses with 27 loads each."""
    bounds = {"z": (0.3, 0.45), "theta": (-0.3, 0.3), "phi": (-0.3, 0.3)}
    poses = random_poses(robot, bounds, 14 * copies, seed=1)
    rng = np.random.default_rng(2)
    cycle = np.array([0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5, 0])
    loads = []
    for _ in range(3 * len(poses)):
        force, moment = rng.normal(size=3), rng.normal(size=3)
        top = np.concatenate((force / np.linalg.norm(force) * 150, moment / np.linalg.norm(moment) * 20))
        loads.append(cycle[:, None] * top)
    actuators = np.repeat([list(pose.actuators.values()) for pose in poses], 27, axis=0)
    n = len(actuators)
    return Inputs(np.arange(float(n)), actuators, np.concatenate(loads), np.repeat(np.arange(len(poses)), 27))


def timed(robot, inputs, effects=()):
    simulator = Simulator(robot, inputs)
    begun = time.perf_counter()
    run = simulator.run(effects)
    return 1e3 * (time.perf_counter() - begun) / len(inputs), run


def plain_newton(robot, inputs, samples):
    """Return ms a sample and tool positions of a Newton whose dense derivative comes from finite differences."""
    chain = chain_of(robot._statics)
    begun = time.perf_counter()
    positions = []
    for sample in samples:
        pose = robot.pose_from_actuators(inputs.actuators[sample])
        rows = np.zeros(1, int)
        rigid, state = chain.rigid_samples([pose], rows), chain.rigid_state([pose], rows)
        conditions = Conditions(wrench=inputs.wrench[sample][None])
        for _ in range(30):
            at = chain.evaluate(rigid, state, conditions)
            size = at.residual.shape[1]
            matrix = np.empty((size, size))
            for column in range(size):
                step = np.zeros((1, size))
                step[0, column] = 1e-7 if column < size - chain.structure.closure_count else 1e-3
                moved = chain.evaluate(rigid, chain.step(state, step), conditions).residual
                matrix[:, column] = (moved - at.residual)[0] / step[0, column]
            change = -np.linalg.lstsq(matrix, at.residual[0], rcond=None)[0]
            state = chain.step(state, change[None])
            if np.abs(change[: size - chain.structure.closure_count]).max() < 1e-10:
                break
        positions.append(chain.evaluate(rigid, state, conditions).tool[0, :3, 3])
    return 1e3 * (time.perf_counter() - begun) / len(samples), np.array(positions)


def slopes(run) -> tuple[float, int]:
    """Return seconds for all first-order changes of a solved run, and how many they are.

    Places of joints and of loops' ends, masses, and a step of every finite value of the modules.
    """
    begun = time.perf_counter()
    first = FirstOrder(run.equilibria)
    mechanism, count = first.chain.mechanism, 0
    for joint in mechanism.joints:
        first.by_joint(joint.id)
        count += 6
    for link in mechanism.links:
        first.by_mass(link, mechanism.gravity)
        count += 1
    for loop in range(len(mechanism.loops)):
        for end in (0, 1):
            first.by_loop_end(loop, end)
            count += 6
    for module in mechanism.modules:
        for quantity in module.kind.quantities:
            value = module.values[quantity.name]
            if np.ndim(value) == 0 and np.isfinite(value) and value > 0:
                ends = [{**module.values, quantity.name: value * factor} for factor in (1 + 1e-5, 1 - 1e-5)]
                first.by_values(module.name, *ends)
                count += 1
    return time.perf_counter() - begun, count


def recorded(robot, copies: int) -> float:
    """Return ms a row of `prup_pin.simulate`, which takes long recordings in parts."""
    inputs = job(robot, copies)
    positions = dict(zip(robot.mechanism.actuated, inputs.actuators.T, strict=True))
    recording = Recording(time=inputs.time, positions=positions, wrench=inputs.wrench)
    begun = time.perf_counter()
    prup_pin.simulate(robot, recording)
    return 1e3 * (time.perf_counter() - begun) / len(recording)


def verdict(value: float, target: float) -> str:
    return f"{value:6.2f} ms a sample, target {target:g}: {'met' if value <= target else 'missed'}"


def main() -> None:
    robot = prup_pin.load("3prup")
    inputs = job(robot)
    timed(robot, job(robot))  # first calls import and allocate
    plain, run = timed(robot, inputs)
    print(f"without memory laws   {verdict(plain, TARGET)}; all solved: {bool(run.solved.all())}")
    place = Place("leg1/R_theta_P")
    friction = Effect(law_at("coulomb_friction", place), place, {"limit": 1.0, "presliding_stiffness": 4000.0})
    slow, run_friction = timed(robot, inputs, [friction])
    print(f"with friction         {verdict(slow, MEMORY_TARGET)}; all solved: {bool(run_friction.solved.all())}")
    samples = [10, 200]
    peer, positions = plain_newton(robot, inputs, samples)
    apart = np.abs(positions - run.position[samples]).max()
    print(f"plain Newton          {peer:6.0f} ms a sample, ratio {peer / plain:.0f} x; apart by {apart:.1e} m")
    seconds, count = slopes(run)
    each, whole = 1e3 * seconds / count, f"{count} parameters x {len(inputs)} samples in {seconds:.2f} s"
    met = "met" if each <= SLOPES_TARGET else "missed"
    print(f"first order           {each:6.2f} ms a parameter, target {SLOPES_TARGET:g}: {met}; {whole}")
    base = recorded(robot, 1)
    for copies in (2, 4):
        each = recorded(robot, copies)
        print(f"{copies} x the rows          {each:6.2f} ms a sample ({each / base:.2f} x: 1 is linear growth)")


if __name__ == "__main__":
    main()
