import signal

import pytest

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.embedded.exceptions import NotInitializedException


def test_a_context_lives_from_init_to_shutdown(environment):
    context = ros.Context()
    assert not context.ok()
    with pytest.raises(NotInitializedException, match=r"init\(\) has not been called"):
        _ = context.session
    context.init()
    assert context.ok()
    with pytest.raises(RuntimeError, match="already"):
        context.init()
    session = context.session
    context.shutdown()
    assert not context.ok()
    assert session.is_closed()
    with pytest.raises(RuntimeError, match="not been initialised"):
        context.shutdown()
    context.try_shutdown()


def test_a_context_can_be_used_again(environment):
    for _ in range(2):
        ros.init()
        ros.create_node("n")
        ros.shutdown()


@pytest.mark.parametrize("text", ["-1", "x", "1000"])
def test_the_domain_must_be_a_number(environment, monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID must be a number"):
        ros.Context().init()


def test_a_given_domain_wins_over_the_environment(environment):
    context = ros.Context()
    context.init(domain_id=77)
    try:
        assert context.get_domain_id() == 77
    finally:
        context.shutdown()


def test_callbacks_hear_of_the_shutdown_once(environment):
    context, calls = ros.Context(), []
    context.init()
    context.on_shutdown(lambda: calls.append(1))
    context.request_shutdown()
    context.shutdown()
    assert calls == [1]


def test_sigterm_is_handled_as_long_as_the_default_context_lives(environment):
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    ros.init()
    assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    signal.raise_signal(signal.SIGTERM)
    assert not ros.ok()
    ros.shutdown()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
