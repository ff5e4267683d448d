"""The dataset is a pure function of the YAML file."""

from pathlib import Path

import numpy as np
import pytest

from tests import processors
from tests.e2e.collection import INPROCESS, call_here, collect, collect_here, fingerprints, start, write_config
from throwcollect import Simulator, load
from throwcollect.dataset.inspect import info
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
TRIALS = 12


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_config(tmp_path_factory.mktemp("config"), trials=TRIALS)


@pytest.fixture(scope="module")
def reference(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undisturbed collection in one process."""
    directory = tmp_path_factory.mktemp("reference") / "data"
    summary = collect_here(config, directory)
    assert summary["episodes"] == TRIALS
    return directory


def test_a_collection_has_all_files_and_verify_finds_nothing_wrong(reference: Path) -> None:
    assert verify(reference) == []
    promised = {
        "metadata.yaml",
        "plan.parquet",
        "throws.parquet",
        "config.yaml",
        "small_00000.mcap",
    }
    assert set(fingerprints(reference)) == promised


def test_replayed_throws_equal_the_stored_ones_bit_for_bit(reference: Path) -> None:
    said = call_here("dataset", "replay", reference, *(f"--trial={trial}" for trial in range(5)))
    # On a busy machine, the command also tells on standard error how far it has come.
    assert (said.returncode, said.stdout) == (0, f"{reference}: 5 throws replayed, the same bit for bit\n")


def test_a_simulator_gives_the_throws_of_the_dataset(config: Path, reference: Path) -> None:
    dataset = load(reference)
    with Simulator(config) as simulator:
        for stored in dataset[:3]:
            throw = simulator.throw(stored.parameters, trial=stored.trial)
            assert {**throw.row, "shard": None, "chunk_offset": None} == {
                **stored.row,
                "shard": None,
                "chunk_offset": None,
            }
            assert throw.events.contacts == stored.events.contacts
            assert np.array_equal(throw.ball.velocity, stored.ball.velocity)
            assert np.array_equal(throw.joints.effort, stored.joints.effort)


def test_every_file_is_the_same_for_any_number_of_simulations(config: Path, reference: Path, tmp_path: Path) -> None:
    collect(config, tmp_path / "data", 4)
    assert fingerprints(tmp_path / "data") == fingerprints(reference)


def test_every_file_is_the_same_when_trials_end_in_another_order_and_a_simulation_is_killed(
    config: Path, reference: Path, tmp_path: Path
) -> None:
    running = start(config, tmp_path / "data", 2)
    running.wait_until(lambda: running.count_bytes() > 100_000)
    # A simulation that is frozen in the middle of a trial hands it in long after later trials.
    frozen = running.node("--name", "sim_0")
    frozen.suspend()
    running.node("--name", "sim_1").kill()
    before = running.count_bytes()
    running.wait_until(lambda: running.count_bytes() > before + 300_000)
    frozen.resume()
    code, _, err = running.finish()
    assert code == 0, err
    assert "sim_1 was lost (ended by SIGKILL)" in err
    assert fingerprints(tmp_path / "data") == fingerprints(reference)


def test_every_file_is_the_same_on_another_processor(tmp_path: Path) -> None:
    config = Path(__file__).parents[2] / "configs" / "dmp.yaml"
    options = (
        "--trials",
        "3",
        "--set",
        "run.replay=0",
        "--set",
        "record.topics=[joint_states, ball/odometry, controller_state, tf, clock]",
    )
    collect_here(config, tmp_path / "here", *options)
    collect(config, tmp_path / "there", 1, *INPROCESS, *options, **processors.PLAIN)
    assert fingerprints(tmp_path / "there") == fingerprints(tmp_path / "here")


def test_another_seed_gives_another_digest(config: Path, reference: Path, tmp_path: Path) -> None:
    other = write_config(tmp_path, trials=2)
    other.write_text(other.read_text().replace("seed: 7", "seed: 8"))
    collect_here(other, tmp_path / "data")
    assert info(reference).digest != info(tmp_path / "data").digest
