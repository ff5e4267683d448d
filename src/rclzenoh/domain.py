"""The ROS domain of a process; nodes of different domains do not see each other."""

from __future__ import annotations

import os

from rclzenoh.exceptions import ConfigurationError

DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232


def domain_of_environment() -> int:
    """Domain identifier that the environment names; 0 if none.

    Raises:
        ConfigurationError: If it is no number of a domain.
    """
    text = os.environ.get(DOMAIN_VARIABLE) or "0"
    if not text.isdecimal() or int(text) > _LARGEST_DOMAIN:
        raise ConfigurationError(f"{DOMAIN_VARIABLE} must be a number from 0 to {_LARGEST_DOMAIN}, got {text!r}")
    return int(text)
