"""Forgeries whose hashes, CRCs, digests and rows all fit: only physics, plan and configuration contradict them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.dataset.conftest import SETTINGS, Change, Collection, throw
from tests.unit.dataset.damage import find_stored, flip

from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import draw_plan, feasibility_check
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.dataset.verify import verify
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_plan import find_drawing_problems, find_refusal_problems
from throwcollect.dataset.verify_shard import check_shard
from throwcollect.episode.channels import Channels
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.errors import ConfigError
from throwcollect.robots.description import full_description
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.talos import TALOS
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sweep.digest import trial_digests
from throwcollect.sweep.plan import Plan, make_trials
from throwcollect.sweep.points import Points
from throwcollect.sweep.samplers import draw_points
from throwcollect.sweep.trials import Trials
from throwcollect.tasks.task import trajectory_of
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

FORGED = 2
"""The forged trial."""
FLIGHT = 150
"""A sample in its flight."""
ELBOW, LOCKED = TALOS.joints.index("arm_right_4_joint"), TALOS.joints.index("head_1_joint")

Forgery = Callable[[Samples, EpisodeHeader], tuple[Samples, EpisodeHeader]]


def in_samples(column: str, row: int | slice, what: int | slice, change: Callable[[Any], Any]) -> Forgery:
    """Changes some numbers of a column."""

    def forge(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        changed = getattr(samples, column).copy()
        changed[row, what] = change(changed[row, what])
        return replace(samples, **{column: changed}), header

    return forge


def in_header(**changes: Callable[[EpisodeHeader], Any]) -> Forgery:
    """Changes some fields of the header."""
    return lambda samples, header: (samples, replace(header, **{key: make(header) for key, make in changes.items()}))


def cut(end_reason: str, rows: slice = slice(-5)) -> Forgery:
    """Removes some samples, with a header that says that the trial ended there."""

    def forge(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        goals = tuple(replace(goal, status=2) for goal in header.goals)
        left = samples[rows]
        last = int(left.stamps_ns[-1])
        contacts = tuple(replace(each, end_ns=None if each.end_ns > last else each.end_ns) for each in header.contacts)
        return left, replace(header, samples=len(left), goals=goals, end_reason=end_reason, contacts=contacts)

    return forge


def with_contact(body: str, begin_s: float, end_s: float | None, *, off_ns: int = 0) -> Forgery:
    """Adds an invented contact."""

    def add(header: EpisodeHeader) -> tuple[Contact, ...]:
        begin, end = (None if s is None else header.start_ns + round(s * 1e9) + off_ns for s in (begin_s, end_s))
        return (*header.contacts, Contact(body, begin, end))

    return in_header(contacts=add)


def with_goal(**changes: Any) -> Forgery:
    return in_header(goals=lambda header: (replace(header.goals[0], **changes), *header.goals[1:]))


def end_contact_later(by_s: float) -> Forgery:
    """Makes the contact with the spoon end later."""
    return in_header(
        contacts=lambda header: tuple(
            replace(each, end_ns=each.end_ns + round(by_s * 1e9)) for each in header.contacts if each.end_ns
        )
    )


def swap_trials(_: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The recording of another trial, moved into this one's slot of time."""
    plan = Collection().plan
    return throw(plan.config_of(plan.trials[4]), header.trial)


def turn_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    orientation = samples.ball_orientation_xyzw.copy()
    orientation[FLIGHT:] = orientation[FLIGHT:][:, [1, 0, 3, 2]]
    return replace(samples, ball_orientation_xyzw=orientation), header


def end_goals_at_once(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    goals = tuple(replace(goal, status=4) for goal in header.goals)
    return samples[:40], replace(header, samples=40, goals=goals)


FORGERIES: dict[str, tuple[Forgery, str]] = {
    "effort that is no number": (in_samples("effort", 7, 3, lambda _: np.nan), "effort holds .* sample 7"),
    "infinite position": (in_samples("position", 9, 3, lambda _: np.inf), "position holds .* not finite"),
    "infinite ball": (in_samples("ball_position", 9, 1, lambda _: -np.inf), "ball_position holds"),
    "cut end": (cut("landed"), "do not enclose a crossing"),
    "cut as timeout": (cut("timeout"), "ended as timeout after"),
    "cut as rest in flight": (cut("rest"), "ended as rest, but the ball moved at"),
    "cut as rest at the start": (cut("rest", slice(90)), "ended as rest, but the arm moved until"),
    "another end": (in_header(end_reason=lambda _: "timeout"), "although the ball crossed the landing plane"),
    "no velocities": (
        in_samples("velocity", slice(None), slice(None), lambda _: 0.0),
        "moves otherwise than its velocities",
    ),
    "swapped trials": (swap_trials, "departs from the trajectory of the trial by"),
    "other start": (in_samples("position", slice(0, 3), ELBOW, lambda was: was + 0.1), "rad away from the start"),
    "other motion": (in_samples("position", slice(50, 60), ELBOW, lambda was: was + 0.1), "although its torque is"),
    "locked joint moves": (in_samples("position", 50, LOCKED, lambda was: was + 1e-9), "head_1_joint is locked at"),
    "locked joint moves down": (
        in_samples("position", 50, LOCKED, lambda was: was - 1e-9),
        "head_1_joint is locked at",
    ),
    "locked joint has speed": (in_samples("velocity", 50, LOCKED, lambda _: -1e-9), "head_1_joint is locked, and"),
    "locked joint has torque": (in_samples("effort", 50, LOCKED, lambda _: 1e-9), "head_1_joint is locked, and"),
    "too much torque": (in_samples("effort", 50, ELBOW, lambda _: 1e3), "of the most that its motor has"),
    "dropped contact": (in_header(contacts=lambda _: ()), "departs from ballistic motion .* where no contact is"),
    "contact that ends too early": (end_contact_later(-0.1), "velocity departs from ballistic motion"),
    "contact that ends too late": (
        end_contact_later(0.1),
        "contact with 'spoon' at 0.000 s: the ball moves as if nothing",
    ),
    "invented contact": (with_contact("arm_right_4_link", 0.6, 0.602), "the ball moves as if nothing touched it"),
    "invented lasting contact": (with_contact("torso_2_link", 0.6, None), "the ball moves as if nothing"),
    "unknown body": (with_contact("wall", 0.6, 0.602), "'wall' at 0.600 s: no such body"),
    "endless name": (with_contact("x" * 100_000, 0.6, 0.602), "no such body can touch the ball"),
    "contact off the steps": (with_contact("spoon", 0.6, 0.602, off_ns=1), "on physics steps of the trial"),
    "contact that ends before it begins": (with_contact("spoon", 0.6, 0.5), "does not begin and end, in this order"),
    "contact after the end": (with_contact("spoon", 50.0, None), "does not begin and end"),
    "contact within another": (with_contact("spoon", 0.2, 0.3), "begins before the one before it has ended"),
    "contacts in another order": (
        in_header(contacts=lambda header: (Contact("head_1_link", header.start_ns, None), *header.contacts)[::-1]),
        "not in order of their starts",
    ),
    "contact with ground that stops nothing": (with_contact("ground", 0.6, 0.602), "the ground stops nothing"),
    "velocity in flight": (
        in_samples("ball_linear_velocity", FLIGHT, 0, lambda was: was + 1e-6),
        "velocity departs from ballistic motion by 1e-06 m/s",
    ),
    "all velocities": (in_samples("ball_linear_velocity", slice(None), 0, lambda was: was + 1e-6), "position departs"),
    "orientation in flight": (turn_ball, "orientation departs from ballistic motion"),
    "spin in flight": (in_samples("ball_angular_velocity", FLIGHT, 2, lambda _: 1e-6), "spin departs"),
    "no unit quaternion": (in_samples("ball_orientation_xyzw", FLIGHT, 3, lambda was: was + 1e-6), "no unit"),
    "goal of another controller": (with_goal(controller="head_controller"), "the trajectory is sent to"),
    "goal with an unknown status": (with_goal(status=3), "has the unknown status 3"),
    "goal with an unknown error": (with_goal(error_code=-17, status=6), "has the unknown error code -17"),
    "goal that succeeded with an error": (with_goal(error_code=-4, status=4), "an error code all the same"),
    "goal that succeeded too early": (end_goals_at_once, "before its trajectory"),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_episode_is_found(collection: Collection, name: str) -> None:
    forge, problem = FORGERIES[name]
    assert list(problems(collection, None)) == []
    found = list(problems(collection, forge))
    assert any(re.search(problem, each) for each in found), [each[:200] for each in found]
    assert all(len(each) < 500 for each in found)


def depart(by_rad: float, torque_share: float = 0.0) -> Forgery:
    """The elbow leaves its trajectory and comes back, with fitting velocities; one torque is a share of its limit."""

    def forge(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        position, velocity, effort = (each.copy() for each in (samples.position, samples.velocity, samples.effort))
        phase = np.pi * np.linspace(0, 1, len(samples))
        position[:, ELBOW] += by_rad * np.sin(phase) ** 2
        velocity[:, ELBOW] += by_rad * np.gradient(np.sin(phase) ** 2) * 250
        effort[1, ELBOW] = torque_share * joint_limits(TALOS).effort[ELBOW]
        return replace(samples, position=position, velocity=velocity, effort=effort), header

    return forge


def tilt_ball(by_rad: float) -> Forgery:
    def forge(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        orientation = samples.ball_orientation_xyzw.copy()
        # A small turn about the vertical axis.
        orientation[FLIGHT:] += by_rad / 2 * orientation[FLIGHT:][:, [1, 0, 3, 2]] * [-1, 1, 1, -1]
        return replace(samples, ball_orientation_xyzw=orientation), header

    return forge


@pytest.mark.parametrize(
    ("forge", "found"),
    [
        (depart(0.019), None),
        (depart(0.021), "departs from the trajectory of the trial by 0.021 rad"),
        (depart(0.021, torque_share=0.99), "departs from the trajectory of the trial by 0.021 rad"),
        (depart(0.021, torque_share=0.9995), None),
        (in_samples("velocity", slice(40, 60), ELBOW, lambda was: was + 0.15), None),
        (in_samples("velocity", slice(40, 60), ELBOW, lambda was: was + 0.25), "moves otherwise than its velocities"),
        (tilt_ball(5e-10), None),
        (tilt_ball(2e-9), "orientation departs from ballistic motion"),
    ],
)
def test_forgeries_are_found_from_the_documented_tolerances_on(
    collection: Collection, forge: Forgery, found: str | None
) -> None:
    said = list(problems(collection, forge))
    assert len(said) == (found is not None)
    assert found is None or found in said[0]


def problems(collection: Collection, forge: Change | None) -> Iterator[str]:
    channels = Channels(collection.config, full_description(collection.config))
    return EpisodeCheck(collection.plan, {}).find_content_problems(collection.episode(FORGED, forge), channels)


def test_verify_names_the_trial_of_a_forged_episode(collection: Collection, tmp_path: Path) -> None:
    def change(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        return swap_trials(samples, header) if header.trial == FORGED else (samples, header)

    (finding,) = verify(collection.collect(tmp_path / "dataset", change=change))
    assert str(finding).startswith("quick_00000.mcap: trial 2: arm_right_4_joint departs from the trajectory")


def forge_some(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """Forge some trials, each for another step of the check."""
    forgeries = {
        0: FORGERIES["infinite position"],
        2: FORGERIES["velocity in flight"],
        3: FORGERIES["locked joint moves"],
        5: FORGERIES["cut as timeout"],
    }
    forge, _ = forgeries.get(header.trial, (lambda *same: same, ""))
    return forge(samples, header)


def test_many_forged_episodes_are_each_reported_as_if_alone(tmp_path: Path) -> None:
    collection = Collection({"record": {"trials_per_shard": 10}})
    alone = EpisodeCheck(collection.plan, {})
    channels = Channels(collection.config, full_description(collection.config))
    expected = [
        (f"trial {trial}", problem)
        for trial in range(7)
        for problem in alone.find_content_problems(collection.episode(trial, forge_some), channels)
    ]
    assert list(dict.fromkeys(place for place, _ in expected)) == ["trial 0", "trial 2", "trial 3", "trial 5"]
    path = collection.collect(tmp_path / "dataset", change=forge_some)
    assert [(each.place, each.problem) for each in verify(path)] == expected


def test_damage_between_forged_episodes_is_reported_in_order_of_the_file(tmp_path: Path) -> None:
    collection = Collection({"record": {"trials_per_shard": 10}})
    path = collection.collect(tmp_path / "dataset", change=forge_some) / "quick_00000.mcap"
    start = find_stored(path, 1).offset
    flip(path, start)
    report = check_shard(path, collection.config, range(7), EpisodeCheck(collection.plan, {}).find_problems)
    places = list(dict.fromkeys(finding.place for finding in report.findings))
    assert places == ["trial 0", f"byte {start}", "trial 2", "trial 3", "trial 5", "trial 1"]
    assert sorted(report.digests) == [0, 2, 3, 4, 5, 6]


def test_an_error_during_a_check_is_reported_after_the_problems_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    collection = Collection({"record": {"trials_per_shard": 10}})
    path = collection.collect(tmp_path / "dataset", change=forge_some) / "quick_00000.mcap"

    def plan_motion(config: Config) -> JointTrajectory:
        if config.task.duration_s == collection.plan.trial(3).values["task.duration_s"]:
            raise ConfigError("no usable motion")
        return trajectory_of(config)

    monkeypatch.setattr("throwcollect.dataset.verify_episode.trajectory_of", plan_motion)
    report = check_shard(path, collection.config, range(7), EpisodeCheck(collection.plan, {}).find_problems)
    assert list(dict.fromkeys(finding.place for finding in report.findings)) == ["trial 0", "trial 2", ""]
    assert report.findings[-1].problem == "no usable motion"
    assert sorted(report.digests) == [0, 1, 2]


def draw_other_plan(plan: Plan, points: Points, *, seed: int | None = None) -> Plan:
    """A plan of other points, or with the seeds of another configuration, whose digests fit."""
    seeds = plan.config if seed is None else plan.config.model_copy(update={"seed": seed})
    drawn = make_trials(seeds, points).seeds
    return replace(plan, trials=Trials(points, drawn, trial_digests(plan.config, points, drawn)))


def test_a_plan_that_the_configuration_does_not_draw_is_found(collection: Collection, tmp_path: Path) -> None:
    points = draw_points(collection.config, directory=tmp_path)
    points.values[5] = 0.9
    collection.plan = draw_other_plan(collection.plan, points)
    (finding,) = verify(collection.collect(tmp_path / "dataset"))
    assert str(finding).startswith("plan.parquet: trial 5: has task.duration_s = 0.9, the configuration draws")


def test_seeds_that_the_configuration_does_not_give_are_found(collection: Collection, tmp_path: Path) -> None:
    points = draw_points(collection.config, directory=tmp_path)
    plan = draw_other_plan(collection.plan, points, seed=8)
    found = list(find_drawing_problems(tmp_path, plan, None))
    assert len(found) == len(plan.trials)
    assert "has seed" in found[0].problem


def test_a_plan_with_fewer_trials_is_found(collection: Collection, tmp_path: Path) -> None:
    plan = replace(collection.plan, trials=collection.plan.trials[:6])
    (finding,) = find_drawing_problems(tmp_path, plan, None)
    assert finding.problem == "has 6 trials, the configuration gives 7"


def test_invented_dropped_and_changed_refusals_are_found(tmp_path: Path) -> None:
    collection = Collection(
        {"trials": 2, "sweep": {"sampler": "grid", "parameters": {"task.duration_s": {"values": [0.3, 1.0]}}}}
    )
    honest = draw_plan(collection.config, directory=tmp_path)
    assert [trial.refused is None for trial in honest.trials] == [False, True]
    assert list(find_refusal_problems(honest, (), feasibility_check)) == []
    forged = replace(honest, trials=honest.trials.refuse([None, "too fast"]))
    dropped, invented = find_refusal_problems(forged, (), feasibility_check)
    assert dropped.problem.startswith("is refused as None, the check says 'arm_right_7_joint moves at")
    assert invented.problem == "is refused as 'too fast', the check says None"
    reason = honest.trials[0].refused
    assert reason is not None
    renamed = replace(honest, trials=honest.trials.refuse([reason.replace("_7_", "_4_"), None]))
    (found,) = find_refusal_problems(renamed, (), feasibility_check)
    assert found.problem.startswith("is refused as 'arm_right_4_joint moves at")


def test_where_a_plan_with_until_ends_is_not_checked_without_results(tmp_path: Path) -> None:
    config = Config.model_validate({**SETTINGS, "trials": None, "until": {"landed": 60}})
    points = draw_points(config, directory=tmp_path)
    plan = Plan(config, make_trials(config, points[:192]))
    assert list(find_drawing_problems(tmp_path, plan, None)) == []


@pytest.mark.parametrize(
    ("trials", "landed", "problem"),
    [
        (60, 60, None),
        (600, 59, None),
        (50, 50, "has 50 trials, the configuration gives 600"),
        (64, 64, "has 64 trials, the configuration gives 60"),
    ],
)
def test_the_end_of_a_plan_with_until_is_checked_against_the_results(
    tmp_path: Path, trials: int, landed: int, problem: str | None
) -> None:
    config = Config.model_validate({**SETTINGS, "trials": None, "until": {"landed": 60}})
    plan = Plan(config, make_trials(config, draw_points(config, directory=tmp_path)[:trials]))
    table = ThrowsTable.of(plan)
    outcomes = [ThrowOutcome.LANDED if number < landed else ThrowOutcome.TIMEOUT for number in range(trials)]
    made = [table.row(trial, ThrowResult(outcomes[trial.number]), None) for trial in plan.trials]
    rows = {row["trial"]: row for row in table.table(made).to_pylist()}
    assert [finding.problem for finding in find_drawing_problems(tmp_path, plan, rows)] == (
        [problem] if problem else []
    )
