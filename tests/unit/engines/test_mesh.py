import numpy as np
import pytest

from throwcollect.engines.mesh import STL, Mesh, encode
from throwcollect.errors import ConfigError

CORNERS = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 2.5]]], np.float32)
ASCII = "solid x\n" + "".join(
    "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in each) + "endloop\nendfacet\n"
    for each in CORNERS
)


def test_binary_stl_is_read(tmp_path):
    facets = b"".join(bytes(12) + corners.tobytes() + bytes(2) for corners in CORNERS)
    whole = bytes(80) + len(CORNERS).to_bytes(4, "little") + facets
    # Some programs write more behind the triangles.
    for content in (whole, whole + b"color"):
        (tmp_path / "mesh.STL").write_bytes(content)
        assert Mesh(tmp_path / "mesh.STL").triangles.tolist() == CORNERS.tolist()


def test_stl_as_text_is_read(tmp_path):
    (tmp_path / "mesh.stl").write_text(ASCII + "endsolid x\n")
    (tmp_path / "upper.stl").write_text((ASCII + "endsolid x\n").upper())
    for name in ("mesh.stl", "upper.stl"):
        assert Mesh(tmp_path / name).triangles.tolist() == CORNERS.tolist()


def test_faces_of_obj_are_split_into_triangles(tmp_path):
    square = "# a square\nv 0 0 0\nv 1 0 0 1.0\nvn 0 0 1\nv 1 1 0\nv 0 1 0\n\nf 1/1/1 2//1 -2 -1\n"
    (tmp_path / "mesh.obj").write_text(square)
    assert Mesh(tmp_path / "mesh.obj").triangles.tolist() == [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
    ]


def test_triangles_are_written_with_their_normals():
    flat = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]]], np.float32)
    written = np.frombuffer(encode(np.concatenate([CORNERS, flat])), STL, offset=84)
    assert written["normal"] == pytest.approx(np.array([[0, 0, 1], [0, -0.832050, 0.554700], [0, 0, 0]]), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("mesh.dae", b"<COLLADA/>", "cannot be read as a mesh"),
        ("mesh.stl", bytes(84), "without triangles"),
        ("mesh.stl", b"solid x\nvertex 0 0 0\nendsolid", "cannot be read as a mesh"),
        ("mesh.obj", b"v 0 0 0\nf 0 0 0\n", "a face uses vertex 0 of 1"),
        ("mesh.obj", bytes(range(256)), "without triangles"),
    ],
)
def test_meshes_that_cannot_be_used_are_refused_by_their_names(name, content, words, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError, match=f"{name}: .*({words})|{words}") as refused:
        _ = Mesh(tmp_path / name).triangles
    assert name in str(refused.value)
