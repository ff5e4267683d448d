"""A layout for Foxglove and Lichtblick: the scene, plots of the ball and of joints in their limits, and results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from throwcollect.episode.frames import WORLD
from throwcollect.view.viewer_recording import FACTS_HARDWARE, FACTS_NAME

_SCENE = "3D!throws"
_BALL = "Plot!ball"
_LIMITS = "Plot!limits"
_FACTS = "DiagnosticStatusPanel!facts"
_SPEED = 0.2
"""Speed of the playback [-]: at real speed a throw is over within a second or two."""


def layout(joints: Sequence[str]) -> bytes:
    """JSON text of the layout, as applications import it; joints are those whose limits are plotted."""
    shares = [_describe_series(f"/view/limits.position[{index}]", joint) for index, joint in enumerate(joints)]
    height = _describe_series("/ball/odometry.pose.pose.position.z", "height [m]")
    panels = {
        _SCENE: _describe_scene(),
        _BALL: _describe_plot([height, _describe_series("/view/ball_speed.data", "speed [m/s]")], "Ball"),
        _LIMITS: _describe_plot(
            [*shares, _describe_series("-1", "lower limit"), _describe_series("1", "upper limit")],
            "Joint positions within their limits",
        ),
        _FACTS: {"topicToRender": "/view/facts", "selectedHardwareId": FACTS_HARDWARE, "selectedName": FACTS_NAME},
    }
    document = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": _SPEED},
        "layout": _describe_split(
            "row", _SCENE, _describe_split("column", _FACTS, _describe_split("column", _BALL, _LIMITS, 50), 34), 64
        ),
    }
    return (json.dumps(document, indent=2) + "\n").encode()


def _describe_scene() -> dict[str, Any]:
    camera = {
        "perspective": True,
        "distance": 4.6,
        "phi": 72.0,
        "thetaOffset": 215.0,
        "target": [0.0, 0.0, 0.0],
        "targetOffset": [0.5, 0.0, 1.05],
        "targetOrientation": [0, 0, 0, 1],
        "fovy": 45,
        "near": 0.05,
        "far": 500,
    }
    layers = {
        "ground": {
            "instanceId": "ground",
            "layerId": "foxglove.Grid",
            "label": "Ground",
            "visible": True,
            "frameId": WORLD,
            "size": 10,
            "divisions": 10,
            "lineWidth": 1,
            "color": "#248eff60",
            "order": 1,
        },
    }
    return {
        "followMode": "follow-none",
        "followTf": WORLD,
        "cameraState": camera,
        # The meshes are STL files with z up, as usual in ROS; the default of the application is y.
        "scene": {"meshUpAxis": "z_up", "transforms": {"showLabel": False, "axisScale": 0, "lineWidth": 0}},
        "topics": {
            "/view/robot": {"visible": True, "showOutlines": False},
            "/view/tool": {"visible": True, "showOutlines": False},
            "/view/throw": {"visible": True, "showOutlines": False},
            "/view/throws": {"visible": True, "showOutlines": False},
            "/view/path": {"visible": False},
            # This is the same robot, but with paths of mesh files, which not every machine has.
            "/robot_description": {"visible": False},
        },
        "layers": layers,
    }


def _describe_plot(paths: Sequence[Mapping[str, Any]], title: str) -> dict[str, Any]:
    return {
        # Lichtblick, which began as a copy of Foxglove, uses another key for the title.
        "foxglovePanelTitle": title,
        "lichtblickPanelTitle": title,
        "paths": list(paths),
        "showLegend": True,
        "legendDisplay": "left",
        "sidebarDimension": 190,
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _describe_series(value: str, label: str) -> dict[str, Any]:
    return {"value": value, "label": label, "enabled": True, "timestampMethod": "receiveTime"}


def _describe_split(direction: str, first: Any, second: Any, percentage: int) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
