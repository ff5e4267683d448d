"""`throwcollect dataset export`, `report`, `view` and `render`: files for other programs and people."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.cli.printing import show
from throwcollect.errors import ConfigError
from throwcollect.wording import format_count


def export(
    directory: DatasetArgument,
    output: OutputArgument,
    *,
    to: str,
    rate: int | None = None,
    images: str | None = None,
    json: JsonOption = False,
) -> None:
    """Write a dataset in another format, with a data card.

    Options:
        to (FORMAT): parquet, npz, lerobot, hdf5, mat, or one of another package.
        rate (HZ): Samples per second; as recorded, or as sensors have frames, if not given.
        images (WAY): How to store what sensors saw: av1, h264, png or depth (lerobot), arrays (hdf5, npz), or none.
    """
    from throwcollect.publish.export.export import export as export_dataset

    exported = export_dataset(directory, output, to=to, rate_hz=rate, images=images)
    text = (
        f"{exported.directory}: {format_count(exported.episodes, 'throw')} "
        f"of {format_count(exported.trials, 'trial')}, "
        f"{format_count(exported.samples, 'sample')} at {exported.rate_hz} Hz, {exported.size_bytes / 1e6:.1f} MB"
    )
    show(exported, text, json=json)


def report(
    directory: DatasetArgument, *, output: Path | None = None, model: Path | None = None, json: JsonOption = False
) -> None:
    """Write a page that shows what a dataset holds.

    Options:
        output (--output -o FILE): HTML file to write; DIR.html next to the dataset if not given.
        model (MODEL): Also show a model of the dataset, and how it hits.
    """
    from throwcollect.publish.report.sections import write_report

    resolved = directory.resolve()
    page = output or resolved.with_name(f"{resolved.name}.html")
    write_report(directory, page, model=model)
    size = page.stat().st_size
    show({"page": page, "size_bytes": size}, f"{page}: {size / 1e6:.1f} MB", json=json)


def view(
    directory: DatasetArgument, output: OutputArgument, *, trials: str | None = None, json: JsonOption = False
) -> None:
    """Write throws with frames, meshes, markers and a layout, for Foxglove, Rerun and RViz.

    Options:
        trials (3,5,7-9): Trials to show; all if not given.
    """
    from throwcollect.publish.view.viewer_directory import view as write_view

    written = write_view(directory, output, None if trials is None else read_trials(trials))
    text = (
        f"{written.recording}: {format_count(written.throws, 'throw')}, {written.duration_s:.0f} s; "
        f"with meshes {written.size_bytes / 1e6:.1f} MB\n"
        f"Foxglove  open {written.recording.name}, then import the layout {written.layout}\n"
        f"Rerun     ROS_PACKAGE_PATH={shlex.quote(str(output.absolute()))} "
        f"rerun {shlex.quote(str(written.recording))}"
    )
    show(written, text, json=json)


def read_trials(text: str) -> list[int]:
    """Read numbers of trials such as ``3,5,7-9``, in their order."""
    chosen: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]{1,7})\s*(?:-\s*([0-9]{1,7})\s*)?", part)
        numbers = range(int(match[1]), int(match[2] or match[1]) + 1) if match else ()
        if not numbers:
            raise ConfigError(f"--trials: got {part!r}", expected="numbers and ranges such as 3,5,7-9")
        chosen += numbers
    return list(dict.fromkeys(chosen))


def render(
    directory: DatasetArgument,
    *,
    output: Path,
    trials: str | None = None,
    camera: str | None = None,
    size: str | None = None,
    slow: float = 1.0,
    json: JsonOption = False,
) -> None:
    """Draw throws as an animated picture, a video or a picture, from what was recorded.

    Options:
        output (-o --output FILE): File to write: .webp, .gif, .mp4 or .png.
        trials (3,5,7-9): Trials to show side by side; the first recorded one if not given.
        camera (NAME): Camera of the configuration that sees them; a place to their right if not given.
        size (WIDTHxHEIGHT): Size of the picture of a throw in pixels.
        slow (FACTOR 0.5..20): How many times slower than it was.
    """
    from throwcollect.publish.view.animation import render as render_throws

    pixels = None
    if size is not None:
        match = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", size)
        pixels = (int(match[1]), int(match[2])) if match else (0, 0)
        if min(pixels) < 8:
            raise ConfigError(f"--size: got {size!r}", expected="pixels such as 640x400, each from 8 to 9999")
    chosen = None if trials is None else read_trials(trials)
    written = render_throws(directory, output, trials=chosen, camera=camera, size=pixels, slow=slow)
    text = (
        f"{written.file}: {format_count(len(written.trials), 'throw')}, {format_count(written.pictures, 'picture')}, "
        f"{written.duration_s:.1f} s, {written.size_bytes / 1e6:.2f} MB"
    )
    show(written, text, json=json)
