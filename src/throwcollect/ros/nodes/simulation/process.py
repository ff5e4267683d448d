"""The process of one simulation."""

from __future__ import annotations

import signal
from pathlib import Path

from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import leaves
from throwcollect.episode.channels import Channels
from throwcollect.errors import ConfigError
from throwcollect.own_process import Heartbeat, ready_line
from throwcollect.robots.description import full_description, physics_description
from throwcollect.ros.nodes import descriptors
from throwcollect.ros.nodes.sensors.node import SensorProcess
from throwcollect.ros.nodes.simulation.node import SimulationNode, record_all_topics
from throwcollect.ros.serving import begin_to_serve
from throwcollect.sim.live import LiveSimulator
from throwcollect.tasks.task import task_of


def foresee(configuration: str) -> None:
    """Fill the caches that simulations of a configuration, in JSON, fill at their start; start no engine, no policy."""
    config = Config.model_validate_json(configuration)
    task_of(config)
    physics_description(config)
    Channels(record_all_topics(config), full_description(config))
    for leaf in leaves(config):
        descriptors.of_key(leaf.name, leaf.value)


def run(config: Path, *, name: str, namespace: str | None = None, record: Path | None = None) -> None:
    """Serve one simulation until SIGTERM, SIGINT or SIGHUP, or until a client sets its state to quitting.

    While a trial runs, the process reads messages between two stretches; otherwise it sleeps until a message arrives.

    Args:
        config: YAML file of the collection.
        name: Name of the node.
        namespace: Namespace of the node; None for the root if `run.root_namespace` is set, otherwise ``/<name>``.
        record: Directory of the dataset that clients may record into; None if they may not.
    """
    heartbeat = Heartbeat()
    simulation = LiveSimulator(load(config), heartbeat.beat)
    if namespace is None and simulation.config.run.root_namespace:
        namespace = "/"
    ros.init()
    try:
        node = SimulationNode(name, simulation, namespace=namespace, record=record)
    except ros.NameValidationException as error:
        raise ConfigError(str(error)) from error
    nodes = (node, *node.other_nodes)
    executor, stopped = begin_to_serve(*nodes)
    sensors = SensorProcess(node, simulation.config, config)
    print(ready_line(name), flush=True)
    try:
        while not stopped() and not node.quitting:
            heartbeat.beat()
            # Messages come first, so that a cancel or a reset has its effect before time goes on.
            ros.spin_some(executor, timeout_sec=0.0 if simulation.running else node.patience_s)
            if simulation.running:
                node.advance()
            node.follow_up()
            sensors.follow_up()
        node.get_logger().info(f"ends: {signal.Signals(stopped()).name if stopped() else 'a client asked for it'}")
    finally:
        sensors.close()
        for served in reversed(nodes):
            served.destroy_node()
        ros.shutdown()
