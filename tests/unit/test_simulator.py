"""Single throws by `Simulator`, in this process or in several."""

import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from tests.pages import find_blocks, read_section

from throwcollect import Simulator, load_config
from throwcollect.errors import ConfigError, ConflictError, PlanError

ROOT = Path(__file__).parents[2]
POINT = {"task.duration_s": 1.1, "ball.mass_kg": 0.04}
REFUSED = {"task.duration_s": 0.2}
TOO_FAST = r"moves at .* rad/s at .* its limit is"


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(ROOT / "configs" / "quickstart.yaml") as simulator:
        yield simulator


def test_a_throw_does_not_depend_on_earlier_throws(simulator: Simulator) -> None:
    first = simulator.throw(POINT)
    other = simulator.throw({"ball.mass_kg": 0.05})
    again = simulator.throw(POINT)
    assert first.row == again.row
    assert first.row["digest"] != other.row["digest"]
    assert np.array_equal(first.ball.position, again.ball.position)


def test_a_closed_simulator_refuses_throws_and_may_be_closed_again() -> None:
    with Simulator(ROOT / "configs" / "quickstart.yaml") as simulator:
        pass
    simulator.close()
    for throw in (lambda: simulator.throw(POINT), lambda: next(simulator.throw_many([POINT] * 2, processes=2))):
        with pytest.raises(ConflictError, match="this simulator is closed"):
            throw()


def test_the_trial_number_changes_only_the_stamps(simulator: Simulator) -> None:
    first, second = simulator.throw(POINT), simulator.throw(POINT, trial=1)
    assert (first.trial, second.trial) == (0, 1)
    assert first.joints.stamps_ns[0] < second.joints.stamps_ns[0]
    assert np.array_equal(first.joints.time_s, second.joints.time_s)
    assert np.array_equal(first.joints.effort, second.joints.effort)


def test_a_throw_has_the_row_events_and_samples_of_a_stored_one(simulator: Simulator) -> None:
    throw = simulator.throw(POINT)
    assert (throw.outcome, throw.reason, throw.recorded, throw.parameters) == ("landed", None, True, POINT)
    assert throw.row["samples"] == len(throw.ball) == len(throw.joints)
    assert throw.events.release.time_s < throw.events.apex.time_s < throw.events.landing.time_s
    assert throw.events.contacts[0].body == "spoon"
    assert repr(throw).startswith("Throw(0: landed at x = ")


def test_a_target_adds_only_the_miss_to_a_throw(simulator: Simulator) -> None:
    plain = simulator.throw(POINT)
    throw = simulator.throw(POINT, target={"target_x_m": 1.4, "target_y_m": -0.2})
    assert throw.target == {"target_x_m": 1.4, "target_y_m": -0.2}
    assert throw.miss_m == pytest.approx(
        np.hypot(throw.row["landing_x_m"] - 1.4, throw.row["landing_y_m"] + 0.2), rel=1e-12
    )
    assert {name: value for name, value in throw.row.items() if name in plain.row} == plain.row
    assert (plain.target, plain.miss_m) == ({}, None)


def test_several_processes_give_the_same_throws_without_the_file(tmp_path: Path) -> None:
    path = tmp_path / "throws.yaml"
    path.write_text((ROOT / "configs" / "quickstart.yaml").read_text() + "\nsim: {engine: ballistic}\n")
    simulator = Simulator(path)
    path.unlink()
    points = [POINT, {}, {"task.duration_s": 1.2}]
    alone = [throw.row for throw in simulator.throw_many(points)]
    assert [row["trial"] for row in alone] == [0, 1, 2]
    throws = simulator.throw_many([*points, REFUSED], processes=2)
    together = [next(throws) for _ in points]
    assert [throw.row for throw in together] == alone
    assert together[0].ball.position.shape == (alone[0]["samples"], 3)
    # The throws come before the error, as they do in one process.
    with pytest.raises(PlanError, match=r"^points\[3\]: .*" + TOO_FAST):
        next(throws)
    simulator.close()


def test_throws_before_a_refused_point_are_returned(simulator: Simulator) -> None:
    throws = simulator.throw_many([{}, REFUSED])
    assert next(throws).trial == 0
    with pytest.raises(PlanError, match=TOO_FAST):
        next(throws)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"task.duration": 1.0}, "task.duration: unknown key; did you mean 'task.duration_s'"),
        ({"record.rate_hz": 100.0}, "record.rate_hz: cannot vary from trial to trial"),
        ({"ball.mass_kg": -1.0}, "ball.mass_kg: should be greater than 0"),
    ],
)
def test_a_wrong_key_or_value_is_an_error_that_names_the_key(
    simulator: Simulator, values: dict[str, float], message: str
) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        simulator.throw(values)


def test_a_simulator_of_a_config_throws_as_that_of_its_file(simulator: Simulator) -> None:
    config = load_config(ROOT / "configs" / "quickstart.yaml")
    with Simulator(config) as other:
        assert other.throw(POINT).row == simulator.throw(POINT).row
    with pytest.raises(ConfigError, match=r"^overrides: win over a file, got a Config\n  try: load_config"):
        Simulator(config, overrides=["seed=1"])


def test_a_simulator_throws_for_several_threads_one_after_the_other(simulator: Simulator) -> None:
    points = [{"task.duration_s": duration_s} for duration_s in (1.0, 1.1)] * 3
    alone = [simulator.throw(point).row for point in points[:2]] * 3

    def throw(point: dict[str, float]) -> dict[str, object]:
        assert "moves at" in str(simulator.find_refusal(REFUSED))
        return simulator.throw(point).row

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(throw, points)) == alone


def test_the_program_of_the_page_runs_without_error_output(tmp_path: Path) -> None:
    (program,) = find_blocks("python", read_section("python.md", "Single throws"))
    (tmp_path / "program.py").write_text(program)
    said = subprocess.run(
        [sys.executable, tmp_path / "program.py"], capture_output=True, text=True, timeout=120, cwd=ROOT, check=False
    )
    assert (said.returncode, said.stderr) == (0, "")
    assert len(said.stdout.splitlines()) == 4
