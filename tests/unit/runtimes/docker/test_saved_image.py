"""Saving images to files with a fake engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
from docker.errors import APIError

from throwcollect.errors import DatasetError, WorkerError
from throwcollect.runtimes.docker import image as saved_image
from throwcollect.runtimes.docker.image import default_tag, save_image


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """A client of an engine that has all images, none of them outdated."""
    client = Mock()
    client.images.get.return_value.save.return_value = iter([b"first ", b"second"])
    monkeypatch.setattr(saved_image, "connect", lambda: client)
    for name, answer in {"is_there": True, "is_outdated": False, "ensure": None, "build": 0}.items():
        monkeypatch.setattr(saved_image, name, Mock(return_value=answer))
    return client


def save(archive: Path, image: str | None = None) -> list[str]:
    said: list[str] = []
    save_image(archive, image, base="base", wheelhouse=None, say=said.append)
    return said


def test_an_image_that_is_up_to_date_is_saved_without_a_build(client: Mock, tmp_path: Path) -> None:
    assert save(tmp_path / "image.tar") == [f"saving {default_tag()}"]
    assert (tmp_path / "image.tar").read_bytes() == b"first second"
    saved_image.build.assert_not_called()
    client.close.assert_called_once()


@pytest.mark.parametrize(("name", "answer"), [("is_there", False), ("is_outdated", True)])
def test_a_missing_or_outdated_image_is_built_before_it_is_saved(
    client: Mock, tmp_path: Path, name: str, answer: bool
) -> None:
    getattr(saved_image, name).return_value = answer
    assert "of these sources; building it" in save(tmp_path / "image.tar")[0]
    assert saved_image.build.call_args.kwargs["base"] == "base"


def test_errors_of_the_engine_and_of_the_disk_while_saving_differ(
    client: Mock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(error: Exception) -> Callable[..., Iterator[bytes]]:
        def send(**_: object) -> Iterator[bytes]:
            yield b"first "
            raise error

        return send

    for error in (APIError("it broke"), ConnectionResetError(104, "Connection reset by peer")):
        client.images.get.return_value.save = fail(error)
        with pytest.raises(WorkerError, match=f"does not hand out the image {default_tag()}"):
            save(tmp_path / "image.tar")
    with pytest.raises(DatasetError, match="cannot be written: No such file or directory"):
        save(tmp_path / "missing" / "image.tar")
