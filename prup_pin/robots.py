"""Finding robots: packaged ones, example-robot-data's, and files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from .errors import InputError, MissingExtraError, PrupPinError, UnknownNameError, folder_holds
from .files import as_path, is_file
from .plugins import Plugin, brought

#: Robots of example-robot-data by the names its users know: folder and file below `robots/`.
EXAMPLE_ROBOTS: Mapping[str, str] = {
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur5_limited": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "ur5_gripper": "ur_description/urdf/ur5_gripper.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "ur10_limited": "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "double_pendulum": "double_pendulum_description/urdf/double_pendulum.urdf",
    "double_pendulum_continuous": "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "double_pendulum_simple": "double_pendulum_description/urdf/double_pendulum_simple.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "finger_edu": "finger_edu_description/robots/finger_edu.urdf",
    "so100": "so_arm_description/urdf/so100.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
}
#: Other names under which example-robot-data itself loads a robot.
_ALIASES: Mapping[str, str] = {
    "talos": "talos_reduced",
    "talos_full": "talos_full_v2",
    "talos_box": "talos_reduced_box",
    "solo8": "solo",
    "anymal_kinova": "anymal-kinova",
    "b1_z1": "b1-z1",
}
#: Where the tool of a well-known arm sits, used when `tool` is not given.
EXAMPLE_TOOLS: Mapping[str, str] = {
    "ur3": "tool0",
    "ur5": "tool0",
    "ur5_limited": "tool0",
    "ur10": "tool0",
    "ur10_limited": "tool0",
    "ur3_gripper": "tool0",
    "ur3_joint_limited": "tool0",
    "ur5_gripper": "tool0",
    "xarm7": "link_eef",
    "panda": "panda_hand_tcp",
    "kinova": "j2s6s200_end_effector",
    "panda_collision": "panda_hand_tcp",
    "z1": "link06",
    "so100": "gripper",
    "so101": "gripper_frame_link",
    "talos_arm": "wrist_left_ft_tool_link",
    "talos": "wrist_left_ft_tool_link",
    "talos_reduced": "wrist_left_ft_tool_link",
    "tiago": "arm_tool_link",
    "tiago_no_hand": "arm_tool_link",
    "finger_edu": "finger_tip_link",
    "TwoDofs": "Tip",
    "double_pendulum": "link2",
    "double_pendulum_continuous": "link2",
    "double_pendulum_simple": "link3",
}


def packaged_folder() -> Path:
    """Return the folder of the robots that come with this package."""
    here = Path(__file__).resolve().parent
    for folder in (here / "urdf", here.parent / "urdf"):  # installed, or a source checkout
        if (folder / "3prup.urdf").is_file():
            return folder
    raise PrupPinError(f"the packaged robots are missing next to {here}; reinstall prup_pin")


def examples_folder() -> Path:
    """Return the folder of the examples: installed with the package, or that of a source checkout."""
    package = Path(__file__).resolve().parent
    for folder in (package / "examples", package.parent / "examples"):
        if (folder / "bench.csv").is_file():
            return folder
    raise PrupPinError(f"the examples are missing next to {package}; reinstall prup_pin")


def example_folder() -> Path | None:
    """Return example-robot-data's folder of robots, or None where it is not installed."""
    try:
        folder = metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except metadata.PackageNotFoundError:
        return None
    path = Path(str(folder))
    return path if path.is_dir() else None


def example_files() -> dict[str, str]:
    """Return every robot of example-robot-data by name: its file below `robots/`.

    Names are those of EXAMPLE_ROBOTS, then those of the files without the ending _robot.
    """
    files = dict(EXAMPLE_ROBOTS)
    examples = example_folder()
    known = set(files.values())
    if examples is None:
        return files
    for path in sorted(examples.rglob("*.urdf")):
        file = path.relative_to(examples).as_posix()
        if file not in known and b"<link" in path.read_bytes():
            files.setdefault(path.stem.removesuffix("_robot").replace(".", "_"), file)
    return files | {alias: files[name] for alias, name in _ALIASES.items() if name in files}


def packaged_names() -> tuple[str, ...]:
    """Return the names of the packaged robots."""
    return tuple(sorted(path.stem for path in packaged_folder().glob("*.urdf")))


def brought_robots() -> tuple[Plugin[Path], ...]:
    """Return the files of robots that are brought along, by name. Raises PluginError."""
    return brought("robots", (*packaged_names(), *EXAMPLE_ROBOTS), _brought)


def _brought(plugin: Plugin[Any]) -> tuple[str, Path]:
    if any(plugin.name.startswith(f"{own}_") for own in packaged_names()):
        raise InputError(f"'{plugin.name}' reads as a variant of a packaged robot; choose another name")
    if not plugin.name or Path(plugin.name).suffix or len(Path(plugin.name).parts) > 1:
        raise InputError(f"'{plugin.name}' is no name of a robot; expected {{'name': 'file.urdf'}}, without an ending")
    if not isinstance(plugin.thing, str | Path) or not is_file(plugin.folder / plugin.thing):
        raise InputError(f"robot '{plugin.name}': {plugin.thing!r} is no file; expected a path, from {plugin.folder}")
    return plugin.name, plugin.folder / plugin.thing


def find(name: str) -> tuple[Path, tuple[Path, ...], str | None]:
    """Return (file, package folders, variant) of a robot given by name or path.

    A name is a packaged robot, '<packaged>_<variant>', one that is brought along, or one of example-robot-data.
    Anything with a folder or an ending is a path. Raises UnknownNameError with the nearest names.
    """
    path = as_path(name)
    if is_file(path / "diagnosis.json"):
        raise InputError(
            f"'{name}' holds a diagnosis; expected a robot. Its page is {path / 'report.html'}; its "
            "corrected_model.json goes to prup-pin predict, and to --model of simulate and compensate"
        )
    if path.suffix or len(path.parts) > 1 or is_file(path):
        return path, (), None
    packaged = packaged_folder()
    for known in sorted(packaged_names(), key=len, reverse=True):
        if name == known or name.startswith(f"{known}_"):
            return packaged / f"{known}.urdf", (), name[len(known) + 1 :] or None
    own = {found.name: found.thing for found in brought_robots()}
    if name in own:
        return own[name], (), None
    examples = example_folder()
    if name in EXAMPLE_ROBOTS:
        if examples is None:
            raise MissingExtraError("example-robot-data", "robots")
        return examples / EXAMPLE_ROBOTS[name], (examples.parents[1], examples.parent), None
    every = example_files()
    if examples is not None and name in every:
        return examples / every[name], (examples.parents[1], examples.parent), None
    if os.path.isdir(path):  # also where a name is longer than any file's
        also = folder_holds(path, ".urdf", ".xml")
        raise InputError(f"'{name}' is a folder; expected a robot file, or a name of `prup-pin robots`.{also}")
    raise UnknownNameError("robot", name, (*packaged_names(), *own, *every), "A path to a file works too.")


def folders(extra: Sequence[str | Path] | str | Path | None) -> tuple[Path, ...]:
    """Return declared package folders as paths."""
    if extra is None:
        return ()
    items: Iterable[str | Path] = (extra,) if isinstance(extra, str | Path) else extra
    try:
        return tuple(as_path(item).resolve() for item in items)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise InputError(f"package_folders: {extra!r}: expected paths of folders ({error})") from error
