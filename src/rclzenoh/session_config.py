"""Makes configurations of Zenoh sessions, from values of a program or from the environment, and reads its domain.

The environment variables are those of rmw_zenoh_cpp: ``ZENOH_SESSION_CONFIG_URI`` names a whole configuration file and
``ZENOH_CONFIG_OVERRIDE`` (``key=json5;key=json5``) is applied after it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, Protocol

import zenoh

from rclzenoh.exceptions import ConfigurationError

DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
_LARGEST_DOMAIN = 232
DEFAULT_ENDPOINT = "tcp/localhost:7447"
"""Where the router of a host listens."""
CONFIG_FILE_VARIABLE = "ZENOH_SESSION_CONFIG_URI"
OVERRIDE_VARIABLE = "ZENOH_CONFIG_OVERRIDE"
OPEN = "tcp/"
"""Beginning of the endpoints whose router lets every process in."""
PROTECTED = "tls/"
"""Beginning of the endpoints whose router rejects processes without a key."""
_TLS = "transport/link/tls"
_SETTINGS = {
    "scouting/multicast/enabled": "false",
    # With shared memory, no session would open where /dev/shm is missing or full; rmw_zenoh_cpp has none, either.
    "transport/shared_memory/enabled": "false",
    # All subscribers of rmw_zenoh_cpp are advanced ones, which order samples by the time stamps of the session.
    "timestamping/enabled": "true",
    "queries_default_timeout": "600000",
    # A silent connection is closed after this time [ms]. On a busy machine, a router with 64 sessions takes longer than
    # the default of 10 s. A machine that vanishes without closing its connections is noticed this late.
    "transport/link/tx/lease": "60000",
}
"""Values in JSON by their keys, as in ``ZENOH_CONFIG_OVERRIDE``."""


class Key(Protocol):
    """The key of a router and its clients, which all show the same certificate and trust no other (mutual TLS)."""

    @property
    def private_key(self) -> Path:
        """File of the private key, in PEM."""

    @property
    def certificate(self) -> Path:
        """File of the certificate, in PEM."""


def client_config(endpoint: str, key: Key | None = None) -> zenoh.Config:
    """Configuration of a client of a router, regardless of the environment; a router at ``tls/...`` needs the key."""
    return _configure(zenoh.Config(), {**_make_client_settings(endpoint, key), **_SETTINGS}, "endpoint")


def router_config(endpoint: str, key: Key | None = None) -> zenoh.Config:
    """Configuration of a router that listens on one endpoint; at ``tls/...`` it rejects processes without the key."""
    settings = {"mode": '"router"', "listen/endpoints": json.dumps([endpoint]), **_SETTINGS}
    return _configure(zenoh.Config(), {**settings, **_make_tls_settings(endpoint, key, "listen")}, "listen endpoint")


def environment_config() -> zenoh.Config:
    """Configuration that the environment asks for; by default, that of a client of the router on this host."""
    config, settings = zenoh.Config(), {**_SETTINGS}
    if path := os.environ.get(CONFIG_FILE_VARIABLE):
        try:
            config, settings = zenoh.Config.from_file(path), {}
        except zenoh.ZError as error:
            raise ConfigurationError(
                f"{CONFIG_FILE_VARIABLE}: {path} is no Zenoh configuration: {describe(error)}"
            ) from error
    else:
        settings |= {"mode": '"client"', "connect/endpoints": json.dumps([DEFAULT_ENDPOINT])}
    for override in filter(str.strip, os.environ.get(OVERRIDE_VARIABLE, "").split(";")):
        key, separator, value = override.partition("=")
        if not separator:
            raise ConfigurationError(f"{OVERRIDE_VARIABLE}: {override.strip()!r}: expected key/path=json5")
        settings[key.strip()] = value.strip()
    return _configure(config, settings, OVERRIDE_VARIABLE)


def connect_endpoint() -> str | None:
    """Endpoint of the router that the environment names; None if it names none."""
    if not (os.environ.get(OVERRIDE_VARIABLE) or os.environ.get(CONFIG_FILE_VARIABLE)):
        return None
    return next(iter(_read_endpoints(environment_config(), "connect") or ()), None)


def is_protected() -> bool:
    """Whether the environment leads to a router that rejects processes without a key, and opens no other way in.

    Sessions listen by default, on rmw_zenoh_cpp even clients, so the environment has to set where: `client_override`
    does. Lists for single modes of sessions count as not set.
    """
    config = environment_config()
    connect, listen = (_read_endpoints(config, side) for side in ("connect", "listen"))
    if not connect or listen is None:
        return False
    return all(each.startswith(PROTECTED) for each in (*connect, *listen))


def client_override(endpoint: str, key: Key | None = None) -> str:
    """Value of ``ZENOH_CONFIG_OVERRIDE`` that has the effect of `client_config`; it names files and holds no secret."""
    return ";".join(f"{name}={value}" for name, value in _make_client_settings(endpoint, key).items())


def describe(error: zenoh.ZError) -> str:
    """Message of an error of Zenoh, without the names and lines of its source files."""
    return re.sub(r'^\w+\([^"]*"', "", re.split(r' at /| \(os error|", location: |"\)', str(error))[0])


def _make_client_settings(endpoint: str, key: Key | None) -> dict[str, str]:
    # `listen/endpoints` is set, because a configuration file, as that of rmw_zenoh_cpp, may let clients listen, and
    # they would listen even without a key.
    settings = {"mode": '"client"', "connect/endpoints": json.dumps([endpoint]), "listen/endpoints": "[]"}
    return {**settings, **_make_tls_settings(endpoint, key, "connect")}


def _make_tls_settings(endpoint: str, key: Key | None, side: Literal["connect", "listen"]) -> dict[str, str]:
    if key is None or not endpoint.startswith(PROTECTED):
        return {}
    return {
        f"{_TLS}/root_ca_certificate": json.dumps(str(key.certificate)),
        f"{_TLS}/{side}_private_key": json.dumps(str(key.private_key)),
        f"{_TLS}/{side}_certificate": json.dumps(str(key.certificate)),
        f"{_TLS}/enable_mtls": "true",
        # Names are not verified, because the address of a router in a container is not known when the certificate is
        # made.
        f"{_TLS}/verify_name_on_connect": "false",
    }


def _configure(config: zenoh.Config, settings: Mapping[str, str], where: str) -> zenoh.Config:
    """Set values in JSON5, and refuse a key that cannot be read, for which Zenoh's error is that it cannot connect."""
    for key, value in settings.items():
        try:
            config.insert_json5(key, value)
        except zenoh.ZError as error:
            raise ConfigurationError(f"{where}: {key} cannot be {value}: {describe(error)}") from error
    sided = [f"{side}_{name}" for name in ("private_key", "certificate") for side in ("connect", "listen")]
    for name in (*sided, "root_ca_certificate"):
        if path := json.loads(config.get_json(f"{_TLS}/{name}")):
            try:
                Path(path).read_bytes()
            except OSError as error:
                raise ConfigurationError(f"the key of the run cannot be read: {path}: {error.strerror}") from error
    return config


def _read_endpoints(config: zenoh.Config, side: str) -> Sequence[str] | None:
    """Endpoints that sessions of any mode connect to or listen on; None if there is no such list."""
    endpoints = json.loads(config.get_json(f"{side}/endpoints"))
    return endpoints if isinstance(endpoints, list) else None


def domain_of_environment() -> int:
    """Domain identifier that the environment names; 0 if none."""
    text = os.environ.get(DOMAIN_VARIABLE) or "0"
    if not text.isdecimal() or int(text) > _LARGEST_DOMAIN:
        raise ConfigurationError(f"{DOMAIN_VARIABLE} must be a number from 0 to {_LARGEST_DOMAIN}, got {text!r}")
    return int(text)
