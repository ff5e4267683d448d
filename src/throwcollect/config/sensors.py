"""Keys of sensors: cameras and lidars that see the recorded states of a trial."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from throwcollect.config.key import Key
from throwcollect.config.section import Angle, Section, any_of

SensorName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
SensorSections = Mapping[str, object]
"""Sections of sensors by name, as they are in YAML."""
Stream = Literal["color", "depth", "segmentation"]
_Triple = Annotated[list[Annotated[float, Field(ge=-100, le=100)]], Field(min_length=3, max_length=3)]
_Pixels = Annotated[int, Field(ge=8, le=4096)]
_Length = Annotated[float, Field(ge=0.001, le=1000)]
_Share = Annotated[float, Field(ge=0, le=1)]


class SensorNoise(Section):
    """Noise that follows from the seed of the collection; readers apply it, unless they ask for what is clean."""

    dropout: Annotated[_Share, Key(swept=True)] = 0.0
    """Share of pixels without a depth, or of rays without a range."""
    recorded: bool = False
    """Whether the recording has the noise, too; then it is a hundred times as large."""


class CameraNoise(SensorNoise):
    """Noise of the pixels of a camera."""

    color_std: Annotated[float, Field(ge=0, le=100), Key(swept=True)] = 0.0
    """Standard deviation of colors, of 255."""
    depth_std_m: Annotated[float, Field(ge=0, le=1), Key(swept=True)] = 0.0
    """Standard deviation of depths."""
    depth_std_share: Annotated[_Share, Key(swept=True)] = 0.0
    """Standard deviation of depths as a share of the depth; it adds to `depth_std_m`."""


class LidarNoise(SensorNoise):
    """Noise of the ranges of a lidar."""

    range_std_m: Annotated[float, Field(ge=0, le=1), Key(swept=True)] = 0.0
    """Standard deviation of ranges."""


class SensorConfig(Section):
    """A sensor that is attached to a link or to the world."""

    link: str = "world"
    """Link of the robot or of the tool that carries the sensor, or `world`."""
    position_m: Annotated[_Triple | None, Key(swept=True)] = None
    """Position of the sensor in the frame of the link: x, y, z. Null: the origin; for a camera in the world, a place to
    the right of the robot from which it sees the throw."""
    rpy_rad: Annotated[Annotated[list[Angle], Field(min_length=3, max_length=3)] | None, Key(swept=True)] = None
    """Rotations about the axes x, y, z of the link, in this order, of a sensor that looks along x, with y to its left
    and z upwards. Null: zeros, or what follows from `look_at_m`."""
    look_at_m: Annotated[_Triple | None, Key(swept=True)] = None
    """Point in the frame of the link at which the sensor looks, with the link's z upwards; in place of `rpy_rad`.
    Null: the direction of `rpy_rad`; for a camera in the world without it, [1.0, 0.0, 0.9]."""
    rate_hz: Annotated[int, Field(ge=1, le=1000)] = 10
    """Frames per simulated second; must divide `record.rate_hz`."""
    latency_s: Annotated[float, Field(ge=0, le=5), Key(swept=True)] = 0.0
    """Time after which a message arrives; its stamp is that of the state that it shows."""

    @property
    def place(self) -> tuple[list[float], list[float] | None]:
        """Its position in the link [m], and the point at which it looks; None if `rpy_rad` gives its direction."""
        return self.position_m or [0.0, 0.0, 0.0], self.look_at_m

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        position, look_at = self.place
        if self.look_at_m is not None and self.rpy_rad is not None:
            yield "rpy_rad", "should be left out, because look_at_m gives the direction"
        if look_at is not None and all(abs(at - here) < 1e-9 for at, here in zip(look_at, position, strict=True)):
            yield "look_at_m", f"should be another place than position_m, got {look_at}"


class PictureConfig(SensorConfig):
    """A sensor that takes pictures."""

    width: _Pixels = 96
    """Width of the pictures [pixels]."""
    height: _Pixels = 96
    """Height of the pictures [pixels]."""
    vertical_fov_rad: Annotated[float, Field(gt=0.02, lt=3.1), Key(swept=True)] = 1.05
    """Angle of view from the upper to the lower edge."""
    near_m: _Length = 0.02
    """Nothing nearer than this along the optical axis is seen."""
    far_m: _Length = 20.0
    """Nothing farther than this along the optical axis is seen."""
    depth_encoding: Literal["16UC1", "32FC1"] = "16UC1"
    """How depths are recorded: `16UC1` in mm, 0 for none, or `32FC1` in m, infinite for none."""
    noise: CameraNoise = CameraNoise()
    """Noise of the pixels."""

    @property
    def place(self) -> tuple[list[float], list[float] | None]:
        """Its position in the link [m], and the point at which it looks; None if `rpy_rad` gives its direction."""
        if self.link != "world":
            return super().place
        position = self.position_m or [1.0, -3.2, 1.5]
        return position, self.look_at_m or (None if self.rpy_rad else [1.0, 0.0, 0.9])

    @property
    def recorded(self) -> tuple[Stream, ...]:
        """The streams, in the order of their channels."""
        return ("depth",)

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        yield from super()._find_contradictions()
        if self.near_m >= self.far_m:
            yield "near_m", f"should be below far_m, {self.far_m:g}, got {self.near_m:g}"


class DepthConfig(PictureConfig):
    """A camera that measures depths along its optical axis."""

    kind: Literal["depth"]
    """Kind of the sensor."""


class CameraConfig(PictureConfig):
    """A camera."""

    kind: Literal["camera"]
    """Kind of the sensor."""
    streams: Annotated[list[Stream], Field(min_length=1)] = ["color"]
    """What is recorded: `color`, `depth` along the optical axis, and `segmentation`, the link or body in each pixel."""
    shadows: bool = False
    """Whether robot and bodies throw shadows; a small picture takes twice as long with them."""

    @property
    def recorded(self) -> tuple[Stream, ...]:
        """The streams, in the order of their channels."""
        every: tuple[Stream, ...] = ("color", "depth", "segmentation")
        return tuple(stream for stream in every if stream in self.streams)


class LidarConfig(SensorConfig):
    """A lidar that turns about its axis z, counter-clockwise."""

    kind: Literal["lidar_2d"]
    """Kind of the sensor."""
    rays: Annotated[int, Field(ge=1, le=4096)] = 360
    """Rays of a layer."""
    from_rad: Angle = -3.141592653589793
    """Angle of the first ray about z; 0 is along x."""
    to_rad: Angle = 3.141592653589793
    """Angle at which the layer ends; the last ray is one step before it if that is a whole turn."""
    range_m: Annotated[list[_Length], Field(min_length=2, max_length=2)] = [0.1, 30.0]
    """Smallest and largest range."""
    noise: LidarNoise = LidarNoise()
    """Noise of the ranges."""

    @property
    def angles_rad(self) -> tuple[float, ...]:
        """Angle of each ray of a layer about z; a whole turn ends one step before it begins anew."""
        span = self.to_rad - self.from_rad
        step = span / (self.rays if span > 6.283 else max(self.rays - 1, 1))
        return tuple(self.from_rad + number * step for number in range(self.rays))

    @property
    def elevations_rad(self) -> tuple[float, ...]:
        """Angle of each layer above the plane of x and y, the lowest first."""
        return (0.0,)

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        yield from super()._find_contradictions()
        for key, (low, high) in {"range_m": self.range_m, "from_rad": (self.from_rad, self.to_rad)}.items():
            if low >= high:
                yield key, f"should begin below {high:g}, got {low:g}"


class LayersConfig(LidarConfig):
    """A lidar with several layers."""

    kind: Literal["lidar_3d"]  # type: ignore[assignment]
    """Kind of the sensor."""
    layers: Annotated[int, Field(ge=1, le=256)] = 16
    """Number of layers."""
    vertical_rad: Annotated[list[Annotated[float, Field(ge=-1.5, le=1.5)]], Field(min_length=2, max_length=2)] = [
        -0.26,
        0.26,
    ]
    """Angles of the lowest and the highest layer above the plane of x and y."""

    @property
    def elevations_rad(self) -> tuple[float, ...]:
        """Angle of each layer above the plane of x and y, the lowest first."""
        low, high = self.vertical_rad
        return tuple(low + number * (high - low) / max(self.layers - 1, 1) for number in range(self.layers))


if TYPE_CHECKING:
    AnySensor = DepthConfig | CameraConfig | LidarConfig | LayersConfig
else:
    AnySensor = any_of(
        {"camera": CameraConfig, "depth": DepthConfig, "lidar_2d": LidarConfig, "lidar_3d": LayersConfig},
        lambda value: value.get("kind", "camera") if isinstance(value, dict) else None,
    )

Sensors = Annotated[dict[SensorName, AnySensor], Field(max_length=32)]
