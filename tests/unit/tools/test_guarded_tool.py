"""A tool of another package that fails, or answers what no tool can, is an error that names the package."""

import math
from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from throwcollect import members
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, MemberError
from throwcollect.pinocchio_library import pinocchio
from throwcollect.tools.spoon.spoon import Spoon
from throwcollect.tools.tool import Box, GuardedTool, Tool, tool_of

UP = np.array([1.0, 0.0, 0.0])
ASK: dict[str, Callable[[Tool], object]] = {
    "mount": lambda tool: tool.mount,
    "boxes": lambda tool: tool.boxes,
    "inertia": lambda tool: tool.inertia,
    "rim_radius_m": lambda tool: tool.rim_radius_m,
    "depth_m": lambda tool: tool.depth_m,
    "ball_seat": lambda tool: tool.ball_seat(0.02),
    "way_out": lambda tool: tool.way_out(0.02, UP),
}


def fail(*_: object) -> Any:
    raise ValueError("boom")


def guard(**wrong: Any) -> GuardedTool:
    """A spoon of another package whose answers are replaced by these."""
    return GuardedTool(type("Wrong", (Spoon,), wrong)(Config().tool), "mine")


@pytest.mark.parametrize("name", ASK)
def test_answers_of_a_good_tool_pass(name: str) -> None:
    right, guarded = ASK[name](Spoon(Config().tool)), ASK[name](guard())
    assert str(guarded) == str(right) if name == "boxes" else guarded == right


@pytest.mark.parametrize("name", ASK)
def test_an_exception_in_a_tool_names_its_package(name: str) -> None:
    broken = fail if name in ("ball_seat", "way_out") else property(fail)
    with pytest.raises(MemberError, match=r"the tool mine of .* cannot .*: ValueError: boom"):
        ASK[name](guard(**{name: broken}))


@pytest.mark.parametrize(
    ("name", "answer", "said"),
    [
        ("mount", None, "mount should be a pinocchio.SE3, is None"),
        ("boxes", (), "boxes should be a tuple of at least one Box"),
        ("boxes", (3,), "boxes should be a tuple of at least one Box"),
        ("boxes", (Box((0.1, -0.1, 0.1), pinocchio.SE3.Identity()),), "with finite edges above 0"),
        ("inertia", None, "inertia should be a pinocchio.Inertia of a mass above 0, is None"),
        ("inertia", pinocchio.Inertia.Zero(), "inertia should be a pinocchio.Inertia of a mass above 0"),
        ("rim_radius_m", "wide", "rim_radius_m should be a finite number above 0, is 'wide'"),
        ("depth_m", math.nan, "depth_m should be a finite number above 0, is nan"),
        ("depth_m", lambda _: 0.04, "depth_m should be a finite number above 0, is <"),
        ("ball_seat", lambda *_: (0.0, math.nan, 0.0), "ball_seat should be three finite numbers"),
        ("ball_seat", lambda *_: (0.0, 0.0), "ball_seat should be three finite numbers"),
        ("way_out", lambda *_: None, "way_out should be a finite number, is None"),
        ("way_out", lambda *_: math.nan, "way_out should be a finite number, is nan"),
    ],
)
def test_an_answer_of_a_wrong_kind_says_what_would_be_right(name: str, answer: Any, said: str) -> None:
    with pytest.raises(MemberError) as caught:
        ASK[name](guard(**{name: answer}))
    assert said in caught.value.message


def test_a_tool_without_a_name_is_refused() -> None:
    with pytest.raises(MemberError, match="name should be a text, is 3"):
        guard(name=3)


def test_a_refusal_of_the_tool_passes_unchanged() -> None:
    with pytest.raises(ConfigError, match="falls through the floor"):
        guard().ball_seat(0.001)


def test_a_tool_of_another_package_is_guarded_and_ours_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(tool_of(Config().tool), Spoon)
    foreign = Mock(implementation="throwcollect.tools.spoon.spoon:Spoon")
    foreign.name = "mine"
    monkeypatch.setattr(members, "entry_points", lambda **_: ())
    assert isinstance(tool_of(foreign), GuardedTool)
