"""The ROS graph: all nodes and endpoints of a domain, which announce themselves by liveliness tokens.

Tokens are parsed when somebody asks about the graph, in the asking thread. Asking again while nothing changed costs a
dictionary lookup.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator

import zenoh

from rclzenoh.duration import deadline_after
from rclzenoh.keys import PREFIX, EntityKind, Token, parse_token

_MOST_UNREAD = 10_000
"""With this many unread changes, they are read even if nobody asks about the graph."""
_POLL_S = 0.1
_HISTORY_TIMEOUT_S = 10.0


class Graph:
    """Nodes and endpoints that are known in one domain."""

    def __init__(self, session: zenoh.Session, domain: int) -> None:
        # A thread may take the lock of a Condition twice, as `_on_change` does when it reads changes.
        self._changed = threading.Condition()
        self._unread: deque[tuple[bool, str]] = deque()
        self._tokens: dict[str, Token] = {}
        self._counts: Counter[tuple[EntityKind, str, str]] = Counter()
        self.changes = 0
        """Number of changes so far; as long as it stays the same, the graph does, too."""
        key = f"{PREFIX}/{domain}/**"
        handler = zenoh.handlers.Callback(self._on_change, indirect=False)
        self._subscriber = session.liveliness().declare_subscriber(key, handler, history=True)
        # Nobody answers this query, but the router ends it only after it has sent the history that the subscriber asked
        # for, so the graph is complete afterwards. A liveliness query would not do: with a subscriber to the same
        # tokens, it does not end (Zenoh 1.10).
        list(session.get(f"{PREFIX}/{domain}/{session.zid()}", timeout=_HISTORY_TIMEOUT_S))

    def _on_change(self, sample: zenoh.Sample) -> None:
        with self._changed:
            self._unread.append((sample.kind == zenoh.SampleKind.PUT, str(sample.key_expr)))
            self.changes += 1
            if len(self._unread) > _MOST_UNREAD:
                self._read()
            self._changed.notify_all()

    def _read(self) -> None:
        with self._changed:
            while self._unread:
                appeared, key = self._unread.popleft()
                token = parse_token(key)
                if token is None:
                    continue
                # After a lost connection to the router, tokens that are known already are announced again.
                if appeared and key not in self._tokens:
                    self._tokens[key] = token
                    self._counts[token.kind, token.name, token.type] += 1
                elif not appeared and self._tokens.pop(key, None) is not None:
                    self._counts[token.kind, token.name, token.type] -= 1

    def tokens(self, *kinds: EntityKind) -> Iterator[Token]:
        """All nodes and endpoints of some kinds."""
        self._read()
        # The values are copied, because threads of Zenoh may change the dictionary while a caller iterates over them.
        return (token for token in list(self._tokens.values()) if token.kind in kinds)

    def count(self, kind: EntityKind, name: str, dds_type: str | None = None) -> int:
        """Endpoints of one kind, name and, if given, DDS type."""
        if self._unread:
            self._read()
        if dds_type is not None:
            return self._counts.get((kind, name, dds_type), 0)
        return sum(token.name == name for token in self.tokens(kind))

    def names_and_types(self, *kinds: EntityKind, node: tuple[str, str] | None = None) -> list[tuple[str, list[str]]]:
        """Names and ROS types of endpoints, sorted, of all nodes or of one, given by its namespace and name."""
        return group_types(
            (token.name, token.ros_type)
            for token in self.tokens(*kinds)
            if node is None or (token.namespace, token.node) == node
        )

    def wait_for(self, condition: Callable[[], bool], timeout_s: float | None, alive: Callable[[], bool]) -> bool:
        """Wait until a condition is true of the graph; return whether it is.

        Args:
            condition: What to wait for.
            timeout_s: Longest time [s]; None or negative for no limit.
            alive: Whether waiting still makes sense.
        """
        deadline = deadline_after(timeout_s)
        while not condition():
            # The thread waits for short times only, because nothing notifies it when the context is shut down.
            left = deadline - time.monotonic()
            if left <= 0 or not alive():
                return False
            with self._changed:
                # If a change has come since the condition was checked, it is checked again at once, without waiting for
                # another change.
                if not self._unread:
                    self._changed.wait(min(left, _POLL_S))
        return True


def group_types(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, list[str]]]:
    """Pairs of name and type as one sorted entry per name."""
    types: dict[str, set[str]] = {}
    for name, type_name in pairs:
        types.setdefault(name, set()).add(type_name)
    return [(name, sorted(of_name)) for name, of_name in sorted(types.items())]
