"""Pinocchio, imported when it is first used, because a reader of datasets needs only the names of a robot's joints."""

from typing import TYPE_CHECKING

from throwcollect.extras import lazily

if TYPE_CHECKING:
    import pinocchio as pinocchio
else:
    pinocchio = lazily("pinocchio")
