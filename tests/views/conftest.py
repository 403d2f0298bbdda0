"""One Chromium for all tests of a process."""

import pytest

from .chromium import Browser


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    """A Chromium whose `tab` is fresh for whoever asks."""
    browser = Browser(str(tmp_path_factory.mktemp("chromium")))
    yield browser
    browser.close()
