from pathlib import Path

from throwcollect.runtime.logs import Tail, log_files


def append(path: Path, data: bytes) -> None:
    with path.open("ab") as file:
        file.write(data)


def test_lines_come_once_and_whole(tmp_path: Path) -> None:
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


def test_what_is_there_can_be_skipped(tmp_path: Path) -> None:
    path = tmp_path / "sim_0.log"
    Tail(path).skip()
    append(path, b"old\n")
    tail = Tail(path)
    tail.skip()
    append(path, b"new\n")
    assert list(tail.lines()) == ["new"]


def test_logs_come_in_the_order_in_which_nodes_are_started(tmp_path: Path) -> None:
    names = ["launcher", "router", "coordinator", "sim_0", "sim_2", "sim_10"]
    for name in reversed(names):
        (tmp_path / f"{name}.log").touch()
    (tmp_path / "events.jsonl").touch()
    assert list(log_files(tmp_path)) == names
    assert log_files(tmp_path / "none") == {}
