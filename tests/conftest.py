"""Settings and fixtures for all tests."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.commands import command_server
from throwcollect.state_directory import STATE_VARIABLE

# A shell may start tests in the background with SIGINT ignored, which all their processes would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

# There is no deadline, as the time of an example depends on the load of the machine.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")


def pytest_collection_finish() -> None:
    """Exempt objects that live until the end from garbage collection: that saves a twentieth of the time of tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)


@pytest.fixture(scope="session", autouse=True)
def _state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Remember runs of tests where `throwcollect ps` of whoever runs the tests does not find them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Fork the commands of all tests off one process, which sees only packages that the extras bring."""
    # Arrow imports pandas if it is installed, which would take each process a quarter of a second.
    extras_alone = tmp_path_factory.mktemp("extras")
    (extras_alone / "pandas.py").write_text("raise ImportError('no extra brings pandas')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(extras_alone), prepend=os.pathsep)
        with command_server():
            yield


@pytest.fixture(autouse=True)
def _unsettled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the middleware that an earlier test has settled on, so that the environment decides again."""
    monkeypatch.setattr("throwcollect.ros.middleware._settled", [])


@pytest.fixture(autouse=True)
def _signal_handlers() -> Iterator[None]:
    """Restore signal handlers after each test, as commands and nodes that run in this process set their own."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
