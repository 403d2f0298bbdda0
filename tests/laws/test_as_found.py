"""What was found before, as one law, and one of its effects that has changed."""

import numpy as np
import pytest

from prup_pin.laws import LAWS, Effect, Place
from prup_pin.laws.as_found import AsFound, ChangedEffect, said_of_change, value_name
from prup_pin.laws.deviations import calibration_of
from prup_pin.simulation import Simulator, effect_named, inputs_of

from ..simulation import bench


@pytest.fixture(scope="module")
def robot():
    return bench.three_prup()


@pytest.fixture(scope="module")
def effects(robot):
    off = {"leg1_slide.encoder_offset": 3e-5, "leg1/ball_nut.stiffness": 2e8}
    return (
        Effect(calibration_of(robot.mechanism), Place("robot"), off),
        effect_named("stiffness_changed", "leg1/ball_nut", "", {"factor": 0.5}, robot.mechanism),
        effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 1.2e-5, "closing_load": 1.0}, robot.mechanism),
    )


@pytest.fixture(scope="module")
def recorded(robot):
    return inputs_of(bench.inputs(robot), robot)


def test_it_does_what_its_effects_do_one_after_the_other(robot, effects, recorded):
    simulator = Simulator(robot, recorded)
    whole = Effect(AsFound(effects, ()), Place("robot"), {})
    one, other = simulator.run(effects), simulator.run([whole])
    assert np.array_equal(one.position, other.position)
    # the same where they act from the start; the law stands for them there, and is not added to them
    acting = Simulator(robot, recorded, effects)
    assert np.array_equal(acting.run().position, one.position)
    assert np.array_equal(acting.run([whole]).position, one.position)
    assert np.array_equal(acting.under(recorded).run().position, one.position)


def test_its_values_may_be_others(robot, effects, recorded):
    simulator = Simulator(robot, recorded)
    law = AsFound(effects, ())
    name = value_name(effects[2], "half_gap")
    assert name == "backlash at leg2/ball_nut: half_gap"
    grown = Effect(effects[2].law, effects[2].place, {**effects[2].values, "half_gap": 1.9e-5})
    found = law.with_changed({"leg1_slide.encoder_offset": 1e-5}, [grown])
    off, soft, gap = law.at(found)
    assert (off.values["leg1_slide.encoder_offset"], soft) == (1e-5, effects[1])
    assert gap == grown
    moved = simulator.run([Effect(law, Place("robot"), {name: 1.9e-5})])
    assert np.array_equal(moved.position, simulator.run([*effects[:2], grown]).position)


def test_an_effect_that_changed_is_its_law_from_what_it_was(robot, effects):
    law = ChangedEffect(effects[2])
    place = effects[2].place
    assert law.places(robot.mechanism) == [place]
    assert law.starts(place, robot.mechanism) == [effects[2].values]
    assert law.neutral_at(place, robot.mechanism) == effects[2].values
    assert law.physics == "backlash"
    assert law.instead_of == effects[2]


def test_no_law_speaks_of_the_robot_file_where_a_change_is_told():
    for law in LAWS:
        mechanism = bench.three_prup().mechanism
        for place in list(law.places(mechanism))[:1]:
            if law.weighs:
                continue  # it is never told as changed
            told = said_of_change(law.statement(place, law.starts(place, mechanism)[0], mechanism))
            assert not {"robot file", "drawing"} & {word for word in ("robot file", "drawing") if word in told}, told
