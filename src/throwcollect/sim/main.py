"""The process of one simulation."""

from __future__ import annotations

import gc
import signal
from pathlib import Path
from types import FrameType

from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.interruption import stop_signals
from throwcollect.sim.node import SimulationNode
from throwcollect.sim.simulation import Simulation


def _nothing() -> None:
    """Work that marks a place among the inputs."""


def _take_inputs(executor: ros.Executor) -> None:
    """Handle the inputs that have come by now, but none that come meanwhile."""
    last = executor.create_task(_nothing)
    while not last.done():
        executor.spin_once(timeout_sec=0.0)


def run(config: Path, *, name: str) -> None:
    """Serve one simulation until SIGTERM, SIGINT or SIGHUP, or until a client sets its state to quitting.

    Inputs are looked at between slices of a running trial; otherwise the process sleeps until one arrives.

    Args:
        config: YAML file of the collection.
        name: Name of the node and of its namespace.

    Raises:
        ConfigError: If the configuration cannot be used.
        WorkerError: If the physics engine does not start.
    """
    simulation = Simulation(load(config))
    ros.init()
    node = SimulationNode(name, simulation)
    executor = ros.SingleThreadedExecutor()
    for each in (node, *node.companions):
        executor.add_node(each)
    stopped = False

    def stop(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    for number in stop_signals():
        signal.signal(number, stop)
    # What is here now stays until the end; the garbage collector need not go through it again and again.
    gc.freeze()
    print(f"{name} is ready", flush=True)
    try:
        while not stopped and not node.quitting:
            if not simulation.running:
                executor.spin_once(timeout_sec=node.patience_s)
            _take_inputs(executor)
            if simulation.running:
                simulation.advance(watched=node.watched)
            node.follow_up()
    finally:
        for each in (*node.companions, node):
            each.destroy_node()
        ros.shutdown()
