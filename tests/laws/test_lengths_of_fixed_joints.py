"""Lengths that move fixed joints: the tool's frame, a loop's end, the seat of what comes after."""

import gc
import weakref

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import PoseChannel, Stack
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.diagnosis import FittedParameter
from prup_pin.diagnosis.influence import Influence
from prup_pin.laws import Effect, Place
from prup_pin.laws.deviations import calibration_of
from prup_pin.laws.law import is_untold
from prup_pin.recordings import Noise, Recording, add_noise
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.spatial import rotation_log
from prup_pin.views.text.diagnosis_words import parameter_texts

_BODY = (
    '<inertial><origin xyz="{0} 0 0"/><mass value="{1}"/>'
    '<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.005"/></inertial>'
)
_TURNS = '<axis xyz="{axis}"/><limit lower="-3.2" upper="3.2" effort="50" velocity="5"/>'


def _joint(name, parent, child, xyz, kind="revolute", rpy="0 0 0", axis="0 0 1"):
    turns = _TURNS.format(axis=axis) if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{turns}</joint>'
    )


FIVE_BAR = "".join(
    (
        '<robot name="fivebar"><link name="table"/><link name="endL"/><link name="endR"/>',
        *(f'<link name="{name}">{_BODY.format(0.12, 0.8)}</link>' for name in ("armL", "armR", "rodL", "rodR")),
        _joint("motorL", "table", "armL", "-0.1 0 0"),
        _joint("motorR", "table", "armR", "0.1 0 0"),
        _joint("elbowL", "armL", "rodL", "0.25 0 0"),
        _joint("elbowR", "armR", "rodR", "0.25 0 0"),
        _joint("tipL", "rodL", "endL", "0.35 0 0", "fixed"),
        _joint("tipR", "rodR", "endR", "0.35 0 0", "fixed"),
        '<prup_pin version="1"><tool frame="endL"/><actuated joints="motorL motorR"/>',
        '<home motorL="2.2" motorR="0.94" elbowL="-1.2" elbowR="1.2"/>',
        '<loop name="pin" frame1="endL" frame2="endR" free="rz"/>',
        *(
            f'<length name="{name}" value="{value}" unit="m"><moves joint="{joint}" direction="1 0 0"/></length>'
            for name, value, joint in (
                ("left.rod", 0.35, "tipL"),
                ("right.rod", 0.35, "tipR"),
                ("left.arm", 0.25, "elbowL"),
                ("right.arm", 0.25, "elbowR"),
            )
        ),
        *(
            f'<module name="{side}/drive" type="joint_spring" joint="motor{side[0].upper()}">'
            '<parameter name="stiffness" value="3e3" unit="N m/rad"/></module>'
            for side in ("left", "right")
        ),
        "</prup_pin></robot>",
    )
)
#: A crane whose mast is set on a turned plate, and whose jib ends in a hook on a turned plate with a mass.
CRANE = "".join(
    (
        '<robot name="crane"><link name="ground"/><link name="plate"/>',
        *(f'<link name="{name}">{_BODY.format(0.2, 3.0)}</link>' for name in ("mast", "jib", "hook")),
        _joint("set", "ground", "plate", "0 0 0.1", "fixed", rpy="0.3 0 0.7"),
        _joint("yaw", "plate", "mast", "0 0 0.4"),
        _joint("bracket", "mast", "shoe", "0.1 0 0.2", "fixed", rpy="0 0.4 0.5"),
        '<link name="shoe"/>',
        _joint("lift", "shoe", "jib", "0.1 0 0", axis="0 1 0"),
        _joint("end", "jib", "hook", "0.5 0 0", "fixed", rpy="0 0.6 0.2"),
        '<prup_pin version="1"><tool frame="hook"/>',
        '<length name="jib.length" value="0.5" unit="m"><moves joint="end" direction="1 0 0"/></length>',
        '<length name="shoe.reach" value="0.1" unit="m"><moves joint="bracket" direction="1 0 0"/></length>',
        '<length name="plate.out" value="0" unit="m"><moves joint="lift" direction="1 0 0"/></length>',
        '<module name="lift_drive" type="joint_spring" joint="lift">'
        '<parameter name="stiffness" value="4e3" unit="N m/rad"/></module>',
        '<module name="yaw_drive" type="joint_spring" joint="yaw">'
        '<parameter name="stiffness" value="4e3" unit="N m/rad"/></module>',
        "</prup_pin></robot>",
    )
)


def written(folder, text):
    path = folder / "robot.urdf"
    path.write_text(text)
    return prup_pin.load(path)


@pytest.fixture(scope="module")
def five_bar(tmp_path_factory):
    return written(tmp_path_factory.mktemp("five_bar"), FIVE_BAR)


@pytest.fixture(scope="module")
def crane(tmp_path_factory):
    return written(tmp_path_factory.mktemp("crane"), CRANE)


def planned(robot, poses, force=40.0):
    """Loads at some poses, in the plane alone where the robot is planar."""
    random = np.random.default_rng(4)
    planar = bool(robot.mechanism.loops)
    home = np.array([2.2, 0.94]) if planar else np.array([0.3, -0.4])
    stands = np.repeat(home + random.uniform(-0.3, 0.3, (poses, 2)), 5, axis=0)
    wrench = np.zeros((len(stands), 6))
    wrench[:, : 2 if planar else 6] = random.uniform(-1, 1, (len(stands), 2 if planar else 6))
    wrench *= force
    wrench[:, 3:] *= 0.1
    positions = dict(zip(robot.mechanism.actuated, stands.T, strict=True))
    return Recording(np.arange(len(stands), dtype=float), positions, wrench=wrench)


@pytest.mark.parametrize(
    ("name", "length"),
    [
        ("five_bar", "left.rod"),  # the tool's frame and a loop's end in one
        ("five_bar", "right.rod"),  # a loop's end alone
        ("crane", "jib.length"),  # the tool and a mass, on a turned plate
        ("crane", "shoe.reach"),  # the seat of the next joint
        ("crane", "plate.out"),  # a movable joint on a turned plate
    ],
)
@pytest.mark.parametrize("acting", ["law", "calibration"])
def test_first_order_is_the_simulations_slope(request, name, length, acting):
    robot = request.getfixturevalue(name)
    mechanism = robot.mechanism
    simulator = Simulator(robot, inputs_of(planned(robot, 3), robot))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, mechanism)
    place, _, short = length.rpartition(".")
    frames = [mechanism.tool, mechanism.frame("endR" if name == "five_bar" else "jib")]
    stack = Stack(tuple(PoseChannel.nothing(frame, len(simulator.inputs)) for frame in frames))
    run = simulator.run([weight])
    influence = Influence(simulator, run, stack)

    def changed(step):
        if acting == "law":
            values = dict.fromkeys(("rod", "arm"), 0.0) if name == "five_bar" else {}
            return effect_named("geometric_offset", place, "", {**values, short: step}, mechanism)
        given = float(mechanism.parameters[length].value)
        return Effect(calibration_of(mechanism), Place("robot"), {length: given + step})

    step = 1e-5
    setup = simulator.setup([weight, changed(step)])
    moved = sum(
        change
        for kind in prup_pin.laws.deeds.DEEDS
        if (change := kind.first_order(setup, influence.solved)) is not None
    )
    ends = [simulator.run([weight, changed(sign * step)]) for sign in (-1.0, 1.0)]
    for index, frame in enumerate(frames):
        before, after = (end.pose_of(frame) for end in ends)
        expected = np.concatenate((after[0] - before[0], rotation_log(after[1] @ before[1].mT)), axis=1) / 2
        found = moved[:, 6 * index : 6 * index + 6]
        np.testing.assert_allclose(found, expected, atol=2e-4 * step)
    assert np.abs(moved[:, :3]).max() > 0.3 * step


def test_a_length_moves_what_stands_beyond_a_fixed_joint(five_bar, crane):
    rod = five_bar.mechanism.moved_by_length["left.rod"]
    assert (set(rod.joints), set(rod.loop_ends), set(rod.frames)) == (set(), {(0, 0)}, {"endL", "tipL"})
    jib = crane.mechanism.moved_by_length["jib.length"]
    assert (set(jib.joints), set(jib.links)) == (set(), {"hook"})
    reach = crane.mechanism.moved_by_length["shoe.reach"]
    assert set(reach.joints) == {crane.mechanism.joint("lift").id}


@pytest.mark.parametrize("side", ["left", pytest.param("right", marks=pytest.mark.slow)])
def test_the_rod_of_a_five_bar_is_named(five_bar, side):
    """It ends in fixed joints, at the pin; nothing else in the drawing is called so."""
    recording = planned(five_bar, 12)
    rod = effect_named("geometric_offset", side, "", {"rod": 8e-4, "arm": 0.0}, five_bar.mechanism)
    bench = prup_pin.simulate(five_bar, recording, [rod])
    measured = recording.with_measurements(position=bench.position)
    noise = Noise(position=4e-6, force=0.02)
    found = diagnose(five_bar, add_noise(measured, noise, seed=5))
    (finding,) = [item for item in found.findings if item.physics != "finite_deflection"]
    assert (finding.physics, finding.location, finding.candidates) == ("geometric_offset", side, (side,))
    assert finding.parameters["rod"].value == pytest.approx(8e-4, rel=0.01)
    assert abs(finding.parameters["arm"].value) < 5e-6


def test_a_length_that_the_data_cannot_tell_is_told_as_such(five_bar):
    """Any of its values would do: what a fit leaves there is rounding."""
    law = effect_named("geometric_offset", "left", "", {"rod": -4.4e-20, "arm": 8e-4}, five_bar.mechanism)
    intervals = {"rod": (-0.05, 0.05), "arm": (7.9e-4, 8.1e-4)}
    said = law.law.told(law.place, law.values, intervals, five_bar.mechanism)
    assert said == "left is not where the drawing has it: arm +800 µm"
    quantities = {item.name: item for item in law.law.quantities_at(law.place, five_bar.mechanism)}
    fitted = {
        name: FittedParameter(law.values[name], "m", ends, untold=is_untold(quantities[name], ends))
        for name, ends in intervals.items()
    }
    assert parameter_texts(fitted) == [
        ("rod", "not determined by this recording", "-50 to 50 mm"),
        ("arm", "800 µm", "790 to 810 µm"),
    ]


def test_what_lengths_move_is_kept_by_the_mechanism_alone(five_bar):
    mechanism = five_bar.mechanism.with_tool("armL")
    assert mechanism.moved_by_length
    left = weakref.ref(mechanism)
    del mechanism
    gc.collect()
    assert left() is None
