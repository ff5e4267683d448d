"""Commands that look into datasets and make others of them; the work is done elsewhere, and imported when called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

dataset_app = typer.Typer(help="Look into datasets, and make others of them.", no_args_is_help=True)

DatasetArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the dataset.", readable=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@dataset_app.command("info")
def dataset_info(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Say what a dataset holds."""
    from throwcollect.cli.dataset.info import show_info

    show_info(directory, json=json)


@dataset_app.command("verify")
def dataset_verify(
    directory: DatasetArgument,
    replay: Annotated[
        int | None,
        typer.Option("--replay", metavar="N", min=1, help="Also simulate N throws again, chosen by the seed."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Check a dataset against itself and against physics; exit code 4 if anything is wrong."""
    from throwcollect.cli.dataset.verify import show_verification

    show_verification(directory, replay=replay, json=json)


@dataset_app.command("rebuild")
def dataset_rebuild(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Write throws.parquet, datapackage.json and metadata.yaml anew, from the recordings."""
    from throwcollect.cli.dataset.repair import show_rebuilt

    show_rebuilt(directory, json=json)


@dataset_app.command("repair")
def dataset_repair(
    directory: DatasetArgument,
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Directory to write; must be new or empty.")],
    json: JsonOption = False,
) -> None:
    """Write a sound dataset with all that is whole in a damaged one; exit code 3 if trials are lost."""
    from throwcollect.cli.dataset.repair import show_repaired

    show_repaired(directory, output, json=json)


@dataset_app.command("digest")
def dataset_digest(directory: DatasetArgument) -> None:
    """Print one hash over all episodes in trial order."""
    from throwcollect.cli.dataset.info import show_digest

    show_digest(directory)


@dataset_app.command("export")
def dataset_export(
    directory: DatasetArgument,
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Directory to write; must be new or empty.")],
    to: Annotated[str, typer.Option("--to", metavar="parquet|npz|lerobot|hdf5|mat", help="Format.")],
    rate: Annotated[
        int | None, typer.Option("--rate", metavar="HZ", help="Samples per second; as recorded if not given.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write a dataset in another format, with a data card."""
    from throwcollect.cli.dataset.export import export_dataset

    export_dataset(directory, output, to=to, rate_hz=rate, json=json)


OutputArgument = Annotated[Path, typer.Argument(metavar="OUTPUT", help="Directory to write; must be new or empty.")]
SeedOption = Annotated[int, typer.Option("--seed", metavar="S", min=0, help="Seed of the choice.")]


@dataset_app.command("merge")
def dataset_merge(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Directories of the datasets.")],
    output: OutputArgument,
    json: JsonOption = False,
) -> None:
    """Put the trials of several datasets one after the other."""
    from throwcollect.cli.dataset.derive import show_merged

    show_merged(directories, output, json=json)


@dataset_app.command("filter")
def dataset_filter(
    directory: DatasetArgument,
    output: OutputArgument,
    where: Annotated[str, typer.Option("--where", metavar="CONDITION", help="Such as: landing_x_m > 1.5")],
    json: JsonOption = False,
) -> None:
    """Take the trials that fulfil a condition on columns of throws.parquet."""
    from throwcollect.cli.dataset.derive import show_filtered

    show_filtered(directory, output, where=where, json=json)


@dataset_app.command("sample")
def dataset_sample(
    directory: DatasetArgument,
    output: OutputArgument,
    count: Annotated[int, typer.Option("--count", metavar="K", help="Number of trials.")],
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> None:
    """Take trials at random; they stay in their order."""
    from throwcollect.cli.dataset.derive import show_sample

    show_sample(directory, output, count=count, seed=seed, json=json)


@dataset_app.command("split")
def dataset_split(
    directory: DatasetArgument,
    output: OutputArgument,
    fractions: Annotated[
        str, typer.Option("--fractions", metavar="NAME=SHARE,...", help="Such as: train=0.8,test=0.2")
    ],
    cells: Annotated[
        list[str] | None,
        typer.Option("--cells", metavar="EXPRESSION=WIDTH", help="Axis of cells that are not torn apart; repeatable."),
    ] = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> None:
    """Split a dataset so that throws to the same place, by default a square of 5 cm, go to the same part."""
    from throwcollect.cli.dataset.derive import show_split

    show_split(directory, output, fractions=fractions, cells=cells, seed=seed, json=json)


@dataset_app.command("stats")
def dataset_stats(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Print statistics of the table of throws and of all trajectories."""
    from throwcollect.cli.dataset.derive import show_statistics

    show_statistics(directory, json=json)


@dataset_app.command("report")
def dataset_report(
    directory: DatasetArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", metavar="FILE", help="HTML file to write; DIR.html beside the dataset if not given."),
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option("--png", metavar="DIR", help="Also write the main plots as pictures; must be new or empty."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write a page that shows what a dataset holds, and pictures for papers."""
    from throwcollect.cli.dataset.report import report_dataset

    report_dataset(directory, output, pictures=png, json=json)


@dataset_app.command("view")
def dataset_view(
    directory: DatasetArgument,
    output: OutputArgument,
    trials: Annotated[
        str | None, typer.Option("--trials", metavar="3,5,7-9", help="Trials to show; all if not given.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write throws with frames, meshes, markers and a layout, for Foxglove, Rerun and RViz."""
    from throwcollect.cli.dataset.view import write_view

    write_view(directory, output, trials=trials, json=json)


@dataset_app.command("replay")
def dataset_replay(
    directory: DatasetArgument,
    trials: Annotated[
        list[int] | None, typer.Option("--trial", metavar="K", help="Number of a trial; may be repeated.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All trials.")] = False,
    sample: Annotated[
        int | None, typer.Option("--sample", metavar="N", min=1, help="With --all: so many of them, chosen at random.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Simulate stored throws again and compare them bit for bit; exit code 4 if any differs."""
    from throwcollect.cli.dataset.replay import show_replay

    show_replay(directory, trials or [], everything=everything, sample=sample, json=json)
