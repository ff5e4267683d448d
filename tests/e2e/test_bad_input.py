"""Each mistake of a user gives one clear message and the right exit code, no files and no traceback."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.commands import start_command
from tests.e2e.collection import FAST, INPROCESS, call, call_here, collect_here, write_config
from tests.restrictions import Restrictions
from throwcollect.collect.runs.records import Records

pytestmark = pytest.mark.e2e


class Said(NamedTuple):
    code: object
    out: str
    err: str


@pytest.fixture
def say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Said]:
    """The command, called in this process, as most mistakes are found before any other is started."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Said:
        done = call_here(*arguments)
        return Said(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_config(tmp_path, trials=2, sim=FAST)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["up", "--foo"], "No such option: --foo\n  try: throwcollect up --help"),
        (
            ["up", "-n", "0", "small.yaml"],
            "run.simulations: should be 1 or more, as no other machine can join (run.listen), got 0",
        ),
        (["up", "--set", "trails=3", "small.yaml"], "trails: unknown key; did you mean 'trials'?"),
        (["up", "small.yml"], "small.yml: no such file; did you mean 'small.yaml'?"),
        (["config", "broken.yaml"], "broken.yaml:2: not valid YAML: expected ',' or ']', but got '<stream end>'"),
        (["plan", "list.yaml"], "list.yaml: the file should hold keys and values"),
        (["plan", "huge.yaml"], "huge.yaml:1: sweep.parameters.ball.mass_kg.count: should be less than or equal to 1"),
    ],
)
def test_a_wrong_command_line_gives_one_message_and_no_files(
    arguments: list[str], message: str, say: Callable[..., Said], small: Path, tmp_path: Path
) -> None:
    (tmp_path / "broken.yaml").write_text("a: [1\n")
    (tmp_path / "list.yaml").write_text("- 1\n")
    huge = "{sampler: grid, parameters: {ball.mass_kg: {min: 0.03, max: 0.04, count: 99999999999}}}"
    (tmp_path / "huge.yaml").write_text(f"sweep: {huge}\n")
    before = sorted(tmp_path.iterdir())
    said = say(*arguments)
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith(f"throwcollect: {message}")
    # A message may repeat what was typed, but has no traceback.
    assert len(said.err) < 1500 + len("".join(arguments))
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("directory", "message"),
    [
        ("used", "used: holds notes.txt\n  expected: a directory that is new or empty"),
        ("file", "file: cannot be used as directory of a dataset: Not a directory"),
        ("file/data", "file/data: cannot be used as directory of a dataset: Not a directory"),
    ],
)
def test_a_taken_output_directory_is_left_alone(
    directory: str, message: str, say: Callable[..., Said], small: Path, tmp_path: Path
) -> None:
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "notes.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    said = say("up", "small.yaml", "--output", directory)
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith(f"throwcollect: {message}")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "notes.txt", "small.yaml", "used"]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """A dataset, and the summary that was printed."""
    directory = tmp_path_factory.mktemp("whole")
    config = write_config(directory, trials=2, sim=FAST)
    return directory / "data", collect_here(config, directory / "data")


@pytest.mark.parametrize("moment", ["plan", "collection", "finish"])
def test_a_collection_on_a_full_disk_ends_with_an_error_and_can_be_resumed(
    moment: str, small: Path, tmp_path: Path, dataset: tuple[Path, dict[str, object]]
) -> None:
    shard = (dataset[0] / "small_00000.mcap").stat().st_size
    # One of two episodes fits into three quarters of the shard. The finished shard is larger by its summary.
    limit, file = {
        "plan": (1000, "config.yaml"),
        "collection": (shard * 3 // 4, "small_00000.mcap.part"),
        "finish": (shard - 100, "small_00000.mcap"),
    }[moment]
    # In a collection by nodes, it is the coordinator that runs into the full disk.
    runtime = ("-n", "1") if moment == "collection" else INPROCESS
    said = call("up", *runtime, small, "--output", tmp_path / "data", restrictions=Restrictions(file_bytes=limit))
    assert said.stdout == ""
    assert f"{tmp_path / 'data' / file}: cannot be written: File too large\n" in said.stderr
    assert "Traceback" not in said.stderr
    assert said.returncode == (2 if moment == "plan" else 4)
    left = {path.name for path in (tmp_path / "data").glob("*.mcap*")}
    assert left == (set() if moment == "plan" else {"small_00000.mcap.part"})
    assert (tmp_path / "data").exists() == (moment != "plan")
    if moment != "plan":
        resumed = call_here("resume", tmp_path / "data", *INPROCESS, "--json")
        assert resumed.returncode == 0, resumed.stderr
        assert json.loads(resumed.stdout)["digest"] == dataset[1]["digest"]
        kept = [json.loads(line) for line in (tmp_path / "data" / "logs" / "journal.jsonl").read_text().splitlines()]
        episodes = {"collection": 1, "finish": 2}[moment]
        assert [each["episodes"] for each in kept if each["event"] == "recovered"] == [episodes]


def test_json_output_is_one_document_without_messages(
    say: Callable[..., Said], small: Path, dataset: tuple[Path, dict[str, object]]
) -> None:
    for arguments in (
        ["config", "small.yaml"],
        ["plan", "small.yaml"],
        ["doctor"],
        ["dataset", "info", str(dataset[0])],
    ):
        said = say(*arguments, "--json")
        assert (arguments, said.code, said.err) == (arguments, 0, ""), said.out
        assert json.loads(said.out)
    told = json.loads(say("dataset", "info", str(dataset[0]), "--json").out)
    assert told.items() <= dataset[1].items()


@pytest.mark.parametrize("lost", ["both", "messages"])
def test_a_collection_goes_on_when_its_output_pipe_is_closed(lost: str, small: Path, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    collecting = start_command(
        *("up", *(("-n", "1") if lost == "both" else INPROCESS), small, "--output", tmp_path / "data"),
        stdout=writing if lost == "both" else subprocess.PIPE,
        stderr=writing,
    )
    os.close(writing)
    collecting.communicate(timeout=60)
    assert collecting.returncode == (6 if lost == "both" else 0)
    (run,) = [run for run in Records().all() if run.record.directory == tmp_path / "data"]
    assert (run.record.exit_code, run.record.failure) == (0, None)
    assert run.record.progress is not None
    assert run.record.progress.ended == 2
    assert (tmp_path / "data" / "metadata.yaml").exists()
