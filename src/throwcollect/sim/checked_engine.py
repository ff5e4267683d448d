"""Makes physics engines; mistakes of an engine of another package are found and reported as faults of that package."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from types import NoneType
from typing import Any, cast, get_type_hints

from throwcollect.declared_types import check_type
from throwcollect.engine_packages import require_engine
from throwcollect.engines.engine import (
    BALL_NUMBERS,
    GROUND,
    Engine,
    Observer,
    Sample,
    Scene,
    State,
    Steps,
    ball_of,
)
from throwcollect.members import explain_failure, is_own, load_member

_UNIT_TOLERANCE = 1e-3
"""How far the length of an orientation may be from 1; engines may compute in single precision."""


def make_engine(name: str) -> Engine:
    """Make a physics engine."""
    require_engine(name)
    kind = load_member("engines", name)
    if is_own("engines", name):
        made: Engine = kind()
        return made
    with explain_failure("engines", name, "be made"):
        return cast(Engine, _CheckedEngine(name, Engine, kind()))


class _Checked:
    """Stands for an object of an engine of another package, and checks what its methods and properties return.

    Args:
        name: Name of the engine.
        kind: The class whose methods and properties are offered; it declares what they return.
        checked: The object.
    """

    def __init__(self, name: str, kind: type, checked: object) -> None:
        self._name = name
        self._kind = kind
        self._checked = checked

    def __getattr__(self, attribute: str) -> Any:
        if isinstance(declared := getattr(self._kind, attribute), property):
            return self._ask(attribute, partial(getattr, self._checked, attribute), declared.fget)
        return partial(self._call, attribute)

    def _call(self, method: str, *arguments: object) -> Any:
        return self._ask(method, lambda: getattr(self._checked, method)(*arguments), getattr(self._kind, method))

    def _ask(self, what: str, ask: Callable[[], Any], declared: Any) -> Any:
        """Call a function that asks for something, and check the answer against what a function of ours declares."""
        with explain_failure("engines", self._name, f"carry out {what}"):
            answer = ask()
            if (wanted := _find_returned(declared)) is not NoneType:
                check_type(f"what {what} returns", answer, wanted)
        return answer


@cache
def _find_returned(function: Any) -> Any:
    return get_type_hints(function)["return"]


class _CheckedEngine(_Checked):
    """Stands for an engine of another package; it also checks that states, samples and steps fit the scene."""

    _known: frozenset[str] = frozenset()
    """Names that the scene has for what may touch the ball; further bodies come on top of them."""
    _numbers = 0
    """How many numbers a sample of the scene has."""

    def load(self, scene: Scene) -> None:
        """Make the world of a scene, which says what states and samples have."""
        self._call("load", scene)
        self._known = frozenset({GROUND, scene.tool.name, *(link.name for link in scene.robot.links)})
        self._numbers = 3 * len(scene.moving) + BALL_NUMBERS

    @property
    def state(self) -> State:
        """Robot and ball now."""
        with explain_failure("engines", self._name, "carry out state"):
            state: State = self._checked.state  # type: ignore[attr-defined]
            check_type("what state returns", state, State)
            self.check_sample(state.sample)
            self.check_names(state.touching)
        return state

    def run(self, steps: Steps, observer: Observer) -> int:
        """Take steps until the observer stops them."""
        checker = _StepChecker(self, steps, observer)
        taken: int = self._call("run", steps, checker)
        with explain_failure("engines", self._name, "carry out run"):
            checker.check_end(taken)
        return taken

    def check_sample(self, sample: Sample) -> None:
        """Make sure that a sample fits the scene."""
        if len(sample) != self._numbers:
            raise ValueError(f"a sample should have {self._numbers} numbers, has {len(sample)}")
        length = math.hypot(*ball_of(sample).orientation_xyzw)
        if abs(length - 1) > _UNIT_TOLERANCE:
            raise ValueError(f"the orientation of the ball in a sample should have the length 1, has {length:g}")

    def check_names(self, bodies: frozenset[str]) -> None:
        """Make sure that bodies which touch the ball are in the world."""
        for name in bodies - self._known:
            raise ValueError(f"{name!r} touches the ball, but there is no such tool or link")


class _StepChecker(Observer):
    """Checks what an engine tells of its steps, and passes it on.

    Samples and touches are what a trial is judged by, so one that is left out, or told of another step, makes a false
    dataset and no error.
    """

    def __init__(self, engine: _CheckedEngine, steps: Steps, observer: Observer) -> None:
        self._engine = engine
        self._observer = observer
        self._stride = steps.stride
        self._due = steps.first_sample
        """The step of which the next sample is due."""
        self._told = 0
        """The last step of which the engine has told anything."""
        self._last = len(steps.velocities)
        """The last step to take: the last of all, or the one at which the observer stops the engine."""

    def on_touch(self, step: int, bodies: frozenset[str]) -> None:
        """Check and pass on that other bodies touch the ball."""
        check_type("on_touch: step", step, int)
        check_type("on_touch: bodies", bodies, frozenset[str])
        self._engine.check_names(bodies)
        if not self._told < step <= min(self._due, self._last):
            raise ValueError(f"on_touch is called for step {step} after step {self._told} of {self._last}")
        self._told = step
        self._observer.on_touch(step, bodies)

    def on_sample(self, step: int, sample: Sample) -> bool:
        """Check and pass on a sample."""
        check_type("on_sample: step", step, int)
        check_type("on_sample: sample", sample, Sample)
        self._engine.check_sample(sample)
        if step > self._last:
            raise ValueError(f"on_sample is called for step {step}, where step {self._last} is the last one")
        if step != self._due:
            raise ValueError(f"on_sample should be called for step {self._due}, is called for {step}")
        self._told, self._due = step, step + self._stride
        if stops := self._observer.on_sample(step, sample):
            self._last = step
        return stops

    def check_end(self, taken: int) -> None:
        """Make sure that all steps were taken, and all samples made."""
        if self._due <= self._last:
            raise ValueError(f"on_sample should be called for step {self._due} of {self._last}, is not")
        if taken != self._last:
            raise ValueError(f"run should return the number of steps taken, {self._last}, returns {taken}")
