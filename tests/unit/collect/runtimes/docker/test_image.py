"""The image of containers with a fake engine: whether it is there, may be pulled, and is of these sources."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from docker.errors import APIError, ImageNotFound

from throwcollect.collect.runtimes.docker.docker_engine import ensure
from throwcollect.collect.runtimes.image_sources import are_others, digest_sources
from throwcollect.errors import WorkerError


class Engine:
    """Images by name, and a registry from which others are pulled."""

    def __init__(self, *images: str, registry: tuple[str, ...] = ()) -> None:
        self.here = set(images)
        self.registry = registry
        self.images = self

    def get(self, name: str) -> SimpleNamespace:
        if name not in self.here:
            raise ImageNotFound(f"no such image: {name}")
        return SimpleNamespace(labels={})

    def pull(self, name: str) -> SimpleNamespace:
        if name not in self.registry:
            raise APIError("500 Server Error", explanation="no such host")
        self.here.add(name)
        return self.get(name)


@pytest.fixture
def said() -> list[str]:
    return []


def test_a_missing_image_other_than_the_default_is_pulled(said: list[str]) -> None:
    engine = Engine(registry=("lab/throws:2",))
    ensure(engine, "lab/throws:2", say=said.append)
    assert engine.here == {"lab/throws:2"}
    assert said == ["image lab/throws:2 is not here; pulling it"]
    with pytest.raises(WorkerError, match=r"lab/throws:3 is not here and cannot be pulled.*no such host"):
        ensure(engine, "lab/throws:3", say=said.append)


def test_an_image_is_outdated_if_its_label_names_other_sources(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for label, outdated in ((None, False), ("unknown", False), (digest_sources(), False), ("0" * 64, True)):
        assert are_others(label) == outdated
    # A package outside of a clone has no sources to compare with.
    monkeypatch.setattr("throwcollect.collect.runtimes.image_sources._CLONE", tmp_path)
    assert not are_others("0" * 64)
