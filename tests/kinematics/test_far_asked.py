"""What is asked in millimetres where metres are meant is asked about, by the package as by the command line."""

import pytest

from prup_pin import load
from prup_pin.errors import UnreachablePoseError


def test_millimetres_that_would_be_metres_are_asked_about():
    with pytest.raises(
        UnreachablePoseError, match=r"z = 400 m: is it in mm\? Expected m, which would be 0\.4\. "
    ) as caught:
        load("3prup").pose(z=400, theta=0, phi=0)
    assert "Nearest feasible" in str(caught.value)
    with pytest.raises(UnreachablePoseError) as caught:
        load("3prup").pose(z=4, theta=0, phi=0)
    assert "is it in" not in str(caught.value)
