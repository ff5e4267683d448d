"""`throwcollect init`, `config`, `plan` and `doctor`: prepare a collection, and look at what it would do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from throwcollect.cli.options import ConfigArgument, JsonOption, SetOption, TrialsOption, overrides
from throwcollect.cli.printing import Display, format_number, show, tell
from throwcollect.cli.robot_commands import FlangeOption, read_robot, write_robot
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import ConfigError
from throwcollect.side_by_side import count_cores
from throwcollect.wording import command

if TYPE_CHECKING:
    from throwcollect.config.robot_config import RobotConfig
    from throwcollect.plan.plan import Plan
    from throwcollect.tasks.starter import Beginning


def init(*, robot: str = "talos", flange: FlangeOption = None, task: str = "throw") -> None:
    """Write a commented throwcollect.yaml, for `throwcollect up`.

    For a robot without a default motion, it searches a throw that lands.

    Options:
        robot (ROBOT): The robot: its name, a robot.yaml or its directory, or a URDF (--flange).
        task (NAME): What it does: task.name.
    """
    from throwcollect.files import write_file
    from throwcollect.tasks.starter import begin_at_default, check_task, write_starter

    check_task(task)
    section = read_robot(robot, flange)
    beginning = begin_at_default(section.name, task) if robot == section.name else None
    text = write_starter(task, beginning or _search_beginning(robot, section, task))
    if DEFAULT_CONFIG.exists():
        raise ConfigError(f"{DEFAULT_CONFIG}: is there already", hint="move it away, or go to another directory")
    write_file(DEFAULT_CONFIG, text.encode())
    typer.echo(f"{DEFAULT_CONFIG}: written. Look at the trials with {command('plan')}, and collect them with:")
    typer.echo(f"  {command('up')}")


def _search_beginning(robot: str, section: RobotConfig, task: str) -> Beginning:
    from throwcollect.extras import is_installed
    from throwcollect.learning.first_throw import FirstThrowSearch

    engine = "bullet" if is_installed("pybullet") else "mujoco"
    return FirstThrowSearch(section, write_robot(robot, section), task, engine, tell).run()


def config(
    path: ConfigArgument = DEFAULT_CONFIG, *, settings: SetOption = None, schema: bool = False, json: JsonOption = False
) -> None:
    """Print the resolved configuration.

    Options:
        schema: Print the JSON Schema instead.
    """
    from throwcollect.config.loader import dump_yaml, load
    from throwcollect.config.shape import root

    if schema:
        show(root().node, json=True)
        return
    found = load(path, overrides(settings))
    typer.echo(found.model_dump_json(indent=2) if json else dump_yaml(found), nl=json)


def fit_dmp(path: ConfigArgument = DEFAULT_CONFIG, *, settings: SetOption = None, basis_functions: int = 25) -> None:
    """Print a section `task` that follows the motion of a configuration, such as one of a file, by DMPs.

    Options:
        basis_functions (N 2..500): Basis functions of each joint.
    """
    from throwcollect.config.loader import dump_yaml, load
    from throwcollect.robots.description import robot_of
    from throwcollect.robots.trajectory import sample_positions
    from throwcollect.tasks.dmp import fit_motions
    from throwcollect.tasks.task import trajectory_of

    config = load(path, overrides(settings))
    motion = trajectory_of(config)
    (family,) = fit_motions([motion], basis_functions=basis_functions)
    default, times = type(config.task).model_fields["points_hz"].default, motion.times
    keys = {"trajectory": family, "duration_s": float(times[-1]), "points_hz": default}
    fitted = config.model_copy(update={"task": config.task.model_copy(update=keys)})
    misses = abs(sample_positions(trajectory_of(fitted), times) - motion.positions).max(axis=0).tolist()
    miss, joint = max(zip(misses, motion.joints, strict=True))
    typer.echo(dump_yaml(fitted, "task"), nl=False)
    tell(f"the DMP stays within {miss:.2g} {robot_of(config).unit_of(joint)} of the motion; farthest is {joint}")


def plan(
    path: ConfigArgument = DEFAULT_CONFIG,
    *,
    settings: SetOption = None,
    trials: TrialsOption = None,
    output: Path | None = None,
    sensors: Path | None = None,
    json: JsonOption = False,
) -> None:
    """Print the trials without running them.

    Options:
        output (--output -o DIR): Freeze the plan in DIR, for `up --slice`, instead of printing it.
        sensors (DIR): Write the first frame of each sensor as PNG file in DIR.
    """
    from throwcollect.collect.coordinator.prepare import count_trials, draw_plan, prepare
    from throwcollect.config.loader import load_locating_errors

    with load_locating_errors(path, overrides(settings, trials=trials)) as config:
        if sensors is not None and not config.sensors:
            raise ConfigError(f"--sensors {sensors}: the configuration has no sensors")
        reporter = Display(quiet=json)
        if output is None:
            found = draw_plan(config, directory=path.parent, processes=count_cores(), reporter=reporter)
        else:
            found = prepare(config, output, sweep_directory=path.parent, processes=count_cores(), reporter=reporter)
    _load_world(found, sensors, quiet=json)
    if json:
        facts = ("seed", "digest", "refused")
        targets = found.trials.points.target_names
        show(
            [
                {"trial": each.number, "values": dict(each.values), **{name: getattr(each, name) for name in facts}}
                | ({"target": dict(each.target)} if targets else {})
                for each in found.trials
            ],
            json=True,
        )
        return
    if output is None:
        names = found.trials.points.names
        typer.echo("  ".join(["trial", *names]))
        for trial in found.trials:
            values = {**trial.values, **trial.target}
            numbers = [format_number(values.get(name)).rjust(len(name)) for name in names]
            note = f"  refused: {trial.refused}" if trial.refused else ""
            typer.echo("  ".join([f"{trial.number:5}", *numbers]) + note)
    tell(f"{count_trials(found)}; {len(found.trials.refused)} refused")


def _load_world(plan: Plan, pictures: Path | None, *, quiet: bool) -> None:
    """Load the world of the first trial that is not refused, because an engine may not take what a plan allows.

    If there are sensors, it prints what they cost, and writes what they see first into a directory that is given.
    """
    from throwcollect.collect.coordinator.sensor_cost import measure_sensors
    from throwcollect.extras import MissingExtraError
    from throwcollect.sim.world import World

    try:
        if not plan.config.sensors:
            World(plan.config_of(next(trial for trial in plan.trials if not trial.refused))).close()
            return
        cost = measure_sensors(plan)
    except MissingExtraError as error:
        tell(f"whether the engine takes the robot is not known: {error.one_line}")
        return
    for name, body in cost.inside.items():
        tell(f"warning: sensors.{name}: {body} fills the first picture; the camera may be inside of it")
    if not quiet:
        tell(cost.words)
    if pictures is not None:
        from throwcollect.publish.view.sensor_pictures import write_first_frames

        write_first_frames(cost.first, pictures)


def doctor(*, json: JsonOption = False) -> None:
    """Check what this machine can do."""
    from throwcollect.collect.runs.doctor import examine

    checks = examine(Path.cwd())
    width = max(len(check.name) for check in checks)
    lines = [f"{check.status:8}{check.name:{width}}  {check.finding}" for check in checks]
    show(checks, *lines, json=json)
    if any(check.status == "problem" for check in checks):
        raise typer.Exit(1)
