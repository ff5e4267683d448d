"""Runs that are one container of the operator's catalogue, which may join another run."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from throwcollect.config.containers import ContainerSpec
from throwcollect.errors import ConfigError, ConflictError, Interrupted
from throwcollect.extras import explain_missing
from throwcollect.runs.onlooker import Onlooker
from throwcollect.runs.records import OpenRun, Records, Run
from throwcollect.runs.selection import require_living
from throwcollect.runtimes.runtime import Host, Place

if TYPE_CHECKING:
    from throwcollect.runtimes.docker.component import Way

DESCRIPTION = "robot.urdf"
"""Description of the robot that viewers are told, in the directory of the run."""
_POLL_S = 0.2
_ANSWER_S = 5.0
"""Whoever asks for a container waits for the engine as long."""


@dataclass(frozen=True)
class ContainerOrder:
    """What a container is to be made from.

    Attributes:
        component: Name of its component.
        spec: What the catalogue says.
        joins: Id of the run that it joins; None if it joins none.
    """

    component: str
    spec: ContainerSpec
    joins: str | None = None


CONTAINER_ORDERS = TypeAdapter(ContainerOrder)


def check_order(order: ContainerOrder) -> None:
    """Refuse what can be seen to fail at once.

    Raises:
        NotFoundError: If there is no such run as it is to join.
        ConflictError: If that has ended, or has no router to join.
        ConfigError: If a mount or a network is not there or must not be used, or it cannot join that run.
        WorkerError: If no engine answers, or it does not have the image.
        MissingExtraError: If the client of the engine is not installed.
    """
    with explain_missing():
        from throwcollect.runtimes.docker.checks import check_container
        from throwcollect.runtimes.docker.engine import connect
    if order.joins is not None:
        _find_way(Records().get(order.joins), order.spec)
    with closing(connect(timeout_s=_ANSWER_S)) as client:
        check_container(client, order.spec, order.component)


def launch_container(
    run: OpenRun, order: ContainerOrder, *, onlooker: Onlooker, interruptions: Callable[[], int]
) -> None:
    """Run the container until it ends, the run that it joins does, or somebody asks for it.

    Args:
        run: The run, with a record; its end is written there, and the run is let go of.
        order: What it is to be made from.
        onlooker: Is told what goes on.
        interruptions: How often somebody has asked to stop.

    Raises:
        ConfigError: If something is not there that the catalogue asks for, or it cannot join that run.
        ConflictError: If the run that it is to join has ended.
        WorkerError: If the engine or the container fails.
        Interrupted: If somebody asked to stop before there was a container.
    """
    # Whoever asks for a container needs none of it.
    from throwcollect.runs.launcher import launch_host

    def host(place: Place) -> Host:
        from throwcollect.runtimes.docker.component import ComponentContainer

        way = None if order.joins is None else _wait_for_way(order.joins, order.spec, interruptions)
        goes_on = lambda: order.joins is not None and _goes_on(order.joins)  # noqa: E731
        return ComponentContainer(place, order.component, order.spec, way, goes_on=goes_on, warn=onlooker.warn)

    launch_host(run, host, onlooker=onlooker, interruptions=interruptions)


def _goes_on(run: str) -> bool:
    try:
        return Records().get(run).status == "running"
    except ConfigError:
        return False


def _wait_for_way(run: str, spec: ContainerSpec, interruptions: Callable[[], int]) -> Way:
    """The way into a run, which may just be starting.

    Raises:
        ConfigError: If a container cannot join it.
        ConflictError: If it has ended, or has no router to join.
        WorkerError: If its launcher died.
        Interrupted: If somebody asked to stop.
    """
    while (way := _find_way(Records().get(run), spec)) is None:
        if interruptions():
            raise Interrupted("stopped before the container was started")
        time.sleep(_POLL_S)
    return way


def _find_way(run: Run, spec: ContainerSpec) -> Way | None:
    """The way into a run; None while it has no router yet.

    Raises:
        ConfigError: If a container cannot join it.
        ConflictError: If it has ended, or has no router to join.
        WorkerError: If its launcher died.
    """
    from throwcollect.runtimes.docker.component import find_way
    from throwcollect.runtimes.registry import get_runtime

    record = require_living(run)
    if record.kind == "container" or (record.runtime and not get_runtime(record.runtime).can_be_scaled):
        raise ConflictError(f"run {run.id}: has no router that a container could join")
    if not record.runtime or run.connection is None:
        return None
    return find_way(run.id, record.runtime, run.connection, spec)
