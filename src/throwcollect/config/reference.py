"""Prints the reference of all keys: ``python -m throwcollect.config.reference [--output FILE]``."""

from __future__ import annotations

import argparse
from pathlib import Path

from throwcollect import members
from throwcollect.files import write_file


def main() -> None:
    """Print the reference, or write it into a file."""
    parser = argparse.ArgumentParser(
        prog="python -m throwcollect.config.reference", description="Reference of all keys"
    )
    parser.add_argument("--output", type=Path, metavar="FILE", help="write the page to this file once it is complete")
    output: Path | None = parser.parse_args().output
    # The page must not depend on what is installed beside throwcollect.
    members.leave_out_others()
    # Imported only now, because the import makes the kinds of keys from the members that are not left out.
    from throwcollect.config.reference_page import page

    if output is None:
        print(page(), end="")
    else:
        write_file(output, page().encode())


if __name__ == "__main__":
    main()
