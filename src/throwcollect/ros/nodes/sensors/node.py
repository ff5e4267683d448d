"""Publishes what sensors see of the states that a simulation publishes; its physics does not wait for pictures."""

from __future__ import annotations

import json
import os
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import leaves, with_sensors, with_values
from throwcollect.engines.pose import Pose
from throwcollect.episode.channels import Channels
from throwcollect.episode.sensor_topics import SensorTopic, describe_sensor, sensor_topics
from throwcollect.episode.topics import odometry, put_stamps
from throwcollect.errors import ConfigError
from throwcollect.own_process import make_command
from throwcollect.robots.description import full_description
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.ros import DurabilityPolicy, Node, Parameter, Publisher, QoSProfile, get_message
from throwcollect.ros.msg import JointState, Odometry, SetParametersResult, String
from throwcollect.ros.nodes import descriptors
from throwcollect.ros.serving import begin_to_serve
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import check_sensors, make_sensor
from throwcollect.units import NS_PER_S

NAME = "sensors"
"""Name of the node in the namespace of its simulation, and of the parameter and the topic that have all sensors."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Quality of service of that topic."""
_SAMPLED = QoSProfile(depth=10)
_NEWEST = QoSProfile(depth=1)
_WAIT_S = 0.01
_IDLE_S = 0.1


class SensorNode(Node):
    """Publishes the topics of the sensors of a configuration that have subscribers, in the namespace of a simulation.

    Each number and word of a sensor is a parameter, such as ``sensors.head.vertical_fov_rad``, and the parameter
    ``sensors`` has all sections in JSON, to add and to remove sensors; the next frame shows a change. The latched topic
    ``sensors`` lists in JSON what sensors there are. In real time, frames come at most as often as `rate_hz` demands in
    simulated time.
    """

    def __init__(self, config: Config, namespace: str) -> None:
        super().__init__(NAME, namespace=namespace)
        self._made: dict[str, Publisher] = {}
        self._positions: list[float] = []
        self._poses: dict[str, Pose] = {}
        self._stamp_ns = 0
        self._states: list[Any] = []
        self._scene, self._declared = Scene.of(config), set[str]()
        self._described = self.create_publisher(String, NAME, LATCHED)
        self._use(config)
        self._declare()
        self.add_on_set_parameters_callback(self._change)

    @property
    def patience_s(self) -> float:
        """How long the process may wait for messages [s]."""
        return _WAIT_S if any(self._listened.values()) else _IDLE_S

    def _use(self, config: Config) -> None:
        """Render by a configuration from now on."""
        self._topics = Channels(config, full_description(config)).sensors
        self._sensors = {name: make_sensor(name, config, self._scene, 0) for name in config.sensors}
        self._config, self._is_declared = config, False
        for topics in self._topics.values():
            for topic in topics.values():
                if topic.name not in self._made:
                    kind = get_message(topic.type_name)
                    self._made[topic.name] = self.create_publisher(kind, topic.name.lstrip("/"), _SAMPLED)
        self._frames = dict.fromkeys(config.sensors, 0)
        self._due_s = dict.fromkeys(config.sensors, 0.0)
        self._listened: dict[str, list[SensorTopic]] = {}
        self._find_listened()
        # Clients get to know this before the answer to their request.
        described = [vars(describe_sensor(name, config)) for name in config.sensors]
        self._described.publish(String(data=json.dumps(described)))

    def _change(self, parameters: list[Parameter]) -> SetParametersResult:
        values = {parameter.name: parameter.value for parameter in parameters}
        try:
            config = self._config
            if NAME in values:
                if not isinstance(sections := json.loads(values.pop(NAME)), dict):
                    raise TypeError(f"got a {type(sections).__name__}")
                config = with_sensors(config, sections)
            # The parameters of sensors that were removed are undeclared.
            known = {leaf.name for leaf in leaves(config)}
            config = with_values(config, {name: value for name, value in values.items() if name in known})
            if config != self._config:
                check_sensors(config)
                self._use(config)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except (TypeError, ValueError) as error:
            return SetParametersResult(successful=False, reason=f"{NAME}: should be sections by name in JSON: {error}")
        return SetParametersResult(successful=True)

    def _declare(self) -> None:
        """Declare the parameters of all sensors, and undeclare those of sensors that were removed."""
        self._is_declared = True
        sections = {name: section.model_dump() for name, section in self._config.sensors.items()}
        values = {NAME: json.dumps(sections)} | {
            leaf.name: leaf.value
            for leaf in leaves(self._config)
            if leaf.name.startswith(f"{NAME}.") and isinstance(leaf.value, bool | int | float | str)
        }
        changed = [name for name in self._declared if self.get_parameter(name).value != values.get(name)]
        self.set_parameters([Parameter(name, value=values.get(name)) for name in changed])
        for name in values.keys() - self._declared:
            about = descriptors.of_key(name, values[name])
            # Setting it to no value undeclares it.
            about.dynamic_typing = name != NAME
            self.declare_parameter(name, values[name], about)
        self._declared = set(values)

    def _find_listened(self) -> None:
        """Find the topics with subscribers, and listen to the simulation if there are any."""
        listened = {
            name: [topic for topic in topics.values() if self._made[topic.name].get_subscription_count()]
            for name, topics in self._topics.items()
        }
        if listened != self._listened:
            # A new subscriber gets a frame even if time stands still.
            self._listened, self._shown_ns = listened, dict[str, int]()
        if any(self._listened.values()) and not self._states:
            self._states = [self.create_subscription(JointState, "joint_states", self._take_joints, _NEWEST)]
            for number, body in enumerate(moving_bodies_of(self._config)):
                topic, take = odometry(body, number).name.lstrip("/"), partial(self._take_body, body)
                self._states.append(self.create_subscription(Odometry, topic, take, _NEWEST))
        elif not any(self._listened.values()):
            for subscription in self._states:
                self.destroy_subscription(subscription)
            self._states = []

    def _take_joints(self, message: JointState) -> None:
        self._positions = list(message.position)
        self._stamp_ns = message.header.stamp.sec * NS_PER_S + message.header.stamp.nanosec

    def _take_body(self, body: str, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        self._poses[body] = Pose.of((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))

    def follow_up(self) -> None:
        """Publish the frames that are due."""
        if not self._is_declared:
            self._declare()
        self._find_listened()
        bodies = [self._poses.get(body) for body in moving_bodies_of(self._config)]
        if not self._positions or None in bodies:
            return
        now_s, placed = time.monotonic(), None
        for name, topics in self._listened.items():
            if not topics or now_s < self._due_s[name] or self._shown_ns.get(name) == self._stamp_ns:
                continue
            placed = placed or self._scene.place(self._positions, [pose for pose in bodies if pose is not None])
            sensor = self._sensors[name]
            self._due_s[name], self._shown_ns[name] = now_s + 1 / sensor.rate_hz, self._stamp_ns
            seen = sensor.look(placed, self._frames[name])
            self._frames[name] += 1
            for topic in topics:
                message = np.frombuffer(bytearray(topic.layout.template), topic.layout.dtype)
                put_stamps(message, topic.stamp, np.array([self._stamp_ns]))
                for field, values in seen[topic.stream].items():
                    message[field] = values
                self._made[topic.name].publish(message.tobytes())


class SensorProcess:
    """Starts the node of the sensors of a simulation when one of their topics, or `NAME`, has a subscriber.

    The simulation has publishers of these topics, too, by which subscribers find them.

    Args:
        node: Node of the simulation.
        config: Its configuration, and the file of it.
    """

    def __init__(self, node: Node, config: Config, file: Path) -> None:
        topics = [topic for each in sensor_topics(config).values() for topic in each.values() if topic.stream != "pose"]
        self._node, self._file = node, file
        self._offered = [
            node.create_publisher(get_message(topic.type_name), topic.name.lstrip("/"), _SAMPLED) for topic in topics
        ] + [node.create_publisher(String, NAME, LATCHED)]
        self._process: subprocess.Popen[bytes] | None = None

    def follow_up(self) -> None:
        """Start the node if it is wanted and does not run."""
        wanted = any(publisher.get_subscription_count() for publisher in self._offered)
        if wanted and (self._process is None or self._process.poll() is not None):
            words = ["sensors", str(self._file), "--namespace", self._node.get_namespace()]
            self._process = subprocess.Popen(make_command() + words, stdin=subprocess.DEVNULL)

    def close(self) -> None:
        """End the node."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()


def run(config: Path, *, namespace: str) -> None:
    """Publish what the sensors of a configuration see of the simulation in a namespace.

    This ends by a signal, and with the process that has started it.

    Raises:
        ConfigError: If the configuration is wrong.
    """
    read, parent = load(config), os.getppid()
    ros.init()
    node = SensorNode(read, namespace)
    executor, stopped = begin_to_serve(node)
    try:
        while not stopped() and os.getppid() == parent:
            ros.spin_some(executor, timeout_sec=node.patience_s)
            node.follow_up()
    finally:
        node.destroy_node()
        ros.shutdown()
