"""Every error that rclzenoh raises on purpose; errors that rclpy has as well have the same names."""

from __future__ import annotations


class RclzenohError(Exception):
    """Root of all errors raised on purpose."""


class ConfigurationError(RclzenohError):
    """A session cannot be opened because its configuration is wrong."""


class NoRouterError(RclzenohError):
    """There is no router at the endpoints, which are JSON; the reason is that of Zenoh."""

    def __init__(self, endpoints: str, seconds: float, reason: str) -> None:
        self.reason = reason
        super().__init__(f"no Zenoh session within {seconds:g} s; connecting to {endpoints}")


class NotInitializedException(RclzenohError):
    """A node was made, or a context used, before `init` or after `shutdown`."""


class ExternalShutdownException(RclzenohError):
    """The context was shut down while an executor was spinning."""


class InvalidHandle(RclzenohError):
    """A publisher, client or the like was used after it, or the session, was closed."""


class NameValidationException(RclzenohError):
    """Name of a node, namespace, topic, service or parameter that ROS does not allow."""


class ParameterException(RclzenohError):
    """Root of the errors about parameters."""


class ParameterNotDeclaredException(ParameterException):
    """A parameter was used that the node has not declared."""


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter was declared twice."""


class InvalidParameterValueException(ParameterException):
    """The value of a parameter was refused by its range or by a callback."""
