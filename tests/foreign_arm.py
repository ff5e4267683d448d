"""An arm of three joints that no package describes, for tests of robots from their URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np

FLANGE = "flange_link"
MOUNT = 'rpy="0 -1.5707963267948966 3.141592653589793"'
"""How the flange is turned: z along the forearm and x upwards, so that the default tool pose holds the ball."""
_LINK = """  <link name="{name}">
    <inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
    <visual><origin xyz="{x} 0 0"/><geometry><box size="{length} 0.05 0.05"/></geometry></visual>
    <collision><origin xyz="{x} 0 0"/><geometry><box size="{length} 0.05 0.05"/></geometry></collision>
  </link>
"""
_JOINT = """  <joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x} 0 {z}"/><axis xyz="{axis}"/><limit lower="-2.5" upper="2.6" velocity="6" effort="150"/></joint>
"""
ARM = "".join(
    [
        '<robot name="Foreign Arm">\n',
        *(
            _LINK.format(name=f"{name}_link", x=x, mass=mass, length=length)
            for name, x, mass, length in (
                ("base", 0, 8, 0.1),
                ("turret", 0, 3, 0.06),
                ("upper", 0.2, 2, 0.3),
                ("fore", 0.15, 1.5, 0.2),
            )
        ),
        f'  <link name="{FLANGE}"/>\n',
        *(
            _JOINT.format(name=name, parent=f"{parent}_link", child=f"{child}_link", x=x, z=z, axis=axis)
            for name, parent, child, x, z, axis in (
                ("turn", "base", "turret", 0, 0.15, "0 0 1"),
                ("lift", "turret", "upper", 0, 0.1, "0 1 0"),
                ("bend", "upper", "fore", 0.4, 0, "0 1 0"),
            )
        ),
        f'  <joint name="mount" type="fixed"><parent link="fore_link"/><child link="{FLANGE}"/>\n'
        f'    <origin xyz="0.3 0 0" {MOUNT}/></joint>\n',
        "</robot>\n",
    ]
)
BOX = '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.3 0.05 0.05"/></geometry></collision>'
"""The collision shape of the upper arm."""
CORNERS = np.array([(x, y, z) for x in (-0.15, 0.15) for y in (-0.02, 0.02) for z in (-0.02, 0.02)])
FACES = np.array(
    [
        *((0, 1, 2), (3, 2, 1), (4, 5, 6), (7, 6, 5), (0, 4, 1), (5, 1, 4)),
        *((2, 3, 6), (7, 6, 3), (0, 2, 4), (6, 4, 2), (1, 5, 3), (7, 3, 5)),
    ]
)
"""Triangles of a box, as indices of its corners."""


def write_arm(directory: Path, *changes: tuple[str, str]) -> Path:
    """Write the URDF, in which each text of the changes is replaced once."""
    text = ARM
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    directory.mkdir(exist_ok=True)
    path = directory / "arm.urdf"
    path.write_text(text)
    return path


def mesh(filename: str, scale: str = "1 1 1") -> str:
    """The upper arm's collision shape as a mesh."""
    return BOX.replace('<box size="0.3 0.05 0.05"/>', f'<mesh filename="{filename}" scale="{scale}"/>')


def stl(corners: np.ndarray = CORNERS) -> bytes:
    """A box as binary STL."""
    records = np.zeros(len(FACES), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records["corners"] = corners[FACES]
    return bytes(80) + len(records).to_bytes(4, "little") + records.tobytes()


def obj() -> str:
    """A box as OBJ."""
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a} {b} {c}" for a, b, c in FACES + 1]
    return "\n".join(lines) + "\n"


def dae() -> str:
    """A box as COLLADA, in centimetres."""
    numbers = " ".join(f"{100 * value:g}" for value in CORNERS.ravel())
    indices = " ".join(map(str, FACES.ravel()))
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimetre" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="box"><mesh>
<source id="places"><float_array id="numbers" count="{CORNERS.size}">{numbers}</float_array><technique_common>
<accessor source="#numbers" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="corners"><input semantic="POSITION" source="#places"/></vertices>
<triangles count="{len(FACES)}"><input semantic="VERTEX" source="#corners" offset="0"/><p>{indices}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node><instance_geometry url="#box"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#scene"/></scene></COLLADA>
"""
