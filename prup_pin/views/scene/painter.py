"""Draws poses of a robot as scenes: its bodies as they are and as they bend, loads, frames, ellipsoids, shares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...mechanism import Module
from ...numbers import number, quantity, readable_unit
from ...robot import Robot
from ...spatial import Array, as_wrench, axis_as_z, placement, rotation_exp, wrench_text
from ...statics import Compliance
from ..text.answer import first_shares
from ..text.values import pose_words
from .camera import camera_of
from .colours import AXES, ELLIPSOIDS, GHOST, INK, LOAD, METAL, MOVED, SYMBOL, grey_of, map_colour, share_colours
from .elastic import SECTIONS, Deflections, beam_frame, fitting_scale, nice_below, principal, tips_apart
from .scene import (
    ComplianceEllipsoid,
    Label,
    Legend,
    Lines,
    Mesh,
    Part,
    Row,
    Scene,
    Shape,
    Solid,
    Tube,
    ball,
    box_mesh,
    outline,
    rod,
)
from .skeleton import Segment, skeleton
from .symbols import symbols
from .visuals import Visual, visuals

#: Parts of a scene, and the words beside them.
Signs = tuple[list[Part], list[Label]]
#: Diagonal blocks of C: which rows, their unit, what an ellipsoid of each shows.
_BLOCKS = {
    "translation": (slice(0, 3), "m/N", "displacement by 1 N", "in every direction"),
    "rotation": (slice(3, 6), "rad/(N m)", "rotation by 1 N m", "about every axis"),
}
#: What the signs of a load mean.
_LOADED = (
    Row(GHOST, "see-through: without load", sign="ghost"),
    Row(LOAD, "load on the tool", sign="line"),
    Row(MOVED, "displacement of the tool", sign="line"),
)
#: How far a deflection may be drawn at most, in sizes of the robot, or rotated [rad].
_FARTHEST = 100.0


class Painter:
    """Draws poses of one robot: reads its geometry once, keeps eye and sizes the same for all poses."""

    def __init__(self, robot: Robot, pose: ClosedPose):
        mechanism = robot.mechanism
        self.robot = robot
        self.visuals, self.notes = visuals(mechanism)
        self.links = {name: mechanism.frame(name) for name in self.visuals}
        self.drawn_bodies = {frame.joint for frame in self.links.values()}
        self.base_links = sum(frame.joint == 0 for frame in self.links.values())
        self.beams = [module for module in mechanism.modules if module.kind.spans_frames]
        # a link that is a beam's body bends with it
        self.beam_of_link = self._bending_links()
        drawn = {module.name for module in self.beam_of_link.values()}
        self.bare_beams = [module for module in self.beams if module.name not in drawn]
        bones = skeleton(pose)
        self.size = bones.size
        self.middle = (bones.points.min(axis=0) + bones.points.max(axis=0)) / 2
        camera = camera_of(robot, pose)
        self.up, self.viewer, self.page = camera.up, camera.viewer, camera.plane
        still = [outline(part) for part in self.bodies(pose, None, 0.0, "robot", None)]
        points = np.concatenate([*still, bones.points])
        self.flat = points @ self.page.T
        self.bottom = float((points @ self.up).min())

    def _bending_links(self) -> dict[str, Module]:
        """Return the beam by which a link bends: the one whose body it is, or whose two ends it carries."""
        found: dict[str, Module] = {}
        for module in self.beams:
            root, body = module.root, module.frame.joint
            alone = sum(other.frame.joint == body for other in self.beams) == 1
            if root is not None and root.joint == body and body and alone:
                found |= {link: module for link, frame in self.links.items() if frame.joint == body}
        return found | {module.body: module for module in self.beams if module.body in self.visuals}

    @cached_property
    def ring_radii(self) -> dict[str, float]:
        """Radius [m] of the ring that clears the robot's own geometry around each turning joint that has a spring."""
        radii: dict[str, float] = {}
        model = self.robot.model
        meshes: dict[int, list[Array]] = {}
        for link, shapes in self.visuals.items():
            frame = self.links[link]
            for visual in shapes:
                if isinstance(visual.shape, Mesh):
                    at = frame.placement @ visual.placement
                    points = visual.shape.vertices @ at[:3, :3].T + at[:3, 3]
                    meshes.setdefault(frame.joint, []).append(points)
        for module in self.robot.mechanism.modules:
            joint = module.joint
            if module.kind.spans_frames or model.joints[joint].nv != 1 or joint not in meshes:
                continue
            axis = self.robot.mechanism.joint(joint).axis
            points = np.concatenate(meshes[joint])
            along = points @ axis
            across = np.linalg.norm(points - along[:, None] * axis, axis=1)
            near = (np.abs(along) < 0.05 * self.size) & (across < 0.12 * self.size)
            if near.any():
                radii[module.name] = float(across[near].max()) + 0.004 * self.size
        return radii

    # -- the robot -------------------------------------------------------------------------------------------------

    def bodies(
        self,
        pose: ClosedPose,
        moved: Deflections | None,
        scale: float,
        path: str,
        colours: Mapping[str, str] | None,
        ghost: bool = False,
    ) -> list[Part]:
        """Return all bodies; `colours` by module (None: own colours); the base is left out of ghosts."""
        parts: list[Part] = []

        def put(name: str, shape: Shape, at: Array, colour: str, opacity: float = 1.0) -> None:
            if ghost:
                colour, opacity = GHOST, 0.26 * opacity
            parts.append(Part(f"{path}/{name}", shape, at, colour, opacity))

        for link, shapes in self.visuals.items():
            frame = self.links[link]
            if ghost and frame.joint == 0:
                continue
            beam = self.beam_of_link.get(link)
            folder = f"links/{link}"
            if frame.joint == 0:
                folder = "base" if self.base_links == 1 else f"base/{link}"
            for index, visual in enumerate(shapes):
                name = folder if len(shapes) == 1 else f"{folder}/{index + 1}"
                seat = frame.at(pose.placements)
                at = seat @ visual.placement
                colour = visual.colour if colours is None else grey_of(visual.colour)
                if beam is not None:
                    name = f"beams/{beam.name}" + ("" if len(shapes) == 1 else f"/{index + 1}")
                    shape, where = self._bent(beam, pose, moved, scale, visual, at)
                    put(name, shape, where, colour if colours is None else colours[beam.name], visual.opacity)
                else:
                    there = seat if moved is None else moved.place(frame.joint, seat, scale)
                    put(name, visual.shape, there @ visual.placement, colour, visual.opacity)
        for module in self.bare_beams:
            frame_, length = beam_frame(module, pose)
            visual = Visual(rod(self._beam_radius(module), length), np.eye(4), METAL)
            middle = frame_ @ placement(np.eye(3), np.array([0, 0, length / 2]))
            shape, where = self._bent(module, pose, moved, scale, visual, middle)
            put(f"beams/{module.name}", shape, where, visual.colour if colours is None else colours[module.name])
        self._skeleton(pose, moved, scale, put, ghost)
        return parts

    def _beam_radius(self, module: Module) -> float:
        largest = {key: float(np.max(module.values.get(key, np.nan))) for key in ("diameter", "root_diameter", "area")}
        halves = (largest["diameter"] / 2, largest["root_diameter"] / 2, float(np.sqrt(largest["area"] / np.pi)))
        return next(filter(np.isfinite, halves), 0.012 * self.size)

    def _bent(
        self, beam: Module, pose: ClosedPose, moved: Deflections | None, scale: float, visual: Visual, at: Array
    ) -> tuple[Shape, Array]:
        """Return a beam's own geometry bent along its elastic line, and where it stands."""
        shape = visual.shape
        if moved is None:
            return shape, at
        frame, length = beam_frame(beam, pose)
        own, line = np.linalg.inv(frame) @ at, moved.bent(beam, pose, scale, stretched=beam in self.bare_beams)
        if isinstance(shape, Solid) and shape.kind == "cylinder" and abs(own[2, 2]) > 1 - 1e-6:
            low, high = own[2, 3] - shape.size[2] / 2, own[2, 3] + shape.size[2] / 2
            stations = np.clip(np.concatenate(([low], np.linspace(0, length, SECTIONS), [high])), low, high)
            points = np.column_stack((np.tile(own[:2, 3], (len(stations), 1)), stations))
            return Tube(points + line.displacement(points), shape.size[0] / 2), frame
        if isinstance(shape, Solid) and shape.kind == "box":
            shape = box_mesh(shape.size, int(np.argmax(np.abs(own[2, :3]))), SECTIONS)
        if isinstance(shape, Mesh):
            points = shape.vertices @ own[:3, :3].T + own[:3, 3]
            return Mesh(points + line.displacement(points), shape.faces, shape.smooth), frame
        centre = own[:3, 3]
        turned = rotation_exp(line.rotation(centre[None])[0]) @ own[:3, :3]
        return shape, frame @ placement(turned, centre + line.displacement(centre[None])[0])

    def _skeleton(self, pose: ClosedPose, moved: Deflections | None, scale: float, put, ghost: bool) -> None:
        """Draw lines between the joints of every body that has no geometry of its own."""
        bones = skeleton(pose)
        radius = 0.011 * self.size

        def there(body: int, point: Array) -> Array:
            return point if moved is None else point + moved.shift(body, point, scale)

        def bare(segment: Segment) -> bool:
            return segment.kind != "beam" and not self.drawn_bodies & set(segment.bodies)

        for index, segment in enumerate(filter(bare, bones.segments)):
            if ghost and segment.bodies == (0, 0):
                continue
            ends = [there(b, p) for b, p in zip(segment.bodies, (segment.start, segment.end), strict=True)]
            if np.linalg.norm(ends[1] - ends[0]) > 1e-9:
                thin = 0.6 if segment.kind == "slide" else 1.0
                tube = Tube(np.array(ends), thin * radius)
                put(f"skeleton/{segment.name}_{index + 1}", tube, np.eye(4), METAL)
        base = [] if ghost or 0 in self.drawn_bodies else [plate.corners for plate in bones.plates if plate.body == 0]
        for corners in base:
            middle = corners.mean(axis=0)
            for index, corner in enumerate(corners, 1):
                if np.linalg.norm(corner - middle) > 1e-9:
                    put(f"skeleton/base_{index}", Tube(np.array([middle, corner]), radius), np.eye(4), "#5b636d")
        sprung = {module.joint for module in pose.mechanism.modules}
        for joint in bones.joints:
            if joint.body in self.drawn_bodies or ghost:
                continue
            index = pose.mechanism.joint_id(joint.name)
            if index in self.drawn_bodies or index in sprung:
                continue
            at = placement(np.eye(3), there(joint.body, joint.at))
            put(f"skeleton/joints/{joint.name}", ball(1.7 * radius), at, "#4a5058")

    # -- the scene -------------------------------------------------------------------------------------------------

    def scene(
        self,
        pose: ClosedPose,
        compliance: Compliance | None,
        wrench: Array | None = None,
        scale: float | None = None,
        *,
        moved: Deflections | None = None,
        factor: float = 1.0,
        ellipsoids: str = "beside",
        headline: Sequence[str] = (),
    ) -> Scene:
        """Return the scene of a pose; the deflection is drawn `factor * scale` times larger, the load `factor` times.

        A `headline` takes the place of what is told of the load, which is not drawn: it stands for something else.
        """
        shares: dict[str, float] = {}
        if wrench is None or compliance is None or not wrench.any():
            wrench = moved = scale = None
        else:
            moved = moved or Deflections(compliance, wrench)
            metres, radians = moved.largest()
            far = max(metres / float(self.size), radians)
            if scale is not None and scale * far > _FARTHEST:
                raise InputError(
                    f"the deflection of {quantity(metres, 'm')} cannot be drawn {number(scale, 3)} times larger: it "
                    f"would leave the picture. Expected at most {number(nice_below(_FARTHEST / far), 3)}"
                )
            scale = fitting_scale(moved, self.size) if scale is None else scale
            with suppress(InputError):  # nothing deflects
                shares = compliance.shares(wrench)
        colours, top = share_colours(shares)
        drawn = (scale or 0.0) * factor
        end = pose.mechanism.tip
        tool = there = pose.placement(end.name)
        if moved is None:
            parts = self.bodies(pose, None, 0.0, "robot", None)
        else:
            there = moved.place(end.joint, tool, drawn)
            parts = [
                replace(part, path=part.path.replace("robot/deformed/base", "robot/base", 1))
                for part in self.bodies(pose, moved, drawn, "robot/deformed", colours or None)
            ]
            parts += self.bodies(pose, None, 0.0, "robot/ghost", None, ghost=True)
        for symbol in symbols(pose, self.size, self.middle, self.ring_radii):
            at = symbol.placement if moved is None else moved.place(symbol.body, symbol.placement, drawn)
            colour = symbol.colour if symbol.module is None else colours.get(symbol.module, SYMBOL)
            folder = "modules" if symbol.module is not None else "drives"
            parts.append(Part(f"{folder}/{symbol.name}", symbol.shape, at, colour))
        signs = [self._triad("base", np.eye(4))]
        if pose.mechanism.tool is not None:
            signs.append(self._triad("tool", there))
        if wrench is not None and moved is not None and not headline:
            signs += [self._wrench(there, wrench, factor), self._deflection(tool, there, moved, factor)]
        balls: dict[str, ComplianceEllipsoid] = {}
        if compliance is not None and ellipsoids != "none":
            balls, found = self._ellipsoids(compliance, there, ellipsoids)
            signs.append(found)
        labels = [label for _, found in signs for label in found]
        labels += [Label("labels", leg, at, self.middle, INK, True) for leg, at in skeleton(pose).legs.items()]
        parts += [part for found, _ in signs for part in found]
        parts.append(self.floor)
        legend = self._legend(pose, wrench, moved, scale, shares, top, balls, headline)
        return Scene(
            self.robot.name, tuple(parts), tuple(labels), legend, self.up, self.viewer, balls, float(scale or 0.0)
        )

    # -- signs -----------------------------------------------------------------------------------------------------

    def _triad(self, name: str, at: Array) -> Signs:
        """Draw the axes of a frame with their letters."""
        parts, path, origin = [], f"frames/{name}", at[:3, 3]
        away = origin + 0.05 * self.size * at[:3, :3].sum(axis=1)
        labels = [Label(path, name, origin, away)]
        for index, (letter, colour) in enumerate(zip("xyz", AXES, strict=True)):
            frame = at @ placement(axis_as_z(np.eye(3)[index]), np.zeros(3))
            parts += _arrow(f"{path}/{letter}", frame, 0.11 * self.size, 0.0042 * self.size, colour, True)
            labels.insert(index, Label(path, letter, origin + 0.118 * self.size * at[:3, index], origin, colour))
        return parts, labels

    def _wrench(self, at: Array, wrench: Array, factor: float) -> Signs:
        parts: list[Part] = []
        labels: list[Label] = []
        force, moment = np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:])
        origin, size = at[:3, 3], self.size
        if force > 0:
            frame = placement(axis_as_z(wrench[:3] / force), origin)
            length = 0.3 * size * max(factor, 0.02)
            parts += _arrow("wrench/force", frame, length, 0.0105 * size, LOAD)
            tip = origin + length * frame[:3, 2]
            labels.append(Label("wrench/force", f"{number(factor * force, 4)} N", tip, origin, LOAD, True))
        if moment > 0:
            frame = placement(axis_as_z(wrench[3:] / moment), origin)
            # the gap of the arc faces away from the eye
            to_eye = np.arctan2(frame[:3, 1] @ self.viewer, frame[:3, 0] @ self.viewer)
            angle = to_eye + np.linspace(-0.5, 0.5, 49) * np.radians(280) * factor
            points = 0.115 * size * np.column_stack((np.cos(angle), np.sin(angle), np.zeros(49)))
            tangent = np.array([-np.sin(angle[-1]), np.cos(angle[-1]), 0.0])
            head = frame @ placement(axis_as_z(tangent), points[-1] + 0.03 * size * tangent)
            cone = Solid("cone", (0.052 * size, 0.052 * size, 0.06 * size))
            parts.append(Part("wrench/moment/arc", Tube(points, 0.0085 * size, 12), frame, LOAD))
            parts.append(Part("wrench/moment/head", cone, head, LOAD))
            parts.append(Part("wrench/moment/axis", rod(0.003 * size, 0.3 * size), frame, LOAD))
            middle = (frame @ np.append(points[24], 1.0))[:3]
            labels.append(Label("wrench/moment", f"{number(factor * moment, 4)} N m", middle, origin, LOAD, True))
        return parts, labels

    def _deflection(self, tool: Array, there: Array, moved: Deflections, factor: float) -> Signs:
        start, end = tool[:3, 3], there[:3, 3]
        length = float(np.linalg.norm(end - start))
        if length < 1e-6 * self.size:
            return [], []
        frame = placement(axis_as_z(end - start), start)
        parts = _arrow("deflection", frame, length, 0.006 * self.size, MOVED, True)
        text = quantity(factor * float(np.linalg.norm(moved.tool[:3])), "m")
        parts.append(Part("deflection/start", ball(0.011 * self.size), tool, MOVED, on_top=True))
        return parts, [Label("deflection", text, start + 0.5 * (end - start), start - self.up, MOVED, True)]

    def _ellipsoids(
        self, compliance: Compliance, there: Array, where: str
    ) -> tuple[dict[str, ComplianceEllipsoid], Signs]:
        """Draw the ellipsoids of both blocks of C, beside the robot as seen by the eye, or at the tool."""
        if where not in ("beside", "tool"):
            raise InputError(f"ellipsoids: expected 'beside', 'tool' or 'none'; got '{where}'")
        size = self.size
        largest = 0.17 * size
        low, high = self.flat.min(axis=0), self.flat.max(axis=0)
        found: dict[str, ComplianceEllipsoid] = {}
        parts: list[Part] = []
        labels: list[Label] = []
        for index, (name, (block, unit, words, _)) in enumerate(_BLOCKS.items()):
            values, vectors = principal(compliance, block)
            lever = (size, 1 / size)[index]
            other = float(np.trace(compliance.C[3:, 3:] if index == 0 else compliance.C[:3, :3]))
            if values[0] <= 1e-12 * other * lever**2:  # rigid but for rounding
                continue
            # signs: every axis to the right on the page, the last one right-handed
            vectors[:, :2] *= np.where(self.page[0] @ vectors[:, :2] < 0, -1, 1)
            vectors[:, 2] = np.cross(vectors[:, 0], vectors[:, 1])
            centre = there[:3, 3]
            if where == "beside":
                height = (low[1] + high[1]) / 2 + (0.26 - 0.52 * index) * size
                flat = np.array([high[0] + 0.3 * size, height, self.viewer @ self.middle])
                centre = flat @ [*self.page, self.viewer]
            scale = largest / values[0]
            found[name] = ComplianceEllipsoid(values, vectors, centre, scale)
            semi = np.maximum(values * scale, 1e-3 * largest)
            colour, path = ELLIPSOIDS[name], f"ellipsoids/{name}"
            ball_ = Solid("ball", tuple((2 * semi).tolist()))
            parts.append(Part(f"{path}/surface", ball_, placement(vectors, centre), colour, 0.5))
            drawn = values > 1e-9 * values[0]
            ends = tips_apart(self.page @ vectors * semi, drawn)
            for axis, along in enumerate(vectors.T):
                bar = rod(0.0035 * size, 2 * values[axis] * scale + 0.02 * size)
                parts.append(Part(f"{path}/axis_{axis + 1}", bar, placement(axis_as_z(along), centre), MOVED))
                if drawn[axis]:
                    tip = centre + ends[axis] * along * (semi[axis] + 0.01 * size)
                    labels.append(Label(path, quantity(values[axis], unit), tip, centre, colour))
            reach = float(np.linalg.norm(self.page[1] @ vectors * semi))
            top = centre + (reach + 0.075 * size) * self.page[1]
            labels.append(Label(path, words, top, top - self.page[1] * size, colour, True))
        return found, (parts, labels)

    @cached_property
    def floor(self) -> Part:
        """A grid under the robot, with cells of a round length."""
        centre = self.middle + (self.bottom - self.middle @ self.up) * self.up
        cell = nice_below(0.2 * self.size)
        right = self.page[0]
        ahead = np.cross(self.up, right)
        reach = cell * np.ceil(0.75 * self.size / cell)
        ticks = np.arange(-reach, reach + cell / 2, cell)
        lines = [(a * right - reach * ahead, a * right + reach * ahead) for a in ticks]
        lines += [(a * ahead - reach * right, a * ahead + reach * right) for a in ticks]
        return Part("floor/grid", Lines(np.array(lines)), placement(np.eye(3), centre), "#d7dce2")

    # -- words -----------------------------------------------------------------------------------------------------

    def _legend(
        self,
        pose: ClosedPose,
        wrench: Array | None,
        moved: Deflections | None,
        scale: float | None,
        shares: Mapping[str, float],
        top: float,
        balls: Mapping[str, ComplianceEllipsoid],
        headline: Sequence[str],
    ) -> Legend:
        lines = list(headline) or [pose_words(self.robot, pose)]
        rows: list[Row] = []
        signs: list[Row] = []
        if wrench is not None and moved is not None:
            metres, angle = (float(np.linalg.norm(moved.tool[block])) for block in (slice(0, 3), slice(3, 6)))
            turned = "does not turn" if angle * self.size < 1e-9 * metres else f"turns {quantity(angle, 'rad')}"
            if not headline:
                drawn = f"; drawn {number(scale, 3)} times larger" if scale else ""
                lines.append(f"Load on the tool: {wrench_text(wrench)}")
                lines.append(f"The tool moves {quantity(metres, 'm')} and {turned}{drawn}")
            for name, share in first_shares(shares, 6) if top else ():
                colour = map_colour(share / top) if name in shares else ""
                rows.append(Row(colour, name, f"{100 * share:.1f} %"))
            signs += _LOADED[:1] if headline else _LOADED
        elif any(not module.kind.spans_frames for module in pose.mechanism.modules):
            signs.append(Row(SYMBOL, "drives, bearings and springs, as symbols"))
        for name, (_, si, words, around) in _BLOCKS.items():
            if name in balls:
                values = balls[name].values
                unit, factor = readable_unit(values[0], si)
                ends = [number(value * factor, 3) for value in values if value > 1e-9 * values[0]]
                signs.append(Row(ELLIPSOIDS[name], f"{words} {around}: {', '.join(ends)} {unit}"))
        return Legend(
            title=self.robot.name,
            lines=tuple(lines),
            scale_title="Share of each module in the deflection" if shares else "",
            scale_ends=("0", f"{number(100 * top, 3)} %") if shares else ("", ""),
            rows=tuple(rows),
            signs=tuple(signs),
            notes=self.notes,
        )


def pose_scene(
    robot: Robot,
    pose: ClosedPose | None = None,
    wrench=None,
    scale: float | None = None,
    *,
    compliance: Compliance | None = None,
    ellipsoids: str = "beside",
) -> Scene:
    """Return the scene of a pose (none: home), under a wrench (6,) on the tool where one is given.

    `scale` enlarges the deflection (none: a round number that shows it). `ellipsoids` are drawn 'beside' the robot, at
    the 'tool', or 'none'. Raises InputError, and what `robot.compliance` raises where a wrench is given.
    """
    pose = robot.home if pose is None else pose
    load = None if wrench is None else as_wrench(wrench)
    if scale is not None and not (np.isfinite(scale) and scale >= 0):
        raise InputError(f"scale {scale!r}: expected a factor >= 0, or None for one that fits")
    if compliance is None and robot.mechanism.modules and (robot.mechanism.tool is not None or load is not None):
        compliance = robot.compliance(pose)
    if compliance is None and load is not None:
        raise InputError(
            f"no module of '{robot.name}' is compliant, so a wrench deflects nothing: load(..., joint_stiffness=1e4)"
        )
    if compliance is not None and compliance.pose is not pose:
        raise InputError("this compliance belongs to another pose; ask for robot.compliance(pose)")
    return Painter(robot, pose).scene(pose, compliance, load, scale, ellipsoids=ellipsoids)


def _arrow(path: str, frame: Array, length: float, radius: float, colour: str, on_top: bool = False) -> list[Part]:
    """Return an arrow along z of a frame, from its origin."""
    head = min(6.5 * radius, 0.6 * length)
    pieces = (
        ("shaft", rod(radius, length - head), (length - head) / 2),
        ("head", Solid("cone", (4.8 * radius, 4.8 * radius, head)), length - head / 2),
    )
    return [
        Part(f"{path}/{name}", shape, frame @ placement(np.eye(3), np.array([0, 0, middle])), colour, on_top=on_top)
        for name, shape, middle in pieces
    ]
