"""Configuration of Zenoh sessions.

The environment variables are those of rmw_zenoh_cpp: ``ZENOH_SESSION_CONFIG_URI`` names a whole configuration file and
``ZENOH_CONFIG_OVERRIDE`` (``key=json5;key=json5``) is applied after it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import zenoh

from throwcollect.errors import ConfigError
from throwcollect.run_key import RunKey, check_readable

DEFAULT_ENDPOINT = "tcp/localhost:7447"
"""Where the router of a host listens."""

CONFIG_FILE_VARIABLE = "ZENOH_SESSION_CONFIG_URI"
OVERRIDE_VARIABLE = "ZENOH_CONFIG_OVERRIDE"
OPEN = "tcp/"
"""What endpoints begin with whose router lets anybody in."""
PROTECTED = "tls/"
"""What endpoints begin with whose router lets nobody in without the key of the run."""

_TLS = "transport/link/tls"
_NOT_IN_PATHS = ";?"
"""Zenoh puts paths into endpoints, in which these have a meaning."""
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
    # Zenoh would only say that it cannot connect.
    for name in ("connect_private_key", "connect_certificate", "root_ca_certificate"):
        if path := json.loads(config.get_json(f"{_TLS}/{name}")):
            check_readable(Path(path))
    return config


def is_protected() -> bool:
    """Whether the session that the environment asks for is one with a router that lets nobody in without a key.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    endpoints = json.loads(client_config().get_json("connect/endpoints"))
    return all(endpoint.startswith(PROTECTED) for endpoint in endpoints)


def connect_endpoint() -> str | None:
    """Where the environment says that the router of a run is; None if it says nothing of it.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    if not (os.environ.get(OVERRIDE_VARIABLE) or os.environ.get(CONFIG_FILE_VARIABLE)):
        return None
    endpoints: list[str] = json.loads(client_config().get_json("connect/endpoints"))
    return endpoints[0] if endpoints else None


def client_override(endpoint: str, key: RunKey) -> str:
    """Value of ``ZENOH_CONFIG_OVERRIDE`` that makes a session one of a run's router; it names files, and no secrets.

    Args:
        endpoint: Endpoint of the router.
        key: Key of the run.

    Raises:
        ConfigError: If the key lies where Zenoh cannot find it.
    """
    settings: dict[str, object] = {"mode": "client", "connect/endpoints": [endpoint]}
    if endpoint.startswith(PROTECTED):
        settings |= _tls_settings(key, "connect")
    return ";".join(f"{name}={json.dumps(value)}" for name, value in settings.items())


def router_config(endpoint: str, key: RunKey | None = None) -> zenoh.Config:
    """Configuration of a router that listens on one endpoint.

    Args:
        endpoint: Such as ``tcp/127.0.0.1:7447``.
        key: Key of the run that nobody is let in without, if the endpoint is a protected one.

    Returns:
        The configuration.

    Raises:
        ConfigError: If the endpoint is malformed, or a protected one and the key is missing or cannot be read.
    """
    config = zenoh.Config()
    _apply(config, {"mode": "router", "listen/endpoints": [endpoint], **_SETTINGS}, "listen endpoint")
    if endpoint.startswith(PROTECTED):
        if key is None:
            raise ConfigError(
                f"the router cannot listen on {endpoint}: no key is named",
                expected="--key DIR, where a new key is made if there is none; or tcp/..., which lets anybody in",
            )
        key.check()
        _apply(config, _tls_settings(key, "listen"), "key")
    return config


def in_words(error: zenoh.ZError) -> str:
    """What Zenoh says is wrong, without the names and places of its sources."""
    return re.sub(r'^\w+\([^"]*"', "", re.split(r' at /| \(os error|", location: |"\)', str(error))[0])


def _tls_settings(key: RunKey, side: Literal["connect", "listen"]) -> Mapping[str, object]:
    """Settings by which both sides show each other the certificate of the run, and trust no other."""
    if wrong := sorted(set(_NOT_IN_PATHS) & set(str(key.directory))):
        raise ConfigError(
            f"{key.directory}: Zenoh finds no key in a directory with {' or '.join(wrong)} in its name",
            expected=f"a path without {' and '.join(_NOT_IN_PATHS)}, as of the directory that THROWCOLLECT_STATE names",
        )
    return {
        f"{_TLS}/root_ca_certificate": str(key.certificate),
        f"{_TLS}/{side}_private_key": str(key.private_key),
        f"{_TLS}/{side}_certificate": str(key.certificate),
        f"{_TLS}/enable_mtls": True,
        # Routers of containers have no address that a certificate could name beforehand.
        f"{_TLS}/verify_name_on_connect": False,
    }


def _apply(config: zenoh.Config, settings: Mapping[str, object], where: str) -> None:
    for key, value in settings.items():
        _insert(config, key, json.dumps(value), where)


def _insert(config: zenoh.Config, key: str, value: str, where: str) -> None:
    try:
        config.insert_json5(key, value)
    except zenoh.ZError as error:
        raise ConfigError(f"{where}: {key} cannot be {value}: {in_words(error)}") from error
