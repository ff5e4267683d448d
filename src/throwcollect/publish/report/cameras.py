"""The section of a report on what cameras saw: pictures of a few trials, from their start to their end."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from throwcollect.config.sensors import PictureConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.extras import lazily
from throwcollect.publish.report.contents import ReportSection, Table
from throwcollect.publish.report.measured import describe

images = lazily("PIL.Image")

_TRIALS, _FRAMES = 4, 6
_WIDTH_PX = 144
_PICTURE = Markup(
    '<img src="data:image/webp;base64,{}" alt="{}" style="display: block; width: {}px; border-radius: 4px">{:.2f} s'
)


def show_cameras(dataset: Dataset) -> Iterator[ReportSection]:
    """Show pictures of each camera that has colors or depths; nothing if there is none."""
    recorded, blocks = dataset.recorded, list[str | Table]()
    numbers = np.linspace(0, len(recorded) - 1, min(len(recorded), _TRIALS)).round().astype(int).tolist()
    throws = [recorded[number] for number in numbers]
    for name, section in dataset.config.sensors.items():
        if not isinstance(section, PictureConfig) or section.recorded == ("segmentation",):
            continue
        about = f"{section.width} × {section.height} pixels, {section.rate_hz} frames a second"
        shades = "" if "color" in section.recorded else "; the nearer, the brighter"
        blocks.append(Markup("<b>{}</b>, on {}: {}{}.").format(name, section.link, about, shades))
        rows = [
            (f"trial {throw.trial}, {describe(throw.outcome)}", *_show_frames(throw.sensors[name], bool(shades)))
            for throw in throws
        ]
        blocks.append(Table(tuple(rows)))
    if blocks and throws:
        noun = dataset.config.task.noun
        text = f"A few {noun}s, one in each row, with the time since its start."
        yield ReportSection("cameras", "What the cameras see", text, tuple(blocks))


def _show_frames(frames: SensorFrames, shades: bool) -> Iterator[str]:
    pictures = frames.depth_m if shades else frames.images
    numbers = np.linspace(0, len(frames) - 1, min(len(frames), _FRAMES)).round().astype(int).tolist()
    for number, time_s in zip(numbers, frames.time_s[numbers].tolist(), strict=True):
        picture = images.fromarray(_shade(pictures[number]))
        picture.thumbnail((2 * _WIDTH_PX, 2 * _WIDTH_PX))
        buffer = io.BytesIO()
        picture.save(buffer, "WEBP", quality=80)
        data = base64.b64encode(buffer.getvalue()).decode()
        yield _PICTURE.format(data, f"{frames.name} at {time_s:.2f} s", _WIDTH_PX, time_s)


def _shade(picture: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Turn depths into grey; colors stay as they are."""
    if picture.dtype == np.uint8:
        return picture.astype(np.uint8)
    depth = picture.astype(np.float64)
    farthest = np.max(depth, initial=0.1, where=np.isfinite(depth))
    return (255 * (1 - np.where(np.isfinite(depth), depth, farthest) / farthest)).astype(np.uint8)
