"""Bodies of a scene that are meshes, or described by a URDF: what is read, what is refused, and where they lie."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.engines import mesh
from throwcollect.engines.mesh import encode
from throwcollect.errors import ConfigError
from throwcollect.robots import body_files, joint_model
from throwcollect.robots.body_files import files_of
from throwcollect.robots.surroundings import bodies_of, looks_of

FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4)]


def write_box(path: Path, low: tuple[float, ...], high: tuple[float, ...]) -> Path:
    """Write a box without two of its triangles, which the hull does not need."""
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))), np.float32)
    if path.suffix == ".obj":
        lines = [f"v {x} {y} {z}" for x, y, z in corners.tolist()]
        path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]))
    else:
        path.write_bytes(encode(corners[np.array(FACES)]))
    return path


L_SHAPE = """\
<robot name="l_shape">
  <link name="foot">
    <inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><sphere radius="1"/></geometry></visual>
    <collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>
  </link>
  <link name="post">
    <inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><origin rpy="1.5707963267948966 0 0"/><geometry><mesh filename="package://things/post.obj"/></geometry></collision>
  </link>
  <joint name="weld" type="fixed"><parent link="foot"/><child link="post"/><origin xyz="0 0 0.25"/></joint>
</robot>
"""


def write_l_shape(directory: Path, text: str = L_SHAPE) -> Path:
    write_box(directory / "post.obj", (-0.1, -0.2, -0.05), (0.1, 0.2, 0.05))
    package = directory / "things"
    package.mkdir(exist_ok=True)
    (directory / "post.obj").replace(package / "post.obj")
    path = directory / "l_shape.urdf"
    path.write_text(text)
    return path


def load_bodies(directory: Path, **bodies: dict[str, object]) -> Config:
    lines = [f"    {name}: {body}" for name, body in bodies.items()]
    path = directory / "config.yaml"
    path.write_text("\n".join(["trials: 1", "scene:", "  bodies:", *lines]).replace("'", "").replace("None", "null"))
    return load(path)


def test_a_mesh_weighs_as_the_solid_box_of_its_corners_would(tmp_path: Path) -> None:
    write_box(tmp_path / "crate.stl", (0, 0, 0), (200, 300, 400))
    box = {"shape": "box", "size_m": [0.2, 0.3, 0.4], "mass_kg": 2.0}
    crate = {"shape": "mesh", "file": "crate.stl", "scale": [0.001, 0.001, 0.001], "mass_kg": 2.0}
    a_box, a_mesh = bodies_of(load_bodies(tmp_path, box=box, crate=crate))
    assert a_mesh.inertia.placement.xyz == pytest.approx((0.1, 0.15, 0.2))
    assert a_mesh.inertia.moments_kgm2 == pytest.approx(a_box.inertia.moments_kgm2, abs=1e-9)


def test_a_mesh_lies_on_another_by_its_hull(tmp_path: Path) -> None:
    write_box(tmp_path / "slab.obj", (-0.5, -0.5, 0.0), (0.5, 0.5, 0.1))
    write_box(tmp_path / "block.stl", (-0.1, -0.1, -0.3), (0.1, 0.1, 0.1))
    slab = {"shape": "mesh", "file": "slab.obj", "position_m": [1.0, 0.2, 0.5]}
    block = {"shape": "mesh", "file": "block.stl", "lies_on": "slab", "mass_kg": 1.0}
    ball = {"shape": "sphere", "radius_m": 0.05, "lies_on": "slab", "rpy_rad": [1.0, 0.0, 0.0]}
    turned = {**block, "rpy_rad": [1.5707963267948966, 0.0, 0.0]}
    config = load_bodies(tmp_path, slab=slab, block=block, sphere=ball, turned=turned)
    heights = {body.link.name: body.placement.xyz for body in bodies_of(config)}
    assert heights["block"] == pytest.approx((1.0, 0.2, 0.9))
    assert heights["sphere"] == pytest.approx((1.0, 0.2, 0.65))
    assert heights["turned"] == pytest.approx((1.0, 0.2, 0.7))


def test_a_urdf_is_one_body_with_the_spread_of_mass_of_its_links(tmp_path: Path) -> None:
    write_l_shape(tmp_path)
    config = load_bodies(
        tmp_path,
        thing={"shape": "urdf", "file": "l_shape.urdf", "mass_kg": 1.0, "lies_on": "rack"},
        rack={"shape": "box", "size_m": [0.1, 0.1, 0.2]},
    )
    thing = bodies_of(config)[0]
    assert thing.inertia.mass_kg == 1.0
    assert thing.inertia.placement.xyz == pytest.approx((0.0, 0.0, 0.125))
    # Two of 2 kg, each 0.125 m from the middle, weigh 1 kg together here.
    assert thing.inertia.diagonal == pytest.approx([(2 + 4 * 0.125**2) / 4] * 2 + [0.5])
    assert thing.placement.xyz == pytest.approx((0.0, 0.0, 0.15))
    one, other, _, _ = looks_of(config)
    assert (one.shape, other.shape) == ("box", "mesh")
    # The post stands upright: its y is the vertical.
    assert np.ptp(np.array(other.side_m), axis=0) == pytest.approx([0.2, 0.4], abs=2e-3)


def test_what_a_dataset_carries_is_the_same_body_as_its_source(tmp_path: Path) -> None:
    write_l_shape(tmp_path)
    config = load_bodies(tmp_path, thing={"shape": "urdf", "file": "l_shape.urdf", "mass_kg": 1.0})
    section = config.scene.bodies["thing"]
    (tmp_path / "bodies").mkdir()
    for name, content in files_of(section).items():
        (tmp_path / "bodies" / name).write_bytes(content)
    copy = section.in_directory(tmp_path / "bodies")
    assert Path(copy.file).is_file()
    assert files_of(copy) == files_of(section)
    Path(copy.file).write_text(Path(copy.file).read_text().replace("0.4", "0.5"))
    with pytest.raises(ConfigError, match="is not the file of the body's sha256"):
        files_of(
            copy.model_copy(update={"file": str(tmp_path / "." / "bodies" / ".." / "bodies" / Path(copy.file).name)})
        )


def test_what_a_dataset_carries_is_read_and_drawn_without_the_library_of_poses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_l_shape(tmp_path)
    config = load_bodies(tmp_path, thing={"shape": "urdf", "file": "l_shape.urdf", "mass_kg": 1.0})
    (tmp_path / "bodies").mkdir()
    for name, content in files_of(config.scene.bodies["thing"]).items():
        (tmp_path / "bodies" / name).write_bytes(content)
    for module in (body_files, joint_model, mesh):
        monkeypatch.setattr(module, "pinocchio", None)
    config = config.with_files_in(tmp_path)
    assert len(files_of(config.scene.bodies["thing"])) == 2
    assert [look.shape for look in looks_of(config)] == ["box", "mesh", "sphere"]


def flat(directory: Path) -> dict[str, object]:
    write_box(directory / "flat.stl", (0, 0, 0), (1, 1, 0))
    return {"shape": "mesh", "file": "flat.stl"}


def impossible(directory: Path) -> dict[str, object]:
    write_l_shape(directory, L_SHAPE.replace('ixx="1"', 'ixx="9"'))
    return {"shape": "urdf", "file": "l_shape.urdf"}


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (flat, "flat.stl: the mesh is flat"),
        (lambda _: {"shape": "mesh", "file": "lost.stl"}, "lost.stl: cannot be read as a mesh: No such file"),
        (impossible, "l_shape.urdf: its body has principal moments of inertia"),
    ],
)
def test_a_file_that_is_no_body_is_refused_with_key_line_and_file(tmp_path: Path, write, message: str) -> None:
    body = write(tmp_path)
    with pytest.raises(ConfigError) as caught:
        load_bodies(tmp_path, thing=body)
    (problem,) = caught.value.problems
    assert (problem.key, problem.line) == ("scene.bodies.thing.file", 4)
    assert message in problem.message


def test_the_object_is_no_mesh(tmp_path: Path) -> None:
    write_box(tmp_path / "crate.stl", (0, 0, 0), (0.1, 0.1, 0.1))
    path = tmp_path / "config.yaml"
    path.write_text("trials: 1\nobject: crate\nscene: {bodies: {crate: {shape: mesh, file: crate.stl, mass_kg: 1}}}\n")
    with pytest.raises(ConfigError, match="should be a box, cylinder or sphere with a mass_kg, none, got crate"):
        load(path)
