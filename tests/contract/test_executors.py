import threading
import time

import pytest

from tests.contract.rig import ON_RCLPY, PATIENCE_S, choose_words
from throwcollect.ros import ExternalShutdownException, Future, get_message

String = get_message("std_msgs/msg/String")


@pytest.fixture
def node(rig):
    return rig.node("node")


@pytest.fixture
def executor(node):
    return node.executor


def test_spinning_once_without_work_returns_after_the_timeout(executor):
    executor.spin_once(timeout_sec=0)
    start = time.monotonic()
    executor.spin_once(timeout_sec=0)
    executor.spin_once(timeout_sec=0.05)
    assert 0.05 <= time.monotonic() - start < PATIENCE_S


def test_a_waiting_executor_wakes_when_a_message_arrives(rig, node, executor):
    heard = []
    node.create_subscription(String, "t", heard.append, 10)
    publisher = node.create_publisher(String, "t", 10)
    threading.Timer(0.05, lambda: publisher.publish(String())).start()
    while not heard:
        executor.spin_once(timeout_sec=10)


def test_spinning_once_calls_one_callback(node, executor):
    calls = []
    executor.create_task(calls.append, 1)
    executor.create_task(calls.append, 2)
    while not calls:
        executor.spin_once(timeout_sec=1)
    # rclpy calls the latest task first.
    order = [2, 1] if ON_RCLPY else [1, 2]
    assert calls == order[:1]
    executor.spin_once(timeout_sec=1)
    assert calls == order


def test_timers_and_tasks_take_turns(rig, node, executor):
    calls = []
    node.create_timer(0.0, lambda: calls.append("timer"))
    for _ in range(3):
        executor.create_task(calls.append, "task")
    assert rig.spin(lambda: calls.count("task") == 3 and "timer" in calls[calls.index("task") :])
    # rclpy calls all tasks before it looks at timers again.
    assert "timer" in calls[calls.index("task") :][: 4 if ON_RCLPY else 2]


def test_a_timer_fires_while_nothing_else_happens(rig, node):
    calls = []
    node.create_timer(0.01, lambda: calls.append(1))
    assert rig.spin(lambda: len(calls) == 3)


def test_a_task_awaits_futures_and_has_a_result(rig, node, executor):
    future = Future()

    async def double():
        return 2 * await future

    task = executor.create_task(double)
    rig.rest(0.02)
    assert not task.done()
    future.set_result(21)
    assert rig.result(task) == 42


def test_a_future_may_be_completed_by_another_thread(node, executor):
    future = Future()
    threading.Timer(0.05, lambda: future.set_result("x")).start()
    executor.spin_until_future_complete(future, timeout_sec=10)
    assert future.result() == "x"


def test_waiting_for_a_future_ends_at_the_timeout(node, executor):
    future = Future()
    start = time.monotonic()
    executor.spin_until_future_complete(future, timeout_sec=0.05)
    assert not future.done()
    assert 0.05 <= time.monotonic() - start < PATIENCE_S


def test_an_exception_in_a_task_reaches_its_result_and_the_spinning_caller(node, executor):
    async def fail():
        raise LookupError("task failed")

    task = executor.create_task(fail())
    with pytest.raises(LookupError, match="task failed"):
        executor.spin_until_future_complete(task, 1)
    with pytest.raises(LookupError, match="task failed"):
        task.result()


def test_shutting_the_context_down_ends_spinning(node, executor):
    threading.Timer(0.05, node.context.shutdown).start()
    with pytest.raises(ExternalShutdownException, match=choose_words(embedded="shut down", rclpy="^$")):
        executor.spin()
    # rclpy raises another error, as its wait set is gone after the shutdown.
    with pytest.raises(Exception if ON_RCLPY else ExternalShutdownException, match=r"shut down|rcl_shutdown\(\)"):
        executor.spin_once(timeout_sec=0)


def test_shutting_the_executor_down_ends_spinning(node, executor):
    threading.Timer(0.05, executor.shutdown).start()
    executor.spin()
    # On rclpy, a node still refers to its last executor.
    assert ON_RCLPY or node.executor is None
