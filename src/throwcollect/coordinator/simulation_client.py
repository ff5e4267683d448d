"""One simulation as the coordinator sees it: leases go there, episodes and refusals come back."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet

from throwcollect.ros import Future, HistoryPolicy, Node, Parameter, QoSProfile, ReliabilityPolicy
from throwcollect.ros.msg import UInt8MultiArray
from throwcollect.ros.srv import SetParametersAtomically
from throwcollect.trial.lease import LEASES, Lease, leases_to_json
from throwcollect.wording import format_count

_ANSWER_S = 5.0
"""A request that is not answered in this real time was lost, as when the router is started again. Simulations answer
within milliseconds, or between two pieces of a trial."""

EPISODE_TOPIC = "episode"
EPISODE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)


class SimulationClient:
    """Asks one simulation for trials, and receives what it hands over.

    Args:
        node: The coordinator.
        namespace: Namespace of the simulation, such as ``/sim_0`` or ``/``.
        name: Name of its node there.
        publishers: Identifiers of the publishers of its episodes: a simulation that is started again has other ones.
        make_lease: Makes a new lease of a trial for a simulation, which is given by its namespace.
        on_episode: Called with the serialised message of an episode, or of a refusal.
        on_refusal: Called with the reason when the simulation refuses to be asked.
    """

    def __init__(
        self,
        node: Node,
        namespace: str,
        name: str,
        publishers: AbstractSet[bytes],
        *,
        make_lease: Callable[[str, int], Lease],
        on_episode: Callable[[str, bytes], None],
        on_refusal: Callable[[str, str], None],
    ) -> None:
        self.namespace = namespace
        self.name = name
        self.publishers = publishers
        self.deadline = float("inf")
        """Monotonic time [s] at which the trial that runs counts as lost; infinite while none does."""
        self.hung = False
        """Whether a trial was lost at its deadline, and nothing has come from the simulation since."""
        self.unanswered = False
        """Whether the simulation has not answered the last request yet."""
        self._node = node
        self._make_lease = make_lease
        self._on_refusal = on_refusal
        self._generation = 0
        self._leases: dict[int, Lease] = {}
        self._sent_at = 0.0
        self._patience_s = _ANSWER_S
        prefix = namespace.removesuffix("/")
        self._parameters = node.create_client(SetParametersAtomically, f"{prefix}/{name}/set_parameters_atomically")
        self._episodes = node.create_subscription(
            UInt8MultiArray,
            f"{prefix}/{EPISODE_TOPIC}",
            lambda message: on_episode(namespace, message),
            EPISODE_QOS,
            raw=True,
        )

    @property
    def trials(self) -> tuple[int, ...]:
        """The trials that the simulation was asked for and has not handed over, in their order."""
        return tuple(self._leases)

    def ready(self) -> bool:
        """Whether everything that a trial needs is offered."""
        return self._parameters.service_is_ready()

    def ask(self, trials: Sequence[int]) -> bool:
        """Ask for these trials, in order, instead of the last ones; a trial that runs goes on if it is among them.

        Returns:
            Whether this differs from the last request.
        """
        if tuple(trials) == self.trials:
            return False
        # A trial that stays in the list keeps its lease, because the simulation may be running it under that token.
        self._leases = {trial: self._leases.get(trial) or self._make_lease(self.namespace, trial) for trial in trials}
        self._patience_s = _ANSWER_S
        self._send()
        return True

    def remind(self) -> str | None:
        """Ask once more if there was no answer, with new leases, because episodes of the old ones may be lost, too.

        Returns:
            The number of trials asked for, in words; None if there is no reason to ask again yet.
        """
        if not self.unanswered or time.monotonic() < self._sent_at + self._patience_s:
            return None
        # A simulation that was frozen for a while must not find a pile of requests.
        self._patience_s *= 2
        self._leases = {trial: self._make_lease(self.namespace, trial) for trial in self._leases}
        self._send()
        return format_count(len(self._leases), "trial")

    def finish(self, token: str) -> int | None:
        """Forget the lease with a token, as its trial was handed over or refused.

        Returns:
            The trial; None if there is no such lease, or not any more.
        """
        trial = next((trial for trial, lease in self._leases.items() if lease.token == token), None)
        if trial is not None:
            del self._leases[trial]
        return trial

    def abandon(self) -> None:
        """Forget all trials: late answers and episodes are ignored."""
        self._generation += 1
        self._leases = {}
        self.unanswered = False
        self.deadline = float("inf")

    def destroy(self) -> None:
        """Take all clients off the graph."""
        self.abandon()
        self._node.destroy_client(self._parameters)
        self._node.destroy_subscription(self._episodes)

    def _send(self) -> None:
        self._generation += 1
        generation, self._sent_at, self.unanswered = self._generation, time.monotonic(), True

        def check(answer: Future) -> None:
            if generation != self._generation:
                return
            self.unanswered = False
            result = answer.result().result
            if not result.successful:
                self._on_refusal(self.namespace, f"leases: {result.reason}")

        asked = Parameter(LEASES, value=leases_to_json(self._leases.values())).to_parameter_msg()
        self._parameters.call_async(SetParametersAtomically.Request(parameters=[asked])).add_done_callback(check)
