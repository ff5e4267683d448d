"""From a dataset to a throw at a target, as a user does it: by commands, and by the program of the documents."""

import csv
import json
import re
import runpy
import shlex
from pathlib import Path

import pytest

import throwcollect
from tests.e2e.collection import INPROCESS, call_here
from tests.pages import find_blocks, read_section

ROOT = Path(__file__).parents[2]
PAGE = read_section("learning.md", "From a dataset to a target")
TRIALS = 60


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the dataset `data`, whose throws an engine in closed form made, and the model `model`."""
    path = tmp_path_factory.mktemp("learning")
    text = (ROOT / "configs" / "quickstart.yaml").read_text(encoding="utf-8")
    (path / "throws.yaml").write_text(text + "\nsim: {engine: ballistic}\n")
    settings = ["--set", f"trials={TRIALS}", "--set", "run.replay=0", "--runtime", "inprocess"]
    up = call_here("up", path / "throws.yaml", *settings, "--output", path / "data")
    assert up.returncode == 0, up.stderr
    fit = call_here("fit", path / "data", "-o", path / "model", "--onnx")
    assert fit.returncode == 0, fit.stderr
    assert re.search(r"learned from \d+ throws, \d+ ignored", fit.stdout)
    return path


def middle(place: Path) -> str:
    """A target amid the throws, as --at takes it."""
    said = call_here("aim", place / "model", "--at", "0,0").stderr
    found = re.search(r"nearest throw ends at (\S+)", said)
    assert found is not None
    return found[1]


def test_a_throw_with_the_printed_aim_lands_at_the_target(place: Path) -> None:
    target = middle(place)
    aim = call_here("aim", place / "model", "--at", target)
    assert aim.returncode == 0, aim.stderr
    throw = call_here("throw", place / "throws.yaml", "--json", *aim.stdout.split())
    assert throw.returncode == 0, throw.stderr
    row = json.loads(throw.stdout)
    x, y = map(float, target.split(","))
    assert row["landing_x_m"] == pytest.approx(x, abs=0.03)
    assert row["landing_y_m"] == pytest.approx(y, abs=0.03)


def test_the_commands_of_the_page_work_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "configs" / "quickstart.yaml").read_text(encoding="utf-8")
    Path("configs").mkdir()
    Path("configs", "quickstart.yaml").write_text(text + "\nsim: {engine: ballistic}\nrun: {replay: 0}\n")
    fewer = PAGE.replace("--trials 1024", "--trials 80").replace("--targets 20  ", "--targets 3 --seeds 1  ")
    # The runtime `inprocess` has only one simulation.
    fewer = fewer.replace("up -n 2 ", "up ")
    # The ballistic engine throws to other places.
    fewer = fewer.replace("--at 1.3,-0.1", "--at 1.31,-0.05")
    lines = "".join(re.findall(r"```bash\n(.*?)```", fewer, flags=re.DOTALL)).splitlines()
    lines += re.findall(r"^    (throwcollect .*)$", fewer, flags=re.MULTILINE)
    assert " ".join(line.split()[1] for line in lines) == "up fit aim throw score aim up dataset adapt"
    said = ""
    for line in lines:
        if "measured.csv" in line:
            # With a real robot, people write this file from their measurements.
            throws = throwcollect.load("datasets/aimed")
            keys = [*throws.plan.keys, "landing_x_m", "landing_y_m"]
            rows = [",".join(repr(float((throw.row | throw.parameters)[key])) for key in keys) for throw in throws]
            Path("measured.csv").write_text("\n".join([",".join(keys), *rows]))
        inner = re.search(r"\$\((throwcollect .*?)\)", line)
        whole = line.replace(inner[0], call_here(*shlex.split(inner[1])[1:]).stdout) if inner else line
        words = shlex.split(whole.replace("$PWD", str(tmp_path)), comments=True)[1:]
        done = call_here(*words, *(INPROCESS if words[0] == "up" else ()))
        assert done.returncode == 0, (line, done.stderr)
        said += done.stdout
    assert re.search(r"^miss_m +2 of 2 targets: median ", said, re.MULTILINE)
    head, *_, row = re.findall(r"^ +median  .*|^learned from \d+ throws .*", said, re.MULTILINE)
    assert re.split("  +", head.strip()) == ["median", "9 of 10 below", "largest", "throws", "did not succeed"]
    assert re.fullmatch(r"learned from \d+ throws( +[\d.e-]+ cm){3} +3 +0", row)
    assert Path("models", "real", "model.json").exists()


def test_targets_become_a_list_of_throws_and_these_adapt_a_model(place: Path) -> None:
    x, y = middle(place).split(",")
    (place / "targets.csv").write_text(f"landing_x_m,landing_y_m\n{x},{y}\n{x},{y}\n")
    aim = call_here("aim", place / "model", "--targets", place / "targets.csv", "-o", place / "throws.csv")
    assert (aim.returncode, aim.stdout) == (0, f"{place / 'throws.csv'}: 2 throws\n"), aim.stderr
    throws = call_here("throw", place / "throws.yaml", "--list", place / "throws.csv")
    assert throws.stdout.count("landed: landing_x_m") == 2, throws.stderr
    with (place / "throws.csv").open() as file:
        thrown = list(csv.reader(file))
    measured = [[*thrown[0], "landing_x_m", "landing_y_m"], *([*row, float(x) + 0.2, y] for row in thrown[1:])]
    (place / "measured.csv").write_text("\n".join(",".join(map(str, row)) for row in measured))
    adapt = call_here("adapt", place / "model", place / "measured.csv", "-o", place / "real", "--method", "offset")
    assert adapt.returncode == 0, adapt.stderr
    assert re.search(r"landing_x_m: 0\.(1[5-9]|2[0-4])", adapt.stdout)
    same = call_here("adapt", place / "model", place / "data", "-o", place / "same")
    assert re.match(r"\d\d throws; what differs: none", same.stdout), same.stdout + same.stderr


def test_aimed_throws_become_a_dataset_with_targets_and_misses(place: Path) -> None:
    target = middle(place)
    aim = call_here("aim", place / "model", "--at", target, "-o", place / "aimed.csv")
    assert aim.returncode == 0, aim.stderr
    x, y = map(float, target.split(","))
    (setting,) = re.findall(r'--set "(sweep=.*?)"', PAGE)
    setting = setting.replace("$PWD/throws.csv", str(place / "aimed.csv"))
    settings = ["--set", setting, "--set", "trials=null", "--set", "run.replay=0"]
    plan = call_here("plan", place / "throws.yaml", *settings)
    header, row = plan.stdout.splitlines()
    assert header.endswith("  target_x_m  target_y_m")
    assert row.split()[-2:] == [f"{x:.6g}", f"{y:.6g}"]
    up = call_here("up", place / "throws.yaml", *settings, "--runtime", "inprocess", "--output", place / "aimed")
    assert up.returncode == 0, up.stderr
    assert re.search(r"^miss_m +1 of 1 target: median ", up.stdout, re.MULTILINE)
    (throw,) = throwcollect.load(place / "aimed")
    assert throw.target == {"target_x_m": x, "target_y_m": y}
    alone = call_here("throw", place / "throws.yaml", "--list", place / "aimed.csv")
    assert f"miss_m {throw.miss_m:.6f}" in alone.stdout
    assert throw.miss_m < 0.03


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["aim", "model"], "no target"),
        (["fit", "data", "-o", "new", "--targets", "landing_x"], "no column of numbers 'landing_x'"),
        (["throw", "throws.yaml", "--set", "task.duration_s=0.2"], "its limit is 1.76 rad/s"),
    ],
)
def test_a_wrong_learning_command_gives_one_message(place: Path, arguments: list[str], message: str) -> None:
    files = {"model", "data", "throws.yaml", "new", "model/config.yaml"}
    said = call_here(*(place / each if each in files else each for each in arguments))
    assert said.returncode == 2 or "model.json" in message, said.stderr
    assert message in said.stderr
    assert "Traceback" not in said.stderr
    assert not (place / "new").exists()


def test_the_python_program_of_the_page_runs(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (program,) = find_blocks("python", PAGE)
    program = program.replace('"datasets/many"', '"data"').replace('"configs/quickstart.yaml"', '"throws.yaml"')
    x, y = middle(place).split(",")
    (place / "program.py").write_text(program.replace("(1.4, -0.2)", f"({x}, {y})"))
    monkeypatch.chdir(place)
    runpy.run_path("program.py", run_name="__main__")
    assert (place / "models" / "corrected" / "model.json").exists()


def test_the_example_halves_the_miss_of_the_other_robot(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "configs" / "real.yaml").read_text(encoding="utf-8")
    (place / "real.yaml").write_text(text + "\nsim: {engine: ballistic}\n")
    example = runpy.run_path(str(ROOT / "examples" / "learning.py"))
    example["main"](*(str(place / name) for name in ("data", "throws.yaml", "real.yaml")))
    said = capsys.readouterr().out
    (before,) = re.findall(r"the other robot misses by ([\d.]+) cm", said)
    after = re.findall(r"after 3: by ([\d.]+) cm", said)
    assert float(after[0]) < float(before) / 2, said
