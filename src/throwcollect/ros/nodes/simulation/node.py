"""The ROS 2 node of one simulation, with the interfaces that clients of the real robot, or of a simulator, expect."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from throwcollect.config.key import Effect
from throwcollect.config.schema import FASTEST, SLOWEST, Config
from throwcollect.config.values import leaves, sweepable_keys, with_values
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import pack
from throwcollect.episode.record import Samples
from throwcollect.episode.topics import Topic
from throwcollect.errors import ConfigError, DatasetError, MemberError
from throwcollect.plan.lease import LEASES, Lease, leases_from_json
from throwcollect.robots.appearance import check_appearance
from throwcollect.ros import (
    DurabilityPolicy,
    HistoryPolicy,
    Node,
    Parameter,
    ParameterDescriptor,
    Publisher,
    QoSProfile,
    Time,
    get_message,
    provide_time,
)
from throwcollect.ros.msg import SetParametersResult, String, UInt8MultiArray
from throwcollect.ros.nodes import descriptors
from throwcollect.ros.nodes.controller.node import ControllerManager, ControllerNode
from throwcollect.ros.nodes.simulation.control import SimulationControl
from throwcollect.ros.nodes.simulation.leases import LeaseQueue
from throwcollect.ros.nodes.simulation.spawning import SpawningServices
from throwcollect.ros.nodes.simulation.stepping import Stepping
from throwcollect.run_key import Signer
from throwcollect.sim.live import LiveSimulator, StateCode
from throwcollect.units import NS_PER_S

if TYPE_CHECKING:
    from throwcollect.ros.nodes.simulation.recording import RecordService

_CLOCK = "rosgraph_msgs/msg/Clock"
Clock: Any = get_message(_CLOCK)

_EPISODE = "episode"
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_SAMPLED = QoSProfile(depth=100)
_WHOLE = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""For episodes: none is dropped, and each reaches every subscriber, however slow."""

_IDLE_S = 0.1
"""Longest wait for messages. Signals take effect after the wait: their handlers must not disturb a busy executor."""

_REPEAT_S = 0.02
"""Real time between two messages on a topic of samples while time stands still; joint states of the robot have it."""

_FACTOR = "sim.real_time_factor"
DESCRIPTION = "robot_description"
"""Name of the parameter by which clients change what viewers draw; robot_state_publisher of ROS has the same name."""
_NOT_RECORDED = (_FACTOR, DESCRIPTION)
"""Parameters that change nothing that is recorded, so clients may set them during a trial.

A real-time factor so low that the coordinator would think that the simulation hangs is refused during a trial."""
_NO_LIMIT = 0.0
_FACTORS = f"a number from {SLOWEST} to {FASTEST}, or 0 for no limit"
_HIDDEN = (Effect.PLAN, Effect.RUN)
"""Effects of keys that the node does not show as parameters, because they do not concern a simulation."""


class SimulationNode(Node):
    """Serves one simulation, with all names in one namespace, by default ``/<name>``.

    Raises:
        ConfigError: If another simulation has this namespace.
    """

    def __init__(
        self, name: str, simulation: LiveSimulator, *, namespace: str | None = None, record: Path | None = None
    ) -> None:
        super().__init__(name, namespace=namespace or f"/{name}")
        self._require_own_namespace()
        self._simulation = simulation
        config = simulation.config
        provide_time(self)
        self._description = simulation.channels.robot
        self._publish_latched(simulation.channels)
        self._declare_parameters(config)
        self._leases = LeaseQueue(simulation)
        self._live = [
            (topic, self.create_publisher(get_message(topic.type_name), topic.name.lstrip("/"), _SAMPLED))
            for topic in Channels(record_all_topics(config), self._description).recorded.values()
        ]
        self._controllers = {name: ControllerNode(self, simulation, name) for name in simulation.limbs}
        self._manager = ControllerManager(self, simulation)
        self._listened: list[tuple[Topic, Publisher]] = []
        self._published_at = 0.0
        self._published_ns = -1
        self._signer = Signer.of_environment()
        self._requested: tuple[Lease, ...] = ()
        SimulationControl(self, simulation)
        SpawningServices(self, simulation)
        self._stepping = Stepping(self, simulation)
        self._recording: RecordService | None = None
        if record is not None:
            # Simulations that record nothing do without the libraries that datasets need.
            from throwcollect.ros.nodes.simulation.recording import RecordService

            self._recording = RecordService(self, simulation, record)
        # This publisher comes last: a coordinator that sees it takes the whole simulation for ready.
        self._episodes = self.create_publisher(UInt8MultiArray, _EPISODE, _WHOLE)

    @property
    def other_nodes(self) -> tuple[Node, ...]:
        """The other nodes of the simulation: one for each controller, and the controller manager."""
        return (*self._controllers.values(), self._manager)

    @property
    def patience_s(self) -> float:
        """How long the process may wait for messages while time stands still [s]."""
        return _REPEAT_S if self._listened and self._rests else _IDLE_S

    @property
    def quitting(self) -> bool:
        """Whether a client has asked the simulation to quit."""
        return self._simulation.state == StateCode.QUITTING

    @property
    def watched(self) -> bool:
        """Whether samples, states or feedback have subscribers."""
        self._notice_listeners()
        return bool(self._listened) or any(controller.watched for controller in self._controllers.values())

    def advance(self) -> None:
        """Run for a stretch of time; a leased trial in which an engine of another package fails is refused."""
        try:
            self._simulation.advance(watched=self.watched)
        except MemberError as error:
            self._leases.fail(error)

    def follow_up(self) -> None:
        """Publish what has happened since the last call: time, samples, feedback, results, the episode."""
        simulation = self._simulation
        now = Time(nanoseconds=simulation.now_ns)
        for node in (self, *self.other_nodes):
            node.get_clock().set_ros_time_override(now)
        for name, result in simulation.pop_results():
            self._controllers[name].action.finish(result)
        self._notice_listeners()
        self._publish_samples()
        for controller in self._controllers.values():
            controller.publish_state()
        # The next trial begins before the episode is sent, so that no client can reach a controller in between.
        for handed in self._leases.collect():
            self._episodes.publish(pack(handed, self._signer))
        self._stepping.follow_up()
        if self._recording is not None:
            self._recording.follow_up()

    def _require_own_namespace(self) -> None:
        """Refuse the namespace of another simulation, because clients could not tell the two apart."""
        others = {info.node_name for info in self.get_publishers_info_by_topic(_EPISODE)} - {self.get_name()}
        if others:
            # The names are read before the node is destroyed, because in rclpy it has none afterwards.
            name, namespace = self.get_name(), self.get_namespace()
            self.destroy_node()
            raise ConfigError(
                f"namespace {namespace}: the simulation {min(others)} lives there",
                expected=f"one simulation in a namespace, such as --namespace /{name}, the default",
            )

    def _publish_samples(self) -> None:
        if not self._listened:
            return
        samples: Samples = self._simulation.fresh_samples()
        if not len(samples) and self._rests and time.monotonic() - self._published_at >= _REPEAT_S:
            # Robots go on to publish their state while they rest.
            samples = self._simulation.world.samples(self._simulation.world.recorded - 1)
        if len(samples):
            self._published_at = time.monotonic()
        columns = [(publisher, topic.encode(samples, {})) for topic, publisher in self._listened]
        for index in range(len(samples)):
            for publisher, messages in columns:
                publisher.publish(messages[index].tobytes())
        self._publish_steps(samples)

    @property
    def _rests(self) -> bool:
        """Whether time stands still for lack of work; never during a trial, of which each sample is published once."""
        simulation = self._simulation
        return simulation.state == StateCode.PLAYING and not simulation.running and not simulation.shows_trial

    def _publish_steps(self, samples: Samples) -> None:
        """Publish the time after the steps of a paused simulation, because they may end between two samples."""
        simulation = self._simulation
        self._published_ns = int(samples.stamps_ns[-1]) if len(samples) else self._published_ns
        if simulation.state != StateCode.PAUSED or simulation.now_ns == self._published_ns:
            return
        self._published_ns = simulation.now_ns
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(simulation.now_ns, NS_PER_S)
        for topic, publisher in self._listened:
            if topic.type_name == _CLOCK:
                publisher.publish(message)

    def _notice_listeners(self) -> None:
        """Find out which topics have subscribers."""
        self._listened = [(topic, publisher) for topic, publisher in self._live if publisher.get_subscription_count()]
        self._simulation.watch(name for name, controller in self._controllers.items() if controller.wants_states)

    def _publish_latched(self, channels: Channels) -> None:
        """Publish what stays; by a parameter, a client gives viewers another description to draw."""
        self._latched: dict[str, Publisher] = {}
        for channel, message in channels.encode_latched_messages(0).items():
            publisher = self.create_publisher(get_message(channel.type_name), channel.topic.lstrip("/"), _LATCHED)
            publisher.publish(message)
            self._latched[channel.topic] = publisher
        about = "URDF that viewers draw; only what is seen may differ from that of the configuration."
        self.declare_parameter(DESCRIPTION, self._description, ParameterDescriptor(description=about))

        def show(parameters: list[Parameter]) -> None:
            for parameter in parameters:
                if parameter.name == DESCRIPTION:
                    self._latched[f"/{DESCRIPTION}"].publish(String(data=parameter.value))

        self.add_post_set_parameters_callback(show)

    def _declare_parameters(self, config: Config) -> None:
        physics = set(sweepable_keys(config, Effect.PHYSICS))
        shown = {leaf.name: leaf.value for leaf in leaves(config) if leaf.key.effect not in _HIDDEN}
        self._physics = {key: float(value) for key, value in shown.items() if key in physics}
        about_leases = "Trials that a coordinator wants, in JSON with its signatures, instead of those before."
        self.declare_parameter(LEASES, "", ParameterDescriptor(description=about_leases))
        factor = config.sim.real_time_factor or _NO_LIMIT
        about_factor = descriptors.of_key(_FACTOR, factor)
        about_factor.additional_constraints = _FACTORS
        about_factor.floating_point_range = [descriptors.floating_range(_NO_LIMIT, FASTEST)]
        self.declare_parameter(_FACTOR, factor, about_factor)
        for key, value in self._physics.items():
            self.declare_parameter(key, value, descriptors.of_key(key, value))
        for key, value in shown.items():
            if isinstance(value, str | int | float) and not self.has_parameter(key):
                self.declare_parameter(key, value, descriptors.of_key(key, value, read_only=True))
        self.add_on_set_parameters_callback(self._set_up)
        self.add_post_set_parameters_callback(self._take_leases)

    def _set_up(self, parameters: list[Parameter]) -> SetParametersResult:
        """Check parameters and take them over; leases begin their trials at once, others take effect with a reset."""
        values = {parameter.name: parameter.value for parameter in parameters}
        try:
            self._check_factor(values.get(_FACTOR, _NO_LIMIT))
            if DESCRIPTION in values:
                check_appearance(self._description, values[DESCRIPTION])
            if values.get(LEASES):
                # Trials begin only in `_take_leases`, because a callback that is called after this one may still refuse
                # the parameters.
                self._requested = self._read_leases(values)
            else:
                self._prepare(values)
        except (ConfigError, DatasetError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        if _FACTOR in values:
            self._simulation.real_time_factor = values[_FACTOR] or None
        return SetParametersResult(successful=True)

    def _read_leases(self, values: Mapping[str, Any]) -> tuple[Lease, ...]:
        """Read and check the leases that a coordinator sends."""
        if len(values) > 1:
            raise ConfigError(f"{LEASES}: is set alone, not with {next(name for name in values if name != LEASES)}")
        leases = leases_from_json(values[LEASES])
        for lease in leases:
            if lease.simulation != self.get_namespace() or not lease.is_signed(self._signer):
                raise ConfigError(f"{LEASES}: is not signed for {self.get_namespace()} with the key of this run")
        return leases

    def _take_leases(self, parameters: list[Parameter]) -> None:
        """Begin the trials that a coordinator has asked for, and undo what clients have set."""
        if not any(parameter.name == LEASES and parameter.value for parameter in parameters):
            return
        self._restore_parameters()
        self._leases.replace(self._requested)

    def _prepare(self, values: Mapping[str, Any]) -> None:
        """Set up the physics that the next reset prepares, unless the simulation is leased."""
        trial = self._simulation.trial
        changed = [name for name in values if name not in _NOT_RECORDED]
        if trial.leased and changed:
            raise ConfigError(f"{changed[0]}: {trial.lease_in_words}")
        trial.config = with_values(trial.config, {key: values[key] for key in self._physics if key in values})

    def _check_factor(self, factor: float) -> None:
        if factor != _NO_LIMIT and not SLOWEST <= factor <= FASTEST:
            raise ConfigError(f"{_FACTOR}: should be {_FACTORS}, got {factor}")
        trial = self._simulation.trial
        if trial.leased and self._hangs(factor):
            slowest = self._simulation.config.sim.slowest_factor
            expected = f"{slowest:g} or more, or 0 for no limit, as {trial.lease_in_words}"
            raise ConfigError(f"{_FACTOR}: should be {expected}, got {factor:g}")

    def _hangs(self, factor: float) -> bool:
        """Say whether the factor is so low that a coordinator would think that the simulation hangs."""
        return _NO_LIMIT < factor < self._simulation.config.sim.slowest_factor

    def _restore_parameters(self) -> None:
        """Undo what clients have changed of the parameters; of the real-time factor, only slow motion is undone."""
        for controller in self._controllers.values():
            controller.parameter_server.restore()
        stray = {key: value for key, value in self._physics.items() if self.get_parameter(key).value != value}
        if self._hangs(self.get_parameter(_FACTOR).value):
            stray[_FACTOR] = self._simulation.config.sim.real_time_factor or _NO_LIMIT
        if stray:
            self.set_parameters_atomically([Parameter(key, value=value) for key, value in stray.items()])


def record_all_topics(config: Config) -> Config:
    """Change the configuration so that all topics that have a message for every sample are recorded."""
    record = config.record.model_copy(update={"topics": ["joint_states", "ball/odometry", "tf", "clock"]})
    return config.model_copy(update={"record": record})
