"""`throwcollect dataset`: the commands that look into datasets, and make others of them."""

from __future__ import annotations

from collections.abc import Callable

import typer

from throwcollect.cli.dataset import derive, export, info, render, repair, replay, report, verify, view

dataset_app = typer.Typer(help="Look into datasets, and make others of them.", no_args_is_help=True)

_COMMANDS: dict[str, Callable[..., None]] = {
    "info": info.show_info,
    "verify": verify.verify_dataset,
    "rebuild": repair.rebuild_dataset,
    "repair": repair.repair_dataset,
    "digest": info.show_digest,
    "export": export.export_dataset,
    "merge": derive.merge_datasets,
    "filter": derive.filter_dataset,
    "sample": derive.sample_dataset,
    "split": derive.split_dataset,
    "stats": derive.show_statistics,
    "report": report.report_dataset,
    "view": view.view_dataset,
    "render": render.render_dataset,
    "replay": replay.replay_dataset,
}
for name, command in _COMMANDS.items():
    dataset_app.command(name)(command)
