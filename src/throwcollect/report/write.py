"""Writes a report."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from throwcollect.dataset.new_directory import new_directory
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.report.dataset_facts import Facts, gather


@dataclass(frozen=True)
class Written:
    """What a report consists of.

    Attributes:
        page: The page.
        pictures: PNG files; none if they were not asked for.
    """

    page: Path
    pictures: tuple[Path, ...]


def write_report(directory: Path, page: Path, *, pictures: Path | None = None) -> Written:
    """Report on a dataset.

    Args:
        directory: Directory of the dataset.
        page: HTML file to write, which must not exist.
        pictures: Directory for pictures, which must not exist or be empty; None for a page alone.

    Raises:
        ConfigError: If what draws is not installed, or a file is there already.
        DatasetError: If the directory holds no finished dataset, it is damaged, or the report cannot be written.
    """
    _check_installed("plotly", *(("matplotlib",) if pictures else ()))
    if page.exists():
        raise ConfigError(
            f"{page}: exists", expected="a file that is new", hint="choose another --output, or remove it"
        )
    if pictures is None:
        _write_page(gather(Dataset.open(directory)), page)
        return Written(page, ())
    with new_directory(pictures) as beside:
        from throwcollect.report.pictures import write_pictures

        facts = gather(Dataset.open(directory))
        names = [path.name for path in write_pictures(facts, beside)]
        _write_page(facts, page)
    return Written(page, tuple(pictures / name for name in names))


def _write_page(facts: Facts, path: Path) -> None:
    from throwcollect.report.page import page

    write_file(path, page(facts).encode())


def _check_installed(*packages: str) -> None:
    if missing := [name for name in packages if find_spec(name) is None]:
        raise ConfigError(
            f"a report needs {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} not installed",
            hint="pip install 'throwcollect[report]'",
        )
