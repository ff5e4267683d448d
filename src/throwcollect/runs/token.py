"""The token of a run: one line by which another machine joins it, and nobody without."""

from __future__ import annotations

import base64
import binascii
import json
from dataclasses import asdict, dataclass

from pydantic import TypeAdapter, ValidationError

from throwcollect.build import build_digest
from throwcollect.errors import ConfigError

_START = "tc2."
"""What tokens begin with; the number is that of their form."""


@dataclass(frozen=True)
class JoinToken:
    """All that another machine has to know of a run. Whoever reads it may join, so it is a secret as a key is.

    Attributes:
        run: Id of the run.
        endpoint: Endpoint of the router, as other machines reach it.
        secret: Secret of the key of the run, in hexadecimal.
        domain_id: ROS domain.
        engine: Name of the physics engine that computes there.
        build: Digest over what computes there; see `throwcollect.build`.
    """

    run: str
    endpoint: str
    secret: str
    domain_id: int
    engine: str
    build: str

    def encode(self) -> str:
        """The token as one word."""
        text = json.dumps(asdict(self), separators=(",", ":"))
        return _START + base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")

    @classmethod
    def decode(cls, word: str) -> JoinToken:
        """Read a token.

        Raises:
            ConfigError: If it is none, or not whole.
        """
        data = word.strip().removeprefix(_START)
        try:
            if data == word.strip():
                raise ValueError(word)
            text = base64.b64decode(data + "=" * (-len(data) % 4), altchars=b"-_", validate=True)
            token = _JSON.validate_json(text)
            bytes.fromhex(token.secret)
        except (ValueError, binascii.Error, ValidationError) as error:
            raise ConfigError("this is no token of a run, or not a whole one", expected=f"{_START}...") from error
        return token

    def check_build(self) -> None:
        """Refuse to join a run whose machines would compute other throws.

        Raises:
            ConfigError: If something else computes there than here.
        """
        if self.build != build_digest(self.engine):
            raise ConfigError(
                f"run {self.run}: other sources, or another engine {self.engine} or robot model, compute there than "
                "here; other bytes would be collected",
                hint="install the same version of throwcollect on both machines; throwcollect doctor shows it",
            )


_JSON = TypeAdapter(JoinToken)
