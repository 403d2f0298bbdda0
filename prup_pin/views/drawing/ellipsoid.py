"""The ellipsoid of compliance: how far, and whereto, a unit force in every direction moves the tool."""

from __future__ import annotations

import numpy as np

from ...numbers import quantity
from ...spatial import Array
from ...statics import Compliance
from ..scene.camera import Camera
from ..scene.colours import ELLIPSOIDS, FAINT, rgb_of
from .drawing import WIDE, Drawing, Layout
from .plotting import Figure, PolyCollection, Polygon

SOFT = ELLIPSOIDS["translation"]


def _principal(compliance: Compliance) -> tuple[Array, Array]:
    """Return the principal compliances of the translation block [m/N], largest first, and their axes as columns."""
    values, vectors = np.linalg.eigh(compliance.C[:3, :3])
    return np.maximum(values[::-1], 0.0), vectors[:, ::-1]


def _silhouette(camera: Camera, values: Array, vectors: Array) -> Array:
    """Return the outline of the projected ellipsoid, (n, 2), about its centre."""
    half = camera.plane @ vectors * values
    u, s, _ = np.linalg.svd(half, full_matrices=False)
    angle = np.linspace(0, 2 * np.pi, 121)
    return (u * s @ np.array([np.cos(angle), np.sin(angle)])).T


def draw_small_ellipsoid(drawing: Drawing, compliance: Compliance, at: Array, size: float) -> None:
    """Draw the outline around the tool at `at`, in proportion to the mechanism's size."""
    values, vectors = _principal(compliance)
    if values[0] <= 0:
        return
    outline = drawing.camera.flat(at) + _silhouette(drawing.camera, values * 0.15 * size / values[0], vectors)
    drawing.axes.add_patch(Polygon(outline, facecolor=SOFT, alpha=0.35, edgecolor=SOFT, lw=1.0, zorder=9.0))


def draw_ellipsoid(figure: Figure, camera: Camera, compliance: Compliance, layout: Layout) -> None:
    """Draw the ellipsoid large, in the same view, with its semi-axes in µm/N."""
    values, vectors = _principal(compliance)
    drawing = Drawing(figure, layout.beside, camera, (-1.75, -1.6), (1.75, 1.6))
    axes, labels = drawing.axes, drawing.labels
    axes.set_title("Compliance at the tool", fontsize=11, weight="bold", loc="center", pad=14)
    axes.text(
        0.5,
        1.0,
        "displacement by 1 N in every direction" if layout is WIDE else "displacement by 1 N",
        transform=axes.transAxes,
        ha="center",
        fontsize=9,
        color=FAINT,
    )
    if values[0] <= 0:
        axes.text(0, 0, "no force moves the tool", ha="center", color=FAINT)
        return
    size = values / values[0]
    faces, shades = _surface(camera, size, vectors)
    axes.add_collection(PolyCollection(faces, facecolors=shades, edgecolors="face", lw=0.4, zorder=2))
    outline = _silhouette(camera, size, vectors)
    axes.plot(*outline.T, color="#2F6355", lw=1.2, zorder=3)
    flat = _spread_ends(camera, size, vectors)
    labels.avoid(outline)
    labels.obstacles.append(_filled(outline))
    yields = values > 1e-9 * values[0]
    for value, tip in zip(values[yields], flat[yields], strict=True):
        length = float(np.linalg.norm(tip))
        direction = tip / length if length > 1e-6 else np.array([0.0, 1.0])
        edge = max(float((outline @ direction).max()), length) * 1.02
        axes.plot(*np.array([-tip, tip]).T, color="#14352B", lw=1.4, zorder=5)
        axes.plot(*np.array([tip, direction * (edge + 0.18)]).T, color="#14352B", lw=0.8, ls=":", zorder=5)
        axes.plot(*tip, "o", ms=4, color="#14352B", zorder=6)
        labels.put(quantity(value, "m/N"), direction * (edge + 0.16), "#14352B", direction, 10.5, "bold")
    if not yields.all():
        text = "rigid across" if yields.sum() == 1 else "rigid in the third direction"
        axes.text(0.5, 0.0, text, transform=axes.transAxes, ha="center", fontsize=9.5, color="#14352B")


def _surface(camera: Camera, size: Array, vectors: Array) -> tuple[list[Array], Array]:
    """Return the visible faces of an ellipsoid on the page, far ones first, and their shades."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0, np.pi, 25))
    ball = np.stack((np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)), axis=-1)
    points = ball * size @ vectors.T
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = np.nan_to_num(ball / np.maximum(size, 1e-3)) @ vectors.T
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    light = camera.viewer + 0.8 * camera.plane[1] - 0.6 * camera.plane[0]
    light /= np.linalg.norm(light)
    corners, normal = _quads(points), _quads(normals).mean(axis=1)
    seen = normal @ camera.viewer >= -0.1
    corners, normal = corners[seen], normal[seen]
    bright = 0.62 + 0.45 * np.maximum(normal @ light, 0.0)[:, None]
    base = 0.55 * rgb_of(SOFT) + 0.45
    shades = np.clip(base * bright + 0.18 * (bright - 0.62), 0, 1)
    order = np.argsort((corners @ camera.viewer).mean(axis=1), kind="stable")
    return list(camera.flat(corners[order])), shades[order]


def _quads(grid: Array) -> Array:
    """Return the corners (n, 4, 3) of the faces of a grid (rows, columns, 3) of points."""
    return np.stack((grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]), axis=2).reshape(-1, 4, 3)


def _filled(outline: Array) -> Array:
    """Return points that fill an outline, so that labels stay outside."""
    return np.concatenate([outline * share for share in np.linspace(0.1, 0.95, 12)])


def _spread_ends(camera: Camera, size: Array, vectors: Array) -> Array:
    """Return the ends of the three semi-axes, on the page, whose labels are farthest apart."""
    ends = camera.flat((vectors * size).T)
    angles = np.arctan2(ends[:, 1], ends[:, 0])
    best, found = -1.0, (1, 1, 1)
    for signs in ((1, a, b) for a in (1, -1) for b in (1, -1)):
        turned = angles + np.where(np.array(signs) > 0, 0, np.pi)
        gaps = [abs(np.angle(np.exp(1j * (turned[i] - turned[j])))) for i, j in ((0, 1), (1, 2), (0, 2))]
        if min(gaps) > best + 1e-9:
            best, found = min(gaps), signs
    return ends * np.array(found)[:, None]
