from rclzenoh.context import Context


def test_a_context_is_not_ok_as_soon_as_a_shutdown_is_requested(environment):
    context, calls = Context(), []
    context.init()
    context.on_shutdown(lambda: calls.append(1))
    context.request_shutdown()
    assert not context.ok()
    context.shutdown()
    assert calls == [1]
