"""The token of a run: one line with which another machine joins the run."""

from __future__ import annotations

import base64
import binascii
import json
from dataclasses import asdict, dataclass

from pydantic import TypeAdapter, ValidationError

from throwcollect.build import build_digest
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.ros.router_endpoint import split_address
from throwcollect.run_key import RunKey
from throwcollect.trial.conditions import build_of

_START = "tc2."
"""Beginning of every token; the number is the version of the format."""


@dataclass(frozen=True)
class JoinToken:
    """The facts of a run that another machine needs to join it. It holds the key of the run, so it is a secret, too.

    Attributes:
        endpoint: Endpoint at which other machines reach the router.
        secret: Secret of the key of the run, in hexadecimal.
        build: Digest over the code that computes the run's throws with this engine, robot, tool and task; see
            `throwcollect.build`.
    """

    run: str
    endpoint: str
    secret: str
    domain_id: int
    engine: str
    build: str
    robot: str = "talos"
    tool: str = "spoon"
    task: str = "throw"
    policy: str = ""

    @classmethod
    def of(cls, run: str, endpoint: str, key: RunKey, config: Config) -> JoinToken:
        """Make the token of a run with this configuration."""
        policy = config.task.policy.use if config.task.policy else ""
        names = config.sim.engine, build_of(config), config.robot.name, config.tool.name, config.task.name, policy
        return cls(run, endpoint, key.secret.hex(), config.run.domain_id, *names)

    def encode(self) -> str:
        """The token as one word."""
        text = json.dumps(asdict(self), separators=(",", ":"))
        return _START + base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")

    @classmethod
    def decode(cls, word: str) -> JoinToken:
        """Read a token."""
        data = word.strip().removeprefix(_START)
        try:
            if data == word.strip():
                raise ValueError(word)
            # `encode` leaves out the padding, but `b64decode` demands it.
            text = base64.b64decode(data + "=" * (-len(data) % 4), altchars=b"-_", validate=True)
            token = _JSON.validate_json(text)
            bytes.fromhex(token.secret)
            split_address(token.endpoint)
        except (ValueError, binascii.Error, ValidationError) as error:
            raise ConfigError("this is no token of a run, or only a part of one", expected=f"{_START}...") from error
        return token

    def check_build(self) -> None:
        """Check that this machine would compute the same throws as the run's own machine."""
        if self.build != build_digest(self.engine, self.robot, self.tool, self.task, self.policy):
            raise ConfigError(
                f"run {self.run}: this machine has other sources, another build of the engine {self.engine} or another "
                f"package of the robot {self.robot}, the tool {self.tool} or the task {self.task}, and would collect "
                "other bytes",
                hint="install the same versions on both machines, or the image on both; throwcollect doctor shows the "
                "build of each",
            )


_JSON = TypeAdapter(JoinToken)
