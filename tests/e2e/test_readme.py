"""The examples of the README work as they are shown."""

import re
from pathlib import Path

import pytest

from tests.e2e.collection import collect_here
from throwcollect.config.loader import load

pytestmark = pytest.mark.e2e
ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_yaml_and_the_python_of_the_readme_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (yaml,), (python,) = blocks("yaml"), blocks("python")
    config = tmp_path / "throws.yaml"
    config.write_text(yaml, encoding="utf-8")
    assert load(config).trials == 2000
    few = tmp_path / "few.yaml"
    few.write_text(yaml.replace("trials: 2000", "trials: 2"), encoding="utf-8")
    collect_here(few, tmp_path / "data")
    named = re.sub(r'"datasets/[^"]*"', repr(str(tmp_path / "data")), python)
    assert named != python
    exec(named, {})  # noqa: S102
    printed = capsys.readouterr().out
    assert "landing_x_m" in printed
    assert re.search(r"^1 \(\d+, 32\) \[", printed, flags=re.MULTILINE)


def test_a_dataset_has_the_files_that_the_readme_draws(tmp_path: Path) -> None:
    drawn = set(re.findall(r"^[├└]── ([\w.]+)", README, flags=re.MULTILINE))
    (yaml,) = blocks("yaml")
    config = tmp_path / "quickstart.yaml"
    config.write_text(yaml.replace("trials: 2000", "trials: 1").replace("name: throws", "name: quickstart"))
    collect_here(config, tmp_path / "data")
    assert {path.name for path in (tmp_path / "data").iterdir()} == drawn


def test_the_make_targets_of_the_readme_and_of_the_workflow_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(?:make|.*- run: make) (\w+)", README + workflow, flags=re.MULTILINE))
    assert {"up", "test", "docs"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
