"""The page on policies, file by file and command by command, and collections with policies that are at fault."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import throwcollect
from tests.e2e.collection import INPROCESS, call, call_here
from tests.pages import find_blocks, read_section

pytest.importorskip("mujoco")

pytestmark = pytest.mark.e2e
ROOT = Path(__file__).parents[2]
PAGE = read_section("learning.md", "Policies")
FEW = ("--set", "sim.engine=mujoco", "--set", "run.replay=0")
LAB = """\
import numpy as np


class Swing:
    def __init__(self, config):
        self.joints, self.end = config.moving_joints, config.task.end

    def reset(self, seed, target):
        self.start, self.gain = None, np.random.default_rng(seed).uniform(0.9, 1)

    def act(self, observation):
        self.start = observation["command_position_rad"] if self.start is None else self.start
        x = min(observation["time_s"][0] + 0.02, 1)
        goal = np.array([self.end[joint] for joint in self.joints])
        return self.start + self.gain * (10 * x**3 - 15 * x**4 + 6 * x**5) * (goal - self.start)


class Noisy(Swing):
    def act(self, observation):
        return super().act(observation) + np.random.normal(0, 1e-3, 5)


class Fails(Swing):
    def act(self, observation):
        if self.gain < 0.94 and observation["time_s"][0] > 0.3:
            raise RuntimeError("the network is lost")
        return super().act(observation)
"""
CONFIG = """\
name: lab
trials: 4
task: {policy: {use: "lab:Swing"}}
sim: {engine: mujoco}
run: {replay: 0}
sweep: {parameters: {ball.mass_kg: {min: 0.04, max: 0.05}}}
"""


def collect(name: str, *options: str) -> subprocess.CompletedProcess[str]:
    return call_here("up", "lab.yaml", "-o", name, *INPROCESS, *options)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The present directory, which has a package and a configuration; this process finds its modules."""
    directory = tmp_path_factory.mktemp("lab")
    (directory / "lab.py").write_text(LAB, encoding="utf-8")
    (directory / "lab.yaml").write_text(CONFIG, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(directory)
        patch.setenv("PYTHONPATH", str(directory), prepend=os.pathsep)
        patch.chdir(directory)
        yield directory


def test_the_page_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    own, rolling, learning = find_blocks("python", PAGE)
    (tmp_path / "my_lab.py").write_text(own, encoding="utf-8")
    for name, language in (("policy.yaml", "yaml"), ("aims.csv", "csv")):
        (tmp_path / name).write_text(*find_blocks(language, PAGE), encoding="utf-8")

    def run(program: str) -> str:
        exec(program, {})  # noqa: S102
        return capsys.readouterr().out

    printed = []
    commands = "".join(find_blocks("sh", PAGE)).replace("up -n 2 ", "up ").replace("--targets 20", "--targets 5")
    for line in commands.splitlines():
        words = [word for word in shlex.split(line) if word not in ("PYTHONPATH=.", "throwcollect")]
        few = {"up": (*INPROCESS, *FEW, *(("--set", "trials=60") if "quick" in line else ()))}.get(words[0], ())
        done = call_here(*words, *few)
        assert done.returncode == 0, (line, done.stderr)
        printed.append(done.stdout)
    dataset = throwcollect.load(tmp_path / "data" / "policy")
    assert dataset.throws["outcome"].to_pylist() == ["landed"] * 3
    assert max(dataset.throws["miss_m"].to_pylist()) < 0.03
    assert re.search(r"^models/quick/config.yaml +(9.|100)%", printed[-1], flags=re.MULTILINE)
    # The action of an export at the rate of the policy is its command.
    first = pq.read_table(tmp_path / "exports" / "policy" / "data").to_pylist()[:40]
    commands = dataset[0].read_samples()[1].command[::5, 1]
    assert np.allclose([row["action"] for row in first], commands[:40], atol=1e-6)
    outcome, miss, clipped = run(rolling).split()
    assert (outcome, clipped) == ("landed", "0.0")
    assert float(miss) < 0.03
    pytest.importorskip("gymnasium")
    assert run(learning).split()[-1] == "False"


def test_the_dataset_depends_neither_on_the_processes_nor_on_where_it_is_collected(lab: Path) -> None:
    one, two = collect("one"), call("up", "lab.yaml", "-o", "two", "-n", "2", "--runtime", "local", cwd=lab)
    assert (one.returncode, two.returncode) == (0, 0), (one.stderr, two.stderr)
    datasets = [throwcollect.load(lab / name) for name in ("one", "two")]
    assert datasets[0].digest == datasets[1].digest
    checked = call_here("dataset", "verify", "one", "--replay", "2")
    assert "2 of 4 throws, the same bit for bit" in checked.stdout + checked.stderr
    assert "The policy `lab:Swing` commanded the joints at 50 Hz." in (lab / "one" / "README.md").read_text()


def test_a_policy_that_is_no_function_of_its_observations_is_found(lab: Path) -> None:
    done = collect("noisy", "--set", "task.policy.use=lab:Noisy", "--set", "run.replay=1")
    assert done.returncode != 0
    assert "the policy lab:Noisy is not a function of its seed and its observations" in done.stderr
    done = collect("kept", "--set", "task.policy.use=lab:Noisy", "--set", "task.policy.reproducible=false")
    assert done.returncode == 0, done.stderr
    assert "It is not reproducible" in (lab / "kept" / "README.md").read_text()


def test_trials_in_which_a_policy_fails_are_lost_and_all_others_are_kept(lab: Path) -> None:
    done = collect("fails", "--set", "task.policy.use=lab:Fails", "--set", "trials=8")
    outcomes = throwcollect.load(lab / "fails").throws["outcome"].to_pylist()
    assert 0 < outcomes.count("lost") < 8
    assert re.search(r"lab:Fails cannot act at 0\.3\d\d s of trial \d+: RuntimeError: the network is lost", done.stderr)


def test_the_example_trains_and_compares_policies() -> None:
    pytest.importorskip("gymnasium")
    words = [sys.executable, str(ROOT / "examples" / "policy_gym.py"), "--quick"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "trained on 8 throws" in done.stdout
    rewards = dict(re.findall(r"^(random|scripted|trained) .* (\S+)$", done.stdout, flags=re.MULTILINE))
    # The scripted swing comes nearer to the targets than random actions, and the map that was learned changes it.
    assert float(rewards["scripted"]) > float(rewards["random"])
    assert rewards["trained"] != rewards["scripted"]
