"""The lease of a trial: what a coordinator asks of a simulation, in words that nobody else can say.

A lease travels as parameters of the simulation's node, which it accepts all or none. One of them, `LEASE`, signs the
others with the key of the run.
"""

from __future__ import annotations

import hmac
import json
import secrets
from collections.abc import Mapping
from dataclasses import dataclass

from throwcollect.run_key import Signer

NUMBER, CONTROLLERS, LEASE = "trial.number", "trial.controllers", "trial.lease"
"""Names of the parameters."""


@dataclass(frozen=True)
class Lease:
    """A trial for one simulation.

    Attributes:
        simulation: Namespace of the simulation, such as ``/sim_0``.
        trial: Number of the trial.
        controllers: Controllers that will get a goal.
        values: What the trial replaces of the configuration, by dotted key.
    """

    simulation: str
    trial: int
    controllers: tuple[str, ...]
    values: Mapping[str, float]

    def sign(self, signer: Signer) -> str:
        """A token that stands for this lease alone: no two leases have the same."""
        return self._token(signer, secrets.token_hex(8))

    def is_signed(self, token: str, signer: Signer) -> bool:
        """Whether a token was made for this lease with the key of this run."""
        return hmac.compare_digest(token.encode(), self._token(signer, token.partition(".")[0]).encode())

    def _token(self, signer: Signer, nonce: str) -> str:
        text = json.dumps([nonce, self.simulation, self.trial, self.controllers, dict(sorted(self.values.items()))])
        return f"{nonce}.{signer.sign(text.encode())}"
