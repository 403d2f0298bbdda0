"""The robot: what a user holds. It joins mechanism, kinematics and statics and adds nothing of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .errors import InputError, PrupPinError, RobotFileError, UnreachablePoseError, imported, named, shortened
from .files import plain, write_whole
from .kinematics import ClosedPose, LoopKinematics, Mobility, mobility
from .mechanism import Mechanism
from .mechanism.assumed import assumed
from .mechanism.mjcf_writer import MJCF_ENDINGS, mjcf_of
from .mechanism.readers import read_content
from .mechanism.redrawn import dynamics_of
from .mechanism.writer import urdf_of
from .parameters import Parameter
from .spatial import as_wrench
from .statics import Compliance, StaticsLayout, dimensionless, solve_statics

if TYPE_CHECKING:
    from pandas import DataFrame

    from .compensation import Compensation, Effects, PathLike
    from .design import Design, Target
    from .loaded import Chain, LoadedPose
    from .sensitivity import Sensitivity
    from .sweep import Engines, SweepFile, SweepResult
    from .views.meshcat.view import PoseLike, View
    from .workspace import Workspace

__all__ = ["Robot"]

#: A loaded robot has answered for so many places about home.
_REHEARSALS = 12


class Robot:
    """A robot loaded by `prup_pin.load`. Immutable: changes give a new robot."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism

    def __reduce__(self):
        return Robot, (self.mechanism,)

    @property
    def name(self) -> str:
        return self.mechanism.name

    @property
    def model(self) -> pin.Model:
        """Pinocchio's model of the spanning tree."""
        return self.mechanism.model

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Every parameter by its full name, such as 'leg1/linear_rod.diameter'."""
        return self.mechanism.parameters

    @property
    def task_coordinates(self) -> tuple[str, ...]:
        """Names of the task coordinates, in order; for a plain tree the joints."""
        tasks = tuple(task.name for task in self.mechanism.tasks)
        return tasks or (() if self.mechanism.loops else self.mechanism.actuated)

    @cached_property
    def _kinematics(self) -> LoopKinematics:
        return LoopKinematics(self.mechanism)

    @cached_property
    def _statics(self) -> StaticsLayout:
        layout = StaticsLayout(self.mechanism)
        layout.check_beams(self._kinematics.evaluate(self._kinematics.home).placements)
        return layout

    @cached_property
    def _chain(self) -> Chain:
        from .loaded import chain_of

        return chain_of(self._statics)

    def prepared(self) -> Robot:
        """Return this robot with what its task coordinates need for any pose worked out: the first one costs no more.

        It has answered for places about home by then, so that processors, too, have everything at hand. Other robots
        need little. What a robot cannot do is said when it is asked.
        """
        if self.mechanism.tasks:
            with suppress(PrupPinError):
                about_home = self._kinematics.prepare(_REHEARSALS)
                if self.mechanism.modules:
                    self.compliance(self.home)
                for coordinates in about_home:
                    pose = self.pose(**coordinates)
                    if self.mechanism.modules:
                        answer = self.compliance(pose)
                        _ = answer.parts, answer.K
        return self

    @cached_property
    def _scaling(self) -> np.ndarray:
        """Factors that make C dimensionless, (6, 6)."""
        return dimensionless(self._kinematics.length)

    def pose(self, **coordinates: float) -> ClosedPose:
        """Return the closed pose at task coordinates of the robot file [m, rad].

        A robot without loops and task coordinates takes its joint positions by name. What is not named stays at home;
        a robot with task coordinates has to declare its home for that. Raises InputError for unknown, missing or
        non-finite coordinates, UnreachablePoseError or SingularPoseError with the nearest feasible ones.
        """
        if not self.mechanism.loops and not self.mechanism.tasks:
            return self._kinematics.pose_of_joints(coordinates)
        return self._kinematics.pose(coordinates)

    def pose_from_actuators(
        self, positions: Mapping[str, float] | Sequence[float], near: ClosedPose | None = None
    ) -> ClosedPose:
        """Return the closed pose at actuator positions [m, rad]: by joint, {"leg1_slide": 0.4, …}, or in the order of
        `mechanism.actuated`.

        Of several assembly modes, the one connected to home, or to the pose `near`. A tree also takes a whole
        Pinocchio configuration. Raises like `pose`.
        """
        if near is not None:
            self._check_own(near, like=True)
        return self._kinematics.pose_from_actuators(positions, near)

    def pose_from_configuration(self, q: Sequence[float]) -> ClosedPose:
        """Return the closed pose at a full configuration of Pinocchio's model; it must close the loops to 1e-6."""
        return self._kinematics.pose_from_configuration(q)

    @cached_property
    def home(self) -> ClosedPose:
        """The closed pose at the robot file's home position. Raises UnreachablePoseError, SingularPoseError."""
        return self._kinematics.home_pose()

    @cached_property
    def home_not_closed(self) -> str:
        """Sentence on a home that does not close its loops as the file gives it, and what was taken; '' of others.

        Raises UnreachablePoseError where no home is found.
        """
        return self._kinematics.home_not_closed()

    @property
    def characteristic_length(self) -> float:
        """Length [m] that weighs rotations against translations: RMS distance of the joints from the tool at home."""
        return self._kinematics.length

    def compliance(self, pose: ClosedPose, load=None) -> Compliance:
        """Return C, K and all parts at a pose.

        `load` (6,) is the wrench at which nonlinear modules are linearised; none: at rest. Raises PrupPinError where
        no module is compliant, UnreachablePoseError where a module's equation does not hold at this pose.
        """
        self._check_own(pose)
        wrench = None if load is None else as_wrench(load, "load")
        return Compliance(solve_statics(self._statics, pose, wrench), self._scaling, wrench)

    def _check_own(self, pose: ClosedPose, like: bool = False) -> None:
        """Raise InputError for what is no closed pose of this robot; `like`: of one with its joints will do."""
        if not isinstance(pose, ClosedPose):
            raise InputError(f"expected a closed pose, robot.pose(...) or robot.home; got {shortened(pose)}")
        own, other = self.mechanism, pose.mechanism
        if not (list(own.model.names) == list(other.model.names) if like else other.same_as(own)):
            raise InputError(
                f"this pose belongs to another robot or to other parameters ('{other.name}'); "
                "ask this robot for it: robot.pose(...)"
            )

    def equilibrium(
        self, pose: ClosedPose, wrench, gravity: ArrayLike = False, spread_weight: bool = False
    ) -> LoadedPose:
        """Return the equilibrium in the deformed position under a dead `wrench` (6,) on the tool, base axes [N, N m].

        Actuators hold the positions of `pose`. `gravity`: the robot's weight acts as well, that of each link at its
        centre, under the robot file's gravity (True) or under that given, (3,) [m/s^2], base axes; `spread_weight`:
        that of beams along their length. Raises InputError where the pose belongs to another
        robot, NotConvergedError where no equilibrium is found.
        """
        from .loaded import find_loaded_pose

        self._check_own(pose)
        return find_loaded_pose(self._chain, pose, wrench, self._scaling, gravity, spread_weight)

    def sensitivity(self, pose: ClosedPose, wrench, gravity: ArrayLike = False) -> Sensitivity:
        """Return what each parameter does to the loaded tool and to the compliance, by name, at `equilibrium`.

        Values of modules and what follows from them, lengths, places and directions of joints, and masses where
        `gravity` acts. Raises like `equilibrium` and `compliance`.
        """
        from .sensitivity import sensitivity_of

        return sensitivity_of(self.equilibrium(pose, wrench, gravity), self.characteristic_length)

    @cached_property
    def _engines(self) -> Engines:
        from .sweep import Engines

        return Engines(self.mechanism, self._kinematics)

    def sweep(
        self,
        poses: Any = None,
        *,
        quantities: Sequence[str] = ("C", "K"),
        force: float | None = None,
        moment: float | None = None,
        wrench: ArrayLike | Mapping[str, float] | None = None,
        direction: ArrayLike | str | None = None,
        length: float | None = None,
        draws: int | None = None,
        seed: int = 0,
        compiled: bool = False,
        executor: Executor | None = None,
        out: str | Path | None = None,
        progress: Callable[[int, int], None] | None = None,
        **axes: ArrayLike,
    ) -> SweepResult | SweepFile:
        """Return `quantities` (names: `prup_pin.sweep.QUANTITIES`) at many poses, each with a status.

        Where: task coordinates as numbers, which are fixed, and rising arrays, which span a grid in the order given
        (z=0.3, theta=np.linspace(-.5, .5, 41), phi=…) [m, rad]; or `poses`, an array (N, t) in the order of
        `task_coordinates`, or a list or generator of rows or mappings; or `draws` poses between two ends each,
        theta=(-0.5, 0.5). A robot without task coordinates takes its actuated joints. What is not named stays at a home
        that the robot file declares, as in `pose`.

        `force` [N] and `moment` [N m] are half the sides of the box of wrenches, one alone if the other is zero;
        `wrench` (6,) is a load for shares and buckling; `direction` (3,) in base axes, or "tool z"; `length` [m] makes
        rotations arcs where they are weighed against translations, else the characteristic length.
        `compiled` runs the same equations as machine code (extra: compiled), which pays from some ten thousand poses
        on; without it numpy runs them from 5,000 poses on. An `executor` of concurrent.futures solves parts anywhere;
        the bits are the same. `out` streams everything to a Parquet table, for more poses than memory holds; the same
        call goes on where it was interrupted (extra: tables). `progress(done, poses)` is called now and then. Raises
        InputError for what cannot be meant; a pose that fails gets a status, never an error.
        """
        from .sweep import sweep

        return sweep(
            self.mechanism,
            poses,
            quantities=quantities,
            force=force,
            moment=moment,
            wrench=wrench,
            direction=direction,
            length=length,
            draws=draws,
            seed=seed,
            compiled=compiled,
            executor=executor,
            out=out,
            progress=progress,
            engines=self._engines,
            axes=axes,
        )

    def design(
        self,
        targets: Mapping[str, float] | Target | Sequence[Target],
        free: Sequence[str],
        bounds: Mapping[str, tuple[float, float]] | None = None,
        poses: Any = None,
        costs: Mapping[str, float] | None = None,
        **axes: ArrayLike,
    ) -> Design:
        """Return the lightest robot that meets all targets at all poses: which diameter gives 2 µm/N everywhere?

        targets: {"translation": 2e-6} [m/N] in the worst direction, or Targets (`prup_pin.Target`). free: parameters by
        name; with *, 'leg*/linear_rod.diameter', several that stay alike. bounds: by those names, (low, high); without
        any, from a quarter to four times the present value. Where: as in `sweep`, at home by default. costs: by those
        names, kilograms per unit, added to the mass of the beams. `with_parameters(found.changes)` is the robot.

        Raises InfeasibleDesignError where no design meets the targets, InputError for what cannot be meant.
        """
        from .design import design

        return design(self.mechanism, targets, free, bounds, poses, costs, kinematics=self._kinematics, axes=axes)

    def workspace(
        self,
        resolution: float | Mapping[str, float] = 1 / 64,
        *,
        limits: Mapping[str, tuple[float | None, float | None]] | None = None,
        singularity: float = 0.0,
        progress: Callable[[str, float], None] | None = None,
        **spans: Any,
    ) -> Workspace:
        """Return where the robot can go: the boundary to a resolution, the volume with its error.

        spans: every task coordinate (without any the actuated joints), two ends between which it varies, or a number
        [m, rad]. The limits of the robot file hold. limits: more of them, (low, high) with None for an open end, of
        joints and of lengths of beams by name, * for several: {"leg*_slide": (None, 0.5), "leg*/linear_rod": (0.05,
        None)}. singularity: the least margin, the least by the largest singular value of the dimensionless closure
        Jacobian of the free joints: 0 where locked actuators do not hold the tool. resolution: the size of a cell by
        coordinate, or as a share of all spans; what is smaller than an eighth of a span may be missed.

        Raises InputError, UnknownNameError for what cannot be meant.
        """
        from .workspace import workspace

        return workspace(
            self.mechanism,
            resolution,
            limits=limits,
            singularity=singularity,
            progress=progress,
            kinematics=self._kinematics,
            spans=spans,
        )

    def compensate(
        self,
        path: PathLike,
        wrench: ArrayLike | None = None,
        *,
        effects: Effects = (),
        time: ArrayLike | None = None,
        workers: int = 1,
    ) -> Compensation:
        """Return the commands of the actuators that put the loaded tool where a path wants it.

        What each argument means stands at `prup_pin.compensation.compensate`; that room is loaded only now.
        """
        from .compensation import compensate

        return compensate(self, path, wrench, effects=effects, time=time, workers=workers)

    def mobility(self, pose: ClosedPose) -> Mobility:
        """Return rank, mobility, idle joints and redundant closures at a pose."""
        self._check_own(pose)
        return mobility(self._kinematics, pose)

    def view(
        self,
        pose: PoseLike | Sequence[PoseLike] | None = None,
        wrench=None,
        scale: float | None = None,
        *,
        motion: Literal["load", "mode 1", "mode 2", "mode 3", "mode 4", "mode 5", "mode 6"] | None = None,
        workspace: Sequence[ClosedPose] | None = None,
        index: Callable[[Compliance], float] | None = None,
        compliance: Compliance | None = None,
        ellipsoids: Literal["beside", "tool", "none"] = "beside",
        serve: bool = False,
    ) -> View:
        """Return a view of the robot in meshcat's viewer: `view.save("view.html")`, or a notebook cell's last line.

        pose: a closed pose, or task coordinates such as {"z": 0.4}; none: home. Several make a path that the robot
            follows.
        wrench: (6,) or {"fx": 300}, on the tool, base axes [N, N m]: draws the deflection and each module's share.
        scale: the deflection is drawn this many times larger; none: a round number that shows it.
        motion: 'load' lets the load grow and fall; 'mode 1' (to 6) shows a vibration mode, see `statics.vibration`.
        workspace: poses, drawn as a cloud of dots coloured by `index` (of a Compliance); none: the largest
            translational compliance.
        compliance: that of the pose, where it is not the one at rest: `robot.compliance(pose, load=…)`.
        ellipsoids: 'beside' the robot, at the 'tool', or 'none'.
        serve: serve it on this machine; the address is `view.url`.

        Raises InputError, and what `pose` and `compliance` raise.
        """
        from .views.meshcat.view import view

        return view(
            self,
            pose,
            wrench,
            scale,
            motion=motion,
            workspace=workspace,
            index=index,
            compliance=compliance,
            ellipsoids=ellipsoids,
            serve=serve,
        )

    def with_parameters(self, changes: Mapping[str, Any]) -> Robot:
        """Return the robot with other parameter values: {'leg1/linear_rod.diameter': 0.022}.

        Values that were given for the old value of what changes (an area tabulated for the old diameter) are derived
        anew. Raises UnknownNameError, ParameterError.
        """
        if not isinstance(changes, Mapping):
            raise InputError(
                f"expected values by name, {{'leg1/linear_rod.diameter': 0.022}}; got {shortened(changes)}"
            )
        return self._with(self.mechanism.with_parameters(changes))

    def with_locked_joints(self, names: Iterable[str]) -> Robot:
        """Return the robot with a brake on each named joint: it is locked wherever a pose puts it.

        Kinematics do not change; the joint then carries load along itself, which can make the mechanism
        overconstrained. Raises UnknownNameError.
        """
        each = [names] if isinstance(names, str) else list(names)
        for name in each:
            named("movable joint", name, {joint.name: joint for joint in self.mechanism.joints})
        return self._with(self.mechanism.with_locked_joints(each))

    def with_tool(self, frame: str) -> Robot:
        """Return the robot with another tool frame, on which loads act. Raises UnknownNameError."""
        return Robot(self.mechanism.with_tool(frame))

    def with_held_joints(self, positions: Mapping[str, float]) -> Robot:
        """Return the robot with joints that stand still at these positions [m, rad], as if their links were one.

        What yields at them is gone with them. Raises UnknownNameError, and InputError for a joint of several freedoms
        that is not held at 0.
        """
        return self._with(self.mechanism.with_held_joints(positions)) if positions else self

    def save(self, path: str | Path) -> Path:
        """Write the robot as a URDF that `load` reads as the same robot, and return the file's path.

        A path that ends in .xml or .mjcf becomes an MJCF file, for MuJoCo: what moves and weighs, loops and
        <dynamics>, without shapes and meshes; compliant modules stand where MuJoCo does not look. A corrected model is
        written by `prup_pin.export`.

        A URDF is the file that the robot came from, comments included, with what has been changed since: values,
        lengths, springs, the variant. Meshes are not copied. Raises InputError where joints are locked or held (no
        robot file says so), where a URDF is asked for of a robot that did not come from one, and where the file cannot
        be written or would not be read as this robot.
        """
        path = Path(path).expanduser()
        still = sorted({*self.mechanism.locked, *self.mechanism.description.held})
        if still:
            raise InputError(f"locked or held joints ({', '.join(still)}) have no place in a robot file")
        content = urdf_of(self.mechanism.description) if path.suffix.lower() not in MJCF_ENDINGS else self._as_mjcf()
        try:
            Mechanism(read_content(content, path, self.mechanism.description.package_folders))
        except RobotFileError as error:
            raise InputError(f"'{self.name}' cannot be saved as '{path}': {error}") from error
        write_whole({path: (content.decode("utf-8"),)})
        return path

    def _as_mjcf(self) -> bytes:
        try:
            home = self.home.q
        except UnreachablePoseError:
            home = self.mechanism.home_configuration()
        return mjcf_of(self.mechanism, dynamics_of(self.mechanism.description), home)

    def with_yielding_joints(self, places: Iterable[tuple[str, str]]) -> Robot:
        """Return the robot with modules for joints that yield, by name and way: 'own' or 'across'."""
        return self._with(self.mechanism.with_yielding_joints(places))

    def with_variant(self, name: str) -> Robot:
        """Return a variant that the robot file describes. Raises UnknownNameError."""
        return self._with(self.mechanism.with_variant(name))

    def _with(self, mechanism: Mechanism) -> Robot:
        robot = Robot(mechanism)
        if mechanism.model is self.mechanism.model and "_kinematics" in self.__dict__:
            robot._kinematics = self._kinematics.of(mechanism)  # no length has changed
        return robot

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the model leaves out or takes for granted, in words."""
        notes = [*self.mechanism.description.notes, *self.mechanism.description.doubts]
        kinds = {module.kind.kind for module in self.mechanism.modules}
        if not kinds:
            notes.append("no module is compliant")
        elif kinds == {"joint_spring"}:
            notes.append("only the joints' own springs yield; links, bearings and gears across their axes are rigid")
        notes += assumed(self.mechanism)
        if self.mechanism.locked:
            notes.append(f"locked where they stand: {', '.join(sorted(self.mechanism.locked))}")
        return tuple(notes)

    def to_dict(self) -> dict[str, Any]:
        """Return what the robot file says, as plain numbers and lists, SI: joints, loops, modules, all parameters."""
        mechanism = self.mechanism
        joints = {
            joint.name: {"unit": joint.unit, "actuated": joint.name in mechanism.actuated} for joint in mechanism.joints
        }
        return {
            "robot": self.name,
            "file": str(mechanism.description.path),
            "tool": None if mechanism.tool is None else mechanism.tool.name,
            "gravity": mechanism.gravity.tolist(),
            "task_coordinates": list(self.task_coordinates),
            "joints": joints,
            "locked": sorted(mechanism.locked),
            "loops": {
                loop.name: {"frames": [loop.first.name, loop.second.name], "free": sorted(loop.free)}
                for loop in mechanism.loops
            },
            "modules": {
                module.name: {"kind": module.kind.kind, "leg": module.leg, "joint": mechanism.joint(module.joint).name}
                for module in mechanism.modules
            },
            "parameters": {
                name: {"value": plain(parameter.value), "unit": parameter.unit, "source": parameter.source}
                for name, parameter in self.parameters.items()
            },
            "assumptions": list(self.assumptions),
        }

    def to_dataframe(self) -> DataFrame:
        """Return a pandas table of all parameters, a row for each name: module, kind, value, unit, source.

        Raises MissingExtraError (extra: tables).
        """
        kinds = {module.name: module.kind.kind for module in self.mechanism.modules}
        rows = [
            {
                "parameter": name,
                "module": parameter.owner,
                "kind": kinds.get(parameter.owner, "length"),
                "value": parameter.value,
                "unit": parameter.unit,
                "tolerance": parameter.tolerance,
                "source": parameter.source,
            }
            for name, parameter in self.parameters.items()
        ]
        columns = ["parameter", "module", "kind", "value", "unit", "tolerance", "source"]
        return imported("pandas", "tables").DataFrame(rows, columns=columns).set_index("parameter")

    def _repr_html_(self) -> str:
        from .views.report.cells import robot_html

        return robot_html(self)

    def __repr__(self) -> str:
        m = self.mechanism
        return (
            f"<Robot {m.name}: {m.model.njoints - 1} joints, {len(m.loops)} loops, {len(m.modules)} compliant modules>"
        )


def random_poses(
    robot: Robot, bounds: Mapping[str, tuple[float, float]], count: int, seed: int = 0
) -> list[ClosedPose]:
    """Return `count` feasible poses drawn uniformly from a box of task coordinates; infeasible draws are redrawn.

    Raises InputError where fewer than one draw in a hundred is feasible.
    """
    generator = np.random.default_rng(seed)
    poses: list[ClosedPose] = []
    for _ in range(100 * count):
        if len(poses) == count:
            return poses
        drawn = {name: float(generator.uniform(*span)) for name, span in bounds.items()}
        with suppress(UnreachablePoseError):
            poses.append(robot.pose(**drawn))
    raise InputError(f"only {len(poses)} of {100 * count} poses drawn from {dict(bounds)} are feasible")
