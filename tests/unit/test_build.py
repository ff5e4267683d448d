"""What the digest of a build has to see."""

from importlib.metadata import EntryPoint, EntryPoints

import pytest

from throwcollect import build


def test_packages_that_add_members_are_part_of_the_build(monkeypatch: pytest.MonkeyPatch) -> None:
    before = build.build_digest.__wrapped__()
    points = EntryPoints([EntryPoint("free_fall", "lab:FreeFall", "throwcollect.engines"), EntryPoint("x", "y:z", "x")])
    monkeypatch.setattr(build, "entry_points", points.select)
    assert [fact for fact in build._facts() if "lab" in fact] == [
        "throwcollect.engines free_fall: lab:FreeFall of an unknown package"
    ]
    assert not [fact for fact in build._facts() if "y:z" in fact]
    assert build.build_digest.__wrapped__() != before
