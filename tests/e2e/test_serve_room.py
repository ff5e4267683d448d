"""The page in a room: an emulated headset enters, places the robot, sets a target and leaves."""

from __future__ import annotations

import json
import math
import queue
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.e2e.chromium import Tab, browse, chromium
from tests.e2e.collection import FAST, write_config
from tests.e2e.page import find_own_errors, load, press, serve, slide
from tests.npm import install
from throwcollect import ros
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runtimes.run_listener import RunListener

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(chromium() is None, reason="needs Chromium: apt-get install chromium"),
]

_MM = 1e-3
_CONFIG = """\
name: small
trials: {trials}
sweep:
  parameters:
    task.end.arm_right_4_joint: {{min: -0.7, max: -0.4}}
    task.duration_s: {{min: 1.0, max: 1.2}}
sensors:
  scan: {{kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0], rpy_rad: [0, 0.3, 0], rays: 36}}
run: {{runtime: local, replay: 0}}
"""
_DEVICE = """
  window.device = new IWER.XRDevice(IWER.metaQuest3);
  device.installRuntime({forceInstall: true});
  window.someFrames = async () => {
    const { render } = throwcollect.view.renderer.info;
    const until = render.frame + 4;
    while (render.frame < until) await new Promise((resolve) => setTimeout(resolve, 20));
  };
  window.press = async (value) => {
    device.controllers.right.updateButtonValue("trigger", value);
    await someFrames();
  };
  window.pull = async () => {
    await press(1);
    await press(0);
  };
"""
_FLOOR = """
  device.installSEM(class {
    environmentCanvas = document.createElement("canvas");
    trackedPlanes = new Set();
    trackedMeshes = new Set();
    render() {}
    // Where a ray meets the ground, as a matrix.
    computeHitTestResults(ray) {
      const away = ray[13] / ray[9];
      const [x, z] = [ray[12] - away * ray[8], ray[14] - away * ray[10]];
      return away > 0 ? [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, z, 1]] : [];
    }
  })
"""
"""A stand-in for the room, which the emulator lacks; the page looks only for the floor."""
_PAGE = """
(() => {
  const { view, room } = throwcollect;
  const { canvas } = view;
  const camera = view.orbit.object;
  return JSON.stringify([
    canvas.parentElement.id, canvas.width, canvas.height, camera.matrixWorld.elements, camera.projectionMatrix.elements,
    view.world.matrixWorld.elements, view.world.visible, view.renderer.xr.enabled,
    view.room.children.length, view.world.children.length,
    [...view.stations.values()].map(({ group }) => group.position.toArray()), room.button.textContent,
  ]);
})()
"""
_ENTER = "document.querySelector('#enter-room').click()"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[dict[str, Any]]:
    write_config(tmp_path, trials=600, text=_CONFIG, sim=f"{FAST}, real_time_factor: 1")
    catalogue = tmp_path / "catalogue.yaml"
    catalogue.write_text(
        "components: {throws: {pretty_name: Throws, config: small.yaml, max_instances: 2}, "
        "hands: {pretty_name: Hands, session: small.yaml}}\n"
    )
    with serve(catalogue, tmp_path / "datasets") as told:
        yield told


@pytest.fixture(scope="module")
def emulator() -> str:
    """A script that puts an emulated headset into a browser."""
    place = install("iwer", {"iwer": "2.5.0"})
    return (place / "node_modules/iwer/build/iwer.min.js").read_text(encoding="utf-8") + _DEVICE


class Ears:
    """Hears /target in the graph of a run, as long as it is used as a context manager.

    Args:
        run: Id of the run.
    """

    def __init__(self, run: str) -> None:
        self._run = run
        self._heard: queue.Queue[Any] = queue.Queue()
        self._is_enough = threading.Event()
        self._thread = threading.Thread(target=self._listen)

    def __enter__(self) -> Ears:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_enough.set()
        self._thread.join()

    def hear(self) -> tuple[float, float, float]:
        """The target that is heard next."""
        message = self._heard.get(timeout=60)
        assert message.header.frame_id == "world"
        assert message.header.stamp.sec > 0
        return message.point.x, message.point.y, message.point.z

    def _listen(self) -> None:
        with RunListener(lambda _: None, on_connect=self._subscribe) as listener:
            while not self._is_enough.is_set():
                listener.spin(Records().get(self._run).connection, 0.1)

    def _subscribe(self, node: ros.Node) -> None:
        # A late subscriber gets the last target.
        qos = ros.QoSProfile(depth=1, durability=ros.DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(ros.get_message("geometry_msgs/msg/PointStamped"), "/target", self._heard.put, qos)


def enter(tab: Tab) -> None:
    tab.evaluate(_ENTER)
    tab.wait_for("throwcollect.room.isEntered && throwcollect.view.renderer.xr.isPresenting")


def leave(tab: Tab) -> None:
    tab.evaluate(_ENTER)
    tab.wait_for("!throwcollect.room.isEntered")


def hold(tab: Tab, x: float, y: float, z: float, left: float = 0) -> None:
    """Hold the right controller somewhere in the room [m], and point ahead, or turned to the left by an angle [rad]."""
    tab.evaluate(
        f"device.controllers.right.position.set({x}, {y}, {z}); "
        f"device.controllers.right.quaternion.set({turn(left, 0)})"
    )
    tab.evaluate("someFrames()")


def turn(left: float, up: float) -> str:
    """Quaternion (x, y, z, w) of a view that is turned to the left and up by some angles [rad]."""
    (sin_left, cos_left), (sin_up, cos_up) = ((math.sin(each / 2), math.cos(each / 2)) for each in (left, up))
    return f"{cos_left * sin_up}, {sin_left * cos_up}, {-sin_left * sin_up}, {cos_left * cos_up}"


def test_a_hand_can_set_a_target(server: dict[str, Any], emulator: str) -> None:
    still = {"prefers-reduced-motion": "reduce"}
    with browse(server["page"], width=640, height=400, features=still, script=emulator) as tab:
        load(tab)
        tab.evaluate("document.querySelector('#components input').value = '2'")
        press(tab, "Start Throws")
        tab.wait_for("throwcollect.view.stations.get('sim_0')?.robot?.isWhole", within_s=120, every_s=1)
        run = tab.evaluate("throwcollect.watching.id")
        with Ears(run) as ears:
            set_by_hand(tab, ears)
        leave(tab)
        assert find_own_errors(tab) == []


def set_by_hand(tab: Tab, ears: Ears) -> None:
    # Without a device: by a field, which is reached by the keyboard.
    tab.evaluate("document.querySelector('#target-x').value = '1.25'")
    tab.evaluate("document.querySelector('#target-form button').click()")
    assert ears.hear() == pytest.approx((1.25, 0, 0), abs=_MM)

    before = tab.evaluate(_PAGE)
    enter(tab)
    tab.wait_for("throwcollect.view.world.visible")
    assert tab.evaluate(_PAGE) != before
    # The robot stands 2 m ahead and throws to the right; the user sees its left side.
    hold(tab, 0.3, 0.9, -1.2)
    tab.evaluate("pull()")
    assert ears.hear() == pytest.approx((0.3, -0.8, 0.9), abs=_MM)
    # Another robot stands behind it, and a target near that is in its own frame.
    hold(tab, 0.4, 1.0, -3.7)
    tab.evaluate("pull()")
    assert ears.hear() == pytest.approx((0.4, 0.2, 1.0), abs=_MM)
    leave(tab)
    tab.wait_for(f"{_PAGE.strip().rstrip(';')} === {json.dumps(before)}")

    # With a device that knows the floor: who stands at (1, 0) looks to the left, at the floor 1.6 m away.
    tab.evaluate(_FLOOR)
    tab.evaluate("device.position.set(1, 1.6, 0)")
    tab.evaluate(f"device.quaternion.set({turn(math.pi / 2, -math.pi / 4)})")
    enter(tab)
    tab.wait_for("throwcollect.room.reticle.visible")
    assert not tab.evaluate("throwcollect.view.world.visible")
    tab.evaluate("pull()")
    assert tab.evaluate("throwcollect.view.world.visible")
    hold(tab, -0.4, 0.5, -1.4)
    tab.evaluate("pull()")
    assert ears.hear() == pytest.approx((1.4, -0.2, 0.5), abs=_MM)


def test_a_sensor_of_a_session_is_added_and_placed_by_hand(server: dict[str, Any], emulator: str) -> None:
    still = {"prefers-reduced-motion": "reduce"}
    with browse(server["page"], width=390, height=800, features=still, script=emulator) as tab:
        load(tab)
        start = "document.querySelector('button[aria-label=\"Start Hands\"]')"
        tab.evaluate(f"{start}.form.querySelector('input').value = '1'; {start}.click()")
        robot = "throwcollect.view.stations.get('sim_0')?.robot?.isWhole"
        tab.wait_for(f"throwcollect.live.simulations.size && {robot}", within_s=120, every_s=1)
        try:
            place_by_hand(tab)
        finally:
            # A session outlives its server.
            press(tab, f"Stop {tab.evaluate('throwcollect.watching.id')}")
            tab.wait_for("document.querySelector('#ended .status')?.textContent.startsWith('has ended')", every_s=1)


def place_by_hand(tab: Tab) -> None:
    marks, strip = "throwcollect.view.stations.get('sim_0').sensors.object.children", "throwcollect.strip"

    def read(key: str) -> Any:
        """What the simulation says of its camera."""
        path = "`/instances/${throwcollect.watching.id}/simulations/sim_0/sensors`"
        return tab.evaluate(f"throwcollect.connection.read('GET', {path}).then(([, camera]) => camera.section.{key})")

    # The lidar that the session begins with has points; a camera is added.
    tab.evaluate("document.querySelector('#show-sensors').click()")
    tab.wait_for(f"{marks}[1]?.geometry.attributes.position.count > 0")
    tab.evaluate("document.querySelector('#add-camera').click()")
    tab.wait_for(f"{strip}.strands.find(({{ key }}) => key === 'camera/color')?.drawn > 0")
    slide(tab, "width", 64)
    tab.wait_for("document.querySelector('[aria-label=\"color of camera\"]').width === 64")
    assert read("width") == 64
    assert tab.evaluate("document.documentElement.scrollWidth") == 390

    # It stands 1 m behind the user and 1 m to the right. The hand takes it, turns to the left and lets it go.
    enter(tab)
    tab.wait_for(f"throwcollect.view.world.visible && {marks}[2].visible")
    boards = "throwcollect.room.sensors.boards"
    assert tab.evaluate(f"{boards}.length === 1 && {boards}[0].mesh.visible")
    assert tab.evaluate(f"{boards}[0].mesh.position.toArray()") == pytest.approx([1, 1.82, 1], abs=_MM)
    hold(tab, 1, 1.5, 1.1)
    tab.evaluate("press(1)")
    hold(tab, 0.5, 1.2, -0.4, left=math.pi / 2)
    tab.evaluate("press(0)")
    placed = [0.4, -1.6, 1.2]
    tab.wait_for(f"Math.abs({strip}.sensors[1].position_m[0] - 0.4) < {_MM}")
    assert read("position_m") == pytest.approx(placed, abs=_MM)
    yaw = math.atan2(3, -0.4) + math.pi / 2 - math.tau
    assert read("rpy_rad") == pytest.approx([0, math.atan2(0.5, math.hypot(3, 0.4)), yaw], abs=_MM)
    # It was no trigger for a target.
    assert not tab.evaluate("throwcollect.view.stations.get('sim_0').target.visible")
    leave(tab)
    assert not tab.evaluate(f"{marks}[2].visible")

    tab.evaluate("navigator.clipboard.writeText = async (text) => { window.copied = text }")
    tab.evaluate("document.querySelector('#pictures button[title=\"copy camera as YAML\"]').click()")
    copied = yaml.safe_load(tab.evaluate("copied"))["sensors"]["camera"]
    assert (copied["position_m"], copied["width"]) == (pytest.approx(placed, abs=_MM), 64)
    assert "look_at_m" not in copied
    tab.evaluate("document.querySelectorAll('#sensor-form button')[1].click()")
    tab.wait_for(f"{strip}.sensors.length === 1")
    assert find_own_errors(tab) == []
