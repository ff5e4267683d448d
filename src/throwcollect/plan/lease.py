"""Leases: signed notes by which a coordinator gives trials to a simulation.

A simulation holds a list of leases and simulates them in order. The coordinator sends the whole list again whenever it
changes, as one parameter of the simulation's node, so a list that arrives twice changes nothing.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from pydantic import TypeAdapter, ValidationError

from throwcollect.errors import DatasetError
from throwcollect.plan.trials import NO_TARGET, Values
from throwcollect.run_key import Signer

LEASES = "trial.leases"
"""Name of the parameter."""


@dataclass(frozen=True)
class Lease:
    """A signed note that gives one trial to one simulation.

    Attributes:
        simulation: Namespace of the simulation, such as ``/sim_0``.
        trial: Number of the trial.
        values: Values of the trial that replace those of the configuration, by dotted key.
        nonce: Random text by which two leases of the same trial differ: with a new one, a trial that is done is done
            again.
        seed: Seed of the trial, which a policy gets.
        target: Where the trial should end, by column, which a policy gets, too.
        signature: Signature of the coordinator over all other attributes.
    """

    simulation: str
    trial: int
    values: Mapping[str, float]
    nonce: str = ""
    seed: int = 0
    target: Mapping[str, float] = field(default_factory=dict)
    signature: str = ""

    @classmethod
    def make(
        cls, simulation: str, trial: int, values: Values, signer: Signer, *, seed: int = 0, target: Values = NO_TARGET
    ) -> Lease:
        """Make a new lease, and sign it with the key of the run."""
        unsigned = cls(simulation, trial, values, secrets.token_hex(8), seed, {**target})
        return replace(unsigned, signature=signer.sign(unsigned._text))

    def is_signed(self, signer: Signer) -> bool:
        """Whether the lease was signed with the key of this run."""
        return signer.has_signed(self.signature, self._text)

    @property
    def token(self) -> str:
        """Text that no other lease has."""
        return f"{self.nonce}.{self.signature}"

    @cached_property
    def _text(self) -> bytes:
        # The values are sorted, because the same values in another order must have the same signature.
        numbers = (sorted(self.values.items()), self.seed, sorted(self.target.items()))
        return json.dumps([self.nonce, self.simulation, self.trial, *numbers]).encode()


_LEASES = TypeAdapter(tuple[Lease, ...])


def leases_to_json(leases: Iterable[Lease]) -> str:
    """Write a list of leases in JSON."""
    return _LEASES.dump_json(tuple(leases)).decode()


def leases_from_json(text: str) -> tuple[Lease, ...]:
    """Read what `leases_to_json` writes."""
    try:
        return _LEASES.validate_json(text, strict=True)
    except ValidationError as error:
        raise DatasetError(f"list of leases: {error.errors()[0]['msg']}") from error
