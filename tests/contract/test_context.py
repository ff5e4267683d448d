"""Contexts, from init to shutdown."""

import pytest

from tests.contract.rig import choose_words
from throwcollect import ros


def test_a_context_lives_from_init_to_shutdown(environment):
    context = ros.Context()
    assert not context.ok()
    context.init()
    assert context.ok()
    with pytest.raises(RuntimeError, match=choose_words(embedded="already", rclpy="only be called once")):
        context.init()
    context.shutdown()
    assert not context.ok()
    with pytest.raises(RuntimeError, match=choose_words(embedded="not been initialised", rclpy="already called")):
        context.shutdown()
    context.try_shutdown()


def test_a_context_can_be_used_again(environment):
    for _ in range(2):
        ros.init()
        ros.Node("n")
        ros.shutdown()


def test_a_given_domain_wins_over_the_environment(environment):
    context = ros.Context()
    context.init(domain_id=77)
    try:
        assert context.get_domain_id() == 77
    finally:
        context.shutdown()
