"""`throwcollect scale`, `stop` and `down`: runs changed and ended from any terminal."""

from __future__ import annotations

import typer

from throwcollect.cli.interruptions import Interruptions
from throwcollect.errors import Interrupted
from throwcollect.runtime.control import down, stop
from throwcollect.runtime.records import Records
from throwcollect.runtime.runs import died, failure, living, to_change
from throwcollect.wording import counted


def change_scale(named: str | None, simulations: int) -> None:
    """Change the number of simulations of a run.

    Raises:
        ConfigError: If there is no such run, or it cannot have that number.
        WorkerError: If its launcher does not answer.
    """
    run = to_change(Records(), named, command=f"scale {simulations}")
    run.record.middleware.joining.settle()
    from throwcollect.runtime.scaling import scale

    scale(run, simulations)
    typer.echo(f"{run.record.run}: {run.record.simulations} -> {counted(simulations, 'simulation')}")


def stop_run(named: str | None) -> None:
    """Drain a run, and wait until it has ended.

    Raises:
        ConfigError: If there is no such run, or it has ended.
        WorkerError: If it does not end, or failed on the way.
        DatasetError: If it failed on the way.
        Interrupted: If the user did not want to wait.
    """
    records = Records()
    run = to_change(records, named, command="stop")
    living(run)
    typer.echo(f"{run.record.run}: finishing the running trials", err=True)
    with Interruptions() as interruptions:
        run = stop(records, run, keep_on=lambda: not interruptions.count)
    record = run.record
    if run.status == "running":
        raise Interrupted(f"not waited for; run {record.run} is stopping all the same")
    error = died(record) if run.status == "died" else failure(record)
    if error is not None and not isinstance(error, Interrupted):
        raise error
    complete = "is complete" if error is None else "is not complete"
    typer.echo(f"{record.run}: stopped; the dataset {complete}: {record.dataset}")


def end_run(named: str | None, *, volumes: bool) -> None:
    """End everything of a run and forget it.

    Raises:
        ConfigError: If there is no such run.
        WorkerError: If something cannot be ended or removed.
    """
    run, removed = down(Records(), named, volumes=volumes)
    for name in removed:
        typer.echo(f"removed {name}", err=True)
    typer.echo(f"{run}: ended and forgotten")
