"""Runs that consist of one container of the operator's catalogue, which may join another run."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING, cast

from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.collect.runs.launcher import launch_host
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import require_living
from throwcollect.collect.runtimes.nodes import NodeHost
from throwcollect.collect.runtimes.run_record import Origin, RunRecord
from throwcollect.collect.runtimes.runtime import get_runtime
from throwcollect.config.run import ContainerSpec
from throwcollect.errors import ConfigError, ConflictError, Interrupted
from throwcollect.extras import explain_missing

if TYPE_CHECKING:
    from throwcollect.collect.runtimes.docker.component import JoinOptions

DESCRIPTION = "robot.urdf"
"""File in the directory of the run that describes the robot for viewers."""
_POLL_S = 0.2
_ANSWER_S = 5.0
"""A client that asks for a container waits this long for the engine."""


def check_request(spec: ContainerSpec, origin: Origin) -> None:
    """Refuse a request for a container of the catalogue that would fail at once."""
    with explain_missing():
        from throwcollect.collect.runtimes.docker.checks import check_container
        from throwcollect.collect.runtimes.docker.docker_engine import connect
    if origin.joins is not None:
        _find_join_options(Records().get(origin.joins), spec)
    with closing(connect(timeout_s=_ANSWER_S)) as client:
        check_container(client, spec, origin.component)


def launch_container(run: Run, spec: ContainerSpec, *, reporter: Reporter, interruptions: Callable[[], int]) -> None:
    """Run the container until it ends, the run that it joins ends, or the user asks to stop; close the run."""
    origin = cast(Origin, run.record.origin)

    def host(record: RunRecord) -> NodeHost:
        from throwcollect.collect.runtimes.docker.component import ComponentContainer

        joining = None if origin.joins is None else _wait_for_router(origin.joins, spec, interruptions)
        return ComponentContainer(record, origin.component, spec, joining, is_running=_is_running, warn=reporter.warn)

    launch_host(run, host, reporter=reporter, interruptions=interruptions)


def _is_running(run: str) -> bool:
    try:
        return Records().get(run).status == "running"
    except ConfigError:
        return False


def _wait_for_router(run: str, spec: ContainerSpec, interruptions: Callable[[], int]) -> JoinOptions:
    """Wait until a container can join a run, which may just be starting, and return the options for that."""
    while (joining := _find_join_options(Records().get(run), spec)) is None:
        if interruptions():
            raise Interrupted("stopped before the container was started")
        time.sleep(_POLL_S)
    return joining


def _find_join_options(run: Run, spec: ContainerSpec) -> JoinOptions | None:
    """Find the options with which a container joins a run; None while the run has no router yet."""
    from throwcollect.collect.runtimes.docker.component import find_join_options

    record = require_living(run)
    if record.kind == "container" or (record.runtime and not get_runtime(record.runtime).can_be_scaled):
        raise ConflictError(f"run {run.id}: has no router that a container could join")
    if not record.runtime or run.connection is None:
        return None
    return find_join_options(run.id, record.runtime, run.connection, spec)
