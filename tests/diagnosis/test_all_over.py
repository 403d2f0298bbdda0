"""What is off all over is told in its own unit; of what is known as a share of its value, as a share."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.all_over import _sizes
from prup_pin.diagnosis.calibrate import CalibratedParameter
from prup_pin.laws.deviations import deviations_of


def off(deviation, amount):
    value = deviation.value(amount)
    return CalibratedParameter(deviation, 1.0, 0.5, value, 0.1, 0.1, deviation.nominal)


@pytest.mark.parametrize(("kind", "told"), [("stiffness", "50 %"), ("position", "2 mm")])
def test_sizes_of_a_kind(kind, told):
    every = [item for item in deviations_of(load("3prup").mechanism, {kind: 0.1}) if item.kind == kind][:4]
    signs = np.resize([1.0, -1.0], len(every))
    amount = 0.5 if kind == "stiffness" else 2e-3
    items = [off(item, sign * amount) for item, sign in zip(every, signs, strict=True)]
    assert _sizes(items) == f"{told} in the root mean square of {len(items)}"
