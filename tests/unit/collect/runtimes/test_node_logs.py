from pathlib import Path

from throwcollect.collect.runtimes.node_logs import NodeLogs, Tail
from throwcollect.own_process import ready_line


def test_logs_leave_out_what_an_earlier_run_printed(tmp_path: Path) -> None:
    logs = NodeLogs(tmp_path)
    ready = f"{ready_line('sim_0')}\n".encode()
    append(logs.path("sim_0"), ready + "größer\n".encode())
    logs.skip_earlier()
    assert (logs.tail("sim_0"), logs.said_ready("sim_0")) == ("", False)
    append(logs.path("sim_0"), b"begun\n" + ready)
    assert (logs.tail("sim_0").splitlines()[0], logs.said_ready("sim_0")) == ("begun", True)
    assert NodeLogs(tmp_path).tail("sim_0").splitlines()[1] == "größer"


def test_logs_forget_that_a_removed_node_was_ready(tmp_path: Path) -> None:
    logs = NodeLogs(tmp_path)
    for name in ("sim_0", "sim_1"):
        append(logs.path(name), f"{ready_line(name)}\n".encode())
    logs.skip("sim_1")
    logs.skip("sim_2")
    assert [logs.said_ready(name) for name in ("sim_0", "sim_1", "sim_2")] == [True, False, False]
    append(logs.path("sim_1"), f"{ready_line('sim_1')}\n".encode())
    assert logs.said_ready("sim_1")


def append(path: Path, data: bytes) -> None:
    with path.open("ab") as file:
        file.write(data)


def test_the_tail_of_a_log_gives_every_line_once_and_whole(tmp_path: Path) -> None:
    path = tmp_path / "sim_0.log"
    tail = Tail(path)
    assert list(tail.lines()) == []
    append(path, b"one\ntw")
    assert list(tail.lines()) == ["one"]
    assert list(tail.lines()) == []
    append(path, b"o\n\nthr\xffee")
    assert list(tail.lines()) == ["two", ""]
    assert list(tail.lines(torn=True)) == ["thr\ufffdee"]
    assert list(tail.lines(torn=True)) == []


def test_the_tail_of_a_log_can_skip_existing_lines(tmp_path: Path) -> None:
    path = tmp_path / "sim_0.log"
    Tail(path).skip()
    append(path, b"old\n")
    tail = Tail(path)
    tail.skip()
    append(path, b"new\n")
    assert list(tail.lines()) == ["new"]


def test_logs_are_listed_in_the_order_in_which_nodes_are_started(tmp_path: Path) -> None:
    names = ["launcher", "router", "coordinator", "sim_0", "sim_2", "sim_10"]
    for name in reversed(names):
        (tmp_path / f"{name}.log").touch()
    (tmp_path / "events.jsonl").touch()
    assert list(NodeLogs(tmp_path).files()) == names
    assert NodeLogs(tmp_path / "none").files() == {}
