"""How well a corrected model's values are known together, in its file."""

import json

import numpy as np
import pytest

from prup_pin.errors import RecordingFileError
from prup_pin.simulation import CorrectedModel, Posterior, PosteriorValue, effect_named, read_model, write_model

from .bench import three_prup


@pytest.fixture(scope="module")
def model():
    mechanism = three_prup().mechanism
    gap = {"half_gap": 1.2e-5, "closing_load": 0.7}
    off = {"leg1_slide.encoder_offset": 3e-5, "leg2_slide.encoder_offset": -2e-5}
    effects = (
        effect_named("calibration", "robot", "", off, mechanism),
        effect_named("backlash", "leg2/ball_nut", "", gap, mechanism),
    )
    values = [
        PosteriorValue(0, "leg1_slide.encoder_offset", 3e-5, False),
        PosteriorValue(0, "leg2_slide.encoder_offset", -2e-5, False),
        PosteriorValue(1, "half_gap", 1.2e-5, True),
        PosteriorValue(1, "closing_load", 0.7, True),
    ]
    return CorrectedModel("3prup", effects, posterior=Posterior.of(values, covariant()))


def covariant():
    """Return how four values change per number of unit variance: two of them all but one number."""
    rng = np.random.default_rng(3)
    found = rng.normal(size=(4, 6)) * np.array([[1e-5], [1e-5], [0.02], [0.3]])
    found[1] = 0.999 * found[0] + 1e-8 * rng.normal(size=6)
    return found


def test_the_covariance_survives_its_root_and_the_file(model, tmp_path):
    wanted = covariant() @ covariant().T
    root = model.posterior.root
    assert np.allclose(root @ root.T, wanted, rtol=1e-9, atol=0)
    assert np.allclose(root, np.tril(root))
    write_model(model, tmp_path / "model.json")
    again = read_model(tmp_path / "model.json").posterior
    assert again.values == model.posterior.values
    found = again.root @ again.root.T
    assert np.allclose(found, wanted, rtol=1e-6, atol=0)
    # what is known of the difference of two that are told together is known no worse
    apart = np.array([-0.999, 1.0, 0.0, 0.0])
    assert apart @ found @ apart == pytest.approx(apart @ wanted @ apart, rel=1e-3)


def test_what_knows_nothing_says_so(tmp_path):
    model = CorrectedModel("3prup", posterior=Posterior.of([], np.zeros((0, 0))))
    write_model(model, tmp_path / "model.json")
    again = read_model(tmp_path / "model.json").posterior
    assert again == Posterior()
    assert again.root.shape == (0, 0)


def test_a_file_without_it_is_read_as_ever(model, tmp_path):
    write_model(model, tmp_path / "model.json")
    value = json.loads((tmp_path / "model.json").read_text())
    assert value["version"] == 1
    assert value.pop("posterior")["root"]
    (tmp_path / "old.json").write_text(json.dumps(value))
    assert read_model(tmp_path / "old.json").posterior is None


@pytest.mark.parametrize(
    ("change", "key", "told"),
    [
        (lambda it: it.update(explained=1), "posterior.explained", "expected true or false"),
        (lambda it: it.pop("root"), "posterior.root", "is missing; expected a list of texts of numbers"),
        (lambda it: it.update(rooot=[]), "posterior.rooot", "unknown key. Did you mean 'root'?"),
        (lambda it: it["root"].pop(), "posterior.root", "has 3 rows; expected one for each of 4 parameters"),
        (lambda it: it["root"].__setitem__(1, "1e-5"), "posterior.root[1]", "expected a text of 2 numbers"),
        (lambda it: it["root"].__setitem__(0, "nan"), "posterior.root[0]", "is no row of a root"),
        (lambda it: it["root"].__setitem__(0, "-1e-5"), "posterior.root[0]", "the last one above 0"),
        (lambda it: it["root"].__setitem__(0, [1e-5]), "posterior.root[0]", "is a list; expected a text"),
        (lambda it: it["parameters"][0].update(effect=2), "posterior.parameters[0].effect", "0 to 1"),
        (lambda it: it["parameters"][2].update(parameter="gap"), "posterior.parameters[2].parameter", "is gap"),
        (lambda it: it["parameters"][2].update(value="x"), "posterior.parameters[2].value", 'is the text "x"'),
        (lambda it: it["parameters"][1].update(logarithm=True), "posterior.parameters[1].logarithm", "above 0"),
        (lambda it: it["parameters"].__setitem__(1, it["parameters"][0]), "posterior.parameters", "there twice"),
    ],
)
def test_what_is_wrong_with_it_is_told_with_its_place(change, key, told, model, tmp_path):
    write_model(model, tmp_path / "model.json")
    value = json.loads((tmp_path / "model.json").read_text())
    change(value["posterior"])
    (tmp_path / "model.json").write_text(json.dumps(value))
    with pytest.raises(RecordingFileError) as caught:
        read_model(tmp_path / "model.json")
    found = {problem.key: problem.message for problem in caught.value.problems}
    assert told in found[key]
