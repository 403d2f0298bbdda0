"""Every law that is in is challenged by every other one, in turn."""

from types import SimpleNamespace

from prup_pin.diagnosis import search


def test_after_a_term_was_replaced_the_next_one_is_asked_before_it_is_asked_again(monkeypatch):
    """A soft joint beside a bias of the sensor, which stands for weight, is the wrong one: weight comes, it goes."""
    better = {
        (("bias", "drive"), 0): ("weight", "drive"),
        (("weight", "drive"), 0): ("payload", "drive"),  # which makes up for the wrong joint as well
        (("weight", "drive"), 1): ("weight", "joint"),
    }

    def simulated_alternatives(search, fit, index, library):
        terms = better.get((fit.terms, index))
        return [fit.terms[index]], terms and SimpleNamespace(terms=terms)

    monkeypatch.setattr(search, "simulated_alternatives", simulated_alternatives)
    found, _ = search.swapped(SimpleNamespace(over=False), SimpleNamespace(terms=("bias", "drive")), ())
    assert found.terms == ("weight", "joint")
