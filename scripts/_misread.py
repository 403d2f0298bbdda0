"""Trials on logs that are written otherwise than they say: drawn, misread by arithmetic of the trial's own, and asked.

Every log is asked how it seems to be written, which is what `diagnose` and `check` do first. Where that is right, the
log as read is the log as it was before it was misread, and so is all that a diagnosis makes of it; where nothing is
told, or something else, the whole diagnosis is carried out, to see what it makes of the log.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import Kind, columns, grid, in_turn, listed, rate, sealed, spread
from _scattered import robot_file

import prup_pin
from prup_pin.build import delta as delta_robot
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.errors import PrupPinError
from prup_pin.recordings import Recording, read_recording
from prup_pin.spatial import rotation_exp, turn_between
from tests.reference.concealed import delta_by_energy as delta
from tests.reference.concealed import draw, efforts, misread, scattered
from tests.reference.concealed.misread import Misreading

#: Robots, and the faults that may be beside.
ROBOTS = {
    "3prup": ("stiffness_changed", "backlash", "encoder_offset", "coulomb_friction"),
    "six_ups": ("stiffness_changed", "backlash", "encoder_offset", "geometric_offset"),
    "delta": ("stiffness_changed", "encoder_offset"),
    "elastic_arm": ("stiffness_changed", "backlash", "encoder_offset", "payload"),
    "ur5": ("payload", "coulomb_friction", "effort_offset", "counterbalance"),
    "xarm7": ("payload", "viscous_friction", "effort_gain", "rotor_inertia"),
}
_IN_MOTION = ("ur5", "xarm7")
#: One log in so many is not misread at all, to see whether it is accused.
_PLAIN = 4


def _drawn(seed: int, robot: str, out: Path, sealed: Path, faults: Sequence[str]) -> None:
    if robot == "3prup":
        draw.write(draw.draw(seed, list(faults), (5.0, 40.0), poses=(12, 5)), out, sealed, "device")
    elif robot == "delta":
        file = out.parent / "delta.urdf"
        if not file.exists():
            delta_robot(**delta.SIZES, motor_stiffness=delta.MOTOR_STIFFNESS, rod_diameter=delta.ROD_DIAMETER,
                        youngs_modulus=delta.MODULUS, density=1.0).save(file)  # fmt: skip
        delta.write(delta.draw_delta(seed, faults), out, sealed, "device", str(file))
    elif robot in _IN_MOTION:
        efforts.write(efforts.draw_efforts(seed, robot, faults, (5.0, 40.0)), out, sealed, "device")
    else:
        drawn = scattered.draw_scattered(seed, robot, faults, (5.0, 40.0), poses=(12, 5))
        scattered.write(drawn, out, sealed, "device", str(robot_file(robot)))


def misreadings(robot: str, table: Mapping[str, np.ndarray]) -> list[Misreading]:
    """Return the ways in which logs of a robot are misread."""
    joints = [name[2:] for name in table if name.startswith("q.")]
    if robot in _IN_MOTION:
        return misread.of_efforts(joints)
    arm = robot == "elastic_arm"
    return misread.of_poses(joints, slide=robot in ("3prup", "six_ups"), tree=arm, turns=robot != "delta")


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw a device, misread its log, ask how it is written, and only then compare."""
    rng = np.random.default_rng([seed, 71, *robot.encode()])
    known = ROBOTS[robot]
    faults = [str(rng.choice(known))] if rng.random() < 0.5 else []
    with sealed() as (out, hidden):
        out.mkdir()
        _drawn(seed, robot, out, hidden, faults)
        path = out / "device.csv"
        true = read_recording(path)
        table = misread.read(path)
        ways = misreadings(robot, table)
        # every way has its turn, and one log in some has none
        turn = seed + 7 * list(ROBOTS).index(robot)
        way = None if turn % _PLAIN == 0 else ways[(turn - turn // _PLAIN - 1) % len(ways)]
        if way is not None:
            misread.write(path, way.change(table))
        log = read_recording(path)
        loaded = prup_pin.load(log.robot)
        begun = time.perf_counter()
        told, refused, right = [], "", False
        try:
            logs = read_logs(loaded, log)
            told = [str(item) for item in logs.conventions[0]]
            right = same(true, logs.recordings[0], told)
        except PrupPinError as error:
            refused = str(error)
        seconds = time.perf_counter() - begun
        right = right or (way is not None and alike(told, way.said.split(" + ")))
        verdict, findings = "", []
        if not (right and told) and (way is not None or told or refused):
            try:
                found = diagnose(loaded, log)
                verdict = found.verdict
                findings = [(item.physics, item.location) for item in found.findings]
                told_late = [c for item in found.findings for c in item.conventions]
                told = told or [str(item) for item in told_late]
                if way is not None and way.said == "tau=gain each":
                    right = right or each_gain(told_late)
                elif way is not None:
                    right = right or alike(told, way.said.split(" + "))
            except PrupPinError as error:
                refused = str(error)
    truth = {"name": "", "said": ""} if way is None else {"name": way.name, "said": way.said}
    return {
        "robot": robot, "seed": seed, "fault": ", ".join(faults), **truth, "told": told, "refused": refused[:300],
        "right": bool(way is not None and told and right), "verdict": verdict, "findings": findings,
        "physics": bool(way is not None and not told and verdict in ("explained", "nothing_missing")),
        "accused": bool(way is None and (told or refused)), "seconds": seconds,
    }  # fmt: skip


def alike(told: Sequence[str], said: Sequence[str]) -> bool:
    """Return whether what is told is what was done; a gain of all drives within a factor, which only masses decide."""
    if len(told) != len(said):
        return False
    return all(one in said or any(_gain(one, other) for other in said) for one in told)


def _gain(told: str, said: str) -> bool:
    (name, _, size), (other, _, true) = told.partition(":"), said.partition(":")
    return name == other == "tau=gain" and abs(np.log(float(size) / float(true))) < np.log(1.5)


def each_gain(told: Sequence[Any]) -> bool:
    """Return whether every drive's unit was told, and about right."""
    gains = (0.083, 0.08, 0.11, 0.14, 0.12, 0.15, 0.13)
    sizes = [float(item.argument[0]) for item in told if item.word == "gain"]
    return len(sizes) >= 6 and all(
        abs(np.log(size / gain)) < np.log(1.5) for size, gain in zip(sizes, gains, strict=False)
    )


def same(true: Recording, read: Recording, told: Sequence[str]) -> bool:
    """Return whether a log as read is the log before it was changed."""
    about = any("about:" in text for text in told)
    for group, share in (("positions", 1e-3), ("velocities", 1e-3), ("efforts", 0.1)):
        for name, values in getattr(true, group).items():
            other = getattr(read, group)[name]
            if np.linalg.norm(values - other) > share * max(float(np.linalg.norm(values)), 1e-6):
                return False
    if not np.allclose(true.time, read.time, rtol=1e-6, atol=1e-6):
        return False
    if true.position is not None and np.abs(true.position - read.position).max() > 1e-3 * np.abs(true.position).max():
        return False
    if true.rotation is not None:
        turn = turn_between(rotation_exp(np.array(true.rotation)), rotation_exp(np.array(read.rotation)))
        if np.abs(turn).max() > 1e-3:
            return False
    apart = np.sqrt(np.mean((true.wrench - read.wrench) ** 2, axis=0))
    size = np.sqrt(np.mean(true.wrench**2, axis=0))
    return bool((apart <= (0.15 if about else 5e-3) * np.maximum(size, 1e-9)).all())


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    good = not result["accused"] if not result["name"] else result["right"]
    said = " ".join(result["told"]) or result["refused"] or f"{result['verdict']} {result['findings']}"
    beside = f" beside {result['fault']}" if result["fault"] else ""
    return (f"{'ok' if good else '--'} {result['robot']} {result['seed']}: {result['name'] or 'as it says'}{beside} -> "
            f"{said}  {result['seconds']:.0f} s")  # fmt: skip


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    rows = [
        ("logs", lambda ts: str(len(ts))),
        ("misread: told right", rate(lambda t: t["right"], lambda t: t["name"])),
        ("… faultless devices", rate(lambda t: t["right"], lambda t: t["name"] and not t["fault"])),
        ("… a fault beside", rate(lambda t: t["right"], lambda t: t["name"] and t["fault"])),
        ("misread: something else told", rate(lambda t: t["told"] and not t["right"], lambda t: t["name"])),
        ("misread: refused", rate(lambda t: t["refused"] and not t["told"], lambda t: t["name"])),
        ("misread: explained by physics", rate(lambda t: t["physics"], lambda t: t["name"])),
        ("as it says: accused", rate(lambda t: t["accused"], lambda t: not t["name"])),
        ("seconds to ask, median (90th percentile)", lambda ts: spread((t["seconds"] for t in ts), ".1f")),
    ]
    lines = [f"{len(trials)} logs, seeds from {min(t['seed'] for t in trials)} on, as first answered.", ""]
    lines += [*grid(columns(trials, ROBOTS), rows), "", "By misreading:", ""]
    by_name = defaultdict(list)
    for t in trials:
        if t["name"]:
            by_name[t["name"]].append(t["right"])
    hits = ((name, len(right), sum(right)) for name, right in sorted(by_name.items()))
    lines += listed(("written", "logs", "told right"), hits)
    wrong = [t for t in trials if t["accused"] or (t["name"] and not t["right"])]
    if wrong:
        lines += ["", f"All {len(wrong)} logs that were not told right, or accused:", ""]
        lines += listed(("log", "written", "told", "diagnosis"), map(_wrong, wrong))
    return "\n".join(lines) + "\n"


def _wrong(trial: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the row of a log that was not told right."""
    named = ", ".join(f"{physics} at {place}" for physics, place in trial["findings"][:4])
    verdict = f"{trial['verdict']}: {named}" if trial["verdict"] else "refused" if trial["refused"] else ""
    written = (trial["name"] or "as it says") + (f" beside {trial['fault']}" if trial["fault"] else "")
    return f"{trial['robot']} {trial['seed']}", written, " ".join(trial["told"]) or "nothing", verdict


KIND = Kind(
    "misread", "logs that are written otherwise than they say", "misread", in_turn("misread", ROBOTS), trial,
    told, summary,
)  # fmt: skip
