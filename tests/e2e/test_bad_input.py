"""Each mistake of a user gives one clear message and the right exit code, no files and no traceback."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.commands import command, start_command
from tests.e2e.collection import FAST, INPROCESS, call, call_here, collect_here, write_config
from tests.restrictions import Restrictions
from throwcollect.runs.records import Records

pytestmark = pytest.mark.e2e

OBEYING = Restrictions(obeys_permissions=True)
LIST = ["--set", "sweep.sampler=list", "--set", "sweep.parameters={}", "--set"]


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
        (["foo"], "No such command 'foo'.\n  try: throwcollect --help"),
        (["up", "--foo"], "No such option: --foo\n  try: throwcollect up --help"),
        (["up", "a.yaml", "b.yaml"], "Got unexpected extra argument(s) (b.yaml)\n  try: throwcollect up --help"),
        (
            ["up", "-n", "0", "small.yaml"],
            "run.simulations: should be 1 or more, as no other machine can join (run.listen), got 0",
        ),
        (["up", "-n", "300", "small.yaml"], "run.simulations: should be less than or equal to 256, got 300"),
        (["up", "--trials", "0", "small.yaml"], "trials: should be greater than or equal to 1, got 0"),
        (
            ["up", "--runtime", "dockr", "small.yaml"],
            "run.runtime: should be 'auto', 'local', 'docker' or 'inprocess', got 'dockr'; did you mean 'docker'?",
        ),
        (["up", "--set", "trials", "small.yaml"], "an override should be KEY=VALUE, got 'trials'"),
        (["up", "--set", "trails=3", "small.yaml"], "trails: unknown key; did you mean 'trials'?"),
        (["up"], "throwcollect.yaml: no such file"),
        (["up", "none.yaml"], "none.yaml: no such file"),
        (["up", "small.yml"], "small.yml: no such file; did you mean 'small.yaml'?"),
        (["up", "."], ".: cannot be read: not a file"),
        (["plan", "binary.yaml"], "binary.yaml: cannot be read: no UTF-8 text: byte 0"),
        (["config", "broken.yaml"], "broken.yaml:2: not valid YAML: expected ',' or ']', but got '<stream end>'"),
        (["plan", "empty.yaml"], "empty.yaml: the file is empty"),
        (["plan", "list.yaml"], "list.yaml: the file should hold keys and values"),
        (["plan", "bare.yaml"], "bare.yaml: sweep.parameters: nothing is swept"),
        (["plan", "grid.yaml"], "grid.yaml:1: trials: should be at most 1, as the sweep has no more points, got 4\n"),
        (["up", "grid.yaml", "--trials", "3"], "trials: should be at most 1, as the sweep has no more points, got 3\n"),
        (
            ["coordinator", "data", "--config", "grid.yaml"],
            "grid.yaml:1: trials: should be at most 1, as the sweep has no more points, got 4\n",
        ),
        (["plan", "huge.yaml"], "huge.yaml:1: sweep.parameters.ball.mass_kg.count: should be less than or equal to 1"),
        (["up", "small.yaml", "--output", "o" * 300], "ooo"),
        (["up", "pipe"], "pipe: cannot be read: not a file"),
    ],
)
def test_a_wrong_command_line_gives_one_message_and_no_files(
    arguments: list[str], message: str, say: Callable[..., Said], small: Path, tmp_path: Path
) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\x00")
    (tmp_path / "broken.yaml").write_text("a: [1\n")
    (tmp_path / "empty.yaml").write_text("")
    (tmp_path / "list.yaml").write_text("- 1\n")
    (tmp_path / "bare.yaml").write_text("trials: 2\n")
    grid = "{sampler: grid, parameters: {ball.mass_kg: {values: [0.04]}}}"
    (tmp_path / "grid.yaml").write_text(f"trials: 4\nsweep: {grid}\n")
    huge = "{sampler: grid, parameters: {ball.mass_kg: {min: 0.03, max: 0.04, count: 99999999999}}}"
    (tmp_path / "huge.yaml").write_text(f"sweep: {huge}\n")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "torn.parquet").write_bytes(b"PAR1")
    (tmp_path / "bad.csv").write_text("ball.mass_kg\n0.04\nx\n")
    before = sorted(tmp_path.iterdir())
    said = say(*arguments)
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith(f"throwcollect: {message}")
    # A message may repeat what was typed, but has no traceback.
    assert len(said.err) < 1500 + len("".join(arguments))
    assert sorted(tmp_path.iterdir()) == before


def test_all_problems_of_a_configuration_are_reported_at_once(say: Callable[..., Said], tmp_path: Path) -> None:
    (tmp_path / "many.yaml").write_text(
        "trails: 9\nball: {mass_kg: heavy}\ntask: {end: {arm_right_4_joint: 90}}\nsim: {physics_hz: 5}\n"
    )
    said = say("up", "many.yaml", "--output", "data")
    assert said.code == 2
    assert said.err.splitlines() == [
        "throwcollect: many.yaml:1: trails: unknown key; did you mean 'trials'?",
        "many.yaml:2: ball.mass_kg: should be a valid number, got 'heavy'",
        "many.yaml:3: task.end.arm_right_4_joint: should be less than or equal to 6.3, got 90",
        "many.yaml:4: sim.physics_hz: should be greater than or equal to 100, got 5",
    ]
    assert not (tmp_path / "data").exists()


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


def test_a_sweep_that_the_robot_cannot_do_is_refused(say: Callable[..., Said], small: Path, tmp_path: Path) -> None:
    said = say("up", "small.yaml", "--set", "sweep.parameters.task.duration_s={min: 0.2, max: 0.2}", "--output", "data")
    assert said.code == 2
    assert (
        "throwcollect: small.yaml:4: sweep: 2 trials, all refused: 2 × arm_right_7_joint moves at 6.034 rad/s"
        in said.err
    )
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("directory", ["locked", "locked/data"])
def test_up_into_a_directory_without_write_permission_is_refused(directory: str, small: Path, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o555)
    said = call("up", small, "--output", tmp_path / directory, restrictions=OBEYING)
    assert (said.returncode, said.stdout) == (2, "")
    assert said.stderr.startswith(f"throwcollect: {tmp_path / directory}")
    assert "Permission denied" in said.stderr
    assert list((tmp_path / "locked").iterdir()) == []


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


def test_info_verify_and_digest_refuse_an_incomplete_dataset(
    say: Callable[..., Said], tmp_path: Path, dataset: tuple[Path, dict[str, object]]
) -> None:
    whole = dataset[0]
    (tmp_path / "empty").mkdir()
    begun = tmp_path / "begun"
    begun.mkdir()
    for name in ("config.yaml", "plan.parquet"):
        (begun / name).write_bytes((whole / name).read_bytes())
    torn = tmp_path / "torn"
    torn.mkdir()
    for path in whole.iterdir():
        if path.is_file() and path.name != "throws.parquet":
            (torn / path.name).write_bytes(path.read_bytes())
    for verb in ("info", "verify", "digest"):
        for name, message in {
            "none": "none: holds no dataset",
            "empty": "empty: holds no dataset",
            "begun": "begun: the dataset is not finished: it has no metadata.yaml\n  try: throwcollect resume begun",
            "torn": "throws.parquet: is missing",
        }.items():
            said = say("dataset", verb, name)
            assert (verb, name, said.code) == (verb, name, 4)
            assert message in said.out + said.err
            assert said.err.startswith("throwcollect: ")


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


@pytest.mark.parametrize("arguments", [["plan", "small.yaml"], ["--help"]])
def test_a_closed_output_pipe_is_no_error(arguments: list[str], small: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    said = subprocess.run(
        command(*arguments),
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        cwd=small.parent,
        check=False,
    )
    os.close(writing)
    assert said.returncode == 0
    # On a slow machine, the progress of the plan is printed, too.
    assert [line for line in said.stderr.splitlines() if "trials" not in line] == []


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
    (run,) = [run for run in Records().all() if run.record.directory == str(tmp_path / "data")]
    assert (run.record.exit_code, run.record.failure) == (0, None)
    assert run.record.progress is not None
    assert run.record.progress.ended == 2
    assert (tmp_path / "data" / "metadata.yaml").exists()


def test_ctrl_c_while_libraries_are_loaded_prints_no_traceback(small: Path, tmp_path: Path) -> None:
    # This stands in for the library of the command line: Ctrl-C arrives while it is imported.
    (tmp_path / "typer.py").write_text("import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(9)\n")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    said = subprocess.run(
        command("plan", small), capture_output=True, text=True, timeout=60, env=environment, check=False
    )
    assert (said.returncode, said.stdout, said.stderr) == (130, "", "")


def test_output_that_cannot_be_written_is_an_error(small: Path) -> None:
    with Path("/dev/full").open("w") as full:
        said = subprocess.run(
            command("config", small), stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False
        )
    assert said.returncode == 6
    assert said.stderr == "throwcollect: the output cannot be written: No space left on device\n"
