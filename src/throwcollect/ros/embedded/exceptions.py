"""Errors by the names that rclpy gives them, so that node code catches the same ones."""

from __future__ import annotations

from throwcollect.errors import ThrowcollectError


class NotInitializedException(ThrowcollectError):
    """A node was made, or a context used, before `init` or after `shutdown`."""


class ExternalShutdownException(ThrowcollectError):
    """The context was shut down while an executor was spinning."""


class InvalidHandle(ThrowcollectError):
    """A publisher, client or the like was used after it, or the session, was closed."""


class NameValidationException(ThrowcollectError):
    """Name of a node, namespace, topic, service or parameter that ROS does not allow."""


class ParameterException(ThrowcollectError):
    """Root of the errors about parameters."""


class ParameterNotDeclaredException(ParameterException):
    """A parameter was used that the node has not declared."""


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter was declared twice."""


class InvalidParameterValueException(ParameterException):
    """The value of a parameter was refused by its range or by a callback."""


class ParameterUninitializedException(ParameterException):
    """A parameter was read that has a type but no value yet."""
