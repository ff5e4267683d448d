"""The key of a run: processes that have it may join the run, and the dataset takes only episodes signed with it.

A key is a directory of two files, which only its owner can read: a private key, and its certificate. Every run makes
its own key. The router and all nodes of a run show each other the certificate (mutual TLS), and trust no other. We use
mutual TLS because the Zenoh library inside the genuine rmw_zenoh_cpp was built without user/password and without Unix
sockets, so it has no other way to keep strangers out.
"""

from __future__ import annotations

import hashlib
import hmac
import os
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from throwcollect.errors import ConfigError
from throwcollect.extras import lazily
from throwcollect.files import beside, write_all

# Only processes that make a key need these.
x509, hashes = lazily("cryptography.x509"), lazily("cryptography.hazmat.primitives.hashes")
ec = lazily("cryptography.hazmat.primitives.asymmetric.ec")
serialization = lazily("cryptography.hazmat.primitives.serialization")

KEY_VARIABLE = "THROWCOLLECT_KEY"
"""Environment variable that names the directory of the key of the run that a process belongs to."""

_PRIVATE_KEY, _CERTIFICATE = "key.pem", "certificate.pem"
_NAME = "throwcollect"
_FIRST_MOMENT, _LAST_MOMENT = datetime(1970, 1, 1), datetime(9999, 12, 31, 23, 59, 59)
"""Whole time of a certificate, so that nodes let each other in whatever their clocks say, or are set to in a run."""
_SECRET_BYTES = 32
_PURPOSE = b"throwcollect signature 1\0"


@dataclass(frozen=True)
class RunKey:
    """The key of a run, in the directory of its two files."""

    directory: Path

    @property
    def private_key(self) -> Path:
        """File of the private key, in PEM."""
        return self.directory / _PRIVATE_KEY

    @property
    def certificate(self) -> Path:
        """File of the certificate, in PEM."""
        return self.directory / _CERTIFICATE

    @property
    def exists(self) -> bool:
        """Whether both files are there."""
        return self.private_key.is_file() and self.certificate.is_file()

    @classmethod
    def of_environment(cls) -> RunKey | None:
        """Find the key of the run that this process belongs to; None if it belongs to none."""
        named = os.environ.get(KEY_VARIABLE)
        return cls(Path(named).absolute()) if named else None

    def check(self) -> None:
        """Check that this process can read the key."""
        for path in (self.private_key, self.certificate):
            _read(path)

    @property
    def secret(self) -> bytes:
        """The 32 bytes from which another machine can make the key again."""
        key = serialization.load_pem_private_key(_read(self.private_key), None)
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ConfigError(f"{self.private_key}: not a key of a run")
        return int(key.private_numbers().private_value).to_bytes(_SECRET_BYTES, "big")

    def create(self, secret: bytes | None = None) -> None:
        """Make a new key in a directory that need not exist; given a secret, make the key of another machine again.

        A key that is made again has another certificate, but nodes trust it, because they check only who signed it.
        """
        private_key, certificate = _make_pair(secret)
        try:
            self.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            # The private key comes last, because processes that wait for a key wait for that file.
            for path, data in ((self.certificate, certificate), (self.private_key, private_key)):
                with beside(path, mode=0o600) as descriptor:
                    write_all(descriptor, data)
        except OSError as error:
            raise ConfigError(f"{self.directory}: the key of the run cannot be written: {error.strerror}") from error


class Signer:
    """Signs the data that nodes of one run exchange, and checks signatures.

    Args:
        secret: Bytes that only the run's nodes know; empty for nodes that were started by hand without a key, which
            accept each other's signatures and are not protected from others.
    """

    def __init__(self, secret: bytes) -> None:
        self._secret = secret

    @classmethod
    def of_environment(cls) -> Signer:
        """Make the signer of the run that this process belongs to."""
        key = RunKey.of_environment()
        return cls(b"") if key is None else cls.of_key(key)

    @classmethod
    def of_key(cls, key: RunKey) -> Signer:
        """Make the signer of the run with a key."""
        # The purpose is hashed, too, so that this secret differs from any other that is made from the key.
        return cls(hashlib.sha256(_PURPOSE + _read(key.private_key)).digest())

    def sign(self, *parts: bytes | memoryview) -> str:
        """Make the signature (HMAC-SHA256, in hexadecimal) of the parts, put together in their order."""
        signature = hmac.new(self._secret, digestmod=hashlib.sha256)
        for part in parts:
            signature.update(part)
        return signature.hexdigest()

    def has_signed(self, signature: str, *parts: bytes | memoryview) -> bool:
        """Say whether a signature was made of these parts."""
        # The time that `==` takes would tell a forger how many characters of a signature are right.
        return hmac.compare_digest(signature.encode(), self.sign(*parts).encode())


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"the key of the run cannot be read: {path}: {error.strerror}",
            expected=f"a directory with the key of a run, which only its owner can read (--key, {KEY_VARIABLE})",
        ) from error


def _make_pair(secret: bytes | None) -> tuple[bytes, bytes]:
    """Make a private key and its self-signed certificate, both in PEM."""
    try:
        key = (
            ec.generate_private_key(ec.SECP256R1())
            if secret is None
            else ec.derive_private_key(int.from_bytes(secret, "big"), ec.SECP256R1())
        )
    except ValueError as error:
        raise ConfigError("there is no key of this secret") from error
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, _NAME)])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(_FIRST_MOMENT)
        .not_valid_after(_LAST_MOMENT)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(_NAME)]), critical=False)
        # The TLS library of Zenoh (rustls) does not accept the certificate of a CA as the certificate of a peer.
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return private, certificate.public_bytes(serialization.Encoding.PEM)
