"""Properties of every task in the table, and of one of another package."""

import sys
from dataclasses import fields
from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.config.task_config import TaskConfig, is_target
from throwcollect.members import load_member, load_part, names_of
from throwcollect.robots.description import robot_of
from throwcollect.tasks.result import LIMIT_VIOLATED, LOST, REFUSED, TRACKING_FAILED
from throwcollect.tasks.starter import begin_at_default
from throwcollect.tasks.task import Task, task_of
from throwcollect.units import unit_of_name

sys.path.append(str(Path(__file__).parents[2] / "plugins"))

from reach.config import ReachConfig

SECTIONS = [*(load_member("tasks", name) for name in names_of("tasks")), ReachConfig]

of_every_task = pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.model_fields["name"].default)


def fill(section: type[TaskConfig]) -> TaskConfig:
    """Fill the section as `throwcollect init` does, since a task need not have a default motion."""
    if section is ReachConfig:
        return section()  # its package is not installed, so no configuration can name it
    found = begin_at_default(Config().robot.name, section.model_fields["name"].default)
    assert found is not None
    return section(start=found.start, end=found.end, duration_s=found.duration_s)


def make_task(section: type[TaskConfig]) -> Task:
    """The task in a configuration, as if its package were installed."""
    return task_of(Config().model_copy(update={"task": fill(section)}))


@of_every_task
def test_a_task_has_the_common_outcomes_and_its_success(section: type[TaskConfig]) -> None:
    words = {each.value for each in make_task(section).outcomes}
    assert {LIMIT_VIOLATED, TRACKING_FAILED, LOST, fill(section).success} <= words
    assert REFUSED not in words
    # `ThrowTask` finds these.
    assert "landing" not in section.events or {"not_released", "dropped", "self_hit", "recaught"} <= words


@of_every_task
def test_the_name_of_a_task_leads_to_its_class(section: type[TaskConfig]) -> None:
    assert section.model_fields["name"].default == fill(section).name
    assert isinstance(make_task(section), Task)


@of_every_task
def test_every_measure_of_a_task_has_columns(section: type[TaskConfig]) -> None:
    task = make_task(section)
    columns = [column.name for column in task.columns.columns]
    assert len(set(columns)) == len(columns)
    for each in fields(task.results):
        if each.name not in {"outcome", "reason"}:
            assert any(each.name in column for column in columns), each.name
    assert all("{" not in column.description for column in task.columns.columns)


@of_every_task
def test_targets_of_a_task_belong_to_measured_or_given_columns(section: type[TaskConfig]) -> None:
    measured = {column.name: column.kind for column in make_task(section).columns.columns}
    for each in section.target_columns:
        assert is_target(each.name)
        assert measured.get(each.of) == "number" or each.of in section.given, each
        assert unit_of_name(each.name) == unit_of_name(each.of) == unit_of_name(each.miss) != ""
        assert each.miss not in measured
    assert not any(map(is_target, measured))
    assert section.target_columns == () or any(each.required for each in section.target_columns)


@of_every_task
def test_the_motion_moves_the_joints_of_the_configuration_from_time_0_to_its_end(section: type[TaskConfig]) -> None:
    task = make_task(section)
    trajectory = task.trajectory()
    assert trajectory.joints == tuple(joint for joint in robot_of(task.config).joints if joint in task.config.task.end)
    assert trajectory.times[0] == 0
    assert dict(zip(trajectory.joints, trajectory.positions[-1].tolist(), strict=True)) == task.config.task.end


@of_every_task
def test_the_report_part_of_a_task_can_be_loaded(section: type[TaskConfig]) -> None:
    pytest.importorskip("plotly")
    if path := make_task(section).report:
        assert callable(load_part("tasks", section.model_fields["name"].default, path))
