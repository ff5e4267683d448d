"""Services or actions that one client offers to nodes, by their names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name
from throwcollect.serve.rosbridge.belongings import ABelonging, Belongings
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest


class Offers(Belongings[ABelonging]):
    """All services, or all actions, that a client offers.

    Args:
        client: The client.
        kind: The field of requests that has the name.
        make: Makes an offer from the client's name for it and the name of its type.
        probe: What is appended to an offer's name to get the name of a service that every node with that offer has.
    """

    def __init__(
        self,
        client: Peer,
        kind: Literal["service", "action"],
        make: Callable[[Peer, str, str], ABelonging],
        probe: str = "",
    ) -> None:
        super().__init__(client)
        self._kind = kind
        self._make = make
        self._probe = probe

    def advertise(self, request: BridgeRequest) -> None:
        """Offer a service or an action; it replaces an earlier offer of this client with the same name."""
        given = request.text(self._kind)
        name = absolute_name(given)
        # The new offer is made before the old one is withdrawn, so that a malformed request changes nothing.
        offered = self._make(self._client, given, request.text("type"))
        if name in self._by_name:
            self._withdraw(name)
        elif self._is_taken(name):
            raise ConfigError(f"{request.op}: {name} is offered already", expected="another name")
        offered.open()
        self._by_name[name] = offered
        self._client.host.offered.add(name + self._probe)

    def unadvertise(self, request: BridgeRequest) -> None:
        """Withdraw something."""
        self._find(request)
        self._withdraw(absolute_name(request.text(self._kind)))

    def close(self) -> None:
        """Withdraw everything."""
        for name in list(self._by_name):
            self._withdraw(name)

    def pass_on(self, operation: Callable[[ABelonging, BridgeRequest], None]) -> Callable[[BridgeRequest], None]:
        """Make a function that passes a request of the client to the offer that the request names."""
        return lambda request: operation(self._find(request), request)

    def _withdraw(self, name: str) -> None:
        self._client.host.offered.discard(name + self._probe)
        self._by_name.pop(name).close()

    def _is_taken(self, name: str) -> bool:
        # All clients offer through the one node of the bridge, so the graph does not tell their offers apart.
        service = name + self._probe
        return service in self._client.host.offered or self._client.host.session.is_offered_by_others(service)

    def _find(self, request: BridgeRequest) -> ABelonging:
        name = absolute_name(request.text(self._kind))
        if name not in self._by_name:
            raise ConfigError(f"{request.op}: {name} is not advertised by this client")
        return self._by_name[name]
