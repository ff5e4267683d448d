"""Prepares the process that nodes are forked from, when that process imports this module; no other does.

It imports what all nodes need, works out what all simulations of a configuration begin with, has a session of its own,
which no terminal ends, and ends without taking the interpreter apart.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import sys
from contextlib import suppress

from throwcollect.collect.runtimes.local import FORESEEN
from throwcollect.own_process import prepare_environment
from throwcollect.ros.middleware import Middleware

_IMPORTED = (
    "throwcollect.cli.main",
    "throwcollect.cli.node_commands",
    "throwcollect.collect.coordinator_node.node",
    "throwcollect.collect.runtimes.local",
    "throwcollect.ros.nodes.simulation.process",
    "throwcollect.ros.router",
    "pinocchio",
)

os.setsid()
prepare_environment()
Middleware().settle()
for _name in _IMPORTED:
    importlib.import_module(_name)
# If anything is wrong with the configuration, or there is none, the simulations say so.
with suppress(Exception):
    sys.modules["throwcollect.ros.nodes.simulation.process"].foresee(os.environ.pop(FORESEEN))
# The garbage collector does not write to frozen objects, so that forked processes share their memory.
gc.collect()
gc.freeze()
atexit.register(os._exit, 0)
