"""`throwcollect config`, `plan` and `doctor`: what would be done, and where."""

from __future__ import annotations

import json as jsonlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import typer

from throwcollect.config.loader import load, loaded, resolved_yaml
from throwcollect.config.reference import json_schema
from throwcollect.wording import counted


def show_schema() -> None:
    """Print the JSON Schema of the configuration."""
    typer.echo(jsonlib.dumps(json_schema(), indent=2))


def show_config(path: Path, overrides: Sequence[str], *, json: bool) -> None:
    """Print the resolved configuration.

    Raises:
        ConfigError: If the configuration cannot be used.
    """
    config = load(path, overrides)
    typer.echo(config.model_dump_json(indent=2) if json else resolved_yaml(config), nl=json)


def show_plan(path: Path, overrides: Sequence[str], *, json: bool) -> None:
    """Print the trials that would be run: of a plan that grows, those that are known before anything runs.

    Raises:
        ConfigError: If the configuration cannot be used, or the sweep yields no trial that could be run.
    """
    from throwcollect.coordinator.prepare import checked_plan, more_trials

    with loaded(path, overrides) as config:
        plan = checked_plan(config, directory=path.parent)
    if json:
        rows = [
            {
                "trial": trial.number,
                "values": dict(trial.values),
                "seed": trial.seed,
                "digest": trial.digest,
                "refused": trial.refused,
            }
            for trial in plan.trials
        ]
        typer.echo(jsonlib.dumps(rows, indent=2))
        return
    columns = ["trial", *plan.keys]
    typer.echo("  ".join(columns))
    for trial in plan.trials:
        numbers = [f"{trial.values[key]:.6g}".rjust(len(key)) for key in plan.keys]
        note = f"  refused: {trial.refused}" if trial.refused else ""
        typer.echo("  ".join([str(trial.number).rjust(len("trial")), *numbers]) + note)
    refused = Counter(trial.refused for trial in plan.trials if trial.refused)
    typer.echo(f"{counted(len(plan.trials), 'trial')}, {refused.total()} refused{more_trials(plan)}", err=True)


def show_doctor(*, json: bool) -> None:
    """Print what this machine can do.

    Raises:
        typer.Exit: With code 1 when collections would not run here.
    """
    from throwcollect.runtime.doctor import examine

    checks = examine(Path.cwd())
    if json:
        typer.echo(jsonlib.dumps([vars(check) for check in checks], indent=2))
    else:
        width = max(len(check.name) for check in checks)
        for check in checks:
            typer.echo(f"{check.status:8}{check.name:{width}}  {check.finding}")
    if any(check.status == "problem" for check in checks):
        raise typer.Exit(1)
