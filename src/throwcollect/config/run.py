"""Keys for how a collection is run, wherever its nodes live."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Annotated, Any, Literal

from pydantic import Field, PositiveFloat, ValidationError, WrapValidator

from throwcollect.config.section import Section

RUNTIMES = "throwcollect.runtimes"
"""Group of the entry points by which other packages add runtimes."""


def _accept_added(value: Any, validate: Callable[[Any], str]) -> str:
    """A runtime of ours, or the name of one that another package adds; for anything else, ours are what is expected."""
    try:
        return validate(value)
    except ValidationError:
        if isinstance(value, str) and entry_points(group=RUNTIMES, name=value):
            return value
        raise


class RunConfig(Section):
    """How a collection is run; nothing in this section changes the dataset."""

    simulations: Annotated[int, Field(ge=1, le=256)] = 2
    """Number of simulations, unless `-n` says otherwise."""
    runtime: Annotated[Literal["auto", "local", "docker", "inprocess"], WrapValidator(_accept_added)] = "auto"
    """Where the nodes run: in processes (`local`) or in containers; `auto` takes containers if an engine answers.

    `inprocess` takes one simulation without nodes: for tests, breakpoints and Python programs."""
    router_port: Annotated[int, Field(ge=0, le=65535)] = 0
    """TCP port of the router on the loopback interface; 7447 is the one ROS nodes look for.

    0 takes a free one, and publishes none of a container."""
    open: bool = False
    """Anybody who reaches the router may join, read and disturb the run; episodes are still signed."""
    ros: Literal["auto", "rclpy", "embedded"] = "auto"
    """What nodes run on: genuine ROS 2 (`rclpy`) or the embedded client; `auto` takes rclpy where it is installed."""
    root_namespace: bool = False
    """The one simulation lives in the root namespace, where nodes look for the real robot (`/clock`, `/tf`,
    `/arm_left_controller/...`), and not in `/sim_0`."""
    domain_id: Annotated[int, Field(ge=0, le=232)] = 0
    """ROS domain."""
    trial_timeout_s: PositiveFloat = 60.0
    """Real time that a simulation may take for one trial before it counts as lost, besides what slow motion takes."""
    start_timeout_s: PositiveFloat = 60.0
    """Real time within which the first simulation must be ready once it runs."""
    grace_s: Annotated[float, Field(ge=0, le=3600)] = 8.0
    """Real time that running trials get to end in after Ctrl-C or SIGTERM; what is dropped then is run when resumed."""
    retries: Annotated[int, Field(ge=0, le=100)] = 3
    """How often a trial is given to another simulation before it is recorded as failed."""
    replay: Annotated[int, Field(ge=0)] = 3
    """How many trials, chosen by the seed, a fresh process simulates again at the end, to be compared bit for bit."""
    restarts: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often one simulation is restarted before it is given up."""
