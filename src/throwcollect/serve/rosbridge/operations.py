"""Operations that clients of rosbridge send, as models, one for each value of `op`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AliasChoices,
    BaseModel,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from throwcollect.errors import ConfigError

_T = TypeVar("_T")
Compression = Literal["none", "cbor", "cbor-raw"]
"""``none`` is JSON. If the subscriptions of a client to a topic differ, the one that comes last here is used."""
COMPRESSIONS: tuple[Compression, ...] = get_args(Compression)
Level = Literal["none", "error", "warning", "info"]
"""Status messages that a client wants; each level includes those before it."""
LEVELS: tuple[Level, ...] = get_args(Level)
RequestId = str | int | None
"""The id that a client has given an operation; None if it has given none."""
MAY_READ = frozenset(("subscribe", "unsubscribe", "call_service", "fragment", "set_level"))
"""Operations that clients may use that may only look; a call is decided on by its service."""
Natural = Annotated[int, Field(ge=0, lt=1 << 53)]
"""A number from 0 on that JavaScript can represent."""
_OFFER_NAME = AliasChoices("service", "action")


class Operation(BaseModel):
    """One operation of a client; fields that are null count as left out."""

    id: RequestId = None

    @model_validator(mode="before")
    @classmethod
    def _drop_nulls(cls, fields: Any) -> Any:
        return {name: value for name, value in fields.items() if value is not None}


class Subscribe(Operation):
    """Subscribe to a topic, with at least ``throttle_rate`` [ms] between two messages.

    Meanwhile ``queue_length`` messages wait; text frames are cut into parts of ``fragment_size`` characters, unless it
    is 0.
    """

    op: Literal["subscribe"]
    topic: str
    type: str = ""
    throttle_rate: NonNegativeFloat = 0
    queue_length: Natural = 0
    fragment_size: Natural = 0
    compression: Compression = "none"


class Withdraw(Operation):
    """Withdraw a topic, or end one subscription to it, or all if no id is given."""

    op: Literal["unsubscribe", "unadvertise"]
    topic: str


class Publish(Operation):
    """Announce a topic, or publish a message; a topic that others have is announced first."""

    op: Literal["advertise", "publish"]
    topic: str
    type: str = ""
    msg: Any = None
    latch: bool = False
    queue_size: Natural = 0


class CallService(Operation):
    """Call a service, and wait for at most ``timeout`` [s]."""

    op: Literal["call_service"]
    name: str = Field(alias="service")
    type: str = ""
    args: Any = None
    timeout: PositiveFloat = math.inf
    compression: Compression = "none"


class SendGoal(Operation):
    """Send a goal to an action."""

    op: Literal["send_action_goal"]
    name: str = Field(alias="action")
    action_type: str
    args: Any = None
    feedback: bool = False
    compression: Compression = "none"


class CancelGoal(Operation):
    """Ask an action to cancel the goal with this id."""

    op: Literal["cancel_action_goal"]


class Offer(Operation):
    """Offer a service or an action, or withdraw it."""

    op: Literal["advertise_service", "unadvertise_service", "advertise_action", "unadvertise_action"]
    name: str = Field(validation_alias=_OFFER_NAME)
    type: str = ""


class Answer(Operation):
    """What a client answers to a request or a goal of a node; without a status, a result has succeeded."""

    op: Literal["service_response", "action_feedback", "action_result", "action_status"]
    name: str = Field(validation_alias=_OFFER_NAME)
    values: Any = None
    result: bool = True
    status: int | None = None


class Fragment(Operation):
    """One part of a frame."""

    op: Literal["fragment"]
    id: str | int
    data: str
    num: Natural
    total: Natural

    @model_validator(mode="after")
    def _is_one_of_all(self) -> Fragment:
        if self.num >= self.total:
            raise ValueError("num should be below total")
        return self


class SetLevel(Operation):
    """Choose which status messages the client gets."""

    op: Literal["set_level"]
    level: Level


AnyOperation = (
    Subscribe | Withdraw | Publish | CallService | SendGoal | CancelGoal | Offer | Answer | Fragment | SetLevel
)
_OPERATIONS: TypeAdapter[AnyOperation] = TypeAdapter(Annotated[AnyOperation, Field(discriminator="op")])


class Arguments(Operation):
    """Arguments of the services that the bridge answers; each service has some of them."""

    type: str = ""
    topic: str = ""
    service: str = ""
    node: str = ""
    name: str = ""
    value: str = ""
    default_value: str = ""


def read_operation(fields: Mapping[str, Any]) -> AnyOperation:
    """Read an operation from its fields."""
    return read_fields(_OPERATIONS.validate_python, fields)


def read_fields(read: Callable[[Any], _T], fields: Mapping[str, Any], where: str = "") -> _T:
    """Read fields by a function of pydantic; errors name each field that is wrong, after `where`."""
    try:
        return read(fields)
    except ValidationError as error:
        wrong = [f"{where}{'.'.join(map(str, each['loc'])) or 'frame'}: {each['msg']}" for each in error.errors()]
        raise ConfigError("; ".join(wrong)) from error
