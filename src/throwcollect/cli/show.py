"""`throwcollect config`, `plan` and `doctor`: what would be done, and where."""

from __future__ import annotations

import json as jsonlib
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import (
    ConfigArgument,
    JsonOption,
    SetOption,
    TrialsOption,
    overrides,
)
from throwcollect.cli.streams import end_with_reader
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.side_by_side import count_cores
from throwcollect.wording import format_count


def config(
    path: ConfigArgument = DEFAULT_CONFIG,
    settings: SetOption = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema instead.")] = False,
    json: JsonOption = False,
) -> None:
    """Print the resolved configuration."""
    from throwcollect.config.loader import dump_yaml, load
    from throwcollect.config.reference import json_schema

    if schema:
        typer.echo(jsonlib.dumps(json_schema(), indent=2))
        return
    found = load(path, overrides(settings))
    typer.echo(found.model_dump_json(indent=2) if json else dump_yaml(found), nl=json)


def plan(
    path: ConfigArgument = DEFAULT_CONFIG,
    settings: SetOption = None,
    trials: TrialsOption = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", metavar="DIR", help="Freeze the plan in DIR, for `up --slice`, instead of printing it."
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Print the trials without running them."""
    from throwcollect.config.loader import load_locating_errors
    from throwcollect.coordinator.prepare import draw_plan, more_trials, prepare

    end_with_reader()
    with load_locating_errors(path, overrides(settings, trials=trials)) as config:
        if output is None:
            found = draw_plan(config, directory=path.parent, processes=count_cores(), say=partial(typer.echo, err=True))
        else:
            found = prepare(
                config, output, sweep_directory=path.parent, processes=count_cores(), say=partial(typer.echo, err=True)
            )
    if json:
        rows = [
            {
                "trial": trial.number,
                "values": dict(trial.values),
                "seed": trial.seed,
                "digest": trial.digest,
                "refused": trial.refused,
                **({"target": dict(trial.target)} if found.trials.target_names else {}),
            }
            for trial in found.trials
        ]
        typer.echo(jsonlib.dumps(rows, indent=2))
        return
    names = (*found.keys, *found.trials.target_names)
    columns = ["trial", *names]
    shown = found.trials if output is None else ()
    if shown:
        typer.echo("  ".join(columns))
    for trial in shown:
        numbers = [_show(name, {**trial.values, **trial.target}.get(name)) for name in names]
        note = f"  refused: {trial.refused}" if trial.refused else ""
        typer.echo("  ".join([str(trial.number).rjust(len("trial")), *numbers]) + note)
    planned, refused = format_count(len(found.trials), "trial"), len(found.trials.refused)
    typer.echo(f"{planned}, {refused} refused{more_trials(found)}", err=True)


def _show(name: str, value: float | None) -> str:
    return ("-" if value is None else f"{value:.6g}").rjust(len(name))


def doctor(json: JsonOption = False) -> None:
    """Check what this machine can do."""
    from throwcollect.runs.doctor import examine

    checks = examine(Path.cwd())
    if json:
        typer.echo(jsonlib.dumps([vars(check) for check in checks], indent=2))
    else:
        width = max(len(check.name) for check in checks)
        for check in checks:
            typer.echo(f"{check.status:8}{check.name:{width}}  {check.finding}")
    if any(check.status == "problem" for check in checks):
        raise typer.Exit(1)
