"""`throwcollect dataset`: the group of the commands for datasets."""

from __future__ import annotations

import typer

from throwcollect.cli.dataset import derive, info, replay, writing

dataset_app = typer.Typer(help="Look into datasets, and make others from them.", no_args_is_help=True)
dataset_app.command("info")(info.show_info)
dataset_app.command("verify")(info.verify_dataset)
dataset_app.command("digest")(info.show_digest)
dataset_app.command("export")(writing.export_dataset)
dataset_app.command("merge")(derive.merge_datasets)
dataset_app.command("filter")(derive.filter_dataset)
dataset_app.command("sample")(derive.sample_dataset)
dataset_app.command("split")(derive.split_dataset)
dataset_app.command("stats")(derive.show_statistics)
dataset_app.command("report")(writing.report_dataset)
dataset_app.command("view")(writing.view_dataset)
dataset_app.command("render")(writing.render_dataset)
dataset_app.command("replay")(replay.replay_dataset)
