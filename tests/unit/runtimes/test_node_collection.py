from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator.progress import Progress
from throwcollect.errors import WorkerError
from throwcollect.runtimes import node_collection
from throwcollect.runtimes.node_collection import NodeCollection
from throwcollect.runtimes.runtime import NodeState

BLIND = Progress(total=4, ended=0, outcomes={}, simulations=0, throws_per_s=0.0, hung=[])


def collection_of(monkeypatch: pytest.MonkeyPatch, session: Mock, simulations: int = 1) -> NodeCollection:
    """A collection without nodes."""
    supervisor = Mock(states=Mock(return_value=[]))
    monkeypatch.setattr(node_collection, "Supervisor", Mock(return_value=supervisor))
    monkeypatch.setattr(node_collection, "RunListener", Mock())
    monkeypatch.setattr(node_collection, "roster", Mock())
    context = SimpleNamespace(
        simulations=simulations, collects=True, middleware=SimpleNamespace(rmw="rmw_fastrtps_cpp")
    )
    host = SimpleNamespace(context=context, config=Config(), endpoint=None, connection=None)
    return NodeCollection(host, session)


@pytest.mark.parametrize(("simulations", "patience_s"), [(1, 12.5), (64, 44)])
def test_restarted_nodes_have_the_same_time_to_find_each_other_again(
    monkeypatch: pytest.MonkeyPatch, simulations: int, patience_s: float
) -> None:
    now = [0.0]
    monkeypatch.setattr(node_collection, "time", SimpleNamespace(monotonic=lambda: now[0]))
    session = Mock()
    collection = collection_of(monkeypatch, session, simulations)
    supervisor = collection._supervisor
    router = NodeState("router", "running", 0, "2", None)
    supervisor.states.return_value = [router, NodeState("sim_0", "running", 0, "1", None)]
    for now[0] in (0.0, patience_s - 0.1, patience_s + 0.1):
        session.warn.assert_not_called()
        collection._report(BLIND)
    assert "started again" in session.warn.call_args.args[0]
    # The coordinator was restarted too, so the next report comes late, when simulations are ready already.
    for now[0] in (2 * patience_s, 3 * patience_s - 0.1):
        collection._report(BLIND)
    now[0] = 3 * patience_s + 0.1
    with pytest.raises(WorkerError, match=f"for {patience_s} s, twice"):
        collection._report(BLIND)
