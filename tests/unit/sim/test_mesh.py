import numpy as np
import pytest

from throwcollect.errors import RequestError
from throwcollect.sim.mesh import read_mesh

CORNERS = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 2.5]]], np.float32)
ASCII = "solid x\n" + "".join(
    "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in each) + "endloop\nendfacet\n"
    for each in CORNERS
)


def test_binary_stl_is_read(tmp_path):
    facets = b"".join(bytes(12) + corners.tobytes() + bytes(2) for corners in CORNERS)
    (tmp_path / "mesh.STL").write_bytes(bytes(80) + len(CORNERS).to_bytes(4, "little") + facets)
    assert read_mesh(tmp_path / "mesh.STL").tolist() == CORNERS.tolist()


def test_stl_as_text_is_read(tmp_path):
    (tmp_path / "mesh.stl").write_text(ASCII + "endsolid x\n")
    assert read_mesh(tmp_path / "mesh.stl").tolist() == CORNERS.tolist()


def test_faces_of_obj_are_split_into_triangles(tmp_path):
    square = "# a square\nv 0 0 0\nv 1 0 0 1.0\nvn 0 0 1\nv 1 1 0\nv 0 1 0\n\nf 1/1/1 2//1 -2 -1\n"
    (tmp_path / "mesh.obj").write_text(square)
    assert read_mesh(tmp_path / "mesh.obj").tolist() == [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
    ]


@pytest.mark.parametrize(
    ("name", "content", "reason", "words"),
    [
        ("mesh.dae", b"<COLLADA/>", "UNSUPPORTED_ASSETS", "stl or obj"),
        ("mesh.stl", b"", "UNSUPPORTED_ASSETS", "0 bytes are no STL"),
        ("mesh.stl", bytes(84), "UNSUPPORTED_ASSETS", "without triangles"),
        (
            "mesh.stl",
            bytes(80) + b"\xff\xff\xff\xff" + bytes(50),
            "UNSUPPORTED_ASSETS",
            "no STL of 4294967295 triangles",
        ),
        ("mesh.stl", b"solid x\nvertex 0 0 0\n", "UNSUPPORTED_ASSETS", "broken mesh"),
        ("mesh.stl", b"solid x\nvertex a b c\n", "UNSUPPORTED_ASSETS", "broken mesh"),
        ("mesh.stl", ASCII.replace("2.5", "nan").encode(), "UNSUPPORTED_ASSETS", "coordinates beyond 1e\\+06"),
        ("mesh.stl", ASCII.replace("2.5", "1e30").encode(), "UNSUPPORTED_ASSETS", "coordinates beyond 1e\\+06"),
        ("mesh.obj", b"v 0 0 0\nf 1 2 9\n", "UNSUPPORTED_ASSETS", "a face uses vertex 2 of 1"),
        ("mesh.obj", b"v 0 0 0\nf 0 0 0\n", "UNSUPPORTED_ASSETS", "a face uses vertex 0 of 1"),
        ("mesh.obj", b"v 0 0 0\nf -1 -2 -1\n", "UNSUPPORTED_ASSETS", "a face uses vertex -2 of 1"),
        ("mesh.obj", b"v 0 0\nf 1 1 1\n", "UNSUPPORTED_ASSETS", "broken mesh"),
        ("mesh.obj", bytes(range(256)), "UNSUPPORTED_ASSETS", "without triangles"),
        ("mesh.obj", None, "MISSING_ASSETS", "no such file"),
    ],
)
def test_meshes_that_cannot_be_used_are_refused_by_their_names(name, content, reason, words, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RequestError, match=f"{name}: .*({words})|{words}") as refused:
        read_mesh(tmp_path / name)
    assert refused.value.reason == reason
    assert name in str(refused.value)


def test_a_missing_or_too_large_mesh_file_is_refused(tmp_path):
    (tmp_path / "directory.stl").mkdir()
    with pytest.raises(RequestError, match="no such file"):
        read_mesh(tmp_path / "directory.stl")
    with open(tmp_path / "huge.stl", "wb") as file:
        file.truncate(2**40)
    with pytest.raises(RequestError, match="1099511627776 bytes"):
        read_mesh(tmp_path / "huge.stl")
    with pytest.raises(RequestError, match=r"cannot be read|no such file"):
        read_mesh(tmp_path / ("x" * 5000 + ".stl"))
