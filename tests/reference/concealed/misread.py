"""Logs that are written otherwise than the recording format: what other controllers, sensors and scripts make of it.

Each misreading changes the columns of a table, by its own arithmetic and SciPy's rotations; no code of the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

Table = dict[str, np.ndarray]
WRENCH = ("w.fx", "w.fy", "w.fz", "w.mx", "w.my", "w.mz")


@dataclass(frozen=True)
class Misreading:
    """How a log is written: by its name, and the conventions that say so, to be joined by ' + '."""

    name: str
    said: str
    change: Callable[[Table], Table]


def read(path) -> Table:
    """Return a table's columns."""
    with open(path, encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T, strict=True))


def write(path, table: Mapping[str, np.ndarray]) -> None:
    """Write a table's columns."""
    np.savetxt(path, np.column_stack(list(table.values())), "%.12g", ",", header=",".join(table), comments="")


def _triple(table: Table, prefix: str) -> np.ndarray:
    return np.column_stack([table[f"{prefix}.{axis}"] for axis in "xyz"])


def _with(table: Table, prefix: str, values: np.ndarray) -> Table:
    return table | {f"{prefix}.{axis}": values[:, k] for k, axis in enumerate("xyz")}


def scaled(prefixes: str, factor: float) -> Callable[[Table], Table]:
    """Columns that begin so, times a factor."""
    return lambda table: {
        name: values * factor if any(name.startswith(each) for each in prefixes.split()) else values
        for name, values in table.items()
    }


def only(names, factor: float) -> Callable[[Table], Table]:
    return lambda table: {name: values * factor if name in names else values for name, values in table.items()}


def reordered(kinds: str, joints, order) -> Callable[[Table], Table]:
    """The column of joint k holds what belongs to joint order[k]."""

    def change(table: Table) -> Table:
        out = dict(table)
        for kind in kinds.split():
            for name, other in zip(joints, order, strict=True):
                if f"{kind}.{name}" in table:
                    out[f"{kind}.{name}"] = table[f"{kind}.{other}"]
        return out

    return change


def counted(turns: Mapping[str, int]) -> Callable[[Table], Table]:
    """Angles that count from so many quarter turns elsewhere."""
    return lambda table: {
        name: values + turns.get(name.removeprefix("q."), 0) * np.pi / 2 if name.startswith("q.") else values
        for name, values in table.items()
    }


def coupled(joint: str, other: str, sign: float) -> Callable[[Table], Table]:
    def change(table: Table) -> Table:
        out = dict(table)
        for kind in ("q", "qd"):
            if f"{kind}.{joint}" in table:
                out[f"{kind}.{joint}"] = table[f"{kind}.{joint}"] + sign * table[f"{kind}.{other}"]
        return out

    return change


def turned(how: Callable[[Rotation], np.ndarray]) -> Callable[[Table], Table]:
    return lambda table: _with(table, "r", how(Rotation.from_rotvec(_triple(table, "r"))))


def in_axes(prefix: str, matrix) -> Callable[[Table], Table]:
    turn = np.array(matrix, float)
    sign = np.linalg.det(turn) if prefix == "r" else 1.0
    return lambda table: _with(table, prefix, sign * _triple(table, prefix) @ turn.T)


def wrench(how: Callable[[np.ndarray, np.ndarray, Rotation, np.ndarray], tuple[np.ndarray, np.ndarray]]):
    """how(force, moment, the tool's orientation, its position) -> force, moment."""

    def change(table: Table) -> Table:
        f, m = (np.column_stack([table[name] for name in part]) for part in (WRENCH[:3], WRENCH[3:]))
        f, m = how(f, m, Rotation.from_rotvec(_triple(table, "r")), _triple(table, "p"))
        return table | dict(zip(WRENCH, np.column_stack((f, m)).T, strict=True))

    return change


def after(first, second) -> Callable[[Table], Table]:
    return lambda table: second(first(table))


_QUARTER, _MIRROR = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, -1, 0], [0, 0, 1]]
_CYCLIC = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


def of_poses(joints, slide: bool, tree: bool, turns: bool = True) -> list[Misreading]:
    """Misreadings of a log of poses and loads. slide: whether joints slide; turns: whether the tool does."""
    second, columns = joints[1], ("q.",)
    exchanged = [joints[1], joints[0], *joints[2:]]
    round_about = [*joints[1:], joints[0]]
    unit, word = (1e3, "mm") if slide else (180 / np.pi, "deg")
    point = np.array([0.03, -0.01, 0.11])
    out = [
        Misreading("positions in mm", "p=mm", scaled("p.", 1e3)),
        Misreading("base turned by a quarter", "p=axes:y,-x,z", in_axes("p", _QUARTER)),
        Misreading("base mirrored", "p=axes:x,-y,z", in_axes("p", _MIRROR)),
        Misreading("axes of the base in another order", "p=axes:y,z,x", in_axes("p", _CYCLIC)),
        Misreading("reaction", "wrench=reaction", scaled("w.", -1.0)),
        Misreading("moments in N mm", "moment=N_mm", scaled("w.m", 1e3)),
        Misreading("forces in kN", "force=kN", scaled("w.f", 1e-3)),
        Misreading("forces in kgf", "force=kgf", scaled("w.f", 1 / 9.80665)),
        Misreading("moments about a sensor's point", "wrench=about:0.03,-0.01,0.11",
                   wrench(lambda f, m, r, p: (f, m - np.cross(r.apply(point), f)))),
        Misreading("moments about the base's origin", "wrench=about_base",
                   wrench(lambda f, m, r, p: (f, m + np.cross(p, f)))),
        Misreading("all joints reversed", "q=reversed", scaled(*columns, -1.0)),
        Misreading("one joint reversed", f"q.{second}=reversed", only([f"q.{second}"], -1.0)),
        Misreading(f"all joints in {word}", f"q={word}", scaled(*columns, unit)),
        Misreading(f"one joint in {word}", f"q.{second}={word}", only([f"q.{second}"], unit)),
        Misreading("two joints exchanged", f"q=order:{','.join(exchanged)}", reordered("q", joints, exchanged)),
        Misreading("joints round about", f"q=order:{','.join(round_about)}", reordered("q", joints, round_about)),
    ]  # fmt: skip
    if turns:
        out += [
            Misreading("rotation in deg", "r=deg", scaled("r.", 180 / np.pi)),
            Misreading("inverse rotation", "r=inverse", scaled("r.", -1.0)),
            Misreading("angles about fixed x y z", "r=euler_xyz", turned(lambda r: r.as_euler("xyz"))),
            Misreading("angles about turned X Y Z", "r=euler_XYZ", turned(lambda r: r.as_euler("XYZ"))),
            Misreading("yaw, pitch, roll in deg", "r=euler_ZYX_deg", turned(lambda r: r.as_euler("ZYX", degrees=True))),
            Misreading("vector part of a quaternion", "r=quaternion", turned(lambda r: r.as_quat(canonical=True)[:, :3])),  # noqa: E501
            Misreading("w x y z taken for x y z w", "r=wxyz_as_xyzw",
                       turned(lambda r: Rotation.from_quat(np.roll(r.as_quat(), 1, axis=1)).as_rotvec())),
            Misreading("wrench in the tool's axes", "wrench=tool_frame",
                       wrench(lambda f, m, r, p: (r.inv().apply(f), r.inv().apply(m)))),
            Misreading("mm, and inverse rotation", "p=mm + r=inverse", after(scaled("p.", 1e3), scaled("r.", -1.0))),
            Misreading("reaction in the tool's axes", "wrench=reaction + wrench=tool_frame",
                       wrench(lambda f, m, r, p: (-r.inv().apply(f), -r.inv().apply(m)))),
            Misreading("degrees of rotation, and reaction", "r=deg + wrench=reaction",
                       after(scaled("r.", 180 / np.pi), scaled("w.", -1.0))),
        ]  # fmt: skip
    if tree:
        out += [
            Misreading("axis against the horizon", f"q.{joints[2]}=plus:{joints[1]}",
                       coupled(joints[2], joints[1], 1.0)),
            Misreading("zeros of another table", f"q.{joints[1]}=quarter_turns:1 + q.{joints[2]}=quarter_turns:3",
                       counted({joints[1]: 1, joints[2]: 3})),
        ]  # fmt: skip
    return out


def of_efforts(joints) -> list[Misreading]:
    """Misreadings of a log of an arm in motion: positions, perhaps speeds, and efforts."""
    both, second, third = "q. qd.", joints[1], joints[2]
    exchanged = [joints[0], joints[2], joints[1], *joints[3:]]
    opposite = list(reversed(joints))
    q = [f"{kind}.{third}" for kind in ("q", "qd")]
    gains = {
        f"tau.{name}": gain for name, gain in zip(joints, (0.083, 0.08, 0.11, 0.14, 0.12, 0.15, 0.13), strict=False)
    }

    def each(table: Table) -> Table:
        return {name: values * gains.get(name, 1.0) for name, values in table.items()}

    return [
        Misreading("all efforts reversed", "tau=reversed", scaled("tau.", -1.0)),
        Misreading("all positions reversed", "q=reversed", scaled(both, -1.0)),
        Misreading("all joints the other way round", "q=reversed + tau=reversed", scaled(f"{both} tau.", -1.0)),
        Misreading("one effort reversed", f"tau.{third}=reversed", only([f"tau.{third}"], -1.0)),
        Misreading("two efforts reversed", f"tau.{second}=reversed + tau.{third}=reversed",
                   only([f"tau.{second}", f"tau.{third}"], -1.0)),
        Misreading("one position reversed", f"q.{third}=reversed", only(q, -1.0)),
        Misreading("one joint the other way round", f"q.{third}=reversed + tau.{third}=reversed",
                   only([*q, f"tau.{third}"], -1.0)),
        Misreading("positions in deg", "q=deg", scaled(both, 180 / np.pi)),
        Misreading("one position in deg", f"q.{third}=deg", only(q, 180 / np.pi)),
        Misreading("positions in revolutions", "q=revolutions", scaled(both, 1 / (2 * np.pi))),
        Misreading("efforts in N mm", "tau=N_mm", scaled("tau.", 1e3)),
        Misreading("efforts in kgf m", "tau=kgf_m", scaled("tau.", 1 / 9.80665)),
        Misreading("efforts in A, drives alike", "tau=gain:0.09", scaled("tau.", 0.09)),
        Misreading("efforts in per cent, drives alike", "tau=gain:0.55", scaled("tau.", 0.55)),
        Misreading("efforts in A, drives of three sizes", "tau=gain each", each),
        Misreading("motor's side of gears of 100", "q=gear:100 + tau=gear:100",
                   after(scaled(both, 100.0), scaled("tau.", 0.01))),
        Misreading("two efforts exchanged", f"tau=order:{','.join(exchanged)}", reordered("tau", joints, exchanged)),
        Misreading("two positions exchanged", f"q=order:{','.join(exchanged)}", reordered("q qd", joints, exchanged)),
        Misreading("columns in the opposite order",
                   f"q=order:{','.join(opposite)} + tau=order:{','.join(opposite)}",
                   reordered("q qd tau", joints, opposite)),
        Misreading("axis against the horizon", f"q.{third}=plus:{second}", coupled(third, second, 1.0)),
        Misreading("one zero a quarter turn on", f"q.{third}=quarter_turns:1", counted({third: 1})),
        Misreading("zeros of another table", f"q.{second}=quarter_turns:1 + q.{third}=quarter_turns:3",
                   counted({second: 1, third: 3})),
        Misreading("time in ms", "time=ms", only(["time"], 1e3)),
        Misreading("time in us", "time=us", only(["time"], 1e6)),
        Misreading("deg, and efforts reversed", "q=deg + tau=reversed",
                   after(scaled(both, 180 / np.pi), scaled("tau.", -1.0))),
    ]  # fmt: skip
