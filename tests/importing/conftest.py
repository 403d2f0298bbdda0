import pytest

import prup_pin


@pytest.fixture(scope="session")
def ur5():
    return prup_pin.load("ur5").mechanism
