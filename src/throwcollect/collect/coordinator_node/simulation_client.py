"""One simulation as the coordinator sees it: leases go there, episodes and refusals come back."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from collections.abc import Set as AbstractSet

from throwcollect.plan.lease import LEASES, Lease, leases_to_json
from throwcollect.ros import Future, HistoryPolicy, Node, Parameter, QoSProfile, ReliabilityPolicy
from throwcollect.ros.msg import UInt8MultiArray
from throwcollect.ros.srv import SetParametersAtomically
from throwcollect.wording import format_count

_ANSWER_S = 5.0
"""A simulation that is not heard of for this real time is asked again, because messages may have been lost, as when the
router is started again. Where answers are slow, it is so many times the time of the slowest one lately."""
_SLOWER = 4
_KEPT = 0.9
"""Share of the time of the slowest answer that each faster one leaves."""

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
        self.began_s = float("inf")
        """Monotonic time [s] since when the trial that runs is waited for; infinite while none runs."""
        self.hung = False
        """Whether a trial took too long, and no episode has come from the simulation since."""
        self.unanswered = False
        """Whether the simulation has not answered the last request yet."""
        self._node = node
        self._make_lease = make_lease
        self._on_refusal = on_refusal
        self._generation = 0
        self._leases: dict[int, Lease] = {}
        self._asked_s = self._heard_s = 0.0
        """Monotonic times [s] of the last request, and of the last message of the simulation."""
        self._slowest_s = 0.0
        """Time of the slowest answer lately [s]; it fades with each answer that is faster."""
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

    @property
    def alive(self) -> bool:
        """Whether the simulation was heard of lately, compared with how long it took for answers before."""
        return time.monotonic() < self._heard_s + self._patience_s

    def ready(self) -> bool:
        """Whether everything that a trial needs is offered."""
        return self._parameters.service_is_ready()

    def ask(self, trials: Sequence[int]) -> None:
        """Ask for these trials, in order, instead of the last ones; a trial that runs goes on if it is among them."""
        if tuple(trials) == self.trials:
            return
        if tuple(trials[:1]) != self.trials[:1]:
            self._wait_for_first(trials)
        # A trial that stays in the list keeps its lease, so that it is not done again if its episode is under way.
        self._leases = {trial: self._leases.get(trial) or self._make_lease(self.namespace, trial) for trial in trials}
        self._send()

    def remind(self) -> str | None:
        """Ask once more if nothing was heard for long.

        Returns:
            The number of trials asked for, in words, if there was no answer; else None.
        """
        quiet_s = time.monotonic() - max(self._asked_s, self._heard_s)
        missing = format_count(len(self._leases), "trial") if self.unanswered else None
        if quiet_s < self._patience_s or not (missing or self._leases):
            return None
        # A simulation that was frozen for a while must not find a pile of requests.
        self._patience_s *= 2
        if not missing:
            # The simulation has its leases. If it does nothing, it has done them, and the episodes were lost.
            self._leases = {trial: self._make_lease(self.namespace, trial) for trial in self._leases}
        self._send()
        return missing

    def finish(self, trial: int) -> None:
        """Note that a trial was handed over or refused; the next one of the list begins with its end."""
        self._heard_s = time.monotonic()
        self.hung = False
        self._leases.pop(trial, None)
        self._wait_for_first(self._leases)

    def abandon(self) -> None:
        """Forget all trials, and ignore late answers."""
        self._generation += 1
        self._leases = {}
        self.unanswered = False
        self._wait_for_first(())

    def destroy(self) -> None:
        """Take all clients off the graph."""
        self.abandon()
        self._node.destroy_client(self._parameters)
        self._node.destroy_subscription(self._episodes)

    def _wait_for_first(self, trials: Collection[int]) -> None:
        self.began_s = time.monotonic() if trials else float("inf")

    def _send(self) -> None:
        self._generation += 1
        generation, asked_s = self._generation, time.monotonic()
        self._asked_s, self.unanswered = asked_s, True

        def check(answer: Future) -> None:
            self._heard_s = time.monotonic()
            self._slowest_s = max(self._heard_s - asked_s, _KEPT * self._slowest_s)
            if generation != self._generation:
                return
            self.unanswered = False
            self._patience_s = max(_ANSWER_S, _SLOWER * self._slowest_s)
            result = answer.result().result
            if not result.successful:
                self._on_refusal(self.namespace, f"leases: {result.reason}")

        asked = Parameter(LEASES, value=leases_to_json(self._leases.values())).to_parameter_msg()
        self._parameters.call_async(SetParametersAtomically.Request(parameters=[asked])).add_done_callback(check)
