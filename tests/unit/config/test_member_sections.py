"""Sections of tools and tasks of other packages are checked before configurations are read by them."""

from typing import Any, ClassVar, Literal

import pytest
from pydantic import Field

from throwcollect.config import member_sections
from throwcollect.config.member_sections import load_section
from throwcollect.config.section import Section
from throwcollect.config.task_config import TaskConfig
from throwcollect.config.tool_config import ToolConfig
from throwcollect.config.until import UntilConfig, Wanted
from throwcollect.errors import ConfigError, MemberError


class UntilWaved(UntilConfig):
    """When enough has been collected."""

    waved: Wanted


class UntilNothing(UntilConfig):
    """It has no key."""


class UntilBoth(UntilWaved):
    """It has two keys."""

    short: Wanted = 1


class WaveConfig(TaskConfig):
    """Keys of a wave."""

    implementation: ClassVar[str] = "wave:Wave"
    until: ClassVar[type[UntilConfig]] = UntilWaved
    name: Literal["wave"] = "wave"
    start: dict[str, float] = Field(default={"elbow": 0.0})
    end: dict[str, float] = Field(default={"elbow": 1.0})


class NamelessTool(ToolConfig):
    """Its name is any text."""

    implementation: ClassVar[str] = "cup:Cup"
    name: str = "wave"


def change(**attributes: Any) -> type[TaskConfig]:
    return type("Changed", (WaveConfig,), attributes | {"__module__": "hand_wave.config"})


def load(section: type[Section], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(member_sections, "load_member", lambda *_: section)
    return load_section("tasks", "wave")


def test_a_good_section_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert load(WaveConfig, monkeypatch) is WaveConfig


@pytest.mark.parametrize(
    ("section", "said"),
    [
        (change(until=dict), "until should be a class derived from throwcollect.config.until.UntilConfig, is <class"),
        (change(until=UntilNothing), "until should have one key, .*; UntilNothing has none"),
        (change(until=UntilBoth), "until should have one key, .*; UntilBoth has waved, short"),
        (change(implementation=3), "implementation should be a text 'module:class', is 3"),
        (change(implementation="wave.Wave"), "implementation should be a text 'module:class', is 'wave.Wave'"),
        (change(targets="end_m"), "targets should be a tuple of str, is 'end_m'"),
        (change(target_columns=("end_m",)), "target_columns should be a tuple of TargetColumn, is"),
        (NamelessTool, "the key name should be declared as `name: Literal\\['wave'\\] = 'wave'`, like the entry point"),
    ],
)
def test_a_wrong_section_is_an_error_that_says_what_would_be_right(
    section: type[Section], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ConfigError, match=f"the task wave of .*{said}"):
        load(section, monkeypatch)


def test_a_section_that_fails_while_it_checks_its_keys_is_named() -> None:
    def fail(_: object) -> Any:
        raise KeyError("elbow")

    with pytest.raises(
        MemberError, match=r"hand_wave\.config\.Changed of another package cannot check its keys: KeyError"
    ):
        change(_find_contradictions=fail)()
