"""What all tests rely on."""

import signal

import pytest

# Whoever starts the tests in the background may have SIGINT ignored, which all processes that they start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Where tests run side by side, one worker gets all that share fixtures, or look at everything on the engine."""
    shared = item.path.parent if item.path.parent.name == "docker" else item.path
    item.add_marker(pytest.mark.xdist_group(shared.name))
