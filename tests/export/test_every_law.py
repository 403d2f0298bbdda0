"""No law is lost on the way into a robot file without a word: each is in it, or told to be left out, or both."""

import pytest

import prup_pin
from prup_pin.laws import LAWS, Inputs, Setup
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.mechanism import Changes

from .test_export import ARM, EXAMPLES


@pytest.fixture(scope="module")
def mechanisms(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    packaged = "3prup", "3prup_as_published", "ball_screw_axis"
    files = EXAMPLES / "six_ups.urdf", EXAMPLES / "elastic_arm.urdf", path
    return [prup_pin.load(name).mechanism for name in (*packaged, *files)]


@pytest.mark.parametrize("law", [*LAWS, *EFFORT_LAWS], ids=lambda law: f"{type(law).__name__} {law.physics}")
def test_a_law_is_written_or_told_to_be_left_out(law, mechanisms):
    somewhere = False
    for mechanism in mechanisms:
        setup = Setup.nominal(mechanism, Inputs.empty(len(mechanism.actuated)))
        for place in law.places(mechanism)[:2]:
            somewhere = True
            starts = law.starts(place, mechanism)[0]
            values = {
                # what is nothing where a fit starts would rightly change nothing
                item.name: starts[item.name] or min(1e-3, item.upper)
                for item in law.quantities_at(place, mechanism)
            }
            changes = Changes(mechanism)
            left = law.written(place, values, setup, changes)
            assert all(isinstance(text, str) and text for text in left)
            assert left or not changes.empty, f"{law.physics} at {place} is lost"
    assert somewhere, f"{law.physics} has a place on none of these robots"
