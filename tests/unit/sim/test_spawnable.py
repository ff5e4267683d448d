import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from tests.unit.sim.bodies import box, pendulum, write_mesh

from throwcollect.errors import RequestError
from throwcollect.sim.spawnable import read_model

TRIANGLE = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
INERTIA = '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'


def no_mesh(filename):
    raise AssertionError(filename)


def model(text, find_mesh=no_mesh):
    return read_model(text, find_mesh)


def write_model(text):
    return ElementTree.fromstring(model(text).write_urdf().encode())  # noqa: S314 - written by ourselves


def robot(*parts):
    return f"<robot name='r'>{''.join(parts)}</robot>"


def joint(name="j", parent="a", child="b", kind="fixed", inside=""):
    return f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>{inside}</joint>"


A, B, C = (f"<link name='{name}'/>" for name in "abc")
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def inertia(text):
    given = write_model(text).find("link/inertial/inertia").attrib
    return [float(given[key]) for key in ("ixx", "iyy", "izz")]


def test_a_body_with_mass_moves_and_one_without_is_fixed():
    assert (model(box()).is_fixed, model(box()).is_static) == (False, False)
    assert (model(box(mass=0)).is_fixed, model(box(mass=0)).is_static) == (True, True)
    assert model(box().replace('"body"', '"world"')).is_static


def test_the_mass_of_links_rigidly_attached_to_the_root_counts():
    heavy = box().replace("<robot", "<x").split(">", 1)[1].replace("</robot>", "")
    on_frame = robot(A, heavy, joint(child="body"))
    assert not model(on_frame).is_fixed
    hinged = robot(A, heavy, joint(child="body", kind="revolute", inside=LIMIT))
    assert (model(hinged).is_fixed, model(hinged).is_static, len(model(hinged).moving)) == (True, False, 1)


def test_a_robot_that_is_fixed_can_have_joints_that_move():
    hanging = model(pendulum())
    assert (hanging.name, len(hanging.moving), hanging.is_fixed, hanging.is_static) == ("pendulum", 1, True, False)


def test_unknown_elements_of_a_description_are_left_out():
    text = robot("<link name='a'><plugin/><collision><geometry><sphere radius='1'/></geometry></collision></link>")
    tags = [element.tag for element in write_model(text).iter()]
    inertial, collision = ["inertial", "origin", "mass", "inertia"], ["collision", "origin", "geometry", "sphere"]
    assert tags == ["robot", "link", *inertial, *collision]


def test_meshes_are_written_once_and_exact_only_where_they_never_move(tmp_path):
    shapes = "<collision><geometry><mesh filename='cup.stl' scale='2 2 2'/></geometry></collision>" * 2
    cup = write_mesh(tmp_path / "cup.stl", TRIANGLE)
    still = model(robot(f"<link name='a'>{shapes}</link>"), lambda name: tmp_path / name)
    assert still.encode_meshes() == {"0.stl": cup.read_bytes()}
    text = still.write_urdf()
    assert text.count('<collision concave="yes">') == text.count('filename="0.stl"') == 2
    mass = f"<inertial><mass value='1'/>{INERTIA.format(1, 1, 1)}</inertial>"
    assert "concave" not in model(robot(f"<link name='a'>{mass}{shapes}</link>"), lambda _: cup).write_urdf()


def test_impossible_moments_of_inertia_are_corrected():
    assert inertia(box(inertia=INERTIA.format(1, 2, 2.5))) == [1, 2, 2.5]
    assert inertia(box(mass=2.0, inertia=INERTIA.format(0, 0, 0))) == pytest.approx([2e-6, 2e-6, 2e-6], rel=0.01)
    assert inertia(box(inertia=INERTIA.format(1, 1, 9))) == pytest.approx([1, 1, 2], rel=0.01)
    assert inertia(box(inertia=INERTIA.format(-0.01, 1, 1))) == pytest.approx([1e-6, 1, 1], rel=0.01)


def test_limits_without_bounds_become_numbers_that_the_engine_can_take():
    endless = pendulum(limit='<limit lower="-1e16" upper="1e16" effort="3" velocity="inf"/>')
    limit = write_model(endless).find("joint/limit").attrib
    assert limit == {"lower": "-1000000.0", "upper": "1000000.0", "effort": "3.0", "velocity": "1000000.0"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not well-formed XML: no element found: line 1"),
        ("<robot>\n<link>\n</robot>", "mismatched tag: line 3, column 2"),
        ("<robot name='\x00'/>", "not well-formed"),
        (b"\xff\xfe\x00", "not well-formed"),
        (b"<?xml version='1.0' encoding='nonsense'?><robot/>", "not well-formed"),
        ("<!DOCTYPE robot [<!ENTITY a 'b'>]><robot/>", "document type 'robot' is declared"),
        ("<!DOCTYPE robot SYSTEM 'file:///etc/passwd'><robot/>", "document type 'robot' is declared"),
        (robot(), "has no links"),
        (
            robot(
                *(f"<link name='l{n}'/>" for n in range(129)),
                *(joint(f"j{n}", "l0", f"l{n}") for n in range(1, 129)),
            ),
            "129 links; 1 to 128",
        ),
        (robot("<link/>"), "a link has the name ''"),
        (robot(f"<link name='{'x' * 256}'/>"), "has the name 'x+"),
        (robot("<link name='a&#10;b'/>"), "should be printable"),
        (robot(A, A), "link a is there twice"),
        (robot(A, B), "links a and b are not connected"),
        (robot(A, joint()), "joint j: there is no link 'b'"),
        (robot(A, B, joint(), joint()), "joint j is there twice"),
        (robot(A, B, C, joint(), joint("k", "c", "b")), "link b hangs on two joints: j and k"),
        (robot(A, B, joint(), joint("k", "b", "a")), "the joints form a ring"),
        (robot(A, B, C, joint("j", "b", "c"), joint("k", "c", "b")), "the joints form a ring"),
        (robot(A, B, "<joint name='j' type='fixed'><parent link='a'/></joint>"), "joint j: <joint> without <child>"),
        (robot(A, B, joint(kind="floating")), "joints of type 'floating' are not simulated"),
        (pendulum(limit=""), "joint hinge: has no limit"),
        (pendulum(limit='<limit lower="1" upper="-1" velocity="1" effort="1"/>'), "lower should be at most upper"),
        (pendulum(limit='<limit lower="nan" upper="1"/>'), "lower of <limit> should be a finite number, is 'nan'"),
        (pendulum(axis="0 0 0"), "has no direction"),
        (pendulum(axis="0 0 1 0"), "xyz of <axis> should be 3 finite numbers"),
        (box("0.1 0.1"), "link body: size of <box> should be 3 finite numbers, is '0.1 0.1'"),
        (box("0.1 0.1 inf"), "size of <box> should be 3 finite"),
        (box("0.1 -0.1 0.1"), "sizes of a box should be above 0"),
        (box("0.1 0.1 zero"), "size of <box> should be 3 finite"),
        (box(mass=-1.0), "a mass of at least 0, is -1"),
        (box(mass=float("nan")), "value of <mass> should be a finite number"),
        (box(origin="0 0 1e99"), "xyz of <origin> should be 3 finite"),
        (box(inertia=INERTIA.format(-1, 1, 1)), "its inertia is not positive"),
        (box().replace("<box", "<plane/><box"), "unknown shape plane"),
        (robot("<link name='a'><collision/></link>"), "a collision without geometry"),
    ],
)
def test_malformed_descriptions_are_refused(text, words):
    with pytest.raises(RequestError, match=words) as refused:
        model(text)
    assert refused.value.reason == "RESOURCE_PARSE_ERROR"


@pytest.mark.parametrize(("text", "kind"), [("<sdf/>", "SDFormat"), ("<mujoco/>", "MJCF"), ("<html/>", "<html>")])
def test_another_format_than_urdf_is_refused_by_name(text, kind):
    with pytest.raises(RequestError, match=kind) as refused:
        model(text)
    assert refused.value.reason == "UNSUPPORTED_FORMAT"


def test_more_triangles_than_can_be_simulated_are_refused(tmp_path):
    shape = "<collision><geometry><mesh filename='{}.stl'/></geometry></collision>"
    text = robot(f"<link name='a'>{shape.format(1)}{shape.format(2)}</link>")
    with pytest.raises(RequestError, match="400002 triangles in all; at most 400000"):
        model(text, lambda name: write_mesh(tmp_path / name, np.repeat(TRIANGLE, 200_001, axis=0)))
