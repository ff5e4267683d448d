"""The data card of a dataset: contents and origin of the dataset, for people who find it."""

from __future__ import annotations

import math

import pyarrow as pa

from throwcollect.config.motion import SESSION
from throwcollect.config.schema import MOTIONS, Config
from throwcollect.config.shape import unit_of_key
from throwcollect.config.values import keys_by_column
from throwcollect.dataset.bag import to_yaml
from throwcollect.dataset.directory import TRIALS
from throwcollect.dataset.provenance import Provenance
from throwcollect.dataset.throws_table import count_outcomes
from throwcollect.plan.arrow_column import find_range
from throwcollect.robots.description import robot_of

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
_MORE = "1M<n<10M"


def outcome_lines(throws: pa.Table) -> list[str]:
    """Write the table of outcomes of a data card, in Markdown."""
    counts = count_outcomes(throws).items()
    return ["| outcome | trials |", "|---|---|", *(f"| {outcome} | {count} |" for outcome, count in counts)]


def data_card(config: Config, throws: pa.Table, provenance: Provenance) -> str:
    """Write the README.md of a dataset, with the YAML header that dataset hubs read."""
    episodes = len(throws) - throws["digest"].null_count
    size = next((label for limit, label in _SIZES if episodes < limit), _MORE)
    measures = ", ".join(config.task.events) or "measures"
    header = {
        "license": "apache-2.0",
        "pretty_name": config.name,
        "task_categories": ["robotics"],
        "tags": ["robotics", config.task.keyword or config.task.name, "ros2", "mcap", config.robot.name, "simulation"],
        "size_categories": [size],
        "configs": [{"config_name": "throws", "data_files": "throws.parquet"}],
    }
    lines = [
        "---\n" + to_yaml(header) + "---\n",
        f"# {config.name}",
        "",
        f"{episodes} simulated {config.task.subject} by {robot_of(config).title}, each with the joint states of "
        f"the robot and the odometry of the {config.acted_on} at {config.record.rate_hz} Hz. Made with throwcollect.",
        "",
        *outcome_lines(throws),
        "",
        "## Files",
        "",
        "- `metadata.yaml` and `*.mcap`: the recordings, a rosbag2 bag (`ros2 bag info`, Foxglove, `rosbags`, `mcap`).",
        f"- `throws.parquet`: one row a trial: swept values, outcome, {measures}, place of its recording.",
        "- `plan.parquet`: the trials, each as it was drawn before it ran.",
        "- `config.yaml`: the configuration"
        + ("; collecting with it again yields the same data." if is_reproducible(config) else "."),
        *([f"- `{TRIALS}`: the list of points that the configuration reads."] if config.sweep.file else []),
        *([f"- `{MOTIONS}`: the motions of the trials."] if config.task.trajectory.family == "file" else []),
        "",
        *_list_ranges(config, throws),
        "## Limits",
        "",
        _LIMITS.get(config.sim.engine, f"Simulated with the physics engine `{config.sim.engine}`.")
        + f" {config.task.noun.capitalize()}s that failed are kept; `outcome` has the kind of failure."
        + _describe_policy(config),
        "",
        "## Provenance",
        "",
        "| | |",
        "|---|---|",
        # People publish the card, and the name of a machine is private; provenance.json has it.
        *(f"| {name} | {value} |" for name, value in provenance.facts().items() if name != "host"),
        "",
    ]
    return "\n".join(lines)


_RIGID_BODIES = (
    "Simulated with {}: rigid bodies, the base of the robot fixed, ideal motors within effort limits, no sensor noise."
)
_LIMITS = {
    "bullet": _RIGID_BODIES.format("Bullet"),
    "mujoco": _RIGID_BODIES.format("MuJoCo"),
    "ballistic": "Computed without contacts (`sim.engine: ballistic`): the arm is always where it is commanded to be, "
    "and the ball leaves the tool when the tool would have to pull it. No robot throws like that.",
}
"""What engines leave out; nothing is known of engines of other packages."""


def _describe_policy(config: Config) -> str:
    """Name the policy that commanded the joints, and state what follows if it is not reproducible."""
    if (policy := config.task.policy) is None:
        return ""
    if policy.use == SESSION:
        return " Recorded in a session: clients commanded the joints, and no trial can be simulated again."
    text = f" The policy `{policy.use}` commanded the joints at {policy.rate_hz} Hz."
    return text if policy.reproducible else text + " It is not reproducible: collecting again gives other data."


def is_reproducible(config: Config) -> bool:
    """Whether collecting with a configuration again gives the same data."""
    return config.task.policy is None or config.task.policy.reproducible


def _list_ranges(config: Config, throws: pa.Table) -> list[str]:
    rows = []
    for name, key in keys_by_column(config, throws.column_names).items():
        lowest, highest = find_range(throws[name]) or (math.nan, math.nan)
        rows.append(f"| `{key}` | {unit_of_key(key)} | {lowest:g} | {highest:g} |")
    return [
        "## What varies",
        "",
        *_describe_drawing(config),
        "",
        "| key | unit | lowest | highest |",
        "|---|---|---|---|",
        *rows,
        "",
    ]


def _describe_drawing(config: Config) -> list[str]:
    """Describe how the values were drawn, one sentence a line."""
    if config.task.policy is not None and config.task.policy.use == SESSION:
        return ["Nothing was drawn: what differs is what clients did."]
    lines = [f"Drawn by the sampler `{config.sweep.sampler}` with seed {config.seed}."]
    if config.until is not None:
        wanted = f"{config.until.wanted} {config.task.noun}s had {config.until.outcome()}"
        lines.append(f"Collected in order of trials until {wanted}, or all trials had been used up.")
    return lines
