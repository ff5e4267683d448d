"""Keys for the sweep: the keys that vary from trial to trial, and the targets that throws are spread over."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from throwcollect.config.key import Key
from throwcollect.config.section import Section, any_of

LANDING_HEIGHT = "scene.landing_height_m"
"""Key that must be swept where heights are a target."""

MOST_TRIALS = 10_000_000
"""Most trials of a plan; even the last one starts at a time that fits into a stamp of ROS."""

_MOST_CELLS = 10_000


class Range(Section):
    """An interval to draw from."""

    min: float
    """Lower bound, in the unit of the key."""
    max: float
    """Upper bound, in the unit of the key."""
    scale: Literal["linear", "log"] = "linear"
    """Whether the value or its logarithm is spread evenly."""
    count: Annotated[int, Field(ge=1, le=MOST_TRIALS)] | None = None
    """Number of grid points, both ends included; for the sampler `grid` only."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.min > self.max:
            yield "min", f"should be at most max, {self.max}, got {self.min}"
        elif self.scale == "log" and self.min <= 0:
            yield "min", f"should be above 0 on a logarithmic scale, got {self.min}"
        if self.count == 1 and self.min < self.max:
            yield "count", "should be 2 or more, as both min and max are grid points"


class Values(Section):
    """A set of values to choose from."""

    values: Annotated[list[float], Field(min_length=1)]
    """The values, in the unit of the key."""


if TYPE_CHECKING:
    Parameter = Range | Values
else:
    Parameter = any_of(
        {"range": Range, "values": Values},
        lambda value: ("values" if "values" in value else "range") if isinstance(value, dict) else None,
    )


class Bins(Section):
    """Equal intervals of a landing target."""

    min: float
    """Lower end, in the unit of the target."""
    max: float
    """Upper end, in the unit of the target."""
    bins: Annotated[int, Field(ge=1, le=1000)]
    """Number of intervals."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.min >= self.max:
            yield "min", f"should be below max, {self.max}, got {self.min}"


class TargetConfig(Section):
    """Cells of landings, which `throwcollect cover` fills evenly, and in which reports count throws."""

    distance_m: Bins | None = None
    """Horizontal distance of the landing ball from the origin of the robot's base."""
    height_m: Bins | None = None
    """Height of the landing plane, `scene.landing_height_m`, which must be swept."""
    hit_angle_rad: Bins | None = None
    """Direction of flight at landing below the horizontal: 0 is level, 1.5708 straight down."""

    @property
    def dimensions(self) -> dict[str, Bins]:
        """The bins of each target that is there, by its key."""
        named = {"distance_m": self.distance_m, "height_m": self.height_m, "hit_angle_rad": self.hit_angle_rad}
        return {name: bins for name, bins in named.items() if bins is not None}

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if not self.dimensions:
            yield "distance_m", "missing; at least one of distance_m, height_m and hit_angle_rad should be there"
        cells = math.prod(each.bins for each in self.dimensions.values())
        if cells > _MOST_CELLS:
            last = list(self.dimensions)[-1]
            yield f"{last}.bins", f"makes {cells} cells together with the others; there may be {_MOST_CELLS}"


class SweepConfig(Section):
    """Which parameters vary from trial to trial, and how they are drawn."""

    sampler: Literal["grid", "uniform", "latin_hypercube", "sobol", "list"] = "sobol"
    """How points are drawn; `list` reads them from `file`."""
    parameters: dict[str, Parameter] = {}
    """Dotted configuration keys (`task.duration_s`, `ball.mass_kg`, ...) and what they range over."""
    file: Annotated[str | None, Key(operator=True)] = None
    """CSV or Parquet file for the sampler `list`, with one row for each trial; its columns are dotted keys, and
    possibly targets.

    A relative path starts at the directory of the configuration file."""
    feasibility: Literal["actual", "nominal"] = "actual"
    """Robot that the plan is checked for: the `actual` one that throws, or the `nominal` one, for which all keys of
    `tool`, `ball` and `robot` have their defaults, except `posture`, `locked` and `base_height_m`. Users who plan
    motions for a real robot know only the nominal one."""
    target: TargetConfig | None = None
    """Cells of landings, which `throwcollect cover` fills evenly, and in which reports count throws."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.sampler == "list":
            if self.file is None:
                yield "file", "missing; the sampler list should have a CSV or Parquet file"
            if self.parameters:
                yield "parameters", "should be left out, as the sampler list takes keys and values from its file"
        elif self.file is not None:
            yield "file", f"should be left out, as the sampler {self.sampler} reads no file"
        if self.target and self.target.height_m and self.sampler != "list" and LANDING_HEIGHT not in self.parameters:
            yield "target.height_m", f"should be left out, as {LANDING_HEIGHT} is not swept"
        for key, parameter in self.parameters.items():
            if not isinstance(parameter, Range):
                continue
            if self.sampler == "grid" and parameter.count is None:
                yield f"parameters.{key}.count", "missing; the sampler grid should know how many points to take"
            elif self.sampler not in ("grid", "list") and parameter.count is not None:
                yield f"parameters.{key}.count", f"should be left out, as the sampler {self.sampler} has no grid"
