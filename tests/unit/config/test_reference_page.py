"""The page on configuration has all keys, as `packaging/configuration_reference.py` prints it."""

import importlib
import os
from pathlib import Path

import pytest
from tests.with_plugins import run_with_plugins

from throwcollect.config.schema import Config
from throwcollect.config.shape import json_schema

ROOT = Path(__file__).parents[3]
MODELS = {"Config": json_schema(Config), **json_schema(Config)["$defs"]}
KEYS = [(model, key) for model, schema in MODELS.items() for key in schema["properties"]]


@pytest.mark.parametrize(("model", "key"), KEYS, ids=".".join)
def test_every_key_has_a_description_that_is_a_sentence(model, key):
    node = MODELS[model]["properties"][key]
    meaning = node.get("description") or MODELS[node["$ref"].rpartition("/")[2]]["description"]
    assert meaning.endswith(".")


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.syspath_prepend(ROOT / "packaging")
    return importlib.import_module("configuration_reference").page()


def test_the_page_is_up_to_date_even_with_plugins_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    path = os.pathsep.join([str(ROOT / "packaging"), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path)
    done = run_with_plugins("configuration_reference")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8"), (
        "run python packaging/configuration_reference.py > docs/configuration.md"
    )


def test_every_key_is_on_the_reference_page(page):
    missing = [key for _, key in KEYS if f"`{key}`" not in page and f".{key}`" not in page]
    assert missing == []


def test_rows_of_the_reference_tables_have_equally_many_cells(page):
    table = 0
    for line in page.splitlines():
        bars = line.count("|") if line.startswith("|") else 0
        assert not table or bars in (0, table)
        table = bars


def test_keys_that_may_be_swept_include_the_offset_of_a_joint(page):
    swept = page.partition("### Keys that may be swept")[2].partition("##")[0]
    assert "`robot.joint_offsets.<joint>`" in swept
    assert "in `robot.joint_offsets`" in swept
