"""Viewers draw robots of other packages, with shapes that Talos lacks and packages that ROS does not know."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from tests.unit.sensing.scenes import make_scene

from throwcollect.episode.frames import read_frames
from throwcollect.episode.sensor_topics import label_names
from throwcollect.publish.view.markers import shape_markers
from throwcollect.sensing.drawn_robot import DrawnRobot, read_drawn_robot

URDF = """\
<robot name="snowman">
  <link name="head"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <link name="nose"><visual><geometry><mesh filename="package://snow/meshes/nose.stl"/></geometry></visual></link>
</robot>
"""


@pytest.fixture
def snowman(tmp_path: Path) -> DrawnRobot:
    mesh = tmp_path / "share" / "snow" / "meshes" / "nose.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b"solid nose")
    return read_drawn_robot(URDF, "nose", lambda url: tmp_path / "share" / url.removeprefix("package://"))


def test_a_sphere_is_drawn_with_its_diameter(snowman: DrawnRobot) -> None:
    head, nose = shape_markers("robot", snowman.shapes, snowman.locate, 0).markers
    assert (head.type, head.scale.x, head.scale.y, head.scale.z) == (head.SPHERE, 0.2, 0.2, 0.2)
    assert (nose.type, nose.mesh_resource) == (nose.MESH_RESOURCE, "data:model/stl;base64,c29saWQgbm9zZQ==")


def test_an_arm_stands_on_a_column_that_reaches_the_ground() -> None:
    joint = '<joint name="neck" type="fixed"><parent link="nose"/><child link="head"/></joint></robot>'
    drawn = read_drawn_robot(URDF.replace("</robot>", joint), "none", Path, 0.8)
    (mount,) = (shape for shape in drawn.shapes if shape.kind == "cylinder")
    assert (mount.link, mount.position, mount.size[2]) == ("nose", (0, 0, -0.4), 0.8)


def test_a_package_without_a_name_gets_that_of_its_directory(snowman: DrawnRobot, tmp_path: Path) -> None:
    snowman.copy_package(tmp_path / "view")
    assert (tmp_path / "view" / "snow" / "meshes" / "nose.stl").read_bytes() == b"solid nose"
    assert ElementTree.parse(tmp_path / "view" / "snow" / "package.xml").findtext("name") == "snow"  # noqa: S314


def test_each_shape_has_its_own_colour(tmp_path: Path) -> None:
    shape = '<visual><geometry><sphere radius="0.1"/></geometry>{}</visual>'
    red, green, named = (
        f'<material name=""><color rgba="{rgba}"/></material>' for rgba in ("1 0 0 1", "0 1 0 1", "0 0 1 1")
    )
    blue = named.replace('""', '"blue"')
    parts = [red, green, blue, '<material name="blue"/>', "", red]
    links = "".join(f'<link name="{number}">{shape.format(part)}</link>' for number, part in enumerate(parts))
    drawn = read_drawn_robot(f'<robot name="r">{links}</robot>', "5", Path)
    colours = [part.rgba for part in drawn.shapes]
    assert colours[:4] == [(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (0, 0, 1, 1)]
    # A part without a colour is grey, and the tool has one of its own, whatever its description says.
    assert len(set(colours)) == 5
    assert drawn.urdf.count("<material") == 5


def test_labels_begin_with_the_root_of_a_description_as_recordings_say() -> None:
    joint = '<joint name="j" type="fixed"><parent link="root"/><child link="hand"/></joint>'
    urdf = f'<robot name="r"><link name="hand"/><link name="root"/>{joint}</robot>'
    recorded = label_names(read_frames(urdf, base_height=0.5).links, "ball", ["ball"])
    assert make_scene(urdf=urdf).labels == recorded == ("background", "root", "hand", "ball", "ground")
