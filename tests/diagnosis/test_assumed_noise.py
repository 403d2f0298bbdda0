"""What nothing shows is said to be assumed or not determined, not to be a result."""

from __future__ import annotations

from types import SimpleNamespace

from prup_pin.channels.noise import Noise
from prup_pin.diagnosis.diagnosis import FittedParameter
from prup_pin.views.text.diagnosis_words import noise_text, parameter_texts


def test_open_intervals_are_said_to_be_no_result():
    fitted = {
        "closing_load": FittedParameter(0.01, "N m", (1e-5, 339.1)),
        "smoothing": FittedParameter(0.0, "m/s", (0.0, 1000.0)),
        "limit": FittedParameter(2.4, "N m", (2.2, 2.6)),
        "presliding": FittedParameter(2e-6, "rad", (0.0, 72e-6)),
    }
    told = {name: value for name, value, _ in parameter_texts(fitted)}
    assert told["closing load"] == told["smoothing"] == "not determined by this recording"
    assert told["limit"] == "2.4 N m"
    assert told["presliding"] == "below 72 µrad"


def test_an_assumed_noise_says_which_keys_declare_it():
    found = SimpleNamespace(
        noise=Noise(1e-6, 5e-6, 0.0, 0.0, "assumed"),
        columns=(("position", "m", slice(0, 3)),),
        by_channel={"position": {}},
        efforts=None,
    )
    *_, source = noise_text(found)
    assert source == "not declared: assumed, as nothing shows it; declare position_noise and rotation_noise"
