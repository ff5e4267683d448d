"""Images of a camera in a LeRobot dataset: as PNG in its tables, or as videos that go on over many episodes."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.sensors import PictureConfig
from throwcollect.errors import refuse_argument
from throwcollect.extras import lazily
from throwcollect.publish.export.parquet import FILES_PER_CHUNK

av = lazily("av")
pillow = lazily("PIL.Image")

MEGABYTES_PER_VIDEO = 200
VIDEOS = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
QUANTILES: Mapping[str, float] = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_FULL = (MEGABYTES_PER_VIDEO - 20) * 2**20
"""Size at which the next episode begins another video [bytes]."""
_LONGEST_S = 500
"""Length at which it does: LeRobot compares times as float32, which at 1024 s are farther apart than its tolerance."""
CODECS: Mapping[str, Mapping[str, Any]] = {
    "av1": {"g": 2, "crf": 30, "preset": 12, "svtav1-params": "lp=1"},
    "h264": {"g": 2, "crf": 23, "bf": 0, "threads": 1},
}
"""Settings of encoders; those of ``av1`` are LeRobot's own. One thread gives the same bytes on each machine."""
_ENCODERS = {"av1": "libsvtav1", "h264": "libx264"}
_PNG = pa.struct([("bytes", pa.binary()), ("path", pa.string())])

Pictures = NDArray[np.uint8] | NDArray[np.uint16]
"""Pictures of one episode, shape ``(n_frames, height, width, 3)``, or depths [mm], 0 for none, with 1 instead of 3."""


class ImageSeries:
    """The images or the depths of one camera, which are written episode after episode, until it is closed.

    Attributes:
        key: Name of the feature.
        in_table: Whether its images are a column of the table of frames.
    """

    def __init__(
        self, name: str, stream: str, camera: PictureConfig, images: str, directory: Path, rate_hz: int
    ) -> None:
        ending, self._channels = ("_depth", 1) if stream == "depth" else ("", 3)
        self.key, self.in_table = f"observation.images.{name}{ending}", images not in CODECS
        if not self.in_table and (camera.width % 2 or camera.height % 2):
            problem = f"{images} of the {camera.width} x {camera.height} pixels of {name}"
            raise refuse_argument("images", problem, expected="even numbers of pixels, or png")
        self._camera, self._images, self._directory, self._rate_hz = camera, images, directory, rate_hz
        self._videos = self._frames_of_video = 0
        self._file: IO[bytes] | None = None

    def as_feature(self) -> dict[str, object]:
        """Make its entry in ``meta/info.json``."""
        shape = [self._camera.height, self._camera.width, self._channels]
        names = ["height", "width", "channels"]
        if self.in_table:
            depth: dict[str, object] = {"info": {"is_depth_map": True, "depth_unit": "mm"}}
            return {"dtype": "image", "shape": shape, "names": names} | (depth if self._channels == 1 else {})
        about = {**dict(zip(names, shape, strict=True)), "codec": self._images, "pix_fmt": "yuv420p"}
        settings = {**about, "fps": self._rate_hz, **CODECS[self._images]}
        info = {f"video.{key}": value for key, value in settings.items()} | {"has_audio": False, "is_depth_map": False}
        return {"dtype": "video", "shape": shape, "names": names, "info": info}

    def append(self, pictures: Pictures) -> dict[str, Any]:
        """Write the pictures of an episode, unless they are in the table, and return their place in the video."""
        if self.in_table:
            return {}
        if self._file is None or self._frames_of_video >= _LONGEST_S * self._rate_hz or self._file.tell() >= _FULL:
            self.close()
            self._begin_video()
        chunk, file = divmod(self._videos - 1, FILES_PER_CHUNK)
        start = self._frames_of_video
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = self._frames_of_video, Fraction(1, self._rate_hz)
            self._container.mux(self._stream.encode(frame))
            self._frames_of_video += 1
        place = {"chunk_index": chunk, "file_index": file, "from_timestamp": start / self._rate_hz}
        place["to_timestamp"] = self._frames_of_video / self._rate_hz
        return {f"videos/{self.key}/{name}": value for name, value in place.items()}

    def _begin_video(self) -> None:
        # The encoder of AV1 would print settings and warnings on standard error.
        os.environ.setdefault("SVT_LOG", "1")
        chunk, file = divmod(self._videos, FILES_PER_CHUNK)
        path = self._directory / VIDEOS.format(video_key=self.key, chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file, self._videos, self._frames_of_video = path.open("wb"), self._videos + 1, 0
        self._container = av.open(self._file, "w", format="mp4")
        options = {name: str(value) for name, value in CODECS[self._images].items()}
        self._stream = self._container.add_stream(_ENCODERS[self._images], rate=self._rate_hz, options=options)
        self._stream.height, self._stream.width = self._camera.height, self._camera.width
        self._stream.pix_fmt = "yuv420p"

    def close(self) -> None:
        """Finish the video that is open, if one is."""
        if self._file is not None:
            with self._file:
                self._container.mux(self._stream.encode(None))
                self._container.close()
            self._file = None


def encode_pictures(pictures: Pictures) -> pa.Array:
    """Make the column of pictures as PNG, in the structure that LeRobot reads."""
    return pa.array([{"bytes": _encode_png(picture), "path": None} for picture in pictures], _PNG)


def _encode_png(picture: Pictures) -> bytes:
    buffer = io.BytesIO()
    # The usual level of 6 takes twice the time for a tenth of the size.
    pillow.fromarray(picture[..., 0] if picture.shape[-1] == 1 else picture).save(buffer, "PNG", compress_level=3)
    return buffer.getvalue()


def summarise_pictures(pictures: Pictures) -> dict[str, NDArray[Any]]:
    """Compute LeRobot's statistics of colors from 0 to 1, or depths [mm], of all pixels of each channel."""
    channels, most = (3, 2**8) if pictures.shape[-1] == 3 else (1, 2**16)
    levels = np.array([np.bincount(pictures[..., each].ravel(), minlength=most) for each in range(channels)])
    colors = np.arange(most) / (255 if channels == 3 else 1)
    pixels, below = levels[0].sum(), levels.cumsum(axis=1)
    mean = levels @ colors / pixels
    deviation = np.sqrt((levels * (colors - mean[:, np.newaxis]) ** 2).sum(axis=1) / pixels)
    ranks = {"min": 1, "max": pixels} | {name: share * pixels for name, share in QUANTILES.items()}
    found = {name: colors[(below < rank).sum(axis=1)] for name, rank in ranks.items()}
    every = {name: values.reshape(channels, 1, 1) for name, values in {**found, "mean": mean, "std": deviation}.items()}
    return {**every, "count": np.array([len(pictures)])}
