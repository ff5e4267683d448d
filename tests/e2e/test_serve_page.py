"""The page of a server in a real browser, which starts, watches and stops a collection."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import throwcollect
from tests.e2e.chromium import browse, chromium
from tests.e2e.collection import FAST, collect_here, write_config
from tests.e2e.page import CHANGED, find_own_errors, load, press, serve, slide
from tests.unit.serve.made_model import make_model
from throwcollect.collect.runs.records import Records
from throwcollect.serve.finding import find_server, make_page_address

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(chromium() is None, reason="needs Chromium: apt-get install chromium"),
]

_SEEN = """
(() => {
  const { view, meshes } = throwcollect;
  const stations = view.shown.map((name) => view.stations.get(name));
  const isSeen = ({ robot, trails }) => robot?.isWhole && trails.count > 0;
  return stations.length === 2 && stations.every(isSeen) && meshes.count;
})()
"""
_TOOLTIPS = """<robot name="talos">
  <tooltip name="elbow" topic="joint_states" field="position[arm_right_4_joint]">
    <parent link="arm_right_4_link"/>
  </tooltip>
  <tooltip name="ball" topic="/sim_0/ball/odometry" field="pose.pose.position.z"><parent link="torso_2_link"/></tooltip>
  <tooltip name="image" topic="/img/base_joint_speed"><parent link="wrist_1_link"/></tooltip>
</robot>"""
_MESHES = 25
"""Number of mesh files in the description of Talos with its spoon."""


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Address of the page of a server, with a code."""
    # Slow enough to be stopped half-way, and to leave the processor to the browser.
    write_config(tmp_path, trials=600, sim=f"{FAST}, real_time_factor: 1")
    catalogue = tmp_path / "catalogue.yaml"
    catalogue.write_text(
        "components: {throws: {pretty_name: Throws, config: small.yaml}, "
        "hands: {pretty_name: Hands, session: small.yaml}}\n"
    )
    make_model(tmp_path / "models" / "quick")
    with serve(catalogue, tmp_path / "datasets", tmp_path / "models") as told:
        yield told["page"]


def test_a_collection_is_started_watched_and_stopped_by_the_page(address: str) -> None:
    # Drawing by software is slow, so the browser asks for little motion, and the replay stands still at first.
    with browse(address, width=800, height=600, features={"prefers-reduced-motion": "reduce"}) as tab:
        load(tab)
        assert tab.evaluate("location.hash") == "", "the code is still in the address"
        # Smooth edges take software longer than the rest of a picture, and would slow down simulations.
        assert tab.evaluate("throwcollect.view.renderer.getContextAttributes().antialias") is False
        assert "Nothing runs" in tab.evaluate("document.querySelector('#empty').textContent")
        tab.evaluate("document.querySelector('#components input').value = '2'")
        press(tab, "Start Throws")
        meshes = tab.wait_for(_SEEN, within_s=120, every_s=1)
        fetched = [url for url in tab.requests if "/meshes/" in url]
        assert meshes == len(set(fetched)) == _MESHES
        assert len(fetched) == _MESHES or any(CHANGED in error for error in tab.errors)
        assert tab.evaluate("document.querySelector('#instances progress').value") > 0
        assert tab.evaluate("document.querySelector('#play').textContent") == "Play"
        tab.evaluate("throwcollect.playback.seek(0); document.querySelector('#play').click()")
        tab.wait_for("document.querySelector('#scrub').value > 0.2")
        # A plot is offered first for the joint that moves most.
        tab.evaluate("document.querySelector('#add-plot').click()")
        assert tab.evaluate("document.querySelector('#plot-name').value") == "arm_right_4_joint"
        tab.evaluate("document.querySelector('#plot-dialog').close()")
        # All landings are on the map, whether their throws were shown or not.
        tab.wait_for("document.querySelector('#map-text').textContent.includes('landings so far')")
        # Each plot of a description is shown once, even if it comes twice; entries that cannot be plotted are left out.
        tab.evaluate(f"for (const _ of [1, 2]) throwcollect.plots.bind('sim_0', {json.dumps(_TOOLTIPS)})")
        titles = "[...document.querySelectorAll('.plot strong')].map((each) => each.textContent).join()"
        assert tab.evaluate(titles) == "arm_right_4_joint position [rad],ball z [m]"
        instance = tab.evaluate("throwcollect.watching.id")
        press(tab, f"Stop {instance}")
        tab.wait_for("document.querySelector('#ended .status')?.textContent.startsWith('has ended')", every_s=1)
        assert {urlsplit(url).netloc for url in tab.requests if not url.startswith(("data:", "blob:"))} == {
            urlsplit(address).netloc
        }
        assert find_own_errors(tab) == []


def test_a_session_is_recorded_by_a_button(address: str) -> None:
    with browse(address, width=390, height=800, features={"prefers-reduced-motion": "reduce"}) as tab:
        load(tab)
        start = "document.querySelector('button[aria-label=\"Start Hands\"]')"
        tab.evaluate(f"{start}.form.querySelector('input').value = '1'; {start}.click()")
        button, note = (f"document.querySelector('#{name}')" for name in ("record", "view-note"))
        tab.wait_for(f"!{button}.hidden && {button}.ariaDisabled === 'false' && throwcollect.live.simulations.size")
        # The service may not be known yet.
        again = f"/^$|is not recorded/.test({note}.textContent) && ({note}.textContent = 'asked', {button}.click())"
        tab.wait_for(f"({again}, {button}.textContent === 'Stop recording')")
        assert "into" in tab.evaluate(f"{note}.textContent")
        tab.evaluate(f"{button}.click()")
        tab.wait_for(f"{button}.textContent === 'Record'")
        assert "nothing has moved" in tab.evaluate(f"{note}.textContent")
        # A session outlives its server.
        press(tab, f"Stop {tab.evaluate('throwcollect.watching.id')}")
        tab.wait_for("document.querySelector('#ended .status')?.textContent.startsWith('has ended')", every_s=1)
        assert find_own_errors(tab) == []


@pytest.fixture
def over(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Two runs that have ended; the dataset of the first one is not there."""
    runs, now = [Records().new(name) for name in ("early", "late")], datetime.now(timezone.utc)
    for run, place in zip(runs, (Path("/none"), tmp_path / "data"), strict=True):
        run.write(run.begin("small", place, runtime="local", ended=now, exit_code=0))
        run.close()
    yield runs[0].id, runs[1].id
    for run in runs:
        run.forget()


def test_the_page_shows_the_run_that_its_address_names(address: str, over: tuple[str, str]) -> None:
    watched = "window.throwcollect?.watching.id"
    with browse(f"{address}&run={over[0]}", width=390, height=800) as tab:
        load(tab)
        tab.wait_for(f"{watched} === {json.dumps(over[0])}")
        server = find_server()
        assert server is not None
        # Only the fragment of the address changes, so the browser does not load the page again.
        tab.ask("Page.navigate", url=make_page_address(server, over[1]))
        tab.wait_for(f"{watched} === {json.dumps(over[1])}")
        assert tab.evaluate("location.hash") == ""
        tab.wait_for("document.querySelector('#empty').textContent.includes('is not there')")
        assert [error for error in find_own_errors(tab) if "404" not in error] == []


_CLICK_LANDING = """
((trial) => {
  const map = document.querySelector('#map');
  const { left, top } = map.getBoundingClientRect();
  for (let y = 0; y < map.clientHeight; y += 2) {
    for (let x = 0; x < map.clientWidth; x += 2) {
      const at = { clientX: left + x, clientY: top + y };
      map.dispatchEvent(new MouseEvent('mousemove', at));
      if (map.title.startsWith(`trial ${trial},`)) return map.dispatchEvent(new MouseEvent('click', at));
    }
  }
  return false;
})
"""


def test_a_landing_of_a_run_that_has_ended_is_clicked_and_its_throw_is_replayed(
    address: str, over: tuple[str, str], tmp_path: Path
) -> None:
    collect_here(write_config(tmp_path, trials=4, sim=FAST), tmp_path / "data")
    throws = throwcollect.load(tmp_path / "data")
    with browse(f"{address}&run={over[1]}", width=390, height=800) as tab:
        load(tab)
        replayed = "throwcollect.playback.at('replay')?.shown.trial"
        tab.wait_for(f"{replayed} === 0 && throwcollect.view.stations.get('replay').robot?.isWhole")
        assert tab.evaluate(f"{_CLICK_LANDING}(2)"), "no landing of trial 2 can be clicked"
        tab.wait_for(f"{replayed} === 2")
        landing = tab.evaluate("throwcollect.playback.at('replay').shown.landing")
        assert landing == throws[2].events.landing.position.tolist()
        assert tab.evaluate("location.hash") == f"#run={over[1]}&trial=2"
        tab.evaluate("document.querySelector('#compare').click(); document.querySelector('#stored-after').click()")
        tab.wait_for(f"{replayed} === 3 && throwcollect.view.stations.get('replay').trails.count === 2")
        # The address opens the same two throws again.
        tab.ask("Page.reload")
        load(tab)
        tab.wait_for(f"{replayed} === 3 && throwcollect.view.stations.get('replay').trails.count === 2")
        # The words come with the next picture.
        tab.wait_for("document.querySelector('#time').value.endsWith('trial 3, landed; transparent: trial 2, landed')")
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
        assert find_own_errors(tab) == []


_SENSORS = """
sensors:
  head: {kind: camera, link: head_2_link, width: 32, height: 24, rate_hz: 2, streams: [color, depth, segmentation]}
  scan: {kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0], rpy_rad: [0, 0.3, 0], rays: 36, rate_hz: 2}
"""
_CHANGE = "document.querySelectorAll('#pictures button[title^=change]')"


_READ_HEAD = """
[...document.querySelector('canvas[aria-label="color of head"]').getContext('2d').getImageData(0, 0, 32, 24).data]
  .filter((_, i) => i % 4 !== 3)
"""


def test_the_page_shows_what_sensors_saw_and_what_another_camera_sees(
    address: str, over: tuple[str, str], tmp_path: Path
) -> None:
    config = write_config(tmp_path, trials=2, sim=FAST)
    config.write_text(config.read_text() + _SENSORS)
    collect_here(config, tmp_path / "data")
    seen = throwcollect.load(tmp_path / "data")[0].sensors["head"]
    with browse(
        f"{address}&run={over[1]}", width=390, height=800, features={"prefers-reduced-motion": "reduce"}
    ) as tab:
        load(tab)
        station, strip = "throwcollect.view.stations.get('replay')", "throwcollect.strip"
        tab.wait_for(f"throwcollect.playback.at('replay') && {station}.robot?.isWhole && {strip}.strands.length === 4")
        tab.evaluate("throwcollect.playback.seek(0.6)")
        tab.wait_for(f"{strip}.strands.every(({{ shown }}) => shown === 1)")
        assert tab.evaluate(_READ_HEAD) == seen.images[1].ravel().tolist()
        lines, points = (f"{station}.sensors.object.children[{number}]" for number in (0, 3))
        assert tab.evaluate(f"{points}.geometry.attributes.position.count") > 0
        assert not tab.evaluate(f"{lines}.visible")
        tab.evaluate("document.querySelector('#frustum').click(); document.querySelector('#add-camera').click()")
        drawn = f"{strip}.strands.find(({{ key }}) => key === 'camera/color')?.drawn"
        tab.wait_for(f"{lines}.visible && {lines}.matrix.elements[14] > 0 && {drawn}")
        # The camera of the frustum is at the head of the robot, from the first frame that is drawn with it on.
        assert 1.3 < tab.evaluate(f"{lines}.matrix.elements[14]") < 2
        assert tab.evaluate(f"{station}.sensors.object.children.length") == 6
        # A slider moves the camera; what is recorded cannot be changed.
        slide(tab, "x [m]", 2)
        added = f"{strip}.sensors.find(({{ name }}) => name === 'camera')"
        tab.wait_for(f"{drawn} > 1 && {added}.position_m[0] === 2")
        assert tab.evaluate(f"[...{_CHANGE}].length") == 1
        tab.evaluate("[...document.querySelectorAll('#sensor-form button')][1].click()")
        assert tab.evaluate(f"{station}.sensors.object.children.length") == 4
        assert tab.evaluate("document.querySelector('#sensor-form').hidden")
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
        assert find_own_errors(tab) == []


def test_a_click_on_the_map_aims_with_the_chosen_model(address: str) -> None:
    with browse(address, width=390, height=800) as tab:
        load(tab)
        tab.wait_for("!document.querySelector('#model-box').hidden")
        assert tab.evaluate("document.querySelector('#map-box').hidden"), "nothing runs, and no model is chosen"
        choose = "(() => { const model = document.querySelector('#model'); model.value = 'quick';"
        tab.evaluate(f"{choose} model.dispatchEvent(new Event('change')); }})()")
        tab.wait_for("document.querySelector('#model-text').textContent.includes('400 throws of quick')")
        assert "400 of the throws" in tab.evaluate("document.querySelector('#map-model').textContent")
        tab.evaluate("document.querySelector('#map').dispatchEvent(new MouseEvent('click', {bubbles: true}))")
        tab.wait_for("document.querySelector('#aim-text').textContent !== ''")
        # The fields take an exact target, which a click cannot give.
        tab.evaluate(
            "document.querySelectorAll('#aim-fields input').forEach((field, i) => field.value = [0.25, -0.5][i])"
        )
        tab.evaluate("document.querySelector('#aim-form').requestSubmit()")
        values = "[...document.querySelectorAll('#aim-values > *')].map((each) => each.textContent).join()"
        tab.wait_for(f"{values} === 'task.a,0.25,task.b,-0.5'")
        tab.evaluate("document.querySelectorAll('#aim-fields input')[0].value = 9")
        tab.evaluate("document.querySelector('#aim-form').requestSubmit()")
        tab.wait_for("document.querySelector('#aim-text').textContent.startsWith('Out of reach')")
        assert tab.evaluate(values) == ""
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
        assert find_own_errors(tab) == []


def test_the_page_works_without_a_network(tmp_path: Path) -> None:
    unshare = ["unshare", "--net"]
    if subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode:
        pytest.skip("may make no network namespace; root may")
    write_config(tmp_path, trials=600, sim=f"{FAST}, real_time_factor: 1")
    catalogue = tmp_path / "catalogue.yaml"
    catalogue.write_text(
        "components: {throws: {pretty_name: Throws, config: small.yaml}, "
        "hands: {pretty_name: Hands, session: small.yaml}}\n"
    )
    command = [*unshare, sys.executable, "-m", "tests.e2e.offline_page", catalogue, tmp_path]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=240, check=False)
    assert done.returncode == 0
    assert json.loads(done.stdout) == {"networks": ["lo"], "meshes": _MESHES, "errors": []}
