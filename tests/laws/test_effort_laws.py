"""Every law of the effort channel, one contract: neutral means nothing, proportion, fit gives back what was put in."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import InMotion
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.simulation import CorrectedModel, read_model, write_model
from tests.dynamics.test_inverse import motion_along

RNG = np.random.default_rng(11)
TIME = np.arange(200) * 0.02


@pytest.fixture(scope="module")
def at():
    robot = load("ur5")
    names = robot.mechanism.actuated
    phase = RNG.uniform(0, 6, (1, 6))
    rate = RNG.uniform(1, 3, (1, 6))
    wave = rate * TIME[:, None] + phase
    motion = motion_along(names, np.sin(wave), rate * np.cos(wave), -(rate**2) * np.sin(wave))
    found = InMotion.of(robot.mechanism, motion)
    return found.knowing(np.zeros_like(found.rigid), RNG.normal(size=found.rigid.shape))


def somewhere(law, at):
    """Return a place of the law that this motion shows, and values of its scanned parameters."""
    place = next(place for place in law.places(at.mechanism) if law.acts(place, at))
    return place, dict(law.scanned(place, at)[0])


@pytest.mark.parametrize("law", EFFORT_LAWS, ids=lambda law: f"{law.physics} {law.variant}")
class TestEveryLaw:
    def test_it_has_words_and_units(self, law, at):
        assert law.physics == law.physics.lower()
        assert law.summary
        place, _ = somewhere(law, at)
        names = {quantity.name for quantity in law.quantities_at(place, at.mechanism)}
        assert set(law.neutral) <= names
        assert place.aspect.startswith("effort")

    def test_nothing_adds_nothing(self, law, at):
        place, values = somewhere(law, at)
        nothing = law.fitted(place, np.zeros(len(law.linear)), values)
        assert np.abs(law.efforts(place, {**values, **nothing}, at)).max() < 1e-12

    def test_a_fit_gives_back_what_was_put_in(self, law, at):
        place, values = somewhere(law, at)
        columns = law.efforts_per(place, values, at)
        assert columns.shape == (len(at), len(at.driven), len(law.linear))
        size = np.sqrt((columns**2).mean(axis=(0, 1)))
        put = np.where(size > 0, 0.01 / np.where(size > 0, size, 1), 0.0)
        added = columns @ put
        table = columns.reshape(-1, len(law.linear))
        found, *_ = np.linalg.lstsq(table, added.ravel(), rcond=None)
        assert table @ found == pytest.approx(added.ravel(), abs=1e-10)
        fitted = law.fitted(place, put, values)
        if "age" not in values:  # a delay is exact, its column a chord
            assert law.efforts(place, {**values, **fitted}, at) == pytest.approx(added, abs=1e-10)

    def test_a_person_reads_what_it_says(self, law, at):
        place, values = somewhere(law, at)
        fitted = law.fitted(place, np.full(len(law.linear), 0.5), values)
        text = law.statement(place, {**values, **fitted}, at.mechanism)
        assert len(text) > 15
        assert "nan" not in text

    def test_it_survives_a_file(self, law, at, tmp_path):
        place, values = somewhere(law, at)
        fitted = law.fitted(place, np.full(len(law.linear), 0.01), values)
        kept = {q.name: float({**values, **fitted}[q.name]) for q in law.quantities_at(place, at.mechanism)}
        model = CorrectedModel("ur5", (Effect(law, place, kept),))
        write_model(model, tmp_path / "model.json")
        assert read_model(tmp_path / "model.json") == model


def test_a_delay_is_the_effort_of_a_little_ago(at):
    delays = [law for law in EFFORT_LAWS if law.physics == "effort_delay"]
    law = next(law for law in delays if law.places(at.mechanism)[0].name == "robot")
    late = law.efforts(law.places(at.mechanism)[0], {"delay": 0.02}, at)
    # one sample of 20 ms
    assert (at.predicted + late)[1:] == pytest.approx(at.predicted[:-1], abs=1e-9)


def test_a_late_encoder_shifts_the_friction_of_its_joint_alone(at):
    law = next(law for law in EFFORT_LAWS if law.physics == "encoder_delay" and law.variant == "effort")
    place = Place("elbow_joint", law.variant)
    rubs = 3.0 * np.column_stack([at.speed(name) for name in at.driven])
    bare, rubbing = (law.efforts(place, {"delay": 0.02}, at.knowing(known, at.left)) for known in (0 * rubs, rubs))
    more, column = rubbing - bare, at.driven.index("elbow_joint")
    # one sample of 20 ms
    assert (rubs[:, column] + more[:, column])[:-1] == pytest.approx(rubs[1:, column], abs=1e-9)
    assert not np.delete(more, column, axis=1).any()


def test_a_load_makes_friction_grow(at):
    law = next(law for law in EFFORT_LAWS if law.variant == "effort by load")
    place, values = somewhere(law, at)
    columns = law.efforts_per(place, values, at)[:, at.driven.index(place.name)]
    load = np.abs(at.rigid[:, at.driven.index(place.name)])
    assert columns[:, 1] == pytest.approx(columns[:, 0] * load)


def test_a_coupled_motor_acts_on_both_joints_with_the_power_of_one(at):
    law = next(law for law in EFFORT_LAWS if law.physics == "transmission_coupling")
    place, values = somewhere(law, at)
    other = law.same_places(place, at.mechanism)[0]
    damping = law.efforts_per(place, {**values, "ratio": -1.0}, at)[:, :, 1]
    speed = at.speed(place.name) - at.speed(other)
    power = sum(damping[:, at.driven.index(name)] * at.speed(name) for name in (place.name, other))
    assert power == pytest.approx(speed**2)
