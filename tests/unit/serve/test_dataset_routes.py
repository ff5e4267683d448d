"""Routes by which clients get files and archive of a dataset."""

from __future__ import annotations

import hashlib
import io
import shutil
import tarfile
from pathlib import Path

import pytest
from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember, make_end_fields

from throwcollect.publish.report import sections

URL = "/api/v1/collections"


@pytest.fixture
def directory(collected: Path, tmp_path: Path, remember: Remember) -> Path:
    """The dataset of a run that has ended."""
    directory = tmp_path / "datasets" / "a"
    shutil.copytree(collected, directory)
    remember("a", **make_end_fields())
    return directory


def test_the_listed_files_are_those_of_the_dataset(client: TestClient, directory: Path) -> None:
    listed = client.get(f"{URL}/a/files").json()
    assert {"config.yaml", "throws.parquet"} <= {each["path"] for each in listed}
    for each in listed:
        content = client.get(f"{URL}/a/files/{each['path']}").content
        assert (len(content), hashlib.sha256(content).hexdigest()) == (each["bytes"], each["sha256"])
    for name in ("datapackage.json", "README.md", "provenance.json"):
        assert client.get(f"{URL}/a/files/{name}").content == (directory / name).read_bytes()
    part = client.get(f"{URL}/a/files/throws.parquet", headers={"Range": "bytes=0-3"})
    assert (part.status_code, part.content) == (206, b"PAR1")
    assert client.get(f"{URL}/a/files/throws.parquet", headers={"Range": "bytes=99999999-"}).status_code == 416


def test_files_that_do_not_belong_to_the_dataset_are_not_found(
    client: TestClient, directory: Path, tmp_path: Path
) -> None:
    (tmp_path / "secret").write_text("secret")
    (directory / "notes.txt").write_text("mine")
    paths = [
        "notes.txt",
        "logs",
        "logs/events.jsonl",
        "../../secret",
        "..%2f..%2fsecret",
        f"{tmp_path}/secret",
        "",
        "%2e",
        "%00",
    ]
    for path in (*paths, "%2e/config.yaml", "logs%2f..%2fconfig.yaml", "CONFIG.YAML", 300 * "a"):
        assert client.get(f"{URL}/a/files/{path}").status_code == 404, path


@pytest.mark.parametrize("name", ["throws.parquet", "README.md", "provenance.json", "datapackage.json"])
def test_a_symbolic_link_in_a_dataset_is_not_followed(
    client: TestClient, directory: Path, tmp_path: Path, name: str
) -> None:
    (tmp_path / "secret").write_text("secret")
    (directory / name).unlink()
    (directory / name).symlink_to(tmp_path / "secret")
    for path in (f"files/{name}", "dataset.tar"):
        answer = client.get(f"{URL}/a/{path}")
        assert answer.status_code == 409
        assert "a symbolic link leads elsewhere" in answer.json()["title"]
        assert "secret\n" not in answer.text


def test_the_archive_holds_all_files_of_the_dataset(client: TestClient, directory: Path) -> None:
    answer = client.get(f"{URL}/a/dataset.tar")
    assert answer.headers["content-disposition"] == 'attachment; filename="a.tar"'
    with tarfile.open(fileobj=io.BytesIO(answer.content)) as archive:
        inside = {member.name: archive.extractfile(member).read() for member in archive if member.isfile()}
    assert inside == {f"a/{path.name}": path.read_bytes() for path in directory.iterdir() if path.is_file()}
    assert client.get(f"{URL}/a/dataset.tar").content == answer.content


def test_the_report_of_a_finished_dataset_is_one_page_and_leaves_no_file(
    client: TestClient, directory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(directory: Path, page: Path) -> None:
        page.write_text(f"<title>{directory.name}</title></html>")

    # The report itself takes ten seconds, and has tests of its own.
    monkeypatch.setattr(sections, "write_report", write)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "scratch"))
    (tmp_path / "scratch").mkdir()
    before = sorted(directory.rglob("*"))
    answer = client.get(f"{URL}/a/report")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert answer.text == "<title>a</title></html>"
    assert sorted(directory.rglob("*")) == before
    assert not list((tmp_path / "scratch").iterdir())


def test_files_of_an_unfinished_dataset_are_refused(client: TestClient, directory: Path, remember: Remember) -> None:
    remember("growing", directory=str(directory))
    remember("torn", **make_end_fields(exit_code=3))
    remember("session", **make_end_fields(kind="session"))
    for what in ("files", "files/config.yaml", "dataset.tar", "report"):
        found = {name: client.get(f"{URL}/{name}/{what}").status_code for name in ("growing", "torn")}
        assert found == {"growing": 409, "torn": 409}, what
    for what in ("files", "files/config.yaml", "dataset.tar", "report", "throws", "throws/0"):
        for name in ("session", "nobody", ".."):
            assert client.get(f"{URL}/{name}/{what}").status_code == 404, (name, what)


def test_files_of_a_dataset_that_another_run_continues_are_refused(
    client: TestClient, directory: Path, remember: Remember
) -> None:
    """A second run collects into the directory of an ended one."""
    assert client.get(f"{URL}/a/files").status_code == 200
    remember("again", directory=str(directory))
    assert client.get(f"{URL}/a/files").status_code == 409
