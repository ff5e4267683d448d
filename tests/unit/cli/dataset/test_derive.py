import json
import re
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection
from typer.testing import CliRunner

from throwcollect.cli.main import assemble
from throwcollect.dataset.reader import Dataset
from throwcollect.derive.split import assign


def run(*arguments: str | Path) -> str:
    done = CliRunner().invoke(assemble(), ["dataset", *map(str, arguments)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def trials_of(directory: Path) -> list[int]:
    """The trials of the source that a derived dataset has taken."""
    found: list[int] = pq.read_table(directory / "sources.parquet")["source_trial"].to_pylist()
    return found


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven trials, one of which was refused and one lost."""
    collection = Collection()
    collection.refuse(2, "too fast")
    return collection.collect(tmp_path_factory.mktemp("cli") / "source", [0, 1, 3, 4, 5, 6], lost=[4])


def test_commands_say_how_many_trials_without_an_episode_were_left_out(source: Path, tmp_path: Path) -> None:
    text = run("filter", source, tmp_path / "a", "--where", "trial < 6")
    assert re.fullmatch(
        rf"{tmp_path}/a: 4 of 7 trials\n  digest  [0-9a-f]{{64}}\n"
        r"left out, as they have no episode: 1 lost, 1 refused\n",
        text,
    )
    run("filter", source, tmp_path / "b", "--where", "trial == 6")
    merged = CliRunner().invoke(assemble(), ["dataset", "merge", *(str(tmp_path / each) for each in "abc"), "--json"])
    found = json.loads(merged.stdout)
    assert found.pop("digest")
    assert found == {"directory": str(tmp_path / "c"), "trials": 5, "offered": 5, "without_episode": {}}


def test_the_command_sample_takes_the_same_trials_for_the_same_seed_and_others_for_another(
    source: Path, tmp_path: Path
) -> None:
    taken = []
    for name, seed in (("given", ["--seed", "0"]), ("left out", []), ("other", ["--seed", "1"])):
        output = tmp_path / name
        assert run("sample", source, output, "--count", "2", *seed).startswith(f"{output}: 2 of 7 trials\n")
        taken.append(trials_of(output))
    assert taken[0] == taken[1] != taken[2]


def test_the_command_split_says_what_each_part_has_and_passes_the_seed_on(source: Path, tmp_path: Path) -> None:
    arguments = ("--fractions", "a=0.5,b=0.5", "--cells", "trial=2", "--seed", "1")
    text = run("split", source, tmp_path / "parts", *arguments)
    told = re.findall(
        rf"^{tmp_path}/parts/([ab]): (\d) of 5 trials that have an episode, in (\d) cells?$", text, flags=re.MULTILINE
    )
    assert text.endswith("left out, as they have no episode: 1 lost, 1 refused\n")
    assert sum(int(trials) for _, trials, _ in told) == 5
    found = json.loads(run("split", source, tmp_path / "again", *arguments, "--json"))
    assert told == [(name, str(part["dataset"]["trials"]), str(part["cells"])) for name, part in found["parts"].items()]
    assert found["without_episode"] == {"lost": 1, "refused": 1}
    options: Any = {"fractions": "a=0.5,b=0.5", "cells": ["trial=2"]}
    first, second = (assign(Dataset.open(source), **options, seed=seed) for seed in (1, 2))
    for name, trials in first.items():
        assert trials_of(tmp_path / "parts" / name) == trials_of(tmp_path / "again" / name) == list(trials)
    assert first != second


def test_stats_prints_a_table_or_json_with_the_same_numbers(source: Path) -> None:
    text = run("stats", source)
    assert text.startswith("7 trials: 5 landed, 1 lost, 1 refused\n\nthrows ")
    found = json.loads(run("stats", source, "--json"))
    column = found["columns"]["landing_x_m"]
    cells = [column["count"], column["nulls"], column["min"], *(column["quantiles"][q] for q in ("q05", "q50", "q95"))]
    row = next(line.split() for line in text.splitlines() if line.startswith("landing_x_m "))
    assert row[1:7] == [f"{cell:.6g}" for cell in cells]
    elbow = found["signals"]["position_rad"]["arm_right_4_joint"]
    row = next(line.split() for line in text.splitlines() if line.startswith("arm_right_4_joint "))
    assert row[1:] == [f"{elbow[name]:.6g}" for name in ("min", "max", "mean", "std")]
    assert text.endswith(f"signals over {found['samples']} samples of 5 episodes\n")
