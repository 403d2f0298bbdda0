"""Laws of poses that are wrong: each check of their contract refuses one that is wrong in nothing else."""

import re

import numpy as np
import pytest

from prup_pin.laws import Place
from prup_pin.laws.deeds import ExtraStrain, Strain
from prup_pin.laws.encoder import EncoderOffset
from prup_pin.laws.out_of_level import OutOfLevel
from prup_pin.laws.payload import Payload
from prup_pin.laws.wrench_sensor import WrenchSensorCommonGain
from prup_pin.testing.poses import (
    check_derivatives,
    check_leaves_alone,
    check_neutral,
    check_quantities,
    check_refit,
    check_shows,
)

from .bench import bench


class Stretch(EncoderOffset):
    """A rod that stretches by the square of its load, as it should be: no law of the library."""

    slope = 2.0

    def deeds(self, place, values, setup):
        yield ExtraStrain("leg1/linear_rod", Strain(self.strain, (np.full(len(setup.inputs), values["offset"]),)))

    def strain(self, load, size):
        value, slopes = np.zeros_like(load), np.zeros((*load.shape, load.shape[1]))
        value[:, 2], slopes[:, 2, 2] = 1e-3 * size * load[:, 2] ** 2, self.slope * 1e-3 * size * load[:, 2]
        return value, slopes


class SteepStretch(Stretch):
    """Its derivative is another function's."""

    slope = 3.0


class RestlessOffset(EncoderOffset):
    """Five is said to be nothing."""

    neutral = {"offset": 0.05}  # noqa: RUF012


class MuteOffset(EncoderOffset):
    """It does nothing."""

    def deeds(self, place, values, setup):
        return ()


class MeddlingOffset(EncoderOffset):
    """It changes what its caller gave it."""

    def deeds(self, place, values, setup):
        values["offset"] *= 2
        yield from super().deeds(place, values, setup)


class UnboundedOffset(EncoderOffset):
    """Where a fit starts lies beyond its bounds."""

    def starts(self, place, mechanism):
        return [{"offset": 5.0}]


class RandomOffset(EncoderOffset):
    """What it does is no function of its values."""

    random = np.random.default_rng(1)

    def deeds(self, place, values, setup):
        yield from super().deeds(place, {"offset": values["offset"] * self.random.uniform(0.5, 1.5)}, setup)


class HeavyPayload(Payload):
    """Twice as much of it is said to do four times as much, as if its effect were not in proportion."""

    def magnified(self, value, times):
        return value * times**2 + 0.1


class OneSidedGain(WrenchSensorCommonGain):
    """A sensor may report too much or too little; by what is in proportion no fit gets from one to the other."""

    def starts(self, place, mechanism):
        return [{"gain": 1.05}]


class MuteLevel(OutOfLevel):
    """Gravity pulls as ever."""

    def deeds(self, place, values, setup):
        return ()


class NeverLevel(OutOfLevel):
    """A base that is not tilted is said to be tilted by a milliradian."""

    def deeds(self, place, values, setup):
        yield from super().deeds(place, {**values, "rx": values["rx"] + 1e-3}, setup)


PLACE, BASE, CELL = Place("leg1/motor"), Place("base", "level"), Place("wrench_sensor", "all channels")
CHECKS = [check_neutral, check_shows, check_leaves_alone, check_derivatives, check_quantities, check_refit]
REFUSED = {
    check_neutral: [(RestlessOffset(), PLACE), (NeverLevel(), BASE)],
    check_shows: [(MuteOffset(), PLACE), (MuteLevel(), BASE)],
    check_leaves_alone: [(MeddlingOffset(), PLACE)],
    check_derivatives: [(SteepStretch(), PLACE)],
    check_quantities: [(UnboundedOffset(), PLACE), (HeavyPayload(), Place("moving_star")), (OneSidedGain(), CELL)],
    check_refit: [(RandomOffset(), PLACE)],
}


@pytest.mark.parametrize("check", CHECKS)
def test_a_right_law_passes_every_check(check):
    check(bench("3prup"), EncoderOffset(), PLACE)
    check(bench("3prup", OutOfLevel()), OutOfLevel(), BASE)
    check(bench("3prup"), Stretch(), PLACE)


@pytest.mark.parametrize(
    ("check", "law", "place"),
    [(check, *wrong) for check, laws in REFUSED.items() for wrong in laws],
    ids=lambda given: getattr(given, "__name__", type(given).__name__),
)
def test_wrong_laws_are_refused(check, law, place):
    assert set(REFUSED) == set(CHECKS)
    with pytest.raises(
        AssertionError, match=re.escape(f"{type(law).__name__} at {place} breaks: {check.__doc__[:40]}")
    ):
        check(bench("3prup", law), law, place)
