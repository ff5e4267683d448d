"""What all tests rely on."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.commands import command_server

# Whoever starts the tests in the background may have SIGINT ignored, which all processes that they start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes depends on what else the machine does.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")


def pytest_collection_finish() -> None:
    """Spare the garbage collector what stays until the end, a twentieth of the time of the tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)


@pytest.fixture(scope="session")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Commands are forked off one process for all tests of a session, and have what the extras bring alone."""
    # Arrow imports pandas wherever that is installed, which takes each process a quarter of a second.
    extras_alone = tmp_path_factory.mktemp("extras")
    (extras_alone / "pandas.py").write_text("raise ImportError('no extra brings pandas')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(extras_alone), prepend=os.pathsep)
        with command_server():
            yield


@pytest.fixture(autouse=True)
def _unsettled(monkeypatch: pytest.MonkeyPatch) -> None:
    """What carries messages is what the environment says again, whatever a test before has settled on."""
    monkeypatch.setattr("throwcollect.ros.middleware._settled", [])


@pytest.fixture(autouse=True)
def _signal_handlers() -> Iterator[None]:
    """Commands and nodes set handlers of signals; where a test runs one in this process, they are put back."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
