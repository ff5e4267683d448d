"""ROS 2 Jazzy interfaces without ROS: message classes, CDR, type hashes, definitions."""

from throwcollect.interfaces.catalog import message_definition, type_hash
from throwcollect.interfaces.cdr import deserialize, serialize
from throwcollect.interfaces.lookup import Action, Service, get_action, get_message, get_service
from throwcollect.interfaces.message import Message, message_class

__all__ = [
    "Action",
    "Message",
    "Service",
    "deserialize",
    "get_action",
    "get_message",
    "get_service",
    "message_class",
    "message_definition",
    "serialize",
    "type_hash",
]
