"""Keys of a policy: what commands the joints of a trial, step by step, in place of a planned motion."""

from typing import Annotated, Literal

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Section

SESSION = "session"
"""`task.policy.use` of a dataset that clients of a session have recorded; nothing can be simulated by it."""


class PolicyConfig(Section):
    """A policy in the loop."""

    use: str
    """Function that makes the policy: `module:function`, or the name that a package gives it (docs/learning.md)."""
    rate_hz: Annotated[int, Field(ge=1, le=10000)] = 50
    """Commands per simulated second; must divide `sim.physics_hz`."""
    observation: list[str] = []
    """Arrays that the policy gets; empty for all that there are but pictures."""
    command: Literal["position", "velocity"] = "position"
    """What the policy commands for each joint of `task.end`: the position at the next command [rad], or the velocity
    until then [rad/s]."""
    timeout_s: Annotated[float, Field(gt=0, le=3600), Key(Effect.RUN)] = 3.0
    """Real time that one command may take."""
    reproducible: Annotated[bool, Key(Effect.PLAN)] = True
    """Whether the policy is a function of its seed and its observations; if not, no trial is simulated again at the
    end, and the data card says so."""
