from typing import ClassVar, Literal

from pydantic import TypeAdapter

from throwcollect.config import schema
from throwcollect.config.schema import Config, Range, SweepConfig, Values
from throwcollect.config.section import any_of
from throwcollect.config.task_config import UntilConfig, Wanted
from throwcollect.tasks.throw.throw_config import ThrowConfig, UntilLanded


def test_an_empty_configuration_is_valid():
    assert Config().task.trajectory.family == "minimum_jerk"


def test_configurations_share_their_default_objects():
    assert Config().ball is Config(trials=3).ball
    assert Config().task.end is Config(trials=3).task.end


def test_swept_parameters_with_values_and_with_min_and_max_are_distinguished():
    sweep = SweepConfig.model_validate({"parameters": {"a": {"values": [1]}, "b": {"min": 1, "max": 2}}})
    assert sweep.parameters == {"a": Values(values=[1.0]), "b": Range(min=1.0, max=2.0)}


def test_slots_of_trials_do_not_overlap_and_none_starts_at_zero():
    config = Config()
    starts = [config.trial_start_ns(number) for number in range(3)]
    assert starts[0] > 0
    assert starts[1] - starts[0] == starts[2] - starts[1] > config.sim.max_trial_s * 10**9


class UntilLandedToo(UntilConfig):
    """The section `until` of a task of another package."""

    landed: Wanted


class LobConfig(ThrowConfig):
    """A task that names its success as `throw` does."""

    until: ClassVar[type[UntilConfig]] = UntilLandedToo
    name: Literal["lob"] = "lob"


def test_two_tasks_may_name_their_success_alike(monkeypatch):
    tasks = {"throw": ThrowConfig, "lob": LobConfig}
    monkeypatch.setattr(schema, "usable_names", lambda _: tuple(tasks))
    monkeypatch.setattr(schema, "load_member", lambda _, name: tasks[name])
    until = TypeAdapter(schema._make_until_type()).validate_python({"landed": 3})
    assert type(until) is UntilLanded
    monkeypatch.undo()
    for task in (ThrowConfig(), LobConfig()):
        assert list(Config().model_copy(update={"until": until, "task": task})._find_contradictions()) == []


def test_task_classes_of_two_packages_may_have_the_same_name():
    namesake = type("ThrowConfig", (LobConfig,), {"__module__": "somebody.elses"})
    kind = TypeAdapter(any_of({"throw": ThrowConfig, "lob": namesake}, lambda value: value["name"]))
    assert [type(kind.validate_python({"name": name})) for name in ("throw", "lob")] == [ThrowConfig, namesake]
