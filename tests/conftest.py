"""What all tests rely on."""

import signal

import pytest

# Whoever starts the tests in the background may have SIGINT ignored, which all processes that they start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the tests of a file on one worker with `--dist loadgroup`, and on one worker all that need an engine.

    Tests of a file share a collection or a simulation. Those with an engine look at all that is on it.
    """
    for item in items:
        group = "engine" if item.get_closest_marker("docker") else item.nodeid.partition("::")[0]
        item.add_marker(pytest.mark.xdist_group(group))
