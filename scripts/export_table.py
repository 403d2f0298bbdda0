"""Do exported files reproduce what was not diagnosed? Three devices, their held-out recordings, and other simulators.

    python scripts/export_table.py [--docs]

A simulator of its own (tests/reference/concealed) draws a 3-PRUP, a hexapod and a ur5 with two recordings each. The
first is diagnosed, the corrected model written as URDF and MJCF; the table says what is left of the second one by the
robot file, by `predict`, and by each file in another simulator. `--docs` writes it into docs/export.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import mujoco
import numpy as np
from _project import ROOT
from _scattered import robot_file
from scipy.signal import butter, sosfiltfilt

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.export import Exported, export_model
from prup_pin.laws import Effect, Setup
from prup_pin.laws.deviations import Calibration
from prup_pin.recordings import Recording, read_recording
from prup_pin.robot import Robot
from prup_pin.simulation import CorrectedModel, effect_named, simulate
from prup_pin.simulation.prediction import inputs_of
from tests.reference.concealed import efforts as in_motion
from tests.reference.concealed import scattered
from tests.reference.concealed.chain import read_chain

#: Kinds of parameters that no robot file holds, as docs/export.md lists them.
LISTED = ("encoder_slope", "wrench_gain", "wrench_rotation", "wrench_bias")
#: Slower than this a joint may be turning round, where dry friction is a soft constraint in MuJoCo [rad/s].
MOVING = 0.1
#: The devices: kind, seed, what acts on it.
AT_REST = (("3prup", 71, ["stiffness_changed"]), ("six_ups", 72, ["stiffness_changed"]))
IN_MOTION = ("ur5", 76, ["coulomb_friction", "rotor_inertia"])


@dataclass(frozen=True)
class Row:
    """What is left of a device's held-out recording, root mean square, by who simulates it; in what unit."""

    device: str
    acts: str
    unit: str
    left: dict[str, float]
    listed: tuple[str, ...]


#: Who simulates. The last two have nothing but the file; before them, what it lists as left out is put back.
BY = (
    "the robot file",
    "`predict`",
    "URDF in this package",
    "MJCF in this package",
    "MuJoCo",
    "simulator of its own",
    "MuJoCo, the file alone",
    "simulator of its own, the file alone",
)


def answered(robot: Robot, recording: Recording, name: str, folder: Path) -> tuple[CorrectedModel, list[Exported]]:
    """Diagnose a recording; return the corrected model and what its URDF and MJCF files say."""
    model = corrected_model(diagnose(robot, recording), robot, [recording], name)
    return model, [export_model(model, folder / f"corrected{ending}") for ending in (".urdf", ".xml")]


def listed(made: Sequence[Exported]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(f"{item.physics} at {item.place}" for each in made for item in each.left_out))


# -- poses under loads -------------------------------------------------------------------------------------------------


def wholly_left_out(made: Exported) -> set[tuple[str, str]]:
    """Return physics and place of effects of which nothing is in a file."""
    listed, said = ({(item.physics, item.place) for item in items} for items in (made.left_out, made.said))
    return listed - said


def left_out(model: CorrectedModel, made: Exported) -> list[Effect]:
    """Return what of a model's effects the file does not hold, to act on the file's robot.

    Of calibrated parameters those of kinds that no file holds; other effects wholly, where they are listed as left out.
    """
    robot = model.load()
    wholly, found = wholly_left_out(made), []
    for effect in model.effects:
        if isinstance(effect.law, Calibration):
            kinds = {item.name: item.kind for item in effect.law.deviations}
            rest = {name: value for name, value in effect.values.items() if kinds[name] in LISTED}
            found += [replace(effect, values=rest)] if rest else []
        elif (effect.law.physics, str(effect.place)) in wholly:
            found.append(effect.checked(robot.mechanism))
    return found


def seen_by_file(path: Path, heldout: Recording, effects: Sequence[Effect]) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (N, 3) [m] and placements' rotations (N, 3, 3) that a file's robot shows to the pose sensor."""
    robot = prup_pin.load(path)
    mechanism = robot.mechanism
    target = f"{mechanism.tool.name}_measured"
    target = target if target in mechanism.frame_names else mechanism.tool.name
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, mechanism)
    got = simulate(robot, heldout, [weight, *effects], markers=[target])
    return seen(mechanism, got.markers[target])


def seen(mechanism, position: np.ndarray) -> np.ndarray:
    """Return positions (N, 3) [m] in the frame of the pose sensor, of those in the base."""
    if "pose_sensor" not in mechanism.frame_names:
        return position
    sensor = mechanism.frame("pose_sensor").placement
    return (position - sensor[:3, 3]) @ sensor[:3, :3]


def by_mujoco(path: Path, actuators: dict[str, np.ndarray], target: str) -> np.ndarray:
    """Return where MuJoCo puts a body or site (N, 3) [m] at positions of actuated joints, loops closed by Newton."""
    model = mujoco.MjModel.from_xml_path(str(path))
    state = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, state, 0)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    driven = {model.joint(name).qposadr[0]: values for name, values in actuators.items()}
    held = [model.joint(name).dofadr[0] for name in actuators]
    free = np.setdiff1d(np.arange(model.nv), held)
    is_site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, target) >= 0
    found = []
    for k in range(len(next(iter(actuators.values())))):
        for place, values in driven.items():
            state.qpos[place] = values[k]
        for _ in range(100):
            mujoco.mj_forward(model, state)
            if not state.ne or np.abs(state.efc_pos[: state.ne]).max() < 1e-12:
                break
            jacobian = state.efc_J.reshape(-1, model.nv)[: state.ne]
            step = np.zeros(model.nv)
            step[free] = np.linalg.lstsq(jacobian[:, free], -state.efc_pos[: state.ne], rcond=1e-10)[0]
            mujoco.mj_integratePos(model, state.qpos, step, 1.0)
        else:
            raise RuntimeError(f"MuJoCo's loops stay open by {np.abs(state.efc_pos[: state.ne]).max():.1e} at row {k}")
        found.append(np.array(state.site(target).xpos if is_site else state.body(target).xpos))
    return np.array(found)


def at_rest(kind: str, seed: int, effects: list[str], folder: Path) -> Row:
    """Return what is left of a parallel robot's held-out positions."""
    file = robot_file(kind)
    scattered.write(scattered.draw_scattered(seed, kind, effects), folder, folder / "sealed", "device", str(file))
    recording, heldout = (read_recording(folder / f"device{part}.csv") for part in ("", ".heldout"))
    robot = prup_pin.load(file)
    model, made = answered(robot, recording, str(file), folder)
    measured = heldout.position

    def rms(position) -> float:
        off = np.linalg.norm(position - measured, axis=1)
        return 1e6 * float(np.sqrt(np.nanmean(off**2)))

    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    left = {
        BY[0]: rms(simulate(robot, heldout, [weight]).position),
        BY[1]: rms(simulate(model.load(), heldout, model.effects).position),
    }
    for name, each, ending in ((BY[2], made[0], ".urdf"), (BY[3], made[1], ".xml")):
        left[name] = rms(seen_by_file(folder / f"corrected{ending}", heldout, left_out(model, each)))
    # MuJoCo takes all parts as rigid, which is listed: what this package's robot of the same file yields is put back
    path = folder / "corrected.xml"
    mechanism = made[1].mechanism
    rest = left_out(model, made[1])
    own = Robot(mechanism)
    setup = Setup.nominal(mechanism, inputs_of(heldout, own))
    for effect in rest:
        setup.take(effect.checked(mechanism).deeds(setup))
    stands = setup.inputs.actuators + setup.travel
    actuators = dict(zip(mechanism.actuated, stands.T, strict=True))
    target = f"{mechanism.tool.name}_measured"
    target = target if target in mechanism.frame_names else mechanism.tool.name
    rigid = seen(mechanism, by_mujoco(path, actuators, target))
    ours, pose = [], own.home
    for row in stands:
        pose = own.pose_from_actuators(row.tolist(), near=pose)
        ours.append(pose.placement(target)[:3, 3])
    apart = np.abs(seen(mechanism, np.array(ours)) - rigid).max()
    print(f"{kind}: MuJoCo stands {apart:.1e} m from this package's rigid robot")
    yields = seen_by_file(path, heldout, rest) - seen(mechanism, np.array(ours))
    left[BY[4]] = rms(rigid + yields)
    left[BY[6]] = rms(rigid)
    return Row(kind, effects[0].replace("_", " "), "µm", left, listed(made))


# -- efforts in motion -------------------------------------------------------------------------------------------------


def in_motion_row(kind: str, seed: int, effects: list[str], folder: Path) -> Row:
    """Return what is left of an arm's held-out efforts below the frequency of the trials, where its joints move."""
    drawn = in_motion.draw_efforts(seed, kind, effects, (10.0, 40.0))
    in_motion.write(drawn, folder, folder / "sealed", "device")
    recording, heldout = (read_recording(folder / f"device{part}.csv") for part in ("", ".heldout"))
    robot = prup_pin.load(kind)
    model, made = answered(robot, recording, kind, folder)
    names = list(robot.mechanism.actuated)
    even = np.arange(heldout.time[0], heldout.time[-1], 0.004)
    low = butter(4, in_motion.CUT, fs=250.0, output="sos")

    def smooth(columns) -> np.ndarray:
        """Return columns by joint on an even clock, (n, k), below the frequency of the trials."""
        return np.column_stack(
            [sosfiltfilt(low, np.interp(even, heldout.time, np.asarray(columns[name]))) for name in names]
        )

    q = smooth({name: np.unwrap(heldout.positions[name]) for name in names})
    qd = np.gradient(q, even, axis=0)
    qdd = np.gradient(qd, even, axis=0)
    measured = smooth(heldout.efforts)
    moves = np.abs(qd) > MOVING
    moves[:50] = moves[-50:] = False

    def share(efforts: np.ndarray) -> float:
        rest = sosfiltfilt(low, efforts - measured, axis=0)[moves]
        return 100 * float(np.sqrt(np.mean(rest**2) / np.mean(measured[moves] ** 2)))

    def predicted(loaded: Robot, effects: Sequence[Effect]) -> np.ndarray:
        efforts = simulate(loaded, heldout, effects, band=model.band).efforts
        return smooth({joint: filled(efforts[joint]) for joint in names})

    def filled(values: np.ndarray) -> np.ndarray:
        known = np.isfinite(values)
        return np.interp(heldout.time, heldout.time[known], values[known])

    corrected = model.load()
    whole = predicted(corrected, model.effects)
    left = {BY[0]: share(predicted(robot, ())), BY[1]: share(whole)}
    # what a file lists as left out, as the corrected model has it
    lost = []
    for each in made:
        gone = wholly_left_out(each)
        there = [effect for effect in model.effects if (effect.law.physics, str(effect.place)) not in gone]
        lost.append(whole - predicted(corrected, there))
    arm = mujoco.MjModel.from_xml_path(str(folder / "corrected.xml"))
    state = mujoco.MjData(arm)
    place = [arm.joint(name).dofadr[0] for name in names]
    by_muj = np.zeros_like(q)
    for k in range(len(q)):
        state.qpos[place], state.qvel[place], state.qacc[place] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(arm, state)
        by_muj[k] = state.qfrc_inverse[place]
    left[BY[4]] = share(by_muj + lost[1])
    left[BY[6]] = share(by_muj)
    # the URDF in a simulator that shares no code, and what a URDF has no word for beside it
    chain = read_chain(folder / "corrected.urdf")
    order = [chain.names.index(name) for name in names]
    given = chain.efforts(*(values[:, np.argsort(order)] for values in (q, qd, qdd)))[:, order]
    said = {
        item.get("name"): item.find("dynamics")
        for item in ElementTree.parse(folder / "corrected.urdf").getroot().findall("joint")
    }
    for column, name in enumerate(names):
        dynamics = said[name]
        if dynamics is not None:
            given[:, column] += float(dynamics.get("damping", 0)) * qd[:, column]
            given[:, column] += float(dynamics.get("friction", 0)) * np.sign(qd[:, column])
    left[BY[7]] = share(given)
    left[BY[5]] = share(given + lost[0])
    told = " and ".join(name.replace("_", " ") for name in effects)
    return Row(kind, told, "% of the efforts", left, listed(made))


def table(rows: Sequence[Row]) -> str:
    """Return the table as Markdown."""
    lines = [f"| held out, RMS | {' | '.join(BY)} |", "|---|" + "---|" * len(BY)]
    for row in rows:
        cells = [f"{row.left[by]:.2f}" if by in row.left else "-" for by in BY]
        lines.append(f"| {row.device}, {row.acts} [{row.unit}] | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--docs", action="store_true", help="write the table into docs/export.md")
    parser.add_argument("--only", help="one kind of robot")
    options = parser.parse_args()
    rows = []
    for kind, seed, effects in (*AT_REST, IN_MOTION):
        if options.only in (None, kind):
            make = in_motion_row if kind == IN_MOTION[0] else at_rest
            with TemporaryDirectory() as folder:
                rows.append(make(kind, seed, effects, Path(folder)))
            print(rows[-1], flush=True)
    text = table(rows)
    print(text)
    if options.docs:
        page = ROOT / "docs" / "export.md"
        mark = r"(<!-- other simulators -->\n\n).*?(\n<!-- /other simulators -->)"
        page.write_text(
            re.sub(mark, lambda m: m[1] + text + m[2], page.read_text(encoding="utf-8"), flags=re.DOTALL), "utf-8"
        )


if __name__ == "__main__":
    main()
