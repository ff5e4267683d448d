"""REST on collections: to download their datasets, and to resume them."""

from __future__ import annotations

import asyncio
import io
import os
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse, HTMLResponse, StreamingResponse

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.dataset.directory import CARD, MANIFEST, PROVENANCE
from throwcollect.dataset.manifest import FileEntry, read_manifest
from throwcollect.errors import ConflictError, NotFoundError
from throwcollect.files import check_regular, open_regular
from throwcollect.serve.instances import Instances
from throwcollect.serve.state import InstanceState, describe

_PIECE_BYTES = 1 << 20
_OWN_FILES = {CARD, PROVENANCE}
"""Files that the manifest leaves out, because they differ between two collections of the same dataset."""


def make_dataset_routes(instances: Instances) -> APIRouter:
    """Make the routes on collections."""
    router = APIRouter(prefix="/collections/{instance}")
    reporting = asyncio.Lock()

    @router.post("/resume", status_code=202)
    def resume(instance: str) -> InstanceState:
        """Go on with a dataset whose collection has ended before its last trial, as a run of its own."""
        return describe(instances.resume(instance))

    @router.get("/files")
    def files(instance: str) -> tuple[FileEntry, ...]:
        """The files of a finished dataset, with their digests."""
        return read_manifest(_find_finished(instances, instance))

    @router.get("/files/{path:path}", response_class=FileResponse)
    def file(instance: str, path: str) -> FileResponse:
        """A file of a finished dataset, or a part of it."""
        return FileResponse(_find_file(_find_finished(instances, instance), path))

    @router.get("/dataset.tar", response_class=StreamingResponse)
    def archive(instance: str) -> StreamingResponse:
        """A finished dataset as one file."""
        directory = _find_finished(instances, instance)
        for path in _list_names(directory):
            # Check every file first: once the first bytes are sent, the answer cannot become an error any more.
            _find_file(directory, path)
        name = f'attachment; filename="{instance}.tar"'
        return StreamingResponse(
            _archive(directory, instance), media_type="application/x-tar", headers={"Content-Disposition": name}
        )

    @router.get("/report", response_class=HTMLResponse)
    async def report(instance: str) -> HTMLResponse:
        """The report on a finished dataset: one page with everything inside."""
        # A report needs 100 MB and a core for seconds. Clients that wait for theirs hold no thread, as others need it.
        async with reporting:
            return await asyncio.to_thread(lambda: _report(_find_finished(instances, instance), instance))

    return router


def get_collection(instances: Instances, instance: str) -> Run:
    """Find a run whose dataset has a directory on this machine."""
    run = instances.get(instance)
    if run.record.kind != "collection":
        raise NotFoundError(f"run {instance} has no dataset in a directory")
    return run


def _find_file(directory: Path, path: str) -> Path:
    """A file of a dataset."""
    if path not in _list_names(directory) or not (directory / path).exists():
        raise NotFoundError(f"{directory}: the dataset has no file {path!r}")
    check_regular(directory / path)
    return directory / path


def _report(directory: Path, name: str) -> HTMLResponse:
    """Write the report on a dataset."""
    from throwcollect.publish.report.sections import write_report

    with tempfile.TemporaryDirectory(prefix="throwcollect-report-") as scratch:
        page = Path(scratch) / "report.html"
        write_report(directory, page)
        disposition = f'attachment; filename="{name}.html"'
        return HTMLResponse(page.read_bytes(), headers={"Content-Disposition": disposition})


def is_finished(directory: Path) -> bool:
    """Whether a dataset has come to its end, and no run goes on with it."""
    # A dataset that another run continues is not finished, even if it has a manifest.
    grows = any(each.status == "running" for each in Records().into(directory))
    return not grows and (directory / MANIFEST).is_file()


def _find_finished(instances: Instances, instance: str) -> Path:
    """Directory of the finished dataset of a run."""
    run = get_collection(instances, instance)
    directory = run.record.directory
    if not is_finished(directory):
        raise ConflictError(f"run {instance}: its dataset is not finished")
    return directory


def _list_names(directory: Path) -> list[str]:
    return [
        *(each.path for each in read_manifest(directory)),
        MANIFEST,
        *sorted(_OWN_FILES & set(os.listdir(directory))),
    ]


def _archive(directory: Path, name: str) -> Iterator[bytes]:
    """Write a tar archive of a dataset piece by piece; equal files give equal archives."""
    # `tarfile` would write the whole archive to a file, but here the client decides when it takes the next piece.
    for path in _list_names(directory):
        with open(open_regular(directory / path), "rb") as file:
            entry = tarfile.TarInfo(f"{name}/{path}")
            entry.size = file.seek(0, io.SEEK_END)
            entry.mode = 0o644
            file.seek(0)
            yield entry.tobuf(tarfile.PAX_FORMAT)
            rest = entry.size
            while piece := file.read(min(rest, _PIECE_BYTES)):
                rest -= len(piece)
                yield piece
            yield bytes(-entry.size % tarfile.BLOCKSIZE)
    yield bytes(2 * tarfile.BLOCKSIZE)
