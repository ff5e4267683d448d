import socket
import threading
import time

import pytest

from throwcollect.ros.router_endpoint import answers


@pytest.fixture
def port() -> int:
    """A port at which nothing listens."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        number: int = taken.getsockname()[1]
        return number


def test_an_endpoint_at_which_nothing_listens_does_not_answer(port: int) -> None:
    begun = time.monotonic()
    assert not answers(f"tcp/127.0.0.1:{port}")
    assert not answers(f"tls/127.0.0.1:{port}", patience_s=0.1)
    assert time.monotonic() - begun >= 0.1


def test_an_endpoint_that_begins_to_listen_in_time_answers(port: int) -> None:
    def listen() -> None:
        time.sleep(0.1)
        with socket.create_server(("127.0.0.1", port)) as server:
            server.accept()[0].close()

    thread = threading.Thread(target=listen)
    thread.start()
    assert answers(f"tls/127.0.0.1:{port}", patience_s=30)
    thread.join()
