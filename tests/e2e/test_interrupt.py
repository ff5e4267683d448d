"""Interruptions and losses leave no torn files and no processes, and messages name their cause."""

import io
import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from mcap.exceptions import McapError
from mcap.records import Chunk, Metadata
from mcap.stream_reader import StreamReader

from tests.e2e.collection import (
    FAST,
    INPROCESS,
    Running,
    call_here,
    collect_here,
    fingerprints,
    journal,
    start,
    words_of,
    write_config,
)

pytestmark = pytest.mark.e2e
TRIALS = 16


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    # Slow enough that signals arrive before the last trial has ended, on a busy machine too.
    return write_config(
        tmp_path_factory.mktemp("config"),
        trials=TRIALS,
        sim=f"{FAST}, real_time_factor: 10, max_trial_s: 2",
    )


@pytest.fixture(scope="module")
def reference(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("reference") / "data"
    collect_here(config, directory)
    return directory


@pytest.fixture
def started(tmp_path: Path) -> Iterator[list[Running]]:
    """A list of collections, which are ended after the test even if it fails."""
    running: list[Running] = []
    yield running
    for each in running:
        if each.process.poll() is None:
            each.process.kill()
            each.process.communicate()


def begin(started: list[Running], config: Path, directory: Path, *options: str) -> tuple[Running, list[psutil.Process]]:
    """A collection with two simulations, and its nodes as soon as all four run."""
    running = start(config, directory, 2, *options)
    started.append(running)
    running.wait_until(lambda: len(running.nodes()) == 4)
    return running, running.nodes()


def in_the_middle(running: Running, share: float = 0.3, *, whole: Path) -> None:
    size = (whole / "small_00000.mcap").stat().st_size
    running.wait_until(lambda: running.count_bytes() > share * size)


def assert_gone(nodes: list[psutil.Process]) -> None:
    _, alive = psutil.wait_procs(nodes, timeout=60)
    assert alive == []


def episodes(part: Path, *, cut: bool = False) -> Counter[str]:
    """Trials of the whole episodes of a shard, as MCAP's own reader finds them."""
    found: Counter[str] = Counter()
    data = io.BytesIO(part.read_bytes())
    chunks = 0
    try:
        for record in StreamReader(data, emit_chunks=True, validate_crcs=True).records:
            chunks += isinstance(record, Chunk)
            if isinstance(record, Metadata) and record.name == "throwcollect.episode":
                found[record.metadata["trial"]] += 1
    except (McapError, EOFError):
        # Only the footer is missing: all records before it were read.
        assert cut or data.tell() == len(data.getvalue())
    assert cut or chunks == len(found) + 1
    return found


def assert_goes_on(directory: Path, reference: Path) -> None:
    """Resuming ends with the files of an undisturbed collection, and runs no trial twice."""
    said = call_here("resume", directory, *INPROCESS)
    assert said.returncode == 0, said.stderr
    assert fingerprints(directory) == fingerprints(reference)
    written = Counter(event["trial"] for event in events(directory) if event["event"] == "commit")
    assert written == dict.fromkeys(range(TRIALS), 1)


def events(directory: Path) -> list[dict[str, Any]]:
    return journal(directory)


def test_ctrl_c_before_any_simulation_is_ready_ends_the_run_and_its_nodes(
    config: Path, tmp_path: Path, started: list[Running]
) -> None:
    # A busy machine may find the nodes only when trials run; in real time, the run is then not yet over.
    running, nodes = begin(started, config, tmp_path / "data", "--set", "sim.real_time_factor=1")
    running.process.send_signal(signal.SIGINT)
    code, out, err = running.finish()
    assert (code, out) == (130, "")
    assert f"throwcollect: interrupted; finished throws are in {tmp_path / 'data'}" in err
    assert "Traceback" not in err
    assert_gone(nodes)


def test_an_interruption_finishes_the_running_trials(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, nodes = begin(started, config, tmp_path / "data")
    in_the_middle(running, whole=reference)
    before = running.count_bytes()
    running.process.send_signal(signal.SIGINT)
    code, out, err = running.finish()
    assert (code, out) == (130, "")
    assert "interrupted: finishing the running trials; once more ends at once" in err
    assert_gone(nodes)
    assert running.count_bytes() >= before
    found = episodes(tmp_path / "data" / "small_00000.mcap.part")
    assert 0 < len(found) < TRIALS
    assert set(found.values()) == {1}
    assert "the dataset is not finished" in call_here("dataset", "info", tmp_path / "data").stderr
    assert f"try: throwcollect resume {tmp_path / 'data'}" in err
    assert_goes_on(tmp_path / "data", reference)


def test_a_second_ctrl_c_does_not_wait_for_trials(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, nodes = begin(started, config, tmp_path / "data")
    in_the_middle(running, whole=reference)
    hanging = running.node("--name", "sim_0")
    hanging.suspend()
    coordinator = running.node("coordinator", str(tmp_path / "data"))
    running.process.send_signal(signal.SIGINT)
    # The coordinator waits for the hanging simulation, whose trial does not end.
    with pytest.raises(psutil.TimeoutExpired, match="timeout after 2 seconds"):
        coordinator.wait(2)
    running.process.send_signal(signal.SIGINT)
    code, _, _ = running.finish()
    assert code == 130
    assert_gone(nodes)
    # The coordinator was ended before it could report that it had drained.
    assert "interrupted" not in (tmp_path / "data" / "logs" / "coordinator.log").read_text()
    assert len(episodes(tmp_path / "data" / "small_00000.mcap.part")) > 0


def test_a_restarted_coordinator_recovers_the_recorded_episodes(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, _ = begin(started, config, tmp_path / "data", "--set", "run.trial_timeout_s=5")
    in_the_middle(running, whole=reference)
    running.node("coordinator", str(tmp_path / "data")).kill()
    code, _, err = running.finish()
    assert code == 0, err
    assert "coordinator was lost (ended by SIGKILL) and is started again" in err
    assert fingerprints(tmp_path / "data") == fingerprints(reference)
    assert next(event["episodes"] for event in events(tmp_path / "data") if event["event"] == "recovered") > 0


def test_a_killed_launcher_ends_its_nodes_and_resuming_after_a_power_cut_keeps_the_episodes_on_the_disk(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, nodes = begin(started, config, tmp_path / "data")
    in_the_middle(running, 0.6, whole=reference)
    running.process.kill()
    running.finish()
    assert_gone(nodes)
    part = tmp_path / "data" / "small_00000.mcap.part"
    os.truncate(part, part.stat().st_size * 2 // 3)
    kept = len(episodes(part, cut=True))
    os.truncate(tmp_path / "data" / "plan.parquet", 100)
    said = call_here("resume", tmp_path / "data", *INPROCESS)
    assert said.returncode == 0, said.stderr
    assert fingerprints(tmp_path / "data") == fingerprints(reference)
    assert next(event["episodes"] for event in events(tmp_path / "data") if event["event"] == "recovered") == kept > 0


def test_a_killed_router_is_restarted_and_the_dataset_stays_the_same(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, nodes = begin(started, config, tmp_path / "data", "--set", "run.trial_timeout_s=5")
    in_the_middle(running, whole=reference)
    next(node for node in nodes if "router" in words_of(node)).kill()
    code, out, err = running.finish()
    assert code == 0, err
    # Without a terminal, progress is shown as plain lines.
    assert "\x1b" not in out + err
    assert f"{TRIALS}/{TRIALS} throws: {TRIALS} landed, 0 failed, 2 simulations," in err
    assert "router was lost (ended by SIGKILL) and is started again" in err
    assert fingerprints(tmp_path / "data") == fingerprints(reference)


def test_the_trial_of_a_hanging_simulation_goes_to_another(
    config: Path, reference: Path, tmp_path: Path, started: list[Running]
) -> None:
    running, nodes = begin(started, config, tmp_path / "data", "--set", "run.trial_timeout_s=0.5")
    in_the_middle(running, whole=reference)
    running.node("--name", "sim_0").suspend()
    code, _, err = running.finish()
    assert code == 0, err
    assert "no episode within 2.5 s" in (tmp_path / "data" / "logs" / "coordinator.log").read_text()
    assert fingerprints(tmp_path / "data") == fingerprints(reference)
    assert_gone(nodes)
