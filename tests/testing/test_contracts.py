"""`check_law`, `check_module`, `check_reader`: what is right passes, what is wrong by one per cent is told by name."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.errors import UnreachablePoseError
from prup_pin.imports.log import Log, Stream, frozen, reading
from prup_pin.laws import Place
from prup_pin.laws.coulomb_friction import CoulombFriction
from prup_pin.laws.efforts.viscous_friction import Damping
from prup_pin.laws.encoder import EncoderOffset
from prup_pin.laws.thermal_growth import ThermalGrowth
from prup_pin.modules import Bearing
from prup_pin.modules.hertzian_bearing import HertzianBearing
from prup_pin.testing import check_law, check_module, check_reader
from prup_pin.testing.poses import PoseBench, check_interval

from ..modules.examples import EXAMPLES


def test_right_laws_of_both_channels_pass():
    check_law(EncoderOffset)
    check_law(Damping(), closed_form=damping)


def damping(law, place, values, at):
    speed = at.motion.speed[:, at.motion.names.index(place.name)]
    return np.where(np.array(at.driven) == place.name, values["damping"] * speed[:, None], 0.0)


class Dragging(Damping):
    """One per cent more than it says."""

    def efforts_per(self, place, values, at):
        return 1.01 * super().efforts_per(place, values, at)


class Crooked(Damping):
    """Its efforts are one per cent more than its columns."""

    def efforts(self, place, values, at):
        return 1.01 * super().efforts(place, values, at)


class Mute(EncoderOffset):
    """It does nothing."""

    def deeds(self, place, values, setup):
        return ()


class Restless(EncoderOffset):
    """Nothing is not nothing."""

    neutral = {"offset": 1e-6}  # noqa: RUF012


class Raising(EncoderOffset):
    """It cannot count."""

    def deeds(self, place, values, setup):
        return 1 / 0


class Curt(EncoderOffset):
    """It has no word for a mechanic."""

    remedy = "turn"


@pytest.mark.parametrize(
    ("law", "given", "said"),
    [
        (Dragging, {"closed_form": damping}, "Dragging at joint1 .*breaks: What it adds is its equation"),
        (Crooked, {}, "Crooked at joint1 .*breaks: Its columns are the finite differences of its efforts"),
        (Mute, {}, "Mute at leg1/motor breaks: Where a fit starts the law moves the tool: .* The tool moves by "),
        (Restless, {}, r"Restless at leg1/motor breaks: At its neutral values .* It moves by \d"),
        (Raising, {}, "Raising at leg1/motor breaks: At its neutral values .* ZeroDivisionError: division by zero"),
        (Curt, {}, "Curt at leg1/motor breaks: A mechanic is told in 4 to 30 words.* It says 'turn'"),
        (CoulombFriction, {"robot": "ball_screw_axis"}, "CoulombFriction has no place on 'ball_screw_axis': give"),
    ],
)  # fmt: skip
def test_a_wrong_law_is_told_by_what_it_breaks(law, given, said):
    with pytest.raises(AssertionError, match=f"(?s){said}"):
        check_law(law, **given)


class Stepped(EncoderOffset):
    """It moves by whole steps: no slope leads from one to the next."""

    def deeds(self, place, values, setup):
        yield from super().deeds(place, {"offset": 2e-5 * round(values["offset"] / 2e-5)}, setup)


def test_a_law_whose_fit_stops_short_is_told():
    bench, place = PoseBench.of(load("3prup")), Place("leg1/motor")
    check_interval(bench, EncoderOffset(), place)
    with pytest.raises(AssertionError, match=r"Stepped at leg1/motor breaks: Beside noise .* It stops short"):
        check_interval(bench, Stepped(), place)


def test_a_law_is_tried_where_it_is_asked():
    check_law(ThermalGrowth, actuators=[[0.40, 0.42, 0.36]])
    with pytest.raises(UnreachablePoseError):
        check_law(ThermalGrowth, actuators=[[5.0, 0.42, 0.36]])


class Steep(HertzianBearing):
    """Its slope is one per cent off."""

    def compliance(self, values, at, load):
        return super().compliance(values, at, load) * (1.0 if load is None else 1.01)


class Lopsided(Bearing):
    """It yields to a force across more than the other way round."""

    def compliance(self, values, at, load):
        matrix = super().compliance(values, at, load).copy()
        matrix[..., 0, 1] += 0.01 * matrix[..., 0, 0]
        return matrix


class Generous(Bearing):
    """It gives energy away along its axis."""

    def compliance(self, values, at, load):
        matrix = super().compliance(values, at, load).copy()
        matrix[..., 2, 2] *= -1
        return matrix


class Fickle(Bearing):
    """It says that it depends on nothing."""

    def compliance(self, values, at, load):
        return super().compliance(values, at, load) * (1 + 0.01 * at.position[..., None, None])


class Nameless(Bearing):
    """It has no summary."""

    summary = ""


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (Steep, "Steep breaks: Its compliance is the slope of its deformation"),
        (Lopsided, "Lopsided breaks: Its compliance is symmetric"),
        (Generous, "Generous breaks: Its compliance is symmetric and creates no energy. A diagonal entry is negative"),
        (Fickle, "Fickle breaks: It is constant where it says so"),
        (Nameless, "Nameless breaks: It declares its word, a summary, .*summary is ''"),
    ],
)
def test_a_wrong_module_is_told_by_what_it_breaks(kind, said):
    with pytest.raises(AssertionError, match=f"(?s){said}"):
        check_module(kind, *EXAMPLES[kind.kind])


def test_a_right_module_passes():
    check_module(HertzianBearing, *EXAMPLES["hertzian_bearing"])


# -- readers -----------------------------------------------------------------------------------------------------------


def right(path):
    with reading(path, "two numbers a line"):
        rows = [[float(cell) for cell in line.split()] for line in path.read_text().splitlines()]
        columns = dict(zip(("time", "q"), zip(*rows, strict=True), strict=True))
    return Log(str(path), (Stream("s", frozen(columns)),))


def unguarded(path):
    rows = [[float(cell) for cell in line.split()] for line in path.read_text().splitlines()]
    return Log(str(path), (Stream("s", frozen(dict(zip(("time", "q"), zip(*rows, strict=True), strict=True)))),))


def writable(path):
    log = right(path)
    columns = {name: values.copy() for name, values in log.streams[0].columns.items()}
    return Log(log.path, (Stream("s", columns),))


def table(path):
    return right(path).streams


def test_readers(tmp_path):
    path = tmp_path / "log.two"
    path.write_text("".join(f"{0.01 * k} {0.1 * k}\n" for k in range(100)))
    check_reader(right, path)
    for read, said in (
        (unguarded, "unguarded breaks: A file that is empty, cut off .* raises ValueError: .*with reading"),
        (writable, "writable breaks: A log has streams of read-only columns .* Column 'time' can be written to"),
        (table, "table breaks: A log has streams .* It returned tuple; expected a Log"),
    ):
        with pytest.raises(AssertionError, match=f"(?s){said}"):
            check_reader(read, path)
