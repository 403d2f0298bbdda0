"""A test plan: poses, load programmes, sensor noise and a seed, from which the inputs of a recording follow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, UnreachablePoseError
from ..files import json_lines, named_beside, write_whole, written_beside
from ..spatial import WRENCH_NAMES, Array, as_wrench
from .beside import noise_of, tolerances_of
from .columns import LARGEST_GRAVITY, LARGEST_NUMBER, NOISE_KEYS
from .problems import Problems, ValueReader, is_number, json_kind, read_json_object
from .recording import Noise, Recording
from .tolerances import Tolerances

#: Task coordinates -> positions of the actuated joints [m or rad].
PoseSolver = Callable[[Mapping[str, float]], Mapping[str, float]]

#: Load up and down in both directions: shows hysteresis, gaps and nonlinear stiffness.
FULL_CYCLE = (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
MAX_POSES = 100_000
MAX_SAMPLES = 10_000_000
#: No robot reaches farther, nor turns: metres and radians are meant [m or rad].
MOST_BOUND = 1000.0
# Every kind of draw has its own stream: more poses do not change the loads, another noise not the poses.
_POSE_STREAM, _LOAD_STREAM, _NOISE_STREAM = 1, 2, 3


@dataclass(frozen=True)
class ActuatorPose:
    """One pose, by the positions of the actuated joints [m or rad]."""

    actuators: Mapping[str, float]


@dataclass(frozen=True)
class TaskPose:
    """One pose, by its task coordinates [m or rad]."""

    at: Mapping[str, float]


@dataclass(frozen=True)
class RandomPoses:
    """`count` poses drawn uniformly from a box; `bounds` maps each task coordinate to (low, high) [m or rad]."""

    count: int
    bounds: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        for name, (low, high) in self.bounds.items():
            if not (abs(low) <= MOST_BOUND and abs(high) <= MOST_BOUND):
                raise InputError(f"bounds of '{name}' = {low!r}, {high!r}: expected at most {MOST_BOUND:g} [m or rad]")


Poses = ActuatorPose | TaskPose | RandomPoses


@dataclass(frozen=True)
class LoadProgramme:
    """Wrenches on the tool point, applied one after the other at every pose.

    cycle: factors by which the full wrench is multiplied, one sample each.
    wrench: the full wrench by its components, fx fy fz [N] mx my mz [N m], in the base frame; or, instead of it,
    random_directions: so many full wrenches, drawn anew at each pose. Force and moment have random directions, and the
    sizes `force` [N] and `moment` [N m], each times a share drawn between 0.2 and 1.
    poses: indices of the poses at which the programme runs, counted over all poses of the plan; None is all.
    """

    cycle: tuple[float, ...] = FULL_CYCLE
    wrench: Mapping[str, float] | None = None
    random_directions: int | None = None
    force: float = 0.0
    moment: float = 0.0
    poses: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if (self.wrench is None) == (self.random_directions is None):
            raise InputError("a load programme needs either a wrench or a number of random_directions")
        if self.wrench is not None:
            as_wrench(self.wrench)
        if not self.cycle:
            raise InputError("a load programme needs a cycle of at least one factor")

    def wrenches(self, random: np.random.Generator) -> Array:
        """Return the wrenches at one pose, (samples, 6) [N, N m]."""
        if self.wrench is not None:
            full = as_wrench(self.wrench)[None]
        else:
            full = np.zeros((self.random_directions or 0, 6))
            for row in full:
                row[:3] = self.force * _share(random) * _direction(random)
                row[3:] = self.moment * _share(random) * _direction(random)
        return (full[:, None, :] * np.array(self.cycle)[:, None]).reshape(-1, 6)

    @property
    def samples(self) -> int:
        """How many samples the programme takes at one pose."""
        return len(self.cycle) * (1 if self.wrench is not None else self.random_directions or 0)


@dataclass(frozen=True)
class TestPlan:
    """What a bench test does, and how well it measures.

    sample_interval [s]; temperature [degrees Celsius] is None, a number, or (from, to) reached linearly over the test;
    encoder_resolution [m or rad] rounds the actuators' positions, 0 leaves them. `tolerances` go into the recording.
    markers: frames whose position and orientation are to be measured beside the tool's pose. gravity: acceleration of
    free fall in the base frame [m/s^2], where it is not the robot file's.
    """

    __test__ = False  # pytest takes classes named Test… for tests

    poses: tuple[Poses, ...]
    loads: tuple[LoadProgramme, ...]
    sample_interval: float = 1.0
    temperature: float | tuple[float, float] | None = None
    noise: Noise = field(default_factory=Noise)
    encoder_resolution: float = 0.0
    seed: int = 0
    robot: str | None = None
    notes: str = ""
    tolerances: Tolerances = field(default_factory=Tolerances)
    markers: tuple[str, ...] = ()
    gravity: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not self.poses or not self.loads:
            raise InputError("a test plan needs at least one pose and one load programme")
        if not (np.isfinite(self.sample_interval) and self.sample_interval > 0):
            raise InputError(f"sample_interval = {self.sample_interval!r}: expected seconds above 0")
        if not (np.isfinite(self.encoder_resolution) and self.encoder_resolution >= 0):
            raise InputError(f"encoder_resolution = {self.encoder_resolution!r}: expected 0 or more [m or rad]")
        if self.pose_count > MAX_POSES:
            raise InputError(f"{self.pose_count} poses; expected at most {MAX_POSES}")
        samples = _sample_count(self.loads, self.pose_count)
        if samples > MAX_SAMPLES:
            raise InputError(f"the plan has {samples} samples; expected at most {MAX_SAMPLES}")
        for k, load in enumerate(self.loads):
            for index in load.poses or ():
                if not 0 <= index < self.pose_count:
                    raise InputError(f"loads[{k}].poses: no pose {index}; there are poses 0 to {self.pose_count - 1}")

    @property
    def pose_count(self) -> int:
        """How many poses the plan visits."""
        return sum(pose.count if isinstance(pose, RandomPoses) else 1 for pose in self.poses)

    def inputs(self, solve_pose: PoseSolver) -> Recording:
        """Return what the plan commands and applies: time, actuator positions, wrench and temperature, no measurement.

        solve_pose: turns task coordinates into the positions of the actuated joints. Where it raises
        UnreachablePoseError, a drawn pose is drawn again; for a given pose the error is raised with its place.

        Raises InputError, UnreachablePoseError.
        """
        actuators = list(self._actuator_positions(solve_pose))
        names = list(actuators[0])
        for k, pose in enumerate(actuators):
            if set(pose) != set(names):
                raise InputError(
                    f"pose {k} moves {', '.join(pose)}; pose 0 moves {', '.join(names)}: expected the same"
                )
        poses, step = np.array([[float(pose[name]) for name in names] for pose in actuators]), self.encoder_resolution
        poses = np.round(poses / step) * step if step else poses
        random = np.random.default_rng([self.seed, _LOAD_STREAM])
        loads = [(load, None if load.poses is None else frozenset(load.poses)) for load in self.loads]
        applied = [
            [load.wrenches(random) for load, at in loads if at is None or k in at] for k in range(len(actuators))
        ]
        table = np.repeat(poses, [sum(map(len, wrenches)) for wrenches in applied], axis=0)
        wrench = np.concatenate([np.zeros((0, 6)), *(each for wrenches in applied for each in wrenches)])
        n = len(table)
        if not n:
            raise InputError("the plan has no samples: no load programme runs at any pose")
        temperature: Array | None = None
        if self.temperature is not None:
            ends = self.temperature if isinstance(self.temperature, tuple) else (self.temperature, self.temperature)
            temperature = np.linspace(*ends, n)
        return Recording(
            time=np.arange(n, dtype=float) * float(self.sample_interval),
            positions={name: table[:, k] for k, name in enumerate(names)},
            wrench=wrench,
            gravity=None if self.gravity is None else np.tile(self.gravity, (n, 1)),
            temperature=temperature,
            noise=self.noise,
            tolerances=self.tolerances,
            robot=self.robot,
            notes=self.notes,
        )

    def _actuator_positions(self, solve_pose: PoseSolver) -> Iterator[Mapping[str, float]]:
        random = np.random.default_rng([self.seed, _POSE_STREAM])
        for k, pose in enumerate(self.poses):
            if isinstance(pose, ActuatorPose):
                yield pose.actuators
            elif isinstance(pose, TaskPose):
                try:
                    yield solve_pose(pose.at)
                except UnreachablePoseError as error:
                    raise _placed(error, f"poses[{k}].at") from error
            else:
                yield from _drawn(pose, solve_pose, random, f"poses[{k}].random")


def _sample_count(loads: Iterable[LoadProgramme], poses: int) -> int:
    """Return how many samples load programmes take at so many poses."""
    return sum(load.samples * (poses if load.poses is None else len(set(load.poses))) for load in loads)


def _drawn(
    pose: RandomPoses, solve_pose: PoseSolver, random: np.random.Generator, key: str
) -> Iterator[Mapping[str, float]]:
    low, high = (np.array([bound[k] for bound in pose.bounds.values()], float) for k in (0, 1))
    found = 0
    for draws in range(1, 20 * pose.count + 1):  # poses out of reach are drawn again
        at = dict(zip(pose.bounds, random.uniform(low, high).tolist(), strict=True))
        try:
            solved = solve_pose(at)
        except UnreachablePoseError as error:
            last = error
            if not found and draws >= 100:  # no pose of the box is within reach
                break
            continue
        yield solved
        found += 1
        if found == pose.count:
            return
    text = f"{key}: {found} of {pose.count} poses found in {draws} draws; narrow the bounds. The last one"
    raise _placed(last, text) from last


def _placed(error: UnreachablePoseError, place: str) -> UnreachablePoseError:
    return UnreachablePoseError(f"{place}: {error}", error.requested, error.nearest, error.residual)


def _direction(random: np.random.Generator) -> Array:
    """Return a unit vector (3,), all directions being equally likely."""
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def _share(random: np.random.Generator) -> float:
    """Return which share of the full force or moment a drawn direction carries."""
    return random.uniform(0.2, 1.0)


def add_noise(recording: Recording, noise: Noise, seed: int) -> Recording:
    """Return the recording as sensors with white noise report it, and declare this noise.

    Noise goes to measured position, rotation, efforts and markers, and to the components of the wrench that have a
    column, because the sensor reports them with its noise. A channel without declared noise stays as it is. The same
    seed gives the same noise; each channel has its own stream.
    """

    def noisy(values: Array, deviation: float | None, *stream: int) -> Array:
        if deviation is None:
            return values
        random = np.random.default_rng([seed, _NOISE_STREAM, *stream])
        return values + deviation * random.standard_normal(values.shape)

    changes: dict[str, Any] = {"noise": noise}
    if recording.position is not None:
        changes["position"] = noisy(recording.position, noise.position, 1)
    if recording.rotation is not None:
        changes["rotation"] = noisy(recording.rotation, noise.rotation, 2)
    if recording.has_wrench:
        loads = [noisy(recording.wrench[:, :3], noise.force, 3), noisy(recording.wrench[:, 3:], noise.moment, 4)]
        there = [name in recording.wrench_columns for name in WRENCH_NAMES]
        changes["wrench"] = np.where(there, np.concatenate(loads, axis=1), recording.wrench)
    changes["efforts"] = {
        joint: noisy(values, noise.effort, 5, k) for k, (joint, values) in enumerate(recording.efforts.items())
    }
    for group, deviation, stream in (("markers", noise.position, 6), ("marker_rotations", noise.rotation, 7)):
        marked = getattr(recording, group)
        changes[group] = {name: noisy(values, deviation, stream, k) for k, (name, values) in enumerate(marked.items())}
    return replace(recording, **changes)


def read_plan(path: str | Path) -> TestPlan:
    """Return the test plan of a JSON file. Raises RecordingFileError with all problems, each with its place in it."""
    path = Path(path)
    problems = Problems(path)
    values = read_json_object(path, "a test plan, a JSON object", problems)
    problems.raise_all()
    plan = _PlanReader(problems).plan(values)
    if plan is None:
        raise problems.error()
    return plan


def write_plan(plan: TestPlan, path: str | Path) -> None:
    """Write a test plan as JSON; `read_plan` returns an equal one. Raises InputError if it cannot be written.

    A path of a robot file is written relative to the plan's folder.
    """
    warm, sizes = plan.temperature, ("force", "moment")  # of random directions; a wrench has its own
    value = {
        "robot": None if plan.robot is None else written_beside(plan.robot, path),
        "notes": plan.notes,
        "poses": [{"random": _plain(pose)} if isinstance(pose, RandomPoses) else _plain(pose) for pose in plan.poses],
        "loads": [_plain(load, *(sizes if load.wrench is not None else ())) for load in plan.loads],
        "sample_interval": plan.sample_interval,
        "temperature": {"from": warm[0], "to": warm[1]} if isinstance(warm, tuple) else warm,
        "noise": plan.noise.by_key,
        "tolerances": plan.tolerances.declared,
        "markers": list(plan.markers),
        "gravity": None if plan.gravity is None else list(plan.gravity),
        "encoder_resolution": plan.encoder_resolution,
        "seed": plan.seed,
    }
    said = {key: each for key, each in value.items() if each is not None and each not in ("", {}, [])}
    write_whole({Path(path): json_lines(said)})


def _plain(item: Poses | LoadProgramme, *without: str) -> dict[str, Any]:
    """Return what a pose or a load programme is given by, as JSON has it, but for some of its fields."""

    def plain(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {name: plain(inner) for name, inner in value.items()}
        return list(value) if np.ndim(value) else value

    return {name: plain(value) for name, value in vars(item).items() if value is not None and name not in without}


class _PlanReader(ValueReader):
    """Turns JSON into a plan."""

    largest = LARGEST_NUMBER
    KEYS = ("poses", "loads", "sample_interval", "temperature", "noise", "tolerances", "markers", "gravity",
            "encoder_resolution", "seed", "robot", "notes")  # fmt: skip

    def named_numbers(self, value: object, key: str, what: str) -> dict[str, float]:
        named = self.entries(value, key, ())
        if value == {}:
            self.wrong(key, f"is empty; expected {what}")
        return {name: self.number(entry, self.joined(key, name), "m or rad") for name, entry in named.items()}

    def listed(self, values: Mapping[str, Any], key: str, what: str, read: Callable[[Any, str], Any]) -> list[Any]:
        """Return the items of a list that could be read."""
        if key not in values:
            self.wrong(key, "is missing; expected a list")
            return []
        found = [read(entry, f"{key}[{k}]") for k, entry in enumerate(self.items(values[key], key, what))]
        return [item for item in found if item is not None]

    def plan(self, values: dict[str, Any]) -> TestPlan | None:
        """Return the plan, or None after reporting."""
        self.entries(values, "", self.KEYS)
        poses = self.listed(values, "poses", "poses", self.pose)
        count = sum(pose.count if isinstance(pose, RandomPoses) else 1 for pose in poses)
        if count > MAX_POSES:
            self.wrong("poses", f"has {count} poses; expected at most {MAX_POSES}")
        joints = [(k, set(pose.actuators)) for k, pose in enumerate(poses) if isinstance(pose, ActuatorPose)]
        for other in joints[1:]:
            for name in sorted(joints[0][1] ^ other[1]):
                has, lacks = (joints[0], other) if name in joints[0][1] else (other, joints[0])
                message = f"is missing, but poses[{has[0]}] has it; every pose needs the same joints"
                self.wrong(f"poses[{lacks[0]}].actuators.{name}", message)
        # With a wrong pose, nothing is known of how many there are.
        known = None if self.problems else count
        loads = self.listed(values, "loads", "programmes", lambda entry, key: self.load(entry, key, known))
        interval = self.number(values.get("sample_interval", 1.0), "sample_interval", "s", 0.0, above=True)
        resolution = self.number(values.get("encoder_resolution", 0.0), "encoder_resolution", "m or rad", 0.0)
        temperature = self.temperature(values.get("temperature"))
        noise = noise_of(self, self.entries(values.get("noise", {}), "noise", tuple(NOISE_KEYS)))
        tolerances = tolerances_of(self, values.get("tolerances"), "tolerances")
        markers, gravity = self.markers(values.get("markers")), self.gravity(values.get("gravity"))
        seed = self.whole(values.get("seed", 0), "seed", 0)
        samples = _sample_count(loads, count)
        if samples > MAX_SAMPLES:
            self.wrong("loads", f"come to {samples} samples; expected at most {MAX_SAMPLES}")
        robot, notes = self.text(values.get("robot"), "robot"), self.text(values.get("notes"), "notes")
        if self.problems:
            return None
        return TestPlan(
            poses=tuple(poses),
            loads=tuple(loads),
            sample_interval=interval,
            temperature=temperature,
            noise=noise,
            encoder_resolution=resolution,
            seed=seed,
            robot=named_beside(robot, self.problems.path) if robot else robot,
            notes=notes or "",
            tolerances=tolerances,
            markers=markers,
            gravity=gravity,
        )

    def gravity(self, value: object) -> tuple[float, float, float] | None:
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != 3:
            self.wrong("gravity", f"is {json_kind(value)}; expected a list of three numbers [m/s^2], base axes")
            return None
        x, y, z = (self.number(item, f"gravity[{k}]", "m/s^2") for k, item in enumerate(value))
        if np.linalg.norm([x, y, z]) > LARGEST_GRAVITY:
            self.wrong("gravity", f"is larger than {LARGEST_GRAVITY:g} m/s^2: is it in mm/s^2? Expected m/s^2")
        return x, y, z

    def markers(self, value: object) -> tuple[str, ...]:
        names = [] if value is None else self.items(value, "markers", "frames by name")
        for k, name in enumerate(names):
            if not isinstance(name, str) or not name:
                self.wrong(f"markers[{k}]", f"is {json_kind(name)}; expected the name of a frame of the robot")
        return tuple(dict.fromkeys(name for name in names if isinstance(name, str)))

    def temperature(self, value: object) -> float | tuple[float, float] | None:
        if value is None:
            return None
        if not isinstance(value, dict):
            return self.number(value, "temperature", "degrees Celsius")
        ends = self.entries(value, "temperature", ("from", "to"))
        first, last = (self.number(ends.get(end), f"temperature.{end}", "degrees Celsius") for end in ("from", "to"))
        return first, last

    def pose(self, value: object, key: str) -> Poses | None:
        kinds = ("actuators", "at", "random")
        entry = self.entries(value, key, kinds)
        given = [kind for kind in kinds if kind in entry]
        if len(given) != 1:
            if isinstance(value, dict):
                self.wrong(key, f"has {' and '.join(given) or 'none of them'}; expected one of: {', '.join(kinds)}")
            return None
        if given == ["actuators"]:
            return ActuatorPose(self.named_numbers(entry["actuators"], f"{key}.actuators", "positions by joint name"))
        if given == ["at"]:
            return TaskPose(self.named_numbers(entry["at"], f"{key}.at", "values by task coordinate"))
        key = f"{key}.random"
        box = self.entries(entry["random"], key, ("count", "bounds"))
        count = self.whole(box.get("count"), f"{key}.count", 1, MAX_POSES)
        named = self.entries(box.get("bounds"), f"{key}.bounds", ())
        if box.get("bounds") == {}:
            self.wrong(f"{key}.bounds", "is empty; expected [low, high] by task coordinate")
        bounds = {}
        for name, pair in named.items():
            place = self.joined(f"{key}.bounds", name)
            if not isinstance(pair, list) or len(pair) != 2:
                self.wrong(place, f"is {json_kind(pair)}; expected a list [low, high]")
                continue
            low, high = (self.number(end, f"{place}[{k}]", "m or rad", most=MOST_BOUND) for k, end in enumerate(pair))
            if is_number(pair[0]) and is_number(pair[1]) and low > high:
                self.wrong(place, f"goes from {low:g} to {high:g}; expected [low, high]")
            bounds[name] = (low, high)
        return RandomPoses(count, bounds)

    def load(self, value: object, key: str, pose_count: int | None) -> LoadProgramme | None:
        entry = self.entries(value, key, ("cycle", "wrench", "random_directions", "force", "moment", "poses"))
        if not isinstance(value, dict):
            return None
        before = len(self.problems)
        cycle: tuple[float, ...] = FULL_CYCLE
        if "cycle" in entry:
            factors = self.items(entry["cycle"], f"{key}.cycle", "factors")
            cycle = tuple(self.number(factor, f"{key}.cycle[{k}]", "") for k, factor in enumerate(factors))
        poses = None
        if entry.get("poses") is not None:
            indices = self.items(entry["poses"], f"{key}.poses", "indices of poses, from 0")
            last = None if pose_count is None else max(pose_count - 1, 0)
            poses = tuple(self.whole(index, f"{key}.poses[{k}]", 0, last) for k, index in enumerate(indices))
        if ("wrench" in entry) == ("random_directions" in entry):
            both = "both wrench and" if "wrench" in entry else "neither wrench nor"
            self.wrong(key, f"has {both} random_directions; expected one of them")
        wrench, directions, force, moment = None, None, 0.0, 0.0
        if "wrench" in entry:
            components = self.entries(entry["wrench"], f"{key}.wrench", WRENCH_NAMES)
            wrench = {
                name: self.number(component, f"{key}.wrench.{name}", "N" if name.startswith("f") else "N m")
                for name, component in components.items()
                if name in WRENCH_NAMES
            }
            for name in ("force", "moment"):
                if name in entry:
                    self.wrong(f"{key}.{name}", "belongs to random_directions; a wrench has its own size")
        if "random_directions" in entry:
            directions = self.whole(entry["random_directions"], f"{key}.random_directions", 1, MAX_POSES)
            force = self.number(entry.get("force", 0.0), f"{key}.force", "N", 0.0)
            moment = self.number(entry.get("moment", 0.0), f"{key}.moment", "N m", 0.0)
            if "wrench" not in entry and not entry.get("force") and not entry.get("moment"):
                self.wrong(key, "has neither force nor moment; expected a size for its random directions")
        if len(self.problems) > before:
            return None
        return LoadProgramme(cycle, wrench, directions, force, moment, poses)
