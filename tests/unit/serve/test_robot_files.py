"""Files of the meshes of installed robots."""

from pathlib import Path

import pytest

from throwcollect.errors import NotFoundError
from throwcollect.serve import robot_files
from throwcollect.serve.robot_files import find_mesh


def test_links_that_lead_out_of_a_package_are_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "robot"
    package.mkdir()
    (tmp_path / "secret").write_text("key")
    (package / "mesh.stl").symlink_to(tmp_path / "secret")
    (package / "own.stl").write_text("own")
    monkeypatch.setattr(robot_files, "_find_packages", lambda: {"robot": package})
    assert find_mesh("robot", "own.stl") == package / "own.stl"
    with pytest.raises(NotFoundError, match="no mesh"):
        find_mesh("robot", "mesh.stl")
