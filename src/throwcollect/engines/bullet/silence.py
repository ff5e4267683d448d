"""Imports Bullet without the line by which it tells on standard error when it was built."""

import os


def _import_bullet() -> None:
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        import pybullet  # noqa: F401 - whoever imports it later gets this one
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_import_bullet()
