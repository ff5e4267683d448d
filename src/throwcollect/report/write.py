"""Writes a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import new_directory, write_file


@dataclass(frozen=True)
class Written:
    """Files of a report.

    Attributes:
        page: The page.
        pictures: PNG files; none if they were not asked for.
    """

    page: Path
    pictures: tuple[Path, ...]


def write_report(directory: Path, page: Path, *, pictures: Path | None = None, model: Path | None = None) -> Written:
    """Write a report on a dataset.

    Args:
        directory: Directory of the dataset.
        page: HTML file to write, which must not exist.
        pictures: Directory for pictures, which must not exist or be empty; None for a page alone.
        model: Directory of a model that was learned from the dataset; None for none.

    Raises:
        MissingExtraError: If a library that draws is not installed.
        ConfigError: If a file is there already, or the model was learned from another dataset.
        DatasetError: If the directory holds no finished dataset, it is damaged, or the report cannot be written.
    """
    require("jinja2", "plotly", *(("matplotlib",) if pictures else ()))
    from throwcollect.report.page import render_page
    from throwcollect.report.sections import report_dataset

    if page.exists():
        raise ConfigError(
            f"{page}: exists", expected="a file that is new", hint="choose another --output, or remove it"
        )
    if pictures is None:
        write_file(page, render_page(report_dataset(Dataset.open(directory), model=model)).encode())
        return Written(page, ())
    with new_directory(pictures) as beside:
        from throwcollect.report.pictures import write_pictures

        report = report_dataset(Dataset.open(directory), model=model)
        names = [path.name for path in write_pictures(report.sections, beside)]
        write_file(page, render_page(report).encode())
    return Written(page, tuple(pictures / name for name in names))
