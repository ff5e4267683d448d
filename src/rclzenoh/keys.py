"""Key expressions of rmw_zenoh_cpp (0.2.4 and later): data keys and liveliness tokens.

A data key is ``<domain>/<name>/<DDS type>/<type hash>``. A token announces a node or an endpoint in the ROS graph;
inside it every slash of a value is written as a percent sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cache

from xxhash import xxh3_128_intdigest

from rclzenoh.qos import QoSProfile, decode

PREFIX = "@ros2_lv"
"""First chunk of all tokens."""


class EntityKind(str, Enum):
    """Kind of the node or endpoint that a token announces."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"
    CLIENT = "SC"


@dataclass(frozen=True)
class Token:
    """A node or an endpoint of the ROS graph; an endpoint has the attributes of rclpy's ``TopicEndpointInfo``.

    Attributes:
        domain: Domain identifier.
        session: Identifier of the Zenoh session.
        node_id: Number of the node in its session.
        entity_id: Number of the endpoint in its session; that of the node for a node.
        kind: What is announced.
        node_namespace: Absolute namespace of the node.
        node_name: Name of the node.
        name: Absolute name of the topic or service; empty for a node.
        type: DDS name of the type; empty for a node.
        topic_type_hash: Type hash; empty for a node.
        qos: Quality of service as rmw_zenoh_cpp writes it; empty for a node.
        enclave: Enclave of the node's context.
    """

    domain: int
    session: str
    node_id: int
    entity_id: int
    kind: EntityKind
    node_namespace: str
    node_name: str
    name: str = ""
    type: str = ""
    topic_type_hash: str = ""
    qos: str = ""
    enclave: str = "/"

    def key(self) -> str:
        """Key expression of the token."""
        chunks = [PREFIX, str(self.domain), self.session, str(self.node_id), str(self.entity_id), self.kind.value]
        chunks += [self.enclave.replace("/", "%"), self.node_namespace.replace("/", "%"), self.node_name]
        if self.kind is not EntityKind.NODE:
            chunks += [self.name.replace("/", "%"), self.type, self.topic_type_hash, self.qos]
        return "/".join(chunks)

    @property
    def gid(self) -> bytes:
        """Global identifier of the endpoint, as rmw_zenoh_cpp has it: XXH3-128 of the key, in little-endian order."""
        return xxh3_128_intdigest(self.key().encode()).to_bytes(16, "little")

    @property
    def endpoint_gid(self) -> list[int]:
        """The identifier as rclpy gives it."""
        return list(self.gid)

    @property
    def topic_type(self) -> str:
        """ROS name of the type, such as ``sensor_msgs/msg/JointState``."""
        return ros_type(self.type)

    @property
    def qos_profile(self) -> QoSProfile:
        """Quality of service of the endpoint."""
        return decode(self.qos)


def token_keys(domain: int, kind: EntityKind, namespace: str | None = None, name: str | None = None) -> str:
    """Key expression of all tokens of a kind, or of those of nodes in a namespace, or with a name.

    The name is that of a topic or service; ``/sim_0/$*`` stands for all names below ``/sim_0``.
    """
    some = f"{PREFIX}/{domain}/*/*/*/{kind.value}/*/{(namespace or '*').replace('/', '%')}/*"
    return f"{some}/**" if name is None else f"{some}/{name.replace('/', '%')}/**"


def parse_token(key: str) -> Token | None:
    """Token from its key expression; None if that is malformed, as any process may declare one.

    Chunks that later versions of rmw_zenoh_cpp append are ignored.
    """
    chunks = key.split("/")
    if chunks[0] != PREFIX or not all(chunks):
        return None
    try:
        domain, session, node_id, entity_id, kind, enclave, namespace, node = chunks[1:9]
        is_node = EntityKind(kind) is EntityKind.NODE
        name, dds, type_hash, qos = [""] * 4 if is_node else chunks[9:13]
        if not is_node:
            decode(qos)  # Genuine nodes, too, ignore an endpoint whose quality of service is malformed.
        return Token(
            domain=int(domain),
            session=session,
            node_id=int(node_id),
            entity_id=int(entity_id),
            kind=EntityKind(kind),
            node_namespace=namespace.replace("%", "/"),
            node_name=node,
            name=name.replace("%", "/"),
            type=dds,
            topic_type_hash=type_hash,
            qos=qos,
            enclave=enclave.replace("%", "/"),
        )
    except ValueError:
        return None


def dds_type(name: str) -> str:
    """DDS name of a type: ``a/msg/B`` is ``a::msg::dds_::B_``."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"


@cache
def ros_type(name: str) -> str:
    """ROS name of a DDS type, the inverse of `dds_type`; another name is returned as it is."""
    package, _, short = name.partition("::dds_::")
    return f"{package.replace('::', '/')}/{short.removesuffix('_')}" if short else name


def data_key(domain: int, name: str, type_name: str, type_hash: str) -> str:
    """Key expression of a topic's samples or a service's requests; the name is absolute, the type has its ROS name."""
    return f"{domain}/{name.strip('/')}/{dds_type(type_name)}/{type_hash}"
