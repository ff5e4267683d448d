"""The sections that the task of throwing adds to a report: landings, releases, single throws and their physics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
from markupsafe import Markup

from throwcollect.config.sweep import LANDING_HEIGHT
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throw import Throw
from throwcollect.report.contents import Panel, ReportSection, TaskReport, Tile, format_share
from throwcollect.report.maps import draw_map
from throwcollect.report.measured import MOST_POINTS
from throwcollect.report.outcomes import LANDED, Outcomes, in_words
from throwcollect.report.throw import throw_figures
from throwcollect.report.throw.measured import (
    Coverage,
    Landings,
    Residuals,
    choose_examples,
    count_throws,
    measure_residuals,
    read_landings,
)
from throwcollect.robots.description import robot_of
from throwcollect.robots.quintic_curve import sample_positions
from throwcollect.robots.surroundings import BodyLook, looks_of
from throwcollect.tasks.task import commanded_trajectory, task_of
from throwcollect.tasks.throw.flight import BALLISTIC_TOLERANCE_M
from throwcollect.tasks.throw.throw_task import ThrowTask
from throwcollect.wording import format_count

_HEIGHTS = frozenset((LANDING_HEIGHT, "task.bin.height_m", "task.bin.depth_m"))
"""Keys that the height of landings follows from."""


def report_throws(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of a report that only datasets of throws have."""
    robot = robot_of(dataset.config)
    throws, varies = dataset.throws, not _HEIGHTS.isdisjoint(dataset.plan.keys)
    height_m = None if varies else cast("ThrowTask", task_of(dataset.config)).landing_height_m
    landings = read_landings(throws, outcomes)
    planned = landings[outcomes.are(outcomes.success)[landings.row]]
    coverage = count_throws(planned, throws, target=dataset.config.sweep.target)
    examples = list(dataset.select(choose_examples(dataset, planned, outcomes)))
    configs = [dataset.config_of(throw) for throw in examples] or [dataset.config]
    bodies = tuple(dict.fromkeys(body for config in configs for body in looks_of(config)[:-1]))
    return TaskReport(
        subject=f"simulated throw{'s' if len(throws) > 1 else ''} of a ball by {robot.introduction}",
        tiles=tuple(_show_key_numbers(planned, outcomes)),
        results=(
            _show_landings(landings, planned, outcomes, coverage, height_m=height_m, bodies=bodies),
            _show_releases(landings, outcomes),
        ),
        episodes=(
            _show_examples(dataset, examples, outcomes, height_m=height_m, bodies=bodies),
            _show_physics(measure_residuals(dataset)),
        ),
    )


def _choose_middle(throws: Sequence[Throw], success: str) -> Throw:
    """Choose, of the throws that succeeded, the one in the middle; the first of all if none did."""
    landed = [throw for throw in throws if throw.outcome == success]
    return landed[len(landed) // 2] if landed else throws[0]


def _show_key_numbers(landings: Landings, outcomes: Outcomes) -> Iterator[Tile]:
    trials = len(outcomes.codes)
    yield Tile(f"{trials:,}", "throws planned")
    yield Tile(format_share(outcomes.succeeded, trials), in_words(outcomes.success))
    if len(landings):
        distance, speed = landings.distance_m, landings.speed_mps
        yield Tile(f"{distance.min():.2f}–{distance.max():.2f} m", "landing distance")
        yield Tile(f"{speed.min():.2f}–{speed.max():.2f} m/s", "release speed")


def _show_landings(
    landings: Landings,
    planned: Landings,
    outcomes: Outcomes,
    coverage: Coverage | None,
    *,
    height_m: float | None,
    bodies: Sequence[BodyLook],
) -> ReportSection:
    """Show where balls crossed the landing plane; `planned` are those that were thrown as planned."""
    title = "Where the balls land"
    if not len(landings):
        return ReportSection("landing", "Landings", title, f"No ball crossed the {_name_plane(outcomes)}.")
    text = f"{outcomes.succeeded:,} of {len(outcomes.codes):,} throws {outcomes.verbs[1]}"
    if len(planned):
        if outcomes.success != LANDED:
            text += f"; the balls crossed the {_name_plane(outcomes)}"
        x, y, distance = planned.x_m, planned.y_m, planned.distance_m
        text += (
            f"{'' if height_m is None else f' at z = {height_m:g} m'}, {distance.min():.2f} to {distance.max():.2f} m "
            f"from the robot: x {x.min():.2f} to {x.max():.2f} m, y {y.min():.2f} to {y.max():.2f} m"
        )
    others = len(landings) - len(planned)
    text += f". {format_count(others, 'further ball')} crossed the {_name_plane(outcomes)}, too." if others else "."
    # A landing is all that a throw is about, but only a part of what other tasks are about.
    figure = draw_map(landings, outcomes, bodies, speed="release speed" if outcomes.success == LANDED else None)
    notes = [_say_how_many(landings)]
    if len({body.name for body in bodies}) < len(bodies):
        notes.append("Bodies differ from throw to throw; those of a few throws are drawn.")
    above = Panel("map", "Landings from above", figure, " ".join(filter(None, notes)))
    return ReportSection("landing", "Landings", title, text, ((above, *_show_targets(coverage, outcomes.verbs[1])),))


def _show_targets(coverage: Coverage | None, succeeded: str) -> Iterator[Panel]:
    """Show how many throws that succeeded there are in each cell; `succeeded` is what such a throw did, in words."""
    if coverage is None:
        return
    text = f"{coverage.hit:,} of {coverage.counts.size:,} cells have a throw that {succeeded}, "
    text += f"at most {coverage.counts.max():,}"
    if coverage.configured:
        text += f"; {coverage.throws - int(coverage.counts.sum()):,} landed in no cell"
    if len(coverage.axes) == 1:
        figure = throw_figures.draw_coverage_bars(coverage.axes[0], coverage.counts)
        yield Panel("cells", "Throws by target", figure, f"{text}.")
    for number, (first, second, counts) in enumerate(coverage.pairs):
        yield Panel(
            key=f"cells-{number}",
            title=f"{'Targets:' if coverage.configured else 'Throws by'} {first.name} and {second.name}",
            figure=throw_figures.draw_coverage_map(first, second, counts),
            text="" if number else f"{text}.",
        )


def _show_releases(landings: Landings, outcomes: Outcomes) -> ReportSection:
    title = "How the balls are released"
    if not len(landings):
        return ReportSection("release", "Release", title, f"No ball crossed the {_name_plane(outcomes)}.")
    elevation_deg = np.median(landings.elevation_deg)
    text = (
        f"Of the balls that crossed the {_name_plane(outcomes)}, the median speed is "
        f"{np.median(landings.speed_mps):.2f} m/s, the median direction {abs(elevation_deg):.1f}° "
        f"{'below' if elevation_deg < 0 else 'above'} the horizontal."
    )
    figure = throw_figures.draw_release_map(landings, outcomes)
    panel = Panel("map", "Speed and elevation at release", figure, _say_how_many(landings))
    return ReportSection("release", "Release", title, text, ((panel,),))


def _say_how_many(landings: Landings) -> str:
    count = len(landings)
    return f"{MOST_POINTS:,} of {count:,} throws, chosen at random." if count > MOST_POINTS else ""


def _name_plane(outcomes: Outcomes) -> str:
    return "landing plane" if outcomes.success == LANDED else "plane of the rim"


def _show_examples(
    dataset: Dataset,
    throws: Sequence[Throw],
    outcomes: Outcomes,
    *,
    height_m: float | None,
    bodies: Sequence[BodyLook],
) -> ReportSection:
    title = "A few throws"
    if not throws:
        return ReportSection("throws", "Throws", title, "No trial has an episode.")
    text = f"Dotted while the {dataset.config.tool.name} holds the ball; a ring marks the release."
    if (succeeded := sum(throw.outcome == outcomes.success for throw in throws)) > 1:
        text = f"{succeeded} throws that {outcomes.verbs[1]}, from the nearest to the farthest. {text}"
    side, above = throw_figures.draw_ball_views(throws, outcomes, height_m, bodies)
    views = (
        Panel("side", "The ball from the side", side),
        Panel("above", "The ball from above", above),
    )
    middle = _choose_middle(throws, outcomes.success)
    release = middle.events.release
    trajectory = commanded_trajectory(dataset.config_of(middle), middle.read_samples()[1])
    note = f"Joints of trial {middle.trial}: measured (blue) and commanded (orange, dashed)"
    note += "; the vertical line is the release." if release is not None else "."
    commanded = dict(zip(trajectory.joints, sample_positions(trajectory, middle.joints.time_s).T, strict=True))
    sliding = robot_of(dataset.config).sliding
    scales = {name: (1000.0, " mm") if name in sliding else (math.degrees(1), "°") for name in commanded}
    errors = {name: np.abs(middle.joints[name].position - goal).max() for name, goal in commanded.items()}
    joints = tuple(
        Panel(
            key=name,
            title=name,
            figure=throw_figures.draw_joint(middle.joints[name], goal, release, scale),
            text=f"Largest tracking error: {scale[0] * errors[name]:.2g}{scale[1]}.",
            small=True,
        )
        for (name, goal), scale in zip(commanded.items(), scales.values(), strict=True)
    )
    return ReportSection("throws", "Throws", title, text, (views, note, joints))


def _show_physics(residuals: Residuals) -> ReportSection:
    title = "Whether flights obey physics"
    if not len(residuals.finite_m):
        return ReportSection(
            "physics", "Physics", title, "No flight was long enough to compare it with ballistic motion."
        )
    compared = "All episodes"
    if residuals.checked < residuals.episodes:
        compared = f"{residuals.checked:,} of {residuals.episodes:,} episodes, chosen at random,"
    exact = int((residuals.distance_m == 0).sum())
    exactly = f", {exact:,} agree to the last bit (drawn at {throw_figures.FLOOR_M:g} m)" if exact else ""
    text = (
        f"{compared} were compared, sample by sample, with ballistic motion in steps of the physics, from shortly "
        f"after their release on: the largest distance is {residuals.finite_m.max():.1e} m{exactly}. "
    )
    # NaN counts as a departure, too.
    above = int((~(residuals.distance_m <= BALLISTIC_TOLERANCE_M)).sum())
    if above:
        text += Markup("<b>{:,} depart by more than the tolerance</b>; ").format(above)
        text += Markup("<code>throwcollect dataset verify</code> names them.")
    else:
        text += f"None departs by more than the tolerance of {BALLISTIC_TOLERANCE_M:g} m (dashed)."
    heading = "Largest distance of each flight from ballistic motion"
    panel = Panel("residuals", heading, throw_figures.draw_residuals(residuals))
    return ReportSection("physics", "Physics", title, text, ((panel,),))
