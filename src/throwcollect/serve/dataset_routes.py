"""REST on collections: to download their datasets, and to resume them."""

from __future__ import annotations

import asyncio
import io
import os
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import FileResponse, StreamingResponse
from pydantic import BaseModel
from starlette.background import BackgroundTask

from throwcollect.config.loader import load
from throwcollect.dataset.directory import CARD, JOURNAL, MANIFEST, PROVENANCE, THROWS, config_path
from throwcollect.dataset.journal import read_commits
from throwcollect.dataset.manifest import FileEntry, read_manifest, size_of_file
from throwcollect.errors import ConflictError, NotFoundError
from throwcollect.files import check_regular, open_regular
from throwcollect.runs.records import Records
from throwcollect.runs.run import Run
from throwcollect.serve.instances import Instances
from throwcollect.serve.state import InstanceState, describe
from throwcollect.sweep.parquet_file import read_parquet

_PIECE_BYTES = 1 << 20
_OWN_FILES = {CARD, PROVENANCE}
"""Files that the manifest leaves out, because they differ between two collections of the same dataset."""
_MOST_LANDINGS = 20_000
_JOURNAL_BYTES = 4_000_000
"""Most landings, and most bytes of a journal (about 15,000 throws), for one answer."""


class LandingPoints(BaseModel):
    """Where throws came down.

    Attributes:
        landings: x and y [m], outcome and trial; a trial that was collected again may be there twice.
        total: Number of landings that these were evenly chosen from.
        outcomes: Of a finished dataset, how many trials with an episode ended with each outcome.
        following: What to ask for as `first` next, for landings that come later, if the dataset grows.
        is_finished: Whether the dataset is finished.
        has_more: Whether there are later ones by now.
    """

    landings: list[tuple[float, float, str, int]]
    total: int
    outcomes: dict[str, int]
    following: int
    is_finished: bool
    has_more: bool


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
            size_of_file(directory / path)
        name = f'attachment; filename="{instance}.tar"'
        return StreamingResponse(
            _archive(directory, instance), media_type="application/x-tar", headers={"Content-Disposition": name}
        )

    @router.get("/report", response_class=FileResponse)
    async def report(instance: str) -> FileResponse:
        """The report on a finished dataset: one page with everything inside."""
        # A report needs 100 MB and a core for seconds. Clients that wait for theirs hold no thread, as others need it.
        async with reporting:
            return await asyncio.to_thread(lambda: _report(_find_finished(instances, instance), instance))

    @router.get("/landings")
    def landings(instance: str, first: Annotated[int, Query(ge=0)] = 0) -> LandingPoints:
        """Where throws came down, or pucks rest, of a finished dataset or of one that grows; none for other tasks."""
        directory = _get_collection(instances, instance).context.directory
        end = next(reversed(load(config_path(directory)).task.events), "landing")
        columns = (f"{end}_x_m", f"{end}_y_m", "outcome", "trial")
        if _is_finished(directory):
            return _read_landings(directory, columns)
        return _read_landings_so_far(directory, columns, first)

    return router


def _get_collection(instances: Instances, instance: str) -> Run:
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


def _report(directory: Path, name: str) -> FileResponse:
    """Write the report on a dataset into a file that vanishes when it was sent."""
    from throwcollect.report.sections import write_report

    scratch = tempfile.TemporaryDirectory(prefix="throwcollect-report-")
    page = Path(scratch.name) / f"{name}.html"
    try:
        write_report(directory, page)
    except BaseException:
        scratch.cleanup()
        raise
    return FileResponse(page, filename=page.name, background=BackgroundTask(scratch.cleanup))


def _is_finished(directory: Path) -> bool:
    # A dataset that another run continues is not finished, even if it has a manifest.
    grows = any(each.status == "running" for each in Records().into(directory))
    return not grows and (directory / MANIFEST).is_file()


def _find_finished(instances: Instances, instance: str) -> Path:
    """Directory of the finished dataset of a run."""
    run = _get_collection(instances, instance)
    directory = run.context.directory
    if not _is_finished(directory):
        raise ConflictError(f"run {instance}: its dataset is not finished")
    return directory


def _list_names(directory: Path) -> list[str]:
    return [
        *(each.path for each in read_manifest(directory)),
        MANIFEST,
        *sorted(_OWN_FILES & set(os.listdir(directory))),
    ]


def _read_landings(directory: Path, columns: tuple[str, ...]) -> LandingPoints:
    """Read the landings of a finished dataset."""
    # All columns of a million throws would take half a gigabyte.
    table = read_parquet(directory / THROWS, (*columns, "digest"))
    recorded = table.filter(table["digest"].is_valid())
    outcomes = {each["values"]: each["counts"] for each in recorded["outcome"].value_counts().to_pylist()}
    rows: list[Any] = []
    total = 0
    if set(columns) <= set(table.column_names):
        landed = table.select([*columns]).drop_null()
        total = len(landed)
        # The step is rounded up, so that there are never more landings than allowed.
        some = landed.take([*range(0, total, max(1, -(-total // _MOST_LANDINGS)))])
        rows = list(zip(*(column.to_pylist() for column in some.columns), strict=True))
    return LandingPoints(landings=rows, total=total, outcomes=outcomes, following=0, is_finished=True, has_more=False)


def _read_landings_so_far(directory: Path, columns: tuple[str, ...], first: int) -> LandingPoints:
    """Read the landings of a dataset that grows, from a byte of its journal on."""
    rows, following, has_more = read_commits(directory / JOURNAL, columns, first=first, most_bytes=_JOURNAL_BYTES)
    return LandingPoints(
        landings=rows, total=len(rows), outcomes={}, following=following, is_finished=False, has_more=has_more
    )


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
