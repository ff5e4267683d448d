"""The tutorial, command by command, with few throws of an engine in closed form."""

import re
import shlex
from pathlib import Path

import pytest

from tests.e2e.collection import INPROCESS, call_here

pytestmark = pytest.mark.e2e
PAGE = (Path(__file__).parents[2] / "docs" / "tutorial.md").read_text(encoding="utf-8")


def test_the_tutorial_ends_with_a_throw_at_its_target(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (yaml,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert "trials: 200" in yaml
    few = yaml.replace("trials: 200", "trials: 100") + "sim: {engine: ballistic}\nrun: {replay: 0}\n"
    Path("throws.yaml").write_text(few, encoding="utf-8")
    # The runtime `inprocess` has only one simulation.
    commands = "".join(re.findall(r"```sh\n(.*?)```", PAGE, flags=re.DOTALL)).replace("up -n 2 ", "up ").splitlines()
    done = {}
    for line in commands:
        program, *words = shlex.split(line)
        assert program == "throwcollect"
        done[words[0]] = call_here(*words, *(INPROCESS if words[0] == "up" else ()))
        assert done[words[0]].returncode == 0, (line, done[words[0]].stderr)
    assert list(done) == ["plan", "up", "dataset", "fit", "aim", "throw"]
    (miss,) = re.findall(r"landed: .* miss_m ([\d.]+)$", done["throw"].stdout, flags=re.MULTILINE)
    assert float(miss) < 0.03
    assert Path("report.html").stat().st_size > 10_000
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    exec(program, {})  # noqa: S102
    # The ball came down onto the ground and not into it: its radius is 2.5 cm.
    assert re.search(r"\(\d+, 32\) \[.* 0\.025 *\]", capsys.readouterr().out)
