"""The contracts of what can be added, for the tests of packages and files that bring their own.

Each function returns nothing, or raises AssertionError with a sentence that says who breaks what. The package's own
laws and modules are held to the same checks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

from numpy.typing import ArrayLike

from ..imports.log import Log
from ..laws import Law
from ..laws.efforts import EffortLaw
from ..loading import load
from ..modules import CompliantModule
from ..robot import Robot
from ..robots import examples_folder
from . import efforts, modules, poses, readers, words
from .contract import require, title

__all__ = ["check_law", "check_module", "check_reader"]


def check_law(
    law: Law | type[Law],
    robot: str | Path | Robot | None = None,
    *,
    actuators: ArrayLike | None = None,
    closed_form: Callable[..., Any] | None = None,
) -> None:
    """Raise AssertionError where a law, of poses or of efforts, breaks its contract: docs/add_a_law.md.

    robot: one that has a place for it; by default the 3-PRUP for poses, an arm of six joints for efforts, which must be
    a tree. actuators: the poses (n, k) [m, rad] in which a law of poses is tried; by default home and a bit beside.
    closed_form: of efforts, the equation written a second time, efforts (N, k) of (law, place, values, at).
    """
    law = law() if isinstance(law, type) else law
    words.check_declared(law)
    if robot is None:
        robot = load(examples_folder() / "elastic_arm.urdf" if law.of_efforts else "3prup")
    elif not isinstance(robot, Robot):
        robot = load(robot)
    if law.of_efforts:
        _check_efforts(cast(EffortLaw, law), robot, closed_form)
    else:
        _check_poses(law, robot, actuators)


def _check_poses(law: Law, robot: Robot, actuators: ArrayLike | None) -> None:
    mechanism = robot.mechanism
    places = poses.unlike(law.places(mechanism), mechanism)
    require(places, f"{title(law)} has no place on '{mechanism.name}': give check_law a robot that has one.")
    bench = poses.PoseBench.of(robot, actuators, law)
    for place in places:
        poses.check_quantities(bench, law, place)
        start = law.starts(place, mechanism)[0]
        words.check_advice(law, place, start)
        words.check_statement(law, place, start, mechanism)
        words.check_small_sizes(law, place, mechanism)
        poses.check_neutral(bench, law, place)
        poses.check_leaves_alone(bench, law, place)
        poses.check_derivatives(bench, law, place)
    strongest = max(places, key=lambda place: poses.size_at_start(bench, law, place))
    poses.check_shows(bench, law, strongest)
    poses.check_refit(bench, law, strongest)
    poses.check_interval(bench, law, strongest)


def _check_efforts(law: EffortLaw, robot: Robot, closed_form: Callable[..., Any] | None) -> None:
    at = efforts.in_motion(robot)
    place, values = efforts.somewhere(law, at)
    given = law, place, values, at
    for check in efforts.CHECKS:
        check(*given)
    if closed_form is not None:
        efforts.check_closed_form(*given, closed_form)
    recording, seen = efforts.recorded(at, robot)
    efforts.check_simulated(law, *efforts.somewhere(law, seen), robot, recording, seen)
    some = efforts.fitted(law, place, [0.5] * len(law.linear), values)
    words.check_advice(law, place, some)
    words.check_statement(law, place, some, robot.mechanism)


def check_module(
    kind: CompliantModule | type[CompliantModule], first: Mapping[str, Any], second: Mapping[str, Any]
) -> None:
    """Raise AssertionError where a kind of module breaks its contract: docs/add_a_module.md.

    first, second: values of two different valid modules by parameter, as a robot file would give them.
    """
    kind = kind() if isinstance(kind, type) else kind
    modules.check_declared(kind)
    values = modules.stacked(kind, first, second)
    for check in modules.CHECKS:
        check(kind, values)


def check_reader(read: Callable[[Path], Log], path: str | Path) -> None:
    """Raise AssertionError where a reader of logs breaks its contract: docs/add_a_log_format.md.

    path: a file of the format; copies of it are damaged in a folder of their own.
    """
    readers.check_log(read, Path(path))
    readers.check_damaged(read, Path(path))
