"""ROS 2 Jazzy interfaces without ROS: message classes, CDR, type hashes, definitions."""

from rclzenoh.interfaces.catalog import message_definition, type_hash
from rclzenoh.interfaces.cdr import deserialize, serialize
from rclzenoh.interfaces.lookup import Action, Service, get_action, get_message, get_service
from rclzenoh.interfaces.message import AnyMessage, Message, message_class

__all__ = [
    "Action",
    "AnyMessage",
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
