"""What publishers, subscriptions, services and clients have in common, and what they send along."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import zenoh
from xxhash import xxh3_64_hexdigest
from zenoh.ext import AdvancedPublisher

from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces import type_hash
from rclzenoh.keys import EntityKind, Token, data_key, dds_type
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile, encode

_LAYOUT = struct.Struct("<qqB16s")
GID_LENGTH = 16
"""Length of the identifier of an endpoint [bytes]."""
_ENCODING = "application/cdr;key="
"""Beginning of the encodings that name the key which something is sent to."""


class Endpoint:
    """A publisher, subscription, service or client, made from names as a node has them.

    Attributes:
        name: Absolute name of the topic or service.
        qos_profile: Quality of service.
        key: Key on which samples or requests travel.
        token: Token that announces the endpoint.
        gid: Identifier that is part of every attachment.
        encoding: Encoding of all that is sent; rmw_zenoh_cpp neither sets encodings nor reads them.
        declared: What Zenoh has declared, such as a publisher; None before `announce` and after `destroy`.
    """

    def __init__(self, node: NodeBase, kind: EntityKind, name: str, type_name: str, qos_profile: QoSProfile) -> None:
        self.node = node
        self.qos_profile = qos_profile
        self.name = node.resolve_topic_name(name)
        self.type = dds_type(type_name)
        self.session = node.context.session
        domain, hashed = node.context.get_domain_id(), type_hash(type_name)
        self.key = data_key(domain, self.name, type_name, hashed)
        self.token = Token(
            domain=domain,
            session=str(self.session.zid()),
            node_id=node.token.node_id,
            entity_id=node.context.next_id(),
            kind=kind,
            node_namespace=node.get_namespace(),
            node_name=node.get_name(),
            name=self.name,
            type=self.type,
            topic_type_hash=hashed,
            qos=encode(qos_profile),
        )
        self.gid = self.token.gid
        # It has a digest of the key, because Zenoh panics at encodings of more than 255 bytes, and keys can be longer.
        self.encoding = zenoh.Encoding(f"{_ENCODING}{xxh3_64_hexdigest(self.key.encode())}")
        self.declared: Any = None
        self._declared_token: Any = None
        self._has_complained = False

    def announce(self, declared: Any) -> None:
        """Declare the endpoint's token; called when its Zenoh object works, so that others may use it."""
        self.declared = declared
        self._declared_token = self.session.liveliness().declare_token(self.token.key())

    def destroy(self) -> None:
        """Withdraw the token, then the endpoint; does nothing the second time; see `Node.destroy_publisher`."""
        declared, self.declared = self.declared, None
        if declared is not None and not self.session.is_closed():
            self._declared_token.undeclare()
            # Undeclaring an advanced publisher may wait 10 s for its heartbeat (Zenoh 1.10). Dropping one withdraws it,
            # too, which holds for nothing else that has a callback.
            if not isinstance(declared, AdvancedPublisher):
                declared.undeclare()

    def invalid(self, error: zenoh.ZError) -> InvalidHandle:
        """The error to raise when Zenoh refuses to send."""
        return InvalidHandle(f"{self.name}: cannot send, the session is closed or lost: {error}")

    def check_key(self, encoding: zenoh.Encoding | None) -> None:
        """Refuse what was sent to another key.

        On the wire, numbers stand for keys, and each link has its own. When a session replaces a lost link, a router
        of Zenoh 1.10 may take the new link for one more of the old connection, until it has closed that. Meanwhile it
        uses the numbers of the old link, which stand for other keys of the session now.
        """
        if encoding is not None and encoding != self.encoding and str(encoding).startswith(_ENCODING):
            raise ValueError(
                "it was sent to another topic or service; that happens while a lost connection is restored"
            )

    def complain(self, problem: object) -> None:
        """Log a problem with something that was received; only the first one, as any process may send garbage."""
        if not self._has_complained:
            self._has_complained = True
            self.node.get_logger().warning(f"{self.name}: ignored (this is logged once): {problem}")


class Attachment(NamedTuple):
    """What rmw_zenoh_cpp (0.2.4 and later) puts on every sample, request and reply: who sent it, and when.

    Attributes:
        sequence: Number of the message, counted from 1 by its sender; a reply has that of the request.
        source_timestamp: System time of the sender [ns].
        gid: Identifier of the sending endpoint; a reply has that of the request.
    """

    sequence: int
    source_timestamp: int
    gid: bytes

    def pack(self) -> bytes:
        """The 33 bytes on the wire."""
        return _LAYOUT.pack(self.sequence, self.source_timestamp, GID_LENGTH, self.gid)


def unpack(attachment: zenoh.ZBytes | None) -> Attachment:
    """Attachment of something that was received."""
    data = b"" if attachment is None else attachment.to_bytes()
    if len(data) != _LAYOUT.size or data[16] != GID_LENGTH:
        raise ValueError(f"attachment of {len(data)} bytes is not that of a ROS 2 Jazzy node")
    sequence, timestamp, _, gid = _LAYOUT.unpack(data)
    return Attachment(sequence, timestamp, gid)
