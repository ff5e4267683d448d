"""Imports Bullet without the line with its build time that it prints to standard error."""

import os


def _import_bullet() -> None:
    # The descriptor is redirected and not `sys.stderr`, because Bullet prints from C.
    stderr, devnull = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 2)
    try:
        import pybullet  # noqa: F401 - later imports of it return this module
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(devnull)


_import_bullet()
