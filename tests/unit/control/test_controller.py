"""Driving a controller: many updates at once equal single ones, and mistakes are reported."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.control.values import JointTolerance, Trajectory, TrajectoryGoal, TrajectoryPoint

from .bench import JOINTS, PERIOD_NS, TALOS, Bench, Plant, constrain, goal, seconds, through, to

UPDATES = 120
tolerance = st.sampled_from([0.0, 0.0, 0.005, 0.1, 0.4])


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    names = draw(st.permutations(JOINTS))[: draw(st.sampled_from([3, 3, 1, 2]))]
    values = st.tuples(*[st.floats(-3, 3)] * len(names))
    time_ns, points = draw(st.sampled_from([0, 1, PERIOD_NS, 123_456_789])), []
    for _ in range(draw(st.integers(1, 4))):
        content = draw(st.integers(0, 2))
        velocities = draw(values) if content > 0 else ()
        placed = draw(values) if content == 0 or draw(st.integers(0, 4)) else ()
        points.append(TrajectoryPoint(time_ns, placed, velocities, draw(values) if content > 1 else ()))
        time_ns += draw(st.sampled_from([1, PERIOD_NS, 55_555_555, 200_000_000]))
    return through(points, names, draw(st.sampled_from([None, None, seconds(1000.3), seconds(1000.9)])))


@st.composite
def goals(draw: st.DrawFn) -> TrajectoryGoal:
    asked = st.lists(st.builds(JointTolerance, st.sampled_from(JOINTS), st.sampled_from([0.0, -1.0, 0.2])), max_size=2)
    late_ns = draw(st.sampled_from([0, 0, seconds(-1), seconds(0.05), 1]))
    return TrajectoryGoal(draw(trajectories()), draw(asked), draw(asked), late_ns)


@st.composite
def parameter_sets(draw: st.DrawFn) -> ControllerParameters:
    limits = {
        joint: JointConstraints(draw(st.sampled_from([0.0, 0.0, 0.0, 0.3])), draw(tolerance), 2.0) for joint in JOINTS
    }
    return ControllerParameters(
        JOINTS,
        allow_partial_joints_goal=True,
        allow_integration_in_goal_trajectories=True,
        allow_nonzero_velocity_at_trajectory_end=True,
        cmd_timeout=draw(st.sampled_from([0.0, 0.15])),
        constraints=Constraints(
            goal_time=draw(st.sampled_from([0.0, 0.1])), decelerate_on_cancel=draw(st.booleans()), joints=limits
        ),
    )


speeds = st.sampled_from([0.0, 0.25, 0.765, 1.0, 1.0, 2.0])
requests = st.one_of(goals(), trajectories(), speeds, st.just("cancel"), st.just("reset"))
schedules = st.dictionaries(st.integers(0, UPDATES - 1), requests, max_size=3)


class Side:
    """One controller with its plant; `step` makes a single update, `take` many at once."""

    def __init__(self, parameters: ControllerParameters, kind: str) -> None:
        self.bench = Bench(parameters, Plant(kind, velocity=0.5))
        self.commands: list[np.ndarray] = []

    def ask(self, request: object, goal_id: int) -> None:
        controller, now_ns = self.bench.controller, self.bench.now_ns
        if isinstance(request, TrajectoryGoal):
            controller.submit(goal_id, request, now_ns)
        elif isinstance(request, Trajectory):
            controller.replace(request, now_ns)
        elif isinstance(request, float):
            controller.scale_speed(request)
        elif request == "cancel":
            controller.cancel(controller.goal_id)
        else:
            controller.reset(now_ns, self.bench.plant.measure())

    def step(self) -> None:
        self.bench.step()
        self.commands.append(self.bench.commands[self.bench.k])

    def take(self, n_updates: int) -> None:
        rows = self.bench.controller.take(n_updates)
        assert rows.shape == (n_updates, 3)
        for row in rows:
            measured = self.bench.plant.measure()
            self.bench.plant.apply(row)
            self.commands.append(np.array(row))
        self.bench.controller.observe(measured)
        self.bench.now_ns += n_updates * PERIOD_NS
        self.bench.k += n_updates
        assert self.bench.controller.pop_results() == ()

    def outcome(self) -> dict[str, object]:
        controller = self.bench.controller
        now_ns = self.bench.now_ns
        queries = [controller.query(now_ns + offset) for offset in (-PERIOD_NS, 0, 1, 77 * PERIOD_NS)]
        return plain((controller.state(), controller.command, controller.goal_id, self.bench.results, queries))


def plain(value: object) -> object:
    """The value as nested lists, so that whole states can be compared."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if dataclasses.is_dataclass(value):
        return [plain(getattr(value, field.name)) for field in dataclasses.fields(value)]
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


@settings(max_examples=150, deadline=None)
@given(
    parameters=parameter_sets(),
    kind=st.sampled_from(["ideal", "frozen", "offset", "lag"]),
    schedule=schedules,
    chunks=st.lists(st.integers(1, 60), min_size=1, max_size=6),
)
def test_many_updates_at_once_equal_single_updates(parameters, kind, schedule, chunks) -> None:
    single, bulk = Side(parameters, kind), Side(parameters, kind)
    for k in range(UPDATES):
        if k in schedule:
            single.ask(schedule[k], k)
            single.bench.collect()
        single.step()
    k, turn = 0, 0
    while k < UPDATES:
        if k in schedule:
            bulk.ask(schedule[k], k)
            bulk.bench.collect()
        next_request = min([at for at in schedule if at > k], default=UPDATES)
        n_updates = min(bulk.bench.controller.next_decision(), chunks[turn % len(chunks)], next_request - k)
        if n_updates:
            bulk.take(n_updates)
        else:
            bulk.step()
        k, turn = k + max(1, n_updates), turn + 1
    assert np.array_equal(single.commands, bulk.commands)
    assert single.outcome() == bulk.outcome()


def test_a_goal_needs_decisions_only_in_its_first_update_and_at_its_end() -> None:
    bench = Bench(TALOS)
    assert bench.controller.next_decision() == sys.maxsize
    bench.send(goal(to(1.0, 2.1)))
    assert bench.controller.next_decision() == 0
    bench.step()
    assert bench.controller.next_decision() == 98
    assert bench.controller.take(98)[[0, 97], 0] == pytest.approx([1.12, 2.09])
    assert bench.controller.next_decision() == 0
    bench.plant.position = bench.controller.command
    bench.step()
    assert [result.status for _, result in bench.results] == [4]
    # The next update begins to hold the end.
    assert bench.controller.next_decision() == 0
    bench.step()
    assert bench.controller.next_decision() == sys.maxsize


def test_a_goal_with_path_tolerances_needs_a_decision_in_every_update() -> None:
    bench = Bench(constrain(trajectory=0.5))
    bench.send(goal(to(1.0, 2.1)))
    for _ in range(101):
        assert bench.controller.next_decision() == 0
        bench.step()
    assert bench.controller.next_decision() == sys.maxsize


def test_a_trajectory_from_the_topic_needs_a_decision_once_it_is_late() -> None:
    bench = Bench(TALOS)
    bench.controller.replace(goal(to(1.0, 2.1)).trajectory, bench.now_ns)
    bench.step()
    assert bench.controller.next_decision() == 160
    bench.plant.apply(bench.controller.take(160)[-1])
    assert bench.controller.next_decision() == 0
    assert not bench.controller.at_rest
    bench.step(2)
    assert bench.controller.at_rest
    assert bench.controller.command[0] == 2.1


def test_cancel_returns_whether_the_goal_was_being_executed() -> None:
    bench = Bench()
    bench.send(goal(to(0.0, 2.1)), "A")
    assert not bench.controller.cancel("B")
    assert bench.controller.cancel("A")
    assert not bench.controller.cancel("A")
    assert not bench.controller.cancel(None)


def test_the_order_of_joints_in_a_goal_does_not_matter() -> None:
    ordered, shuffled = Bench(), Bench()
    ordered.send(TrajectoryGoal(through([TrajectoryPoint(seconds(0.5), (1, 2, 3), (0, 0, 0), (1, 2, 3))], JOINTS)))
    names = ("j3", "j1", "j2")
    shuffled.send(TrajectoryGoal(through([TrajectoryPoint(seconds(0.5), (3, 1, 2), (0, 0, 0), (3, 1, 2))], names)))
    ordered.step(60)
    shuffled.step(60)
    assert all(np.array_equal(ordered.commands[k], shuffled.commands[k]) for k in range(1, 61))
