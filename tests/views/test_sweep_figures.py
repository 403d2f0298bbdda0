"""Maps of sweeps, what the paper shows beside what is correct, and the boundary in three dimensions."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin import InputError
from prup_pin.views.drawing.plotting import encoded
from prup_pin.views.drawing.sweep_figures import beside_figure, figures_of, share_figure
from prup_pin.views.meshcat.view import boundary_view
from prup_pin.views.scene.workspace import boundary_scene

ROBOT = prup_pin.load("3prup")
ANGLES = np.linspace(-0.5, 0.5, 7)
LOADS = {"force": 300, "moment": 100}


@pytest.fixture(scope="module")
def swept():
    names = ["extremes", "ksi", "shares", "C"]
    return ROBOT.sweep(z=0.3, theta=ANGLES, phi=ANGLES, quantities=names, **LOADS)


def titles(figure):
    return [axes.get_title() for axes in figure.axes if axes.get_title()]


def test_every_quantity_that_has_a_map_gets_one(swept):
    figures = figures_of(swept)
    assert list(figures) == ["extremes", "ksi", "shares"]
    assert titles(figures["extremes"]) == ["extremes translation [mm]", "extremes rotation [mrad]"]
    for axes in figures["extremes"].axes[:2]:
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("theta [°]", "phi [°]")
    assert figures["extremes"].get_suptitle().startswith("3prup: largest ")
    assert figures["extremes"].get_suptitle().endswith("at z 300 mm")


def test_principal_stiffnesses_are_told_by_their_rank():
    principal = ROBOT.sweep(z=0.3, theta=ANGLES, phi=ANGLES, quantities=["rotational"])
    ranks = [title.partition(",")[2].partition("[")[0].strip() for title in titles(figures_of(principal)["rotational"])]
    assert ranks == ["softest", "middle", "stiffest"]


def test_the_map_shows_the_numbers(swept):
    """The largest level of the colour bar is the first above the largest value, in mm."""
    (drawn,) = [item for item in figures_of(swept)["extremes"].axes[0].collections if item.get_array() is not None][:1]
    largest = 1e3 * np.nanmax(swept["extremes"][..., 0])
    levels = drawn.levels
    assert levels[-2] < largest <= levels[-1]


def test_pictures_are_the_same_bytes_each_time(swept):
    for kind in ("png", "svg"):
        one, other = (encoded(figures_of(swept)["ksi"], kind) for _ in range(2))
        assert one == other
        assert len(one) > 5_000


def test_stiffness_is_told_in_units_without_powers_of_ten():
    """Of two models beside each other in one unit, also where only one of them reaches 1 N/mm."""
    weak = ROBOT.with_parameters({f"leg{leg}/linear_rod.youngs_modulus": 1e6 for leg in (1, 2, 3)})
    stiff, soft = (
        robot.sweep(z=0.3, theta=ANGLES, phi=ANGLES, quantities=["translational"]) for robot in (ROBOT, weak)
    )
    word = "translational 1, softest"
    assert titles(figures_of(stiff)["translational"])[0] == f"{word} [N/mm]"
    assert titles(figures_of(soft)["translational"])[0] == f"{word} [N/m]"
    both = titles(beside_figure([("a", stiff), ("b", soft)], ["translational"], ""))
    assert both[:2] == [f"a: {word} [N/mm]", f"b: {word} [N/mm]"]


def test_two_models_share_a_scale(swept):
    published = prup_pin.load("3prup_as_published")
    other = published.sweep(z=0.3, theta=ANGLES, phi=ANGLES, quantities=["extremes"], **LOADS)
    figure = beside_figure([("as published", other), ("correct", swept)], ["extremes"], "Fig. 22")
    assert titles(figure)[0] == "as published: extremes translation [mm]"
    left, right = (axes.collections[0].levels for axes in figure.axes[:2])
    np.testing.assert_array_equal(left, right)
    kept = beside_figure([("correct", swept)], ["extremes"], "", {"extremes": ("rotation",)})
    assert titles(kept) == ["correct: extremes rotation [mrad]"]


def test_the_largest_share_has_a_legend(swept):
    figure = share_figure(swept)
    words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert words
    assert set(words) <= {module.name for module in ROBOT.mechanism.modules}
    assert titles(figure)[0] == "largest share of the work"
    assert all(title.endswith("[%]") for title in titles(figure)[1:])


def test_one_axis_gives_curves_and_more_than_two_the_middle():
    line = ROBOT.sweep(z=np.linspace(0.2, 0.4, 5), theta=0, phi=0, quantities=["extremes", "shares"], **LOADS)
    figures = figures_of(line)
    assert figures["extremes"].axes[0].get_xlabel() == "z [mm]"
    assert len(figures["shares"].axes[0].lines) == 5
    space = ROBOT.sweep(z=[0.25, 0.3, 0.35], theta=ANGLES, phi=ANGLES, quantities=["ksi"], **LOADS)
    assert "z 300 mm" in figures_of(space)["ksi"].get_suptitle()


@pytest.fixture(scope="module")
def five_bar():
    """Symmetric about x = 0."""
    return prup_pin.load(Path(__file__).parents[2] / "examples" / "five_bar.urdf")


def test_curves_of_one_unit_share_a_drawing_whose_axis_names_it(five_bar):
    asked = ["extremes", "shares", "K_task", "actuators"]
    line = five_bar.sweep(x=0.0, y=np.linspace(0.3, 0.42, 5), quantities=asked, force=100)
    figures = figures_of(line)
    units = {name: [axes.get_ylabel() for axes in figure.axes] for name, figure in figures.items()}
    assert units == {
        "extremes": ["extremes translation [mm]", "extremes rotation [mrad]"],
        "shares": ["share of the work [%]"],
        "K_task": ["K_task [N/mm]", "K_task x y [N/m]"],
        "actuators": ["actuators [°]"],
    }
    assert all("x 0 mm" in figure.get_suptitle() for figure in figures.values())
    assert not figures["K_task"].axes[1].lines[0].get_ydata().any()  # of a symmetric pose; what is there is rounding
    shares = figures["shares"].axes[0]
    assert np.allclose(*(drawn.get_ydata() for drawn in shares.lines[:2]))  # left and right alike
    assert len({drawn.get_linestyle() for drawn in shares.lines[:2]}) == 2
    figures["shares"].draw_without_rendering()
    assert shares.get_legend().get_window_extent().x0 > shares.get_window_extent().x1 - 1


def test_what_is_only_rounding_is_drawn_as_nothing(five_bar):
    """A planar robot under a force in its plane leaves it nowhere; maps and curves have no pattern to tell."""
    grid = {"x": np.linspace(-0.03, 0.03, 5), "y": np.linspace(0.35, 0.38, 4)}
    found = five_bar.sweep(**grid, quantities=["deflection"], wrench={"fx": 10})
    assert np.abs(found["deflection"][..., 2:5]).max() < 1e-15  # dz, rx, ry: rounding, if anything
    figure = figures_of(found)["deflection"]
    assert "`" not in figure.get_suptitle()
    flat = [title for title, axes in zip(titles(figure), figure.axes, strict=False) if len(filled(axes)) == 1]
    assert flat == ["deflection dz [mm]", "deflection rx [mrad]", "deflection ry [mrad]"]
    line = ROBOT.sweep(z=np.linspace(0.2, 0.4, 5), theta=0, phi=0, quantities=["deflection"], wrench={"fx": 100})
    curves = {drawn.get_label(): drawn for axes in figures_of(line)["deflection"].axes for drawn in axes.lines}
    assert not any(curves[f"deflection {name}"].get_ydata().any() for name in ("dy", "dz", "rx", "ry", "rz"))
    assert curves["deflection dx"].get_ydata().all()


def filled(axes):
    """The colours that a map shows."""
    drawn = axes.collections[0]
    return [path for path in drawn.get_paths() if len(path.vertices)]


def test_maps_of_a_hinge_are_in_degrees_and_of_two_alike_the_first_is_named(five_bar):
    grid = {"x": np.linspace(-0.03, 0.03, 5), "y": np.linspace(0.35, 0.38, 4)}
    found = five_bar.sweep(**grid, quantities=["actuators", "K_task", "homogenised_ksi", "shares"], force=100)
    figures = figures_of(found)
    assert titles(figures["actuators"]) == ["actuators left_motor [°]", "actuators right_motor [°]"]
    assert titles(figures["K_task"]) == ["K_task x x [N/mm]", "K_task x y [N/mm]", "K_task y y [N/mm]"]
    assert titles(figures["homogenised_ksi"]) == ["homogenised_ksi"]
    (drawn,) = figures["shares"].axes[0].collections
    codes = np.ma.filled(drawn.get_array(), np.nan).reshape(4, 5)
    assert len(set(codes[:, 2])) == 1


def test_what_has_no_map_is_said(swept):
    with pytest.raises(InputError, match="nothing of C"):
        figures_of(ROBOT.sweep(z=0.3, theta=ANGLES, phi=ANGLES, quantities=["C"]))
    with pytest.raises(InputError, match="scattered poses, or one alone, have no map"):
        figures_of(ROBOT.sweep([[0.3, 0.0, 0.1]], quantities=["ksi"]))


def test_the_boundary_stands_in_its_spans():
    found = ROBOT.workspace(1 / 8, z=(0.1, 0.65), theta=(-1.1, 1.1), phi=(-1.1, 1.1))
    scene = boundary_scene(found, "3prup")
    mesh = scene.part("workspace/boundary").shape
    assert mesh.vertices.min() > -1e-9
    assert mesh.vertices.max() < 1 + 1e-9
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    volume = (np.cross(a, b) * c).sum() / 6 * 0.55 * 2.2 * 2.2
    assert volume == pytest.approx(found.volume, rel=0.15)  # outwards, and about as large
    texts = {label.text for label in scene.labels}
    assert {"z 100 mm", "z 650 mm"} < texts
    assert "volume" in scene.legend.lines[0]
    page = boundary_view(found, "3prup").static_html()
    assert "http-equiv" in page
    assert len(page) > 100_000
