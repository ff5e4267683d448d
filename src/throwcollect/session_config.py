"""Configuration of Zenoh sessions, apart from `ros` because health checks cannot afford to import that.

The environment variables are those of rmw_zenoh_cpp: ``ZENOH_SESSION_CONFIG_URI`` names a whole configuration file and
``ZENOH_CONFIG_OVERRIDE`` (``key=json5;key=json5``) is applied after it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping

import zenoh

from throwcollect.errors import ConfigError

DEFAULT_ENDPOINT = "tcp/localhost:7447"
"""Where the router of a host listens."""

CONFIG_FILE_VARIABLE = "ZENOH_SESSION_CONFIG_URI"
OVERRIDE_VARIABLE = "ZENOH_CONFIG_OVERRIDE"
_SETTINGS = {
    "scouting/multicast/enabled": False,
    # Advanced subscribers, which all those of rmw_zenoh_cpp are, order samples by the time stamps of the session.
    "timestamping/enabled": True,
    "queries_default_timeout": 600_000,
}


def client_config() -> zenoh.Config:
    """Configuration that the environment asks for; by default, that of a client of the router on this host.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    path = os.environ.get(CONFIG_FILE_VARIABLE)
    if path:
        try:
            config = zenoh.Config.from_file(path)
        except zenoh.ZError as error:
            raise ConfigError(f"{CONFIG_FILE_VARIABLE}: {path} is no Zenoh configuration: {in_words(error)}") from error
    else:
        config = zenoh.Config()
        _apply(config, {"mode": "client", "connect/endpoints": [DEFAULT_ENDPOINT], **_SETTINGS}, "default")
    for assignment in filter(str.strip, os.environ.get(OVERRIDE_VARIABLE, "").split(";")):
        key, separator, value = assignment.partition("=")
        if not separator:
            raise ConfigError(
                f"{OVERRIDE_VARIABLE}: {assignment.strip()!r} has no '='", expected="key/path=json5;key/path=json5"
            )
        _insert(config, key.strip(), value.strip(), OVERRIDE_VARIABLE)
    return config


def router_config(endpoint: str) -> zenoh.Config:
    """Configuration of a router that listens on one endpoint.

    Args:
        endpoint: Such as ``tcp/127.0.0.1:7447``.

    Returns:
        The configuration.

    Raises:
        ConfigError: If the endpoint is malformed.
    """
    config = zenoh.Config()
    _apply(config, {"mode": "router", "listen/endpoints": [endpoint], **_SETTINGS}, "listen endpoint")
    return config


def in_words(error: zenoh.ZError) -> str:
    """What Zenoh says is wrong, without the names and places of its sources."""
    return re.sub(r'^\w+\([^"]*"', "", re.split(r' at /| \(os error|", location: |"\)', str(error))[0])


def _apply(config: zenoh.Config, settings: Mapping[str, object], where: str) -> None:
    for key, value in settings.items():
        _insert(config, key, json.dumps(value), where)


def _insert(config: zenoh.Config, key: str, value: str, where: str) -> None:
    try:
        config.insert_json5(key, value)
    except zenoh.ZError as error:
        raise ConfigError(f"{where}: {key} cannot be {value}: {in_words(error)}") from error
