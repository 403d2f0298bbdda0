"""A law at a share of what it does: half a gap, half a spring's loss; and never a number that is none."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.candidates import Candidate, Term
from prup_pin.laws import LAWS


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.physics}-{type(law).__name__}")
def test_a_law_is_lessened_towards_nothing(law):
    mechanism = load("3prup").mechanism
    for place in list(law.places(mechanism))[:1]:
        candidate = Candidate(law, place, mechanism, 1.0)
        term = Term(candidate, candidate.scan()[0])
        with np.errstate(all="raise"):
            less = term.lessened(0.25)
        assert np.isfinite(less.coordinates).all()
        np.testing.assert_allclose(term.lessened(1.0).coordinates, term.coordinates, rtol=1e-9, atol=1e-12)
