"""The process of one simulation."""

from __future__ import annotations

import signal
from pathlib import Path

from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.heartbeat import Heartbeat, ready_line
from throwcollect.members import load_member
from throwcollect.ros.self_check import begin_to_serve
from throwcollect.sim.simulation import Simulation
from throwcollect.sim.simulation_node import SimulationNode

_made: list[Simulation] = []
"""The simulation that `make_ahead` has made, until `run` takes it."""


def make_ahead(config: Config) -> None:
    """Make a simulation, if its engine can be forked; processes that are forked off this one then `run` it."""
    if load_member("engines", config.sim.engine).can_be_forked:
        _made.append(Simulation(config))


def _take(config: Config) -> Simulation:
    """Take the simulation that was made ahead if it has this configuration, or else make one."""
    while _made:
        simulation = _made.pop()
        if simulation.config == config:
            return simulation
        simulation.world.close()
    return Simulation(config)


def run(config: Path, *, name: str, namespace: str | None = None) -> None:
    """Serve one simulation until SIGTERM, SIGINT or SIGHUP, or until a client sets its state to quitting.

    While a trial runs, the process reads messages between two stretches; otherwise it sleeps until a message arrives.

    Args:
        config: YAML file of the collection.
        name: Name of the node.
        namespace: Namespace of the node; None for the root if `run.root_namespace` says so, otherwise ``/<name>``.
    """
    simulation = _take(load(config))
    if namespace is None and simulation.config.run.root_namespace:
        namespace = "/"
    ros.init()
    try:
        node = SimulationNode(name, simulation, namespace=namespace)
    except ros.NameValidationException as error:
        raise ConfigError(str(error)) from error
    nodes = (node, *node.other_nodes)
    executor, stopped = begin_to_serve(*nodes)
    heartbeat = Heartbeat()
    print(ready_line(name), flush=True)
    try:
        while not stopped() and not node.quitting:
            heartbeat.beat()
            # Messages come first, so that a cancel or a reset has its effect before time goes on.
            ros.spin_some(executor, timeout_sec=0.0 if simulation.running else node.patience_s)
            if simulation.running:
                node.advance()
            node.follow_up()
        node.get_logger().info(f"ends: {signal.Signals(stopped()).name if stopped() else 'a client asked for it'}")
    finally:
        for served in reversed(nodes):
            served.destroy_node()
        ros.shutdown()
