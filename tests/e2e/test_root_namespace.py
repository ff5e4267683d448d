"""A collection whose simulation lives in the root namespace."""

from pathlib import Path

from tests.e2e.collection import CONFIG, FAST, collect, collect_here, fingerprints, write_config

ROOT = CONFIG.replace("replay: 0", "replay: 0, simulations: 1, root_namespace: true")


def test_a_simulation_in_the_root_namespace_collects_the_same_files(tmp_path: Path) -> None:
    (tmp_path / "root").mkdir()
    usual, rooted = tmp_path / "a", tmp_path / "b"
    collect_here(write_config(tmp_path, trials=6, sim=FAST), usual)
    collect(write_config(tmp_path / "root", trials=6, text=ROOT, sim=FAST), rooted, 1)
    assert fingerprints(rooted) == fingerprints(usual)
    journal = (rooted / "logs" / "journal.jsonl").read_text()
    assert '"simulation":"sim_0"' in journal.replace(" ", "")
