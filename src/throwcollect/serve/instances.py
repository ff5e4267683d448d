"""Instances of components: runs that clients begin, stop and scale."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

from throwcollect.errors import ConfigError, ConflictError, NotFoundError, Problem
from throwcollect.robots.appearance import check_appearance
from throwcollect.runs import control
from throwcollect.runs.background import begin_run
from throwcollect.runs.record import Origin
from throwcollect.runs.records import Records, Run
from throwcollect.runs.selection import require_living
from throwcollect.serve.catalogue import NAME, Catalogue
from throwcollect.serve.robot_files import description_of
from throwcollect.serve.state import simulations_of

_KEPT = ("run", "containers", "cluster")
"""Sections of a configuration that are the operator's alone."""


@dataclass(frozen=True)
class Instances:
    """All runs of this machine, and what can be done with them; nothing of it is kept here.

    Attributes:
        catalogue: What there may be instances of.
        datasets: Directory in which the datasets of instances are made, each in one of its id.
    """

    catalogue: Catalogue
    datasets: Path

    def get(self, instance: str) -> Run:
        """The run of an id.

        Raises:
            NotFoundError: If there is none.
            ConfigError: If its record cannot be read.
        """
        _check_id(instance)
        return Records().get(instance)

    def put(self, instance: str, origin: Origin) -> tuple[Run, bool]:
        """Begin an instance, unless it has been begun by the same request already.

        Args:
            instance: Its id.
            origin: What is asked for.

        Returns:
            The run, and whether it is new.

        Raises:
            NotFoundError: If there is no such component.
            ConflictError: If there is another run of that id, or as many instances as there may be.
            ConfigError: If the configuration cannot be used.
            WorkerError: If it cannot be begun.
        """
        component = self.catalogue.get(origin.component)
        _check_id(instance)
        overrides = _overrides(origin)
        try:
            found = Records().get(instance)
        except NotFoundError:
            pass
        else:
            if found.record.origin == origin:
                return found, False
            raise ConflictError(f"there is an instance {instance} already, of another request")
        living = [run for run in Records().all() if _is_instance(run, component.name) and run.status == "running"]
        if len(living) >= component.max_instances:
            raise ConflictError(
                f"component {component.name}: {len(living)} instances live, as many as max_instances allows",
                hint=f"stop one of {', '.join(run.id for run in living)}",
            )
        run = begin_run(
            component.config,
            overrides=overrides,
            output=self.datasets / instance,
            run=instance,
            origin=origin,
            kind=component.kind,
        )
        return run, True

    def stop(self, instance: str, *, force: bool = False) -> None:
        """Have an instance drain and end, without waiting for that; by force, at once, and forget it.

        Raises:
            NotFoundError: If there is no such run.
            ConflictError: If it has ended.
            WorkerError: If its launcher died, or something cannot be ended.
        """
        run = self.get(instance)
        if force:
            control.down(run)
        else:
            control.stop(run, keep_on=lambda: False)

    def scale(self, instance: str, simulations: int) -> Run:
        """Ask an instance for another number of simulations.

        Raises:
            NotFoundError: If there is no such run.
            ConflictError: If it has ended.
            ConfigError: If it cannot be scaled.
            WorkerError: If its launcher died, or does not answer.
        """
        run = self.get(instance)
        control.scale(run, simulations)
        return run.now()

    def show(self, instance: str, urdf: str | None) -> None:
        """Have viewers of all simulations of an instance draw another description, or that of its configuration again.

        Args:
            instance: Its id.
            urdf: URDF text, which may differ in what is seen; None for that of the configuration.

        Raises:
            NotFoundError: If there is no such run.
            ConflictError: If it has ended or has no simulation that runs, or more than what is seen differs.
            ConfigError: If it is no URDF.
            WorkerError: If a simulation does not answer.
        """
        run = self.get(instance)
        own = description_of(run)
        if urdf is not None:
            check_appearance(own, urdf)
        record = require_living(run)
        nodes = [f"/{name}/{name}" for name in simulations_of(record)]
        if not nodes:
            raise ConflictError(f"run {run.id}: no simulation runs")
        for result in control.set_parameter(run, nodes, "robot_description", urdf or own):
            if not result.successful:
                raise ConflictError(f"run {run.id}: {result.reason}")


def _is_instance(run: Run, component: str) -> bool:
    return run.record.origin is not None and run.record.origin.component == component


def _check_id(instance: str) -> None:
    """Refuse ids that no run can have, as they name files.

    Raises:
        NotFoundError: If it is none.
    """
    if not re.fullmatch(rf"(?!\.)[A-Za-z0-9_.-]{{1,80}}|{NAME}", instance):
        raise NotFoundError(f"no run {instance!r}", expected="at most 80 of letters, digits, -, _ and .")


def _overrides(origin: Origin) -> list[str]:
    """What replaces keys of the component's configuration, as ``--set`` takes it.

    Raises:
        ConfigError: If a key is the operator's alone.
    """
    problems = [
        Problem("is the operator's alone; a request may not set it", key=key)
        for key in origin.changes
        if key.split(".")[0] in _KEPT
    ]
    if problems:
        raise ConfigError(problems)
    overrides = [f"{key}={json.dumps(value)}" for key, value in origin.changes.items()]
    if origin.simulations is not None:
        overrides.append(f"run.simulations={origin.simulations}")
    return overrides
