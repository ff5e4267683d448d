from __future__ import annotations

import hashlib
import socket
import subprocess
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ruamel.yaml import YAML
from tests.unit.dataset.conftest import Collection

from throwcollect.config.loader import load
from throwcollect.dataset.data_card import data_card
from throwcollect.dataset.provenance import HOST_VARIABLE, IMAGE_VARIABLE, Provenance, read_provenance
from throwcollect.dataset.reader import Dataset


def test_the_data_card_has_the_header_that_hubs_of_datasets_read(dataset: Path) -> None:
    _, header, text = (dataset / "README.md").read_text().split("---\n", 2)
    fields = YAML(typ="safe").load(header)
    assert fields["task_categories"] == ["robotics"]
    assert fields["configs"] == [{"config_name": "throws", "data_files": "throws.parquet"}]
    assert fields["size_categories"] == ["n<1K"]
    assert "| landed | 7 |" in text


def test_the_data_card_tells_between_which_values_each_key_varies_and_in_which_unit(
    make_collection: type[Collection], tmp_path: Path
) -> None:
    swept = {"task.end.arm_right_4_joint": {"values": [-0.75, -0.5]}, "ball.mass_kg": {"values": [0.08, 0.125]}}
    collection = make_collection({"trials": 4, "sweep": {"sampler": "grid", "parameters": swept}})
    text = (collection.collect(tmp_path / "data") / "README.md").read_text()
    assert "| `task.end.arm_right_4_joint` | rad | -0.75 | -0.5 |\n| `ball.mass_kg` | kg | 0.08 | 0.125 |\n" in text


def test_the_data_card_counts_only_trials_with_an_episode_as_throws(dataset: Path) -> None:
    throws = pq.read_table(dataset / "throws.parquet")
    column = throws.schema.get_field_index("digest")
    fewer = throws.set_column(column, "digest", pa.array([None, None, *throws["digest"].to_pylist()[2:]]))
    provenance = Provenance.of_this_machine(simulations=1, wall_s=1.0, was_open=False, robot="<robot/>")
    assert "\n5 simulated throws of a ball" in data_card(load(dataset / "config.yaml"), fewer, provenance)


@pytest.mark.parametrize(("told", "host"), [(None, socket.gethostname()), ("lab-7", "lab-7"), ("", None)])
def test_provenance_takes_the_host_from_the_variable_or_else_this_machine(
    monkeypatch: pytest.MonkeyPatch, dataset: Path, told: str | None, host: str | None
) -> None:
    if told is None:
        monkeypatch.delenv(HOST_VARIABLE, raising=False)
    else:
        monkeypatch.setenv(HOST_VARIABLE, told)
    provenance = Provenance.of_this_machine(simulations=1, wall_s=1.5, was_open=False, robot="<robot/>")
    assert provenance.host == host
    card = data_card(load(dataset / "config.yaml"), pq.read_table(dataset / "throws.parquet"), provenance)
    assert "| host |" not in card
    assert "| wall time | 1.5 s |" in card


def test_provenance_names_revision_image_and_robot_description(monkeypatch: pytest.MonkeyPatch, dataset: Path) -> None:
    read = read_provenance(dataset)
    assert read is not None
    recorded = Dataset.open(dataset).robot_description()
    assert recorded is not None
    assert read.robot_sha256 == hashlib.sha256(recorded.encode()).hexdigest()
    head = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
    )
    assert read.revision is not None
    assert read.revision.removesuffix("-dirty") == head.stdout.strip()
    assert read.image is None
    monkeypatch.setenv(IMAGE_VARIABLE, "sha256:12ab")
    assert Provenance.of_this_machine(simulations=1, wall_s=1.0, was_open=False, robot="").image == "sha256:12ab"
