"""The sections of a report on single throws: paths and joints of a few, and how far flights depart from physics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from numpy.typing import NDArray

from throwcollect.dataset.motion import Joint
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throw import BodyEvent, Throw
from throwcollect.progress_log import log_progress
from throwcollect.publish.report.contents import Panel, ReportSection
from throwcollect.publish.report.figures import (
    BLUE,
    LEGEND_ABOVE,
    LIMIT_LINE,
    MOMENT_LINE,
    NEUTRAL,
    Points,
    draw_bodies,
    place_bars,
    single_precision,
)
from throwcollect.publish.report.measured import Outcomes, describe
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import BodyLook
from throwcollect.robots.trajectory import sample_positions
from throwcollect.tasks.task import commanded_trajectory
from throwcollect.tasks.throw.flight import BALLISTIC_TOLERANCE_M, flight_residual

MOST_RESIDUALS = 2000
"""Most episodes whose flight is computed again, which takes some 15 s; `verify` computes the flights of all."""
_MOST_LANDED = 6
_MOST_OTHERS = 3
_SHADES = ("#3b528b", "#2c728e", "#21908d", "#27ad81", "#5dc863", "#aadc32")
"""Colours of paths that landed, from the nearest to the farthest."""
FLOOR_M = 1e-17
"""Smaller residuals are drawn as this value, as 0 has no place on a logarithmic axis."""


def choose_examples(dataset: Dataset, landed: Points, outcomes: Outcomes) -> tuple[int, ...]:
    """Choose trials to look at: some that succeeded, by distance from near to far, and one of some other outcomes."""
    recorded = set(dataset.recorded.throws["trial"].to_pylist())
    by_distance = landed.trial[np.argsort(landed.distance_m, kind="stable")].tolist()
    usable = [trial for trial in by_distance if trial in recorded]
    picks = np.linspace(0, len(usable) - 1, min(len(usable), _MOST_LANDED)).round().astype(int)
    numbers = dataset["trial"]
    others = (
        next((trial for trial in numbers[outcomes.are(name)].tolist() if trial in recorded), None)
        for name in outcomes.names
        if name != outcomes.success
    )
    return (*(usable[pick] for pick in picks), *[trial for trial in others if trial is not None][:_MOST_OTHERS])


def show_examples(
    dataset: Dataset,
    throws: Sequence[Throw],
    outcomes: Outcomes,
    *,
    height_m: float | None,
    bodies: Sequence[BodyLook],
) -> ReportSection:
    """Show paths of the ball in some throws, and the joints of the one in the middle."""
    title = "A few throws"
    if not throws:
        return ReportSection("throws", "Throws", title, "No trial has an episode.")
    text = f"Dotted while the {dataset.config.tool.name} holds the ball; a ring marks the release."
    if len(succeeded := [throw for throw in throws if throw.outcome == outcomes.success]) > 1:
        text = f"{len(succeeded)} throws that {outcomes.verbs[1]}, from the nearest to the farthest. {text}"
    side, above = _draw_paths(throws, outcomes, 2, bodies), _draw_paths(throws, outcomes, 1, bodies)
    if height_m is not None:
        side.add_hline(y=height_m, line={"color": NEUTRAL, "width": 1})
    views = (Panel("side", "The ball from the side", side), Panel("above", "The ball from above", above))
    middle = succeeded[len(succeeded) // 2] if succeeded else throws[0]
    release = middle.events.release
    trajectory = commanded_trajectory(middle.config, middle.read_samples()[1])
    note = f"Joints of trial {middle.trial}: measured (blue) and commanded (orange, dashed)"
    note += "; the vertical line is the release." if release is not None else "."
    sliding, joints = robot_of(dataset.config).sliding, list[Panel]()
    for name, goal in zip(trajectory.joints, sample_positions(trajectory, middle.joints.time_s).T, strict=True):
        joint = middle.joints[name]
        factor, unit = (1000.0, " mm") if name in sliding else (math.degrees(1), "°")
        error = f"Largest tracking error: {factor * np.abs(joint.position - goal).max():.2g}{unit}."
        joints.append(Panel(name, name, draw_joint(joint, goal, release, (factor, unit)), error, small=True))
    return ReportSection("throws", "Throws", title, text, (views, note, tuple(joints)))


def _draw_paths(throws: Sequence[Throw], outcomes: Outcomes, axis: int, bodies: Sequence[BodyLook]) -> go.Figure:
    """Draw paths of the ball, x against another coordinate: from above with y, from the robot's right with z."""
    letter, title, outline = {1: ("y", "y, left [m]", "above_m"), 2: ("z", "z, up [m]", "side_m")}[axis]
    figure = go.Figure()
    landed = [throw.trial for throw in throws if throw.outcome == outcomes.success]
    for throw in throws:
        name, colour = f"trial {throw.trial}, {describe(throw.outcome)}", outcomes.style_of(throw.outcome).colour
        if throw.outcome == outcomes.success:
            name = f"trial {throw.trial}"
            colour = _SHADES[landed.index(throw.trial) * (len(_SHADES) - 1) // max(len(landed) - 1, 1)]
        x, y = (single_precision(throw.ball.position[:, each]) for each in (0, axis))
        left = throw.events.release
        release = len(x) - 1 if left is None else int(np.searchsorted(throw.ball.time_s, left.time_s))
        hover = f"x %{{x:.3f}} m, {letter} %{{y:.3f}} m<extra>{name}</extra>"
        common = {"legendgroup": name, "name": name, "hovertemplate": hover}
        # Both lines include the sample of the release, so that they meet.
        held, free = slice(release + 1), slice(release, None)
        line = {"color": colour, "width": 1, "dash": "dot"}
        figure.add_scatter(x=x[held], y=y[held], mode="lines", line=line, showlegend=False, **common)
        figure.add_scatter(x=x[free], y=y[free], mode="lines", line={"color": colour, "width": 2}, **common)
        if left is not None:
            at = slice(release, release + 1)
            marker = {"color": colour, "size": 8, "symbol": "circle-open", "line": {"width": 2}}
            figure.add_scatter(x=x[at], y=y[at], mode="markers", marker=marker, showlegend=False, **common)
    figure.update_xaxes(title="x, forward [m]", constrain="domain")
    figure.update_yaxes(title=title, scaleanchor="x", constrain="domain")
    draw_bodies(figure, bodies, outline)
    return figure.update_layout(height=480, legend=LEGEND_ABOVE)


def draw_joint(
    joint: Joint, commanded: NDArray[np.float64], release: BodyEvent | None, scale: tuple[float, str]
) -> go.Figure:
    """Draw commanded and measured position of one joint; the scale is a factor on these and the unit it leads to."""
    factor, unit = scale
    figure = go.Figure()
    for values, name, line in (
        (joint.position, "measured", {"color": "#56B4E9", "width": 4}),
        (commanded, "commanded", {"color": "#D55E00", "width": 1.5, "dash": "dash"}),
    ):
        figure.add_scatter(
            x=single_precision(joint.time_s),
            y=single_precision(factor * values),
            mode="lines",
            name=name,
            line=line,
            hovertemplate=f"%{{x:.3f}} s, %{{y:.2f}}{unit}<extra>{name}</extra>",
        )
    if release is not None:
        figure.add_vline(x=release.time_s, line=MOMENT_LINE, name="release")
    figure.update_xaxes(title="time [s]")
    positions = factor * np.concatenate([commanded, joint.position])
    figure.update_yaxes(title=f"position [{unit.strip()}]", range=_choose_span(positions))
    return figure.update_layout(height=230, showlegend=False)


def _choose_span(positions: NDArray[np.float64]) -> list[float]:
    """Choose the range of positions to show [°; mm]: at least 6, so that a joint at rest looks at rest."""
    finite = positions[np.isfinite(positions)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    room = max(0.05 * (high - low), 3.0 - (high - low) / 2)
    return [low - room, high + room]


def measure_residuals(dataset: Dataset) -> NDArray[np.float64]:
    """Measure how far flights depart from ballistic motion, at most `MOST_RESIDUALS` of them.

    Returns:
        Largest distance of each flight that could be compared [m], shape ``(n,)``; nan if a sample is not a number.
    """
    trials = dataset.recorded.throws["trial"].to_numpy()
    # Episodes are chosen at random, as every n-th point of a Sobol sequence or a grid would lie on a lattice.
    chosen = np.sort(np.random.default_rng(0).permutation(trials)[:MOST_RESIDUALS])
    distances = []
    for trial in log_progress(chosen.tolist(), len(chosen), "flight", "compared"):
        throw = dataset.throw(trial)
        header, samples = throw.read_samples()
        distance = flight_residual(samples, header, config=throw.config)
        if distance is not None:
            distances.append(distance)
    return np.array(distances)


def show_physics(distance_m: NDArray[np.float64], episodes: int) -> ReportSection:
    """Show how far flights depart from ballistic motion, as `measure_residuals` found it for that many episodes."""
    title = "Whether flights obey physics"
    finite_m = distance_m[np.isfinite(distance_m)]
    if not len(finite_m):
        return ReportSection(
            "physics", "Physics", title, "No flight was long enough to compare it with ballistic motion."
        )
    compared = "All episodes"
    if episodes > MOST_RESIDUALS:
        compared = f"{MOST_RESIDUALS:,} of {episodes:,} episodes, chosen at random,"
    exact = int((distance_m == 0).sum())
    exactly = f", {exact:,} agree to the last bit (drawn at {FLOOR_M:g} m)" if exact else ""
    text = (
        f"{compared} were compared, sample by sample, with ballistic motion in steps of the physics, from shortly "
        f"after their release on: the largest distance is {finite_m.max():.1e} m{exactly}. "
    )
    # NaN counts as a departure, too.
    above = int((~(distance_m <= BALLISTIC_TOLERANCE_M)).sum())
    if above:
        text += Markup("<b>{:,} depart by more than the tolerance</b>; ").format(above)
        text += Markup("<code>throwcollect dataset verify</code> names them.")
    else:
        text += f"None departs by more than the tolerance of {BALLISTIC_TOLERANCE_M:g} m (dashed)."
    heading = "Largest distance of each flight from ballistic motion"
    panel = Panel("residuals", heading, _draw_residuals(finite_m))
    return ReportSection("physics", "Physics", title, text, ((panel,),))


def _draw_residuals(distance_m: NDArray[np.float64]) -> go.Figure:
    """Draw how far flights depart from ballistic motion, on a logarithmic axis."""
    shown = np.maximum(distance_m, FLOOR_M)
    low = np.floor(np.log10(shown.min()))
    high = max(np.ceil(np.log10(max(shown.max(), 10 * FLOOR_M))), low + 1)
    # There are four bins for each power of ten; 0.1 more includes the last edge in spite of rounding.
    edges = 10 ** np.arange(low, high + 0.1, 0.25)
    counts, _ = np.histogram(np.clip(shown, edges[0], edges[-1]), edges)
    hover = "%{y} flights near %{x:.1e} m<extra></extra>"
    figure = go.Figure(go.Bar(**place_bars(edges), y=counts, marker_color=BLUE, hovertemplate=hover))
    figure.add_vline(x=BALLISTIC_TOLERANCE_M, line=LIMIT_LINE)
    ends = [low - 0.2, max(high, np.log10(BALLISTIC_TOLERANCE_M)) + 0.5]
    figure.update_xaxes(title="distance from ballistic motion [m]", type="log", range=ends, exponentformat="e")
    figure.update_yaxes(title="flights")
    return figure.update_layout(height=300, bargap=0)
