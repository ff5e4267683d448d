"""Writes a dataset in another format."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.carried_robot import carry_robot
from throwcollect.dataset.directory import CARD, CONFIG, TRIALS
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import refuse_argument
from throwcollect.extras import require
from throwcollect.files import StrPath, new_directory, write_file
from throwcollect.members import explain_failure, load_member, names_of
from throwcollect.plan.point_file import encode_points
from throwcollect.publish.export.exporter import Exporter, render_card
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource, choose_streams
from throwcollect.wording import suggest


@dataclass(frozen=True)
class Exported:
    """An export that was written, with the size of all its files and the digest of the dataset that it was made of.

    Each trial has a row of the table, and each episode time series with samples.
    """

    directory: str
    format: str
    trials: int
    episodes: int
    samples: int
    rate_hz: int
    size_bytes: int
    digest: str


def export(
    directory: StrPath, output: StrPath, *, to: str, rate_hz: int | None = None, images: str | None = None
) -> Exported:
    """Write a dataset in another format, with a data card and its configuration, at the recorded rate or a lower one.

    The format is ``parquet``, ``npz``, ``lerobot``, ``hdf5``, ``mat``, or one of another package. The directory to
    write must be new or empty, and nothing is left there on failure.

    What sensors saw is stored as `images` states: as ``av1``, ``h264``, ``png`` or, with depths, ``depth`` in
    ``lerobot``, as ``arrays`` in ``hdf5`` and ``npz``, or not at all (``none``, which is usual but in ``lerobot`` and
    ``hdf5``). Each sample then has a frame of each sensor, so that the rate is that of the sensors.

    Raises:
        ConfigError: If there is no such format, it has no such images, the rate does not divide the recorded one and
            those of all sensors, or `output` exists.
        MissingExtraError: If a library that the format needs is not installed.
        DatasetError: If the dataset is unfinished, damaged or without episodes, or `output` cannot be written.
        MemberError: If the format is of another package and fails.
    """
    formats = names_of("exporters")
    if to not in formats:
        raise refuse_argument("to", f"unknown format {to!r}{suggest(to, formats)}")
    chosen: Exporter = load_member("exporters", to)
    require(*chosen.packages)
    directory, output = Path(directory), Path(output)
    way = next(iter(chosen.images)) if images is None else images
    if way not in chosen.images:
        raise refuse_argument("images", f"{to} has no {way!r}", expected=" or ".join(chosen.images))
    dataset = Dataset.open(directory)
    streams = choose_streams(dataset.config, chosen.images[way])
    source = ExportSource(dataset, streams, rate_hz=rate_hz, images=way)
    if images not in (None, NO_IMAGES) and not source.streams:
        raise refuse_argument("images", f"{directory} has no sensors that {to} has images of", expected=NO_IMAGES)
    with new_directory(output) as scratch:
        with explain_failure("exporters", to, f"write {output}", passing=(OSError,)):
            chosen.write(source, scratch)
            card = render_card(source, chosen.describe(source))
        shutil.copyfile(directory / CONFIG, scratch / CONFIG)
        carry_robot(source.dataset.config, scratch)
        if source.dataset.config.sweep.file is not None:
            write_file(scratch / TRIALS, encode_points(source.dataset.plan.trials.points))
        (scratch / CARD).write_text(card, encoding="utf-8")
        size = sum(path.stat().st_size for path in scratch.rglob("*") if path.is_file())
    return Exported(
        directory=str(output),
        format=to,
        trials=len(source.table),
        episodes=len(source.throws),
        samples=sum(map(source.count_samples, source.throws)),
        rate_hz=source.rate_hz,
        size_bytes=size,
        digest=source.dataset.digest,
    )
