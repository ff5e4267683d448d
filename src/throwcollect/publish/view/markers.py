"""Markers: robot, bodies, the path of the object, where it was released, highest and landed, and the landing plane."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces import get_message
from throwcollect.config.schema import Config
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.throws_table import body_state
from throwcollect.episode.frames import WORLD
from throwcollect.episode.topics import make_header
from throwcollect.errors import ConfigError
from throwcollect.sensing.drawn_robot import DrawnShape, Rgba, draw_bodies_of, read_hex
from throwcollect.tasks.outcome_styles import style_of

_HELD: Rgba = (0.6, 0.6, 0.6, 0.8)
_PLANE: Rgba = (0.3, 0.5, 0.9, 0.15)
_LABEL: Rgba = (1.0, 1.0, 1.0, 1.0)
_OTHERS_ALPHA = 0.25

_POINT_M, _TEXT_M, _LINE_M, _THIN_LINE_M, _PLANE_M = 0.035, 0.07, 0.012, 0.005, 0.002
_MARGIN_M = 0.5
_POINTS_PER_S = 100
"""Number of points of a path for each second; the eye could not distinguish more."""


@dataclass(frozen=True)
class ShownThrow:
    """A throw with the configuration of its trial, and when it is shown.

    Attributes:
        start_ns: Stamp of its first sample in the file that viewers open [ns].
        path: Centre of the object in world [m], shape ``(n_samples, 3)``.
    """

    throw: Throw
    config: Config
    start_ns: int
    path: NDArray[np.float64]

    @property
    def rgba(self) -> Rgba:
        """Colour of its outcome."""
        return read_hex(style_of(self.throw.outcome, self.config.task.success).colour)


def shape_markers(name: str, shapes: Sequence[DrawnShape], locate: Callable[[str], Path], stamp_ns: int) -> Any:
    """A visualization_msgs/MarkerArray with shapes in the frames of their links.

    Meshes are ``data:`` URLs, so that viewers need no files.

    Args:
        name: Namespace of the markers.
        shapes: The shapes.
        locate: Finds the file of a mesh.
        stamp_ns: Stamp of the markers [ns].
    """
    array, marker = (get_message(f"visualization_msgs/msg/{kind}") for kind in ("MarkerArray", "Marker"))
    kinds = {"mesh": marker.MESH_RESOURCE, "box": marker.CUBE, "cylinder": marker.CYLINDER, "sphere": marker.SPHERE}
    meshes = {mesh: _make_data_url(locate(mesh)) for mesh in {shape.mesh for shape in shapes if shape.mesh}}
    markers = []
    for number, shape in enumerate(shapes):
        drawn = _make_marker(name, kinds[shape.kind], shape.rgba, shape.size, stamp_ns, number=number)
        # The markers are locked: viewers move them with their frames, so the shapes are published only once.
        drawn.header.frame_id, drawn.frame_locked = shape.link, True
        drawn.mesh_resource = meshes.get(shape.mesh, "")
        _place(drawn, *shape.position)
        x, y, z, w = shape.rotation_xyzw
        drawn.pose.orientation = get_message("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w)
        markers.append(drawn)
    return array(markers=markers)


def throw_markers(throw: ShownThrow) -> Any:
    """A visualization_msgs/MarkerArray of the throw that is shown, which replaces the markers of the throw before."""
    array, marker = (get_message(f"visualization_msgs/msg/{name}") for name in ("MarkerArray", "Marker"))
    stamp = throw.start_ns
    markers = [marker(header=make_header(WORLD, stamp), action=marker.DELETEALL)]
    markers += shape_markers("bodies", draw_bodies_of(throw.config), Path, stamp).markers
    markers.append(_make_path("path", throw, stamp, width=_LINE_M, alpha=1.0))
    for point in throw.config.task.events:
        markers += _make_point(point, throw)
    return array(markers=markers)


def all_markers(throws: Sequence[ShownThrow]) -> Any:
    """A visualization_msgs/MarkerArray with thin paths of all throws, and the landing plane of the first, if any."""
    array, marker = (get_message(f"visualization_msgs/msg/{name}") for name in ("MarkerArray", "Marker"))
    stamp = throws[0].start_ns
    thin = [_make_path("paths", throw, stamp, width=_THIN_LINE_M, alpha=_OTHERS_ALPHA) for throw in throws]
    if "landing" not in throws[0].config.task.events:
        return array(markers=thin)
    # The first of these points is the robot's base, so that the plane includes it.
    corners = np.concatenate([np.zeros((1, 2)), *(throw.path[:, :2] for throw in throws)])
    low, high = corners.min(axis=0) - _MARGIN_M, corners.max(axis=0) + _MARGIN_M
    plane = _make_marker("landing plane", marker.CUBE, _PLANE, (*(high - low), _PLANE_M), stamp)
    x, y = (low + high) / 2
    _place(plane, x, y, throws[0].config.scene.landing_height_m - _PLANE_M / 2)
    return array(markers=[plane, *thin])


def path_cloud(throw: ShownThrow) -> Any:
    """A sensor_msgs/PointCloud2 with a throw's path, for viewers that draw no markers."""
    field = get_message("sensor_msgs/msg/PointField")
    data = throw.path.astype("<f4")
    fields = [field(name=name, offset=4 * axis, datatype=field.FLOAT32, count=1) for axis, name in enumerate("xyz")]
    return get_message("sensor_msgs/msg/PointCloud2")(
        header=make_header(WORLD, throw.start_ns),
        height=1,
        width=len(data),
        fields=fields,
        point_step=12,
        row_step=12 * len(data),
        data=np.frombuffer(data.tobytes(), np.uint8),
        is_dense=True,
    )


def _make_path(namespace: str, throw: ShownThrow, stamp_ns: int, *, width: float, alpha: float) -> Any:
    """A line, grey while the object was held, with the colour of the outcome from its release on."""
    point, color = get_message("geometry_msgs/msg/Point"), get_message("std_msgs/msg/ColorRGBA")
    rate, left, last = throw.config.record.rate_hz, throw.throw.events.left, len(throw.path) - 1
    chosen = [*range(0, last, max(1, rate // _POINTS_PER_S)), last]
    release = math.inf if left is None else left.time_s * rate
    colors = {held: color(r=r, g=g, b=b, a=a * alpha) for held, (r, g, b, a) in ((True, _HELD), (False, throw.rgba))}
    marker = get_message("visualization_msgs/msg/Marker")
    line = _make_marker(
        namespace, marker.LINE_STRIP, (*throw.rgba[:3], alpha), (width, 0.0, 0.0), stamp_ns, number=throw.throw["trial"]
    )
    line.points = [point(x=x, y=y, z=z) for x, y, z in throw.path[chosen].tolist()]
    line.colors = [colors[sample < release] for sample in chosen]
    return line


def _make_point(name: str, throw: ShownThrow) -> list[Any]:
    """A dot with a label; nothing if the throw has no such point."""
    state, stamp_ns = body_state(throw.throw.row, name), throw.start_ns
    if state is None:
        return []
    (x, y, z), speed = state.position, math.hypot(*state.velocity)
    marker = get_message("visualization_msgs/msg/Marker")
    dot = _make_marker(name, marker.SPHERE, throw.rgba, (_POINT_M,) * 3, stamp_ns)
    label = _make_marker(name, marker.TEXT_VIEW_FACING, _LABEL, (0.0, 0.0, _TEXT_M), stamp_ns, number=1)
    label.text = f"{name} x {x:.2f} m, y {y:.2f} m, z {z:.2f} m, {speed:.2f} m/s"
    _place(dot, x, y, z)
    # The label of the release is below its dot, because the apex of what is released on its way down is at the same
    # place.
    _place(label, x, y, z + (-1.5 if name == "release" else 1.5) * _TEXT_M)
    return [dot, label]


def _make_marker(
    namespace: str, kind: int, rgba: Rgba, scale: tuple[float, ...], stamp_ns: int, *, number: int = 0
) -> Any:
    r, g, b, a = rgba
    x, y, z = map(float, scale)
    return get_message("visualization_msgs/msg/Marker")(
        header=make_header(WORLD, stamp_ns),
        ns=namespace,
        id=number,
        type=kind,
        scale=get_message("geometry_msgs/msg/Vector3")(x=x, y=y, z=z),
        color=get_message("std_msgs/msg/ColorRGBA")(r=r, g=g, b=b, a=a),
    )


def _place(marker: Any, x: float, y: float, z: float) -> None:
    marker.pose.position = get_message("geometry_msgs/msg/Point")(x=float(x), y=float(y), z=float(z))


def _make_data_url(path: Path) -> str:
    try:
        return f"data:model/{path.suffix[1:].lower()};base64,{base64.b64encode(path.read_bytes()).decode()}"
    except OSError as error:
        raise ConfigError(f"{path}: the robot's mesh cannot be read: {error.strerror}") from error
