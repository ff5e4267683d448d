"""Instances of components: runs that clients begin, stop and scale."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from pydantic import JsonValue

from throwcollect.collect.runs import control
from throwcollect.collect.runs.background import begin_container, begin_run
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import refuse_busy, require_living, require_simulations
from throwcollect.collect.runtimes.run_record import Origin
from throwcollect.config.loader import load
from throwcollect.config.run import ContainerSpec
from throwcollect.config.values import list_operator_keys
from throwcollect.dataset.creation import refuse_taken
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConfigError, ConflictError, NotFoundError, Problem, WorkerError
from throwcollect.robots.appearance import check_appearance
from throwcollect.serve.catalogue import ENTRY, NAME, Catalogue, Component
from throwcollect.serve.live import name_node
from throwcollect.serve.robot_files import description_of
from throwcollect.serve.state import explain_refusal, simulations_of

_KEY = r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*"
_ONE_AT_A_TIME = threading.Lock()
"""Held while an instance is begun or stopped, so that several requests together do not begin one too many."""
_LONGEST_STOP_S = 2.0
"""Longest wait for a launcher to write into its record that it is stopping."""


@dataclass(frozen=True)
class Instances:
    """All runs of this machine, and what clients can do with them; records on disk are the only state.

    Attributes:
        catalogue: Components that clients may have instances of.
        datasets: Directory of the datasets of instances, each in a directory named by the id.
    """

    catalogue: Catalogue
    datasets: Path

    def get(self, instance: str) -> Run:
        """The run of an id."""
        # Ids become names of files, so they must not hold a slash, for example.
        if not re.fullmatch(ENTRY, instance):
            raise NotFoundError(f"no run {instance!r}", expected="at most 80 of letters, digits, -, _ and .")
        return Records().get(instance)

    def put(self, instance: str, origin: Origin) -> tuple[Run, bool]:
        """Begin an instance, unless the same request has begun it already; returns the run, and whether it is new."""
        component = self.catalogue.get(origin.component)
        if not re.fullmatch(NAME, instance):
            raise ConfigError(f"no instance can have the id {instance!r}", expected="at most 63 of a-z, 0-9, - and _")
        _check_request(origin, component)
        overrides = _write_overrides(origin)
        with _ONE_AT_A_TIME:
            with suppress(NotFoundError):
                run = self.get(instance)
                if run.record.origin == origin:
                    return run, False
                raise ConflictError(f"there is an instance {instance} already, of another request")
            _check_room(component)
            if isinstance(component.source, ContainerSpec):
                return begin_container(component.source, run=instance, origin=origin, urdf=component.urdf), True
            directory = self.datasets / instance
            if component.kind == "collection":
                # The run would refuse it, too, but only after the client got its answer.
                with _conflicts(hint="choose another id"):
                    refuse_taken(directory)
            run = begin_run(
                component.source,
                overrides=overrides,
                output=directory,
                run=instance,
                origin=origin,
                kind="session" if component.kind == "session" else "collection",
            )
        return run, True

    def resume(self, instance: str) -> Run:
        """Begin a new run, which continues the dataset of a run that has ended."""
        run = self.get(instance)
        origin = run.record.origin
        with _ONE_AT_A_TIME:
            if (reason := explain_refusal(run.now())) is not None:
                raise ConflictError(reason)
            refuse_busy(run.record.directory)
            if origin is not None and origin.component in self.catalogue.components:
                _check_room(self.catalogue.get(origin.component))
            config = config_path(run.record.directory)
            return begin_run(config, overrides=(), output=run.record.directory, origin=origin, resumed=True)

    def stop(self, instance: str, *, force: bool = False) -> None:
        """Ask an instance to finish its running trials and end; by force, end it at once, and forget it.

        Asking again does not hurry the instance. If its launcher died, this ends all nodes that are left, and
        forgets the instance.
        """
        run = self.get(instance)
        if force or run.status == "died":
            control.down(run)
            return
        with _ONE_AT_A_TIME:
            now = run.now()
            if not (now.lives and now.record.stopping):
                # A second signal would hurry the run, so this waits until its launcher has written that it is stopping.
                deadline = time.monotonic() + _LONGEST_STOP_S
                control.stop(now, keep_on=lambda: not run.now().record.stopping and time.monotonic() < deadline)

    def scale(self, instance: str, simulations: int) -> Run:
        """Ask an instance for another number of simulations."""
        run = self.get(instance)
        with _conflicts():
            require_living(run)
        control.scale(run, simulations)
        return run.now()

    def show(self, instance: str, urdf: str | None) -> None:
        """Set the description of the robot that viewers of an instance draw; None for that of the configuration."""
        run = self.get(instance)
        require_simulations(run)
        own = description_of(run)
        if urdf is not None:
            check_appearance(own, urdf)
        with _conflicts():
            record = require_living(run)
        config = load(config_path(run.record.directory))
        nodes = [name_node(config, name) for name in simulations_of(record.nodes)]
        if not nodes:
            raise ConflictError(f"run {run.id}: no simulation runs")
        for result in control.set_parameter(run, nodes, "robot_description", urdf or own):
            if not result.successful:
                raise ConflictError(f"run {run.id}: {result.reason}")


@contextmanager
def _conflicts(hint: str | None = None) -> Iterator[None]:
    """Turn errors into conflicts, because neither the request is wrong nor does the server fail."""
    try:
        yield
    except (ConfigError, WorkerError) as error:
        raise ConflictError(error.message, hint=hint or error.hint) from error


def _check_request(origin: Origin, component: Component) -> None:
    """Reject a request with fields that do not fit the kind of component."""
    given = {"joins": origin.joins, "simulations": origin.simulations, "set": origin.changes or None}
    fit = {"joins"} if component.kind == "container" else {"simulations", "set"}
    wrong = [key for key, value in given.items() if value is not None and key not in fit]
    if wrong:
        what = f"{component.name} is a {component.kind}, for which this cannot be set"
        raise ConfigError([Problem(what, key=key) for key in wrong])


def _check_room(component: Component) -> None:
    """Refuse one more instance if as many instances live as `max_instances` allows."""
    runs = (run for run in Records().all() if run.record.origin and run.record.origin.component == component.name)
    living = [run.id for run in runs if run.status == "running"]
    if len(living) >= component.max_instances:
        live = "1 instance lives" if len(living) == 1 else f"{len(living)} instances live"
        raise ConflictError(
            f"component {component.name}: {live}, as many as max_instances allows",
            hint=f"stop one of {', '.join(living)}",
        )


def _write_overrides(origin: Origin) -> list[str]:
    """Write the keys that a request sets as ``--set`` takes them."""
    kept = list_operator_keys()
    problems = [
        Problem("should be a dotted key, of letters, digits, - and _", key=key)
        for key in origin.changes
        if not re.fullmatch(_KEY, key)
    ] + [
        Problem("may be set only by the operator, not by a request", key=each)
        for key, value in origin.changes.items()
        for each in kept
        if any(_overlap(path, each.split(".")) for path in _list_paths(key.split("."), value))
    ]
    if problems:
        raise ConfigError(problems)
    overrides = [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in origin.changes.items()]
    if origin.simulations is not None:
        overrides.append(f"run.simulations={origin.simulations}")
    return overrides


def _list_paths(key: list[str], value: JsonValue) -> Iterator[list[str]]:
    """Paths of all keys that setting a key to a value sets."""
    if isinstance(value, dict) and value:
        for name, inner in value.items():
            yield from _list_paths([*key, *name.split(".")], inner)
    else:
        yield key


def _overlap(path: list[str], kept: list[str]) -> bool:
    """Whether two paths are the same, or one is above the other; ``*`` stands for any name."""
    return all(own in (other, "*") for own, other in zip(kept, path, strict=False))
