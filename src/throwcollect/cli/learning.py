"""`throwcollect fit`, `aim`, `throw`, `score` and `adapt`: learn from a dataset how to hit a target."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import ConfigArgument, DatasetArgument, JsonOption, SetOption, overrides
from throwcollect.cli.printing import align, show, tell
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import ConfigError, PlanError
from throwcollect.extras import require
from throwcollect.side_by_side import count_cores
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from throwcollect.learning.model import Model

ModelArgument = Annotated[Path, typer.Argument(metavar="MODEL", help="Directory of the model.", readable=False)]
ModelOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="MODEL", help="Directory to write; must be new or empty.")
]
ScatterOption = Annotated[
    float, typer.Option("--scatter", min=0, help="Standard deviation of where equal throws end, in its unit.")
]


def fit(
    dataset: DatasetArgument,
    *,
    output: ModelOption,
    targets: str | None = None,
    parameters: str | None = None,
    given: str | None = None,
    onnx: bool = False,
    json: JsonOption = False,
) -> None:
    """Learn from a dataset where throws end, and which parameters lead to a target.

    Options:
        targets (COLUMN,...): Where a trial ended; by default, those of the task.
        parameters (KEY,...): What aiming chooses; by default, all of task.
        given (KEY,...): What is given with a target; by default, those of the task.
        onnx: Write model.onnx, too: target to parameters, for a robot's controller.
    """
    from throwcollect.learning.fitting import fit
    from throwcollect.learning.score import format_length

    if onnx:
        require("onnx")
    model = fit(dataset, targets=_split(targets), parameters=_split(parameters), given=_split(given))
    if onnx:
        model = model.distil()
    model.save(output)
    trained = model.trained_on
    lines = [
        f"learned from {format_count(trained.throws, 'throw')}, {trained.ignored} ignored as they show no target",
        f"parameters: {', '.join(model.parameters)}",
    ]
    for names, what in ((model.given, "given with a target"), (model.latents, "of the world")):
        if names:
            lines.append(f"{what}: {', '.join(names)}")
    each = (f"degree {degree}: {format_length(error, model.targets)}" for degree, error in model.errors.items())
    lines.append(f"error for throws that it was not fitted to, in simulation, median: {', '.join(each)}")
    lines.append(f"model: {output}\naim with it: {command('aim', output, '--at', _write_example(model))}")
    show(model.model_dump(mode="json", include={"targets", "axes", "errors", "trained_on"}), *lines, json=json)


def aim(
    directory: ModelArgument,
    *,
    at: list[str] | None = None,
    targets: Path | None = None,
    output: Path | None = None,
    choose: str = "nearest",
    json: JsonOption = False,
) -> None:
    """Find parameters of throws at targets.

    Options:
        at (X,Y): A target, and what is given with it; may be repeated.
        targets (FILE): CSV file of targets, with a header line.
        output (--output -o FILE): CSV file to write, for the sampler `list`.
        choose: Which of several throws: nearest or least-effort.
    """
    from throwcollect.config.loader import load as load_config
    from throwcollect.learning.aiming import explain_reach
    from throwcollect.learning.lists import read_targets, write_aims
    from throwcollect.learning.model import CONFIG, load_model

    model = load_model(directory)
    names = (*model.targets, *model.given)
    given = [_read_target(text, names) for text in at or ()]
    task = load_config(directory / CONFIG).task
    if targets is not None:
        given += read_targets(targets, names, task)
    if not given:
        raise ConfigError(
            "no target",
            expected="--at, or --targets FILE",
            hint=command("aim", directory, "--at", _write_example(model)),
        )
    aims = model.aim(given, choose=choose)
    lines = [" ".join(f"--set {key}={value!r}" for key, value in aim.parameters.items()) for aim in aims]
    if output is not None:
        write_aims(output, aims, names, task)
        lines = [f"{output}: {format_count(len(aims), task.noun)}"]
    show([aim.as_dict() for aim in aims], *lines, json=json)
    for number, aim in enumerate(aims, start=1):
        if not aim.reachable:
            tell(f"target {number} of {len(aims)} is out of reach: {explain_reach(model, aim)}")
    if not all(aim.reachable for aim in aims):
        raise typer.Exit(1)


def throw(
    path: ConfigArgument = DEFAULT_CONFIG,
    *,
    settings: SetOption = None,
    points: Path | None = None,
    json: JsonOption = False,
) -> None:
    """Simulate throws in this process, without nodes and files.

    Options:
        points (--list FILE): CSV or Parquet file: a throw for each row.
    """
    from throwcollect.plan.point_file import read_points
    from throwcollect.simulator import Simulator

    with Simulator(path, overrides=overrides(settings)) as simulator:
        rows: Sequence[tuple[dict[str, float], dict[str, float]]] = [({}, {})]
        if points is not None:
            read = read_points(points, simulator.config, key="--list")
            rows = [read.row(number) for number in range(len(read))]
        measures = simulator.config.task.targets
        measures += tuple(dict.fromkeys(each.miss for each in simulator.config.task.target_columns))
        refused = 0
        for number, (values, target) in enumerate(rows):
            try:
                found = simulator.throw(values, trial=number, target=target)
            except PlanError as error:
                if points is None:
                    raise
                refused += 1
                tell(f"throw {number}: refused: {error.problems[0]}")
                continue
            row = found.row
            ends = ", ".join(f"{name} {row[name]:.6f}" for name in measures if isinstance(row.get(name), float))
            show(row, f"throw {number}: {found.outcome}: {ends or found.reason}", json=json, indent=None)
    if refused:
        raise typer.Exit(1)


def score(
    directory: ModelArgument,
    *,
    targets: int = 40,
    seed: int = 0,
    seeds: int = 3,
    world: Path | None = None,
    settings: SetOption = None,
    scatter: ScatterOption = 0.0,
    policy: str | None = None,
    hit: float = 0.1,
    json: JsonOption = False,
) -> None:
    """Throw at targets in simulation, and note in the model how well it hits.

    Options:
        targets (N 1..): Number of targets for each seed.
        seed (N 0..): First seed; targets are chosen by it.
        seeds (N 1..): Number of seeds; their medians count.
        world (--config CONFIG): Another world, in which the model is adapted by a few throws.
        policy (MODULE:FUNCTION): Score this policy instead; MODEL may be a dataset.
        hit: With --policy: largest miss of a hit, in its unit.
    """
    from throwcollect.learning.model import CONFIG, load_model
    from throwcollect.simulator import Simulator

    if policy is not None:
        own = directory / CONFIG
        worlds = {own: overrides(settings)} if world is None else {own: [], world: overrides(settings)}
        _score_policy(directory, policy, worlds, targets, range(seed, seed + seeds), hit, json=json)
        return
    model = load_model(directory)
    if settings and world is None:
        raise ConfigError("--set: there is no other world", expected="--config CONFIG")
    with ExitStack() as opened:
        simulator = opened.enter_context(Simulator(directory / CONFIG))
        other = None if world is None else opened.enter_context(Simulator(world, overrides=overrides(settings)))
        found = model.score(
            simulator, targets=targets, seed=seed, seeds=seeds, world=other, scatter=scatter, processes=count_cores()
        )
    model.write_score(directory, found)
    show(found, *_describe_score("throws", targets, seeds, found.list_rows()), json=json)


def adapt(
    directory: ModelArgument,
    throws: Path,
    *,
    output: ModelOption,
    method: str = "auto",
    scatter: ScatterOption = 0.0,
    json: JsonOption = False,
) -> None:
    """Correct a model by a few throws of another robot or simulation.

    Options:
        throws (THROWS): CSV file with what was thrown and where it ended, or a dataset.
        method: What the world may differ by: auto, offset, bias, latent or none.
    """
    from throwcollect.learning.lists import read_throws
    from throwcollect.learning.model import load_model
    from throwcollect.learning.score import format_length

    model = load_model(directory)
    keys = (*model.parameters, *model.given)
    rows = read_throws(throws, model)
    adapted = model.adapt(
        [dict(zip(keys, row[: len(keys)], strict=True)) for row in rows],
        [row[len(keys) :] for row in rows],
        method=None if method == "auto" else method,
        scatter=scatter,
    )
    adapted.save(output)
    entry = adapted.adaptation
    if entry is None:
        return
    lines = [f"{format_count(entry.throws, 'throw')}; what differs: {entry.method.value}"]
    for estimate in entry.found:
        lines.append(f"{estimate.name}: {estimate.value:.4g} (standard deviation {estimate.deviation:.2g})")
    before, after = entry.medians
    lines.append(f"median miss before: {format_length(before, model.targets)}")
    if after is not None:
        lines[-1] += f"; after, each by a model of the others: {format_length(after, model.targets)}"
    show(entry, *lines, json=json)


def _split(names: str | None) -> tuple[str, ...]:
    return tuple(name.strip() for name in names.split(",")) if names else ()


def _write_example(model: Model) -> str:
    middle = model.outputs[len(model.outputs) // 2]
    given = [axis.nominal for axis in model.axes if axis.key in model.given]
    return ",".join(f"{value:.2f}" for value in (*middle.tolist(), *given))


def _read_target(text: str, names: Sequence[str]) -> list[float]:
    """Read the numbers of an option --at, one for each name."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != len(names):
        raise ConfigError(f"--at {text}", expected=f"{format_count(len(names), 'number')}: {','.join(names)}")
    return values


def _score_policy(
    directory: Path, policy: str, worlds: dict[Path, list[str]], count: int, seeds: range, hit: float, *, json: bool
) -> None:
    """Score a policy at targets that a model or a dataset has, in some worlds, each with what `--set` changes."""
    from throwcollect.config.loader import load as load_config
    from throwcollect.config.motion import PolicyConfig
    from throwcollect.config.values import with_values
    from throwcollect.learning.fitting import read_ends
    from throwcollect.learning.scoring import score_policy
    from throwcollect.simulator import Simulator

    ends = read_ends(directory)
    with ExitStack() as opened:
        simulators = {}
        for path, changes in worlds.items():
            config = load_config(path, changes)
            section = (config.task.policy or PolicyConfig(use=policy)).model_copy(update={"use": policy})
            simulator = Simulator(with_values(config, {"task.policy": section}))
            simulators[str(path)] = opened.enter_context(simulator)
        found = score_policy(ends, simulators, count, seeds, hit=hit, processes=count_cores())
    rows = [(each.world, f"{each.hits:.0%}", *each.errors.cells) for each in found]
    show(found, *_describe_score(f"{policy} throws", count, len(seeds), rows, "hits"), json=json)


def _describe_score(who: str, targets: int, seeds: int, rows: Sequence[Sequence[str]], *head: str) -> list[str]:
    from throwcollect.learning.score import SCORE_HEAD

    thrown = f"{who} at {format_count(targets, 'target')} for each of {format_count(seeds, 'seed')}"
    return [f"{thrown}, medians of the seeds, in simulation:", *align([("", *head, *SCORE_HEAD), *rows], numbers=True)]
