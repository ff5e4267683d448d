"""Archives of images: they are unpacked into a directory that Apptainer reads, and other files are refused."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zstandard

from throwcollect.errors import ConfigError
from throwcollect.runtimes.apptainer.archive import check_archive, unpack_archive

PLAIN, PACKED, LINKED = "a/layer.tar", "b/layer.tar", "c/layer.tar"


def write_archive(path: Path, *entry_points: str, manifest: bytes | None = None) -> Path:
    """An archive with an image without layers for each entry point."""
    files = {f"{number}.json": describe_image(entry_point=name) for number, name in enumerate(entry_points)}
    images = [{"Config": name, "Layers": []} for name in files]
    return write_files(path, {**files, "manifest.json": manifest or json.dumps(images).encode()})


def describe_image(*layers: bytes, entry_point: str = "throwcollect") -> bytes:
    """The configuration of an image with layers of these contents, without compression."""
    digests = [f"sha256:{hashlib.sha256(layer).hexdigest()}" for layer in layers]
    image = {"config": {"Entrypoint": [entry_point]}, "rootfs": {"type": "layers", "diff_ids": digests}}
    return json.dumps(image).encode()


def write_files(path: Path, contents: dict[str, bytes], links: dict[str, str] | None = None) -> Path:
    with tarfile.open(path, "w") as archive:
        for name, content in contents.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
        for name, target in (links or {}).items():
            info = tarfile.TarInfo(name)
            info.type, info.linkname = tarfile.SYMTYPE, target
            archive.addfile(info)
    return path


@pytest.mark.parametrize(
    ("compress", "ending"),
    [(bytes, ""), (gzip.compress, "+gzip"), (zstandard.ZstdCompressor().compress, "+zstd")],
)
def test_an_image_is_unpacked_into_the_layout_of_oci(
    compress: Callable[[bytes], bytes], ending: str, tmp_path: Path
) -> None:
    plain, packed = bytes(10_000), compress(b"more" * 1000)
    config = describe_image(plain, b"more" * 1000, plain)
    image = {"Config": "it.json", "Layers": [PLAIN, PACKED, LINKED]}
    files = {"it.json": config, PLAIN: plain, PACKED: packed, "manifest.json": json.dumps([image]).encode()}
    # A Docker engine stores a repeated layer as a link.
    archive = write_files(tmp_path / "image.tar", files, {LINKED: f"../{PLAIN}"})

    unpack_archive(archive, tmp_path / "image")

    assert json.loads((tmp_path / "image" / "oci-layout").read_text()) == {"imageLayoutVersion": "1.0.0"}
    (found,) = json.loads((tmp_path / "image" / "index.json").read_text())["manifests"]
    manifest = json.loads(read(tmp_path / "image", found))
    assert read(tmp_path / "image", manifest["config"]) == config
    layers = manifest["layers"]
    assert [read(tmp_path / "image", layer) for layer in layers] == [plain, packed, plain]
    assert [layer["mediaType"].partition(".tar")[2] for layer in layers] == ["", ending, ""]


def read(layout: Path, reference: dict[str, Any]) -> bytes:
    """The content that a reference in a layout names."""
    algorithm, _, digest = reference["digest"].partition(":")
    content = (layout / "blobs" / algorithm / digest).read_bytes()
    assert (len(content), hashlib.sha256(content).hexdigest()) == (reference["size"], digest)
    return content


def test_a_file_that_is_no_archive_of_our_image_is_refused(tmp_path: Path) -> None:
    nothing = tmp_path / "nothing.tar"
    with pytest.raises(ConfigError, match=r"nothing\.tar: No such file or directory"):
        check_archive(nothing)
    nothing.write_bytes(b"no archive at all" * 1000)
    with pytest.raises(ConfigError, match=r"nothing\.tar: is no archive of an image"):
        check_archive(nothing)
    for manifest in (b"[", b"{}", b"[1]", b'[{"Config": "other"}]'):
        with pytest.raises(ConfigError, match=r"is no archive of an image|holds 0 images"):
            check_archive(write_archive(nothing, manifest=manifest))
    with pytest.raises(ConfigError, match="holds an image that is not of throwcollect"):
        check_archive(write_archive(nothing, "bash"))
    with pytest.raises(ConfigError, match="holds 2 images"):
        check_archive(write_archive(nothing, "throwcollect", "throwcollect"))
