import pytest

from rclzenoh.context import Context
from rclzenoh.exceptions import NotInitializedException


def test_a_context_has_an_open_session_from_init_to_shutdown(environment):
    context = Context()
    with pytest.raises(NotInitializedException, match=r"init\(\) has not been called"):
        _ = context.session
    context.init()
    session = context.session
    context.shutdown()
    assert session.is_closed()


def test_a_context_is_not_ok_as_soon_as_a_shutdown_is_requested(environment):
    context, calls = Context(), []
    context.init()
    context.on_shutdown(lambda: calls.append(1))
    context.request_shutdown()
    assert not context.ok()
    context.shutdown()
    assert calls == [1]
