"""The key of a run."""

import json
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh
from cryptography import x509

from throwcollect.errors import ConfigError
from throwcollect.run_key import KEY_VARIABLE, RunKey, Signer

TLS = "transport/link/tls/"


def settings(key: RunKey) -> dict[str, object]:
    return {
        f"{TLS}root_ca_certificate": str(key.certificate),
        f"{TLS}listen_private_key": str(key.private_key),
        f"{TLS}listen_certificate": str(key.certificate),
        f"{TLS}connect_private_key": str(key.private_key),
        f"{TLS}connect_certificate": str(key.certificate),
        f"{TLS}enable_mtls": True,
        f"{TLS}verify_name_on_connect": False,
    }


@contextmanager
def session(mode: str, changes: dict[str, object]) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    fixed = {"mode": mode, "scouting/multicast/enabled": False, "transport/unicast/open_timeout": 2000}
    for name, value in {**fixed, **changes}.items():
        config.insert_json5(name, json.dumps(value))
    opened = zenoh.open(config)
    try:
        yield opened
    finally:
        opened.close()


def make_key(directory: Path) -> RunKey:
    key = RunKey(directory)
    key.create()
    return key


def test_only_the_owner_can_read_a_key(tmp_path: Path) -> None:
    key = make_key(tmp_path / "key")
    assert stat.S_IMODE(key.directory.stat().st_mode) == 0o700
    assert stat.S_IMODE(key.private_key.stat().st_mode) == 0o600
    assert sorted(path.name for path in key.directory.iterdir()) == ["certificate.pem", "key.pem"]


def test_a_router_accepts_only_clients_with_its_key(tmp_path: Path) -> None:
    key, other = make_key(tmp_path / "one"), make_key(tmp_path / "other")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tls/127.0.0.1:{probe.getsockname()[1]}"
    with session("router", {"listen/endpoints": [endpoint], **settings(key)}):
        connect = {"connect/endpoints": [endpoint]}
        with session("client", {**connect, **settings(key)}):
            pass
        for changes in (settings(other), {}, {f"{TLS}root_ca_certificate": str(key.certificate)}):
            with pytest.raises(zenoh.ZError), session("client", {**connect, **changes}):
                pass


def test_a_certificate_is_valid_whatever_the_clocks_say(tmp_path: Path) -> None:
    certificate = x509.load_pem_x509_certificate(make_key(tmp_path / "key").certificate.read_bytes())
    assert (certificate.not_valid_before_utc.year, certificate.not_valid_after_utc.year) == (1970, 9999)


def test_a_signature_is_valid_only_for_its_key_and_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, str(make_key(tmp_path / "one").directory))
    signer = Signer.of_environment()
    signature = signer.sign(b"an ", b"episode")
    assert signer.has_signed(signature, b"an episode")
    assert not signer.has_signed(signature, b"an episodf")
    monkeypatch.setenv(KEY_VARIABLE, str(make_key(tmp_path / "other").directory))
    assert not Signer.of_environment().has_signed(signature, b"an episode")
    assert not Signer(b"").has_signed(signature, b"an episode")


def test_a_missing_key_is_an_error_that_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, str(tmp_path / "gone"))
    with pytest.raises(ConfigError, match=r"the key of the run cannot be read: .*gone/key.pem: No such file"):
        Signer.of_environment()


def test_a_key_can_be_made_again_from_its_secret(tmp_path: Path) -> None:
    one, other = RunKey(tmp_path / "one"), RunKey(tmp_path / "other")
    one.create()
    assert len(one.secret) == 32
    other.create(one.secret)
    assert other.private_key.read_bytes() == one.private_key.read_bytes()
    assert other.certificate.read_bytes() != one.certificate.read_bytes()


@pytest.mark.parametrize("secret", [bytes(32), b"\xff" * 32])
def test_an_invalid_secret_makes_no_key(tmp_path: Path, secret: bytes) -> None:
    with pytest.raises(ConfigError, match="no key of this secret"):
        RunKey(tmp_path / "key").create(secret)
    assert not (tmp_path / "key").exists()
