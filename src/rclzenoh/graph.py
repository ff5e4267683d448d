"""The ROS graph: all nodes and endpoints of a domain, which announce themselves by liveliness tokens.

A context is sent only the tokens of what it has asked about. If each were sent all tokens, their number would grow with
the square of the nodes, and the router of a large run would be busy for a minute before anything else happens.

Asking about a name again costs a microsecond.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import zenoh

from rclzenoh.keys import PREFIX, EntityKind, Token, parse_token, token_keys
from rclzenoh.time import deadline_after

_MOST_PARTS = 16
"""A context that asks about more parts of one kind than this is sent all tokens of that kind."""
_POLL_S = 0.1
_HISTORY_TIMEOUT_S = 10.0


class Graph:
    """Nodes and endpoints of one domain.

    It learns of each kind, or of a part of it, when a node first asks: of endpoints with one name; of all those below
    ``/sim_0``, when those of ``/sim_0/a`` are counted; of those of all nodes in one namespace.

    Attributes:
        session: The session whose tokens and subscribers are meant.
    """

    def __init__(self, session: zenoh.Session, domain: int) -> None:
        self.session = session
        self._domain = domain
        # This is not the lock of `_changed`, which threads of Zenoh need while another thread waits for tokens.
        self._asking = threading.Lock()
        # By kind, and by namespace of nodes or beginning of names.
        self._followed: dict[tuple[EntityKind, str | None, str | None], Any] = {}
        self._changed = threading.Condition()
        # By kind and name, and then by key expression.
        self._tokens: dict[tuple[EntityKind, str], dict[str, Token]] = {}
        self.changes = 0
        """Number of changes so far; as long as it stays the same, what is known of the graph does, too."""

    def _follow(self, kind: EntityKind, namespace: str | None = None, name: str | None = None) -> None:
        """Subscribe to the tokens of a kind, or of a part of it, and wait until those that exist are known."""
        if (kind, None, None) in self._followed or (kind, namespace, name) in self._followed:
            return
        with self._asking:
            # A client that asks about ever new names, such as a client of rosapi, must not leave a subscriber for each.
            if sum(followed is kind for followed, *_ in self._followed) >= _MOST_PARTS:
                namespace = name = None
            # Another thread may have asked meanwhile.
            if (kind, namespace, name) in self._followed:
                return
            key = token_keys(self._domain, kind, namespace, name)
            handler = zenoh.handlers.Callback(self._on_change, indirect=False)
            subscriber = self.session.liveliness().declare_subscriber(key, handler, history=True)
            self.catch_up()
            self._followed[kind, namespace, name] = subscriber

    def catch_up(self) -> None:
        """Wait until what exists is known to the subscribers and clients that were declared before."""
        # No node answers this query, but the router ends it only after it has sent what they have asked for. A
        # liveliness query would not do: with a subscriber to the same tokens, it does not end (Zenoh 1.10).
        asked = f"{PREFIX}/{self._domain}/{self.session.zid()}"
        list(self.session.get(asked, timeout=_HISTORY_TIMEOUT_S))

    def _on_change(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        token, appeared = parse_token(key), sample.kind == zenoh.SampleKind.PUT
        with self._changed:
            if token is not None:
                # A token may be announced more than once: after a lost connection to the router, or because two
                # subscribers follow it, that of its kind and that of a part.
                same_name = self._tokens.setdefault((token.kind, token.name), {})
                if appeared:
                    same_name[key] = token
                else:
                    same_name.pop(key, None)
        self.note_change()

    def note_change(self, _status: object = None) -> None:
        """Note that what is known of the graph has changed, or whether a client has a service."""
        with self._changed:
            self.changes += 1
            self._changed.notify_all()

    def tokens(
        self, *kinds: EntityKind, name: str | None = None, node: tuple[str, str] | None = None
    ) -> Iterator[Token]:
        """All nodes and endpoints of some kinds, or those of one name, or of one node by its namespace and name."""
        for kind in kinds:
            self._follow(kind, node and node[0], name)
        # What is iterated over is copied, because threads of Zenoh may change it meanwhile.
        if name is not None:
            found = [self._tokens.get((kind, name), {}) for kind in kinds]
        else:
            found = [same_name for (kind, _), same_name in list(self._tokens.items()) if kind in kinds]
        tokens = (token for same_name in found for token in list(same_name.values()))
        return (token for token in tokens if node in (None, (token.node_namespace, token.node_name)))

    def count(self, kind: EntityKind, name: str, dds_type: str | None = None) -> int:
        """Endpoints of one kind, name and, if given, DDS type."""
        # Who counts does so for many names of a namespace, again and again.
        _, first, *below = name.split("/", 2)
        self._follow(kind, name=f"/{first}/$*" if below else name)
        return sum(dds_type in (None, token.type) for token in list(self._tokens.get((kind, name), {}).values()))

    def names_and_types(self, *kinds: EntityKind, node: tuple[str, str] | None = None) -> list[tuple[str, list[str]]]:
        """Names and ROS types of endpoints, sorted, of all nodes or of one, given by its namespace and name."""
        return group_types((token.name, token.topic_type) for token in self.tokens(*kinds, node=node))

    def wait_for(self, condition: Callable[[], bool], timeout_s: float | None) -> bool:
        """Wait until a condition is true of the graph, for at most a time [s], and return whether it is.

        None or a negative time is no limit.
        """
        deadline = deadline_after(timeout_s)
        while True:
            seen = self.changes
            if condition():
                return True
            # The thread waits for short times only, because nothing notifies it when the context is shut down.
            left = deadline - time.monotonic()
            if left <= 0 or self.session.is_closed():
                return False
            with self._changed:
                if self.changes == seen:
                    self._changed.wait(min(left, _POLL_S))


def group_types(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, list[str]]]:
    """Pairs of name and type as one sorted entry per name."""
    types: dict[str, set[str]] = {}
    for name, type_name in pairs:
        types.setdefault(name, set()).add(type_name)
    return [(name, sorted(of_name)) for name, of_name in sorted(types.items())]
