"""Pinocchio, imported when it is first used: reading a dataset asks the robot for names of joints, and not for more."""

from typing import TYPE_CHECKING

from throwcollect.extras import lazily

if TYPE_CHECKING:
    import pinocchio as pinocchio
else:
    pinocchio = lazily("pinocchio")
