"""The sections on tasks, command by command and file by file, with few trials."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import tomllib

import throwcollect
from tests.e2e.collection import INPROCESS, call_here
from tests.e2e.plugins import process_with_plugins
from tests.pages import find_blocks, read_section
from throwcollect.config.loader import load

pytest.importorskip("mujoco")

pytestmark = pytest.mark.e2e
ROOT = Path(__file__).parents[2]
HEADINGS = (
    "Things that stand in the world",
    "Another object than a ball",
    "Throw into a bin",
    "Slide a puck",
    "A task of your own",
)
BODIES, OBJECT, INTO, SLIDE, OWN = (read_section("robots.md", heading) for heading in HEADINGS)
CHEAP = ("--set", "run.replay=0", "--set", "record.rate_hz=50", "--set", "sim.engine=mujoco")
Call = Callable[..., "subprocess.CompletedProcess[str]"]


def run(text: str, call: Call, *few: str) -> dict[str, str]:
    """Call the commands of a part of the page, `up` with further options; returns what each printed, by its name."""
    printed = {}
    # The runtime `inprocess` has only one simulation.
    for line in "".join(find_blocks("sh", text)).replace("up -n 2 ", "up ").splitlines():
        program, *words = shlex.split(line)
        if program == "throwcollect":
            done = call(*words, *((*INPROCESS, *few) if words[0] == "up" else ()))
            assert done.returncode == 0, (line, done.stderr)
            printed[" ".join(words[:2]) if words[0] == "dataset" else words[0]] = done.stdout
    return printed


def test_the_world_with_a_table_is_right_and_its_table_can_be_swept(tmp_path: Path) -> None:
    yaml, moving, _files = find_blocks("yaml", BODIES)
    (tmp_path / "table.yaml").write_text(yaml, encoding="utf-8")
    config = load(tmp_path / "table.yaml")
    table = config.scene.bodies["table"]
    assert table.position_m[2] + table.size_m[2] / 2 == pytest.approx(config.scene.landing_height_m)
    assert "scene.bodies.table.position_m.0" in config.sweep.parameters
    (tmp_path / "moving.yaml").write_text(moving, encoding="utf-8")
    throw = throwcollect.Simulator(tmp_path / "moving.yaml").throw()
    assert list(throw.bodies) == ["ball", "can"]
    assert throw.bodies["can"].position[0] == pytest.approx((1.5, -0.25, 0.58), abs=2e-3)
    assert {"can_x_m", "can_wz_radps"} <= set(throw.to_pandas().columns)
    (block,) = find_blocks("yaml", OBJECT)
    (tmp_path / "block.yaml").write_text(block, encoding="utf-8")
    thrown = throwcollect.Simulator(tmp_path / "block.yaml").throw()
    assert (thrown.outcome, thrown.object.name) == ("landed", "block")


def test_a_throw_that_is_aimed_at_a_bin_stays_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "configs", "configs")
    (yaml,) = find_blocks("yaml", INTO)
    assert yaml in Path("configs/bin.yaml").read_text(encoding="utf-8")
    printed = run(INTO, call_here, "--trials", "100", *CHEAP)
    assert "throw 0: in_bin: " in printed["throw"]
    (program,) = find_blocks("python", INTO)
    coarse = program.replace("range(10)", "range(3, 10, 4)")
    assert coarse != program
    exec(coarse, {"__name__": "__main__"})  # noqa: S102
    hits, tried = re.findall(r"(\d+) of (\d+) throws stayed", capsys.readouterr().out)[0]
    assert int(hits) == int(tried) > 0


def test_a_puck_that_is_aimed_at_a_place_rests_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "configs", "configs")
    (yaml,) = find_blocks("yaml", SLIDE)
    assert yaml in Path("configs/slide.yaml").read_text(encoding="utf-8")
    printed = run(SLIDE, call_here, "--trials", "60", *CHEAP)
    assert "60: 60 at_rest" in printed["up"]
    assert re.search(r"^rest +x 0\.", printed["up"], flags=re.MULTILINE)
    assert "Where the pucks rest" in Path("datasets/slide.html").read_text(encoding="utf-8")
    # The throw is simulated with Bullet, and the model was learned with MuJoCo.
    (miss,) = re.findall(r"throw 0: at_rest: .* miss_m ([\d.]+)$", printed["throw"], flags=re.MULTILINE)
    assert float(miss) < 0.15
    (program,) = find_blocks("python", SLIDE)
    exec(program, {"__name__": "__main__"})  # noqa: S102
    distance, law = map(float, re.findall(r"slid ([\d.]+) m; .* is ([\d.]+) m", capsys.readouterr().out)[0])
    assert distance == pytest.approx(law, rel=0.05)


@pytest.fixture
def package(tmp_path: Path) -> Iterator[Path]:
    """The files of the page in a directory of their own, with what `pip install -e` would write about the package."""
    files = dict(re.findall(r"^`([\w./]+)`\n\n```\w+\n(.*?)```", OWN, flags=re.DOTALL | re.MULTILINE))
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    project = tomllib.loads(files["pyproject.toml"])["project"]
    about = tmp_path / "through_hoop-1.0.dist-info"
    about.mkdir()
    about.joinpath("METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    entries = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in members.items())
        for group, members in project["entry-points"].items()
    ]
    about.joinpath("entry_points.txt").write_text("".join(entries))
    return tmp_path


def test_the_task_of_the_page_passes_the_contract_tests_and_aims_through_its_hoop(package: Path) -> None:
    (contract,) = re.findall(r'pytest -q "\$CLONE/(.*?)"', OWN)
    with process_with_plugins(package) as process:
        process.submit(os.chdir, package).result()
        printed = run(OWN, lambda *words: process.submit(call_here, *words).result(), "--trials", "50", *CHEAP)
        options = ["-q", "-p", "no:cacheprovider", "-k", "through_hoop", f"--rootdir={ROOT}"]
        assert process.submit(pytest.main, [*options, str(ROOT / contract)]).result() == 0
    assert list(printed) == ["plan", "up", "dataset verify", "dataset report", "fit", "aim", "throw"]
    assert re.search(r"\d+ through, ", printed["up"])
    assert re.search(r"\d+ hoop_hit", printed["up"])
    (miss,) = re.findall(r"throw 0: through: .* miss_m ([\d.]+)$", printed["throw"], flags=re.MULTILINE)
    assert float(miss) < 0.05
