"""Keys for how a collection is run, wherever its nodes live."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, PositiveFloat

from throwcollect.config.section import Section
from throwcollect.members import names_of

if TYPE_CHECKING:
    RuntimeName = str
else:
    # Packages may add runtimes, so their names are known only when the program runs.
    RuntimeName = Literal[("auto", *names_of("runtimes"))]


_PORT = "[1-9][0-9]{0,3}|[1-5][0-9]{4}|6([0-4][0-9]{3}|5([0-4][0-9]{2}|5([0-2][0-9]|3[0-5])))"
ListenAddress = Annotated[str, Field(pattern=rf"^tcp/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9.-]+):({_PORT})$")]


class RunConfig(Section):
    """How a collection is run; nothing in this section changes the dataset."""

    simulations: Annotated[int, Field(ge=0, le=256)] = 2
    """Number of simulations, unless `-n` says otherwise; 0 only with `listen`, if other machines run all of them."""
    runtime: RuntimeName = "auto"
    """Where the nodes run: in processes (`local`) or in containers.

    `auto` takes containers if an engine of this machine answers. `inprocess` takes one simulation without nodes: for
    tests, breakpoints and Python programs."""
    router_port: Annotated[int, Field(ge=0, le=65535)] = 0
    """TCP port of the router on the loopback interface; 7447 is the one ROS nodes look for.

    0 takes any free port; a router in a container then publishes no port."""
    listen: ListenAddress | None = None
    """Address at which simulations of other machines can join (`throwcollect join-run`), such as `tcp/0.0.0.0:7447`;
    they need the token of the run. Null: this machine alone."""
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
    """Real time after which a simulation that is still at the same trial is started again; if it still answers, all
    trials have twice the time from then on. It comes on top of the real time that `sim.max_trial_s` takes at real-time
    speed, or in slow motion (`sim.real_time_factor`)."""
    start_timeout_s: PositiveFloat = 60.0
    """Real time within which the first simulation must be ready once it runs."""
    grace_s: Annotated[float, Field(ge=0, le=3600)] = 8.0
    """Real time that running trials have left after Ctrl-C or SIGTERM; `throwcollect resume` runs those that did not
    end."""
    retries: Annotated[int, Field(ge=0, le=100)] = 3
    """How often a trial is tried again, by another simulation if there is one, before it is recorded as `lost`. A try
    of a simulation that is alive, and only slow or cut off for a while, does not count."""
    replay: Annotated[int, Field(ge=0)] = 3
    """How many trials, chosen by the seed, a fresh process simulates again at the end, to be compared bit for bit."""
    restarts: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often one simulation is restarted before the run goes on without it."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.listen is None and self.simulations == 0:
            yield "simulations", "should be 1 or more, as no other machine can join (run.listen), got 0"
        if self.listen is not None and self.open:
            yield "open", "should be false, as other machines can reach the run (run.listen)"
        if self.listen is not None and self.runtime not in ("auto", "local"):
            yield "runtime", f"should be local, as other machines are to join (run.listen), got {self.runtime}"
