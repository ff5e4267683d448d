"""What the pictures show, in matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from throwcollect.report.coverage import Coverage
from throwcollect.report.dataset_facts import Facts
from throwcollect.report.episodes import BallPath, JointMotion, Residuals
from throwcollect.report.landing import Landings
from throwcollect.report.limits import JointPeaks
from throwcollect.report.outcomes import LANDED, Outcomes, in_words, style_of
from throwcollect.report.swept_keys import Parameter
from throwcollect.report.thinning import thinned
from throwcollect.tasks.flight import BALLISTIC_TOLERANCE_M

MOST_KEYS = 8
_NEUTRAL = "#6b7280"
_LIMIT = "#D55E00"
_FLOOR_M = 1e-17
_MOST_POINTS = 5000


def landing_map(axes: Axes, landings: Landings, outcomes: Outcomes) -> None:
    """Landings seen from above, coloured by release speed."""
    _coloured(axes, landings, outcomes, (landings.x_m, landings.y_m, landings.speed_mps), "release speed [m/s]")
    axes.plot(0, 0, marker="^", color="black", markersize=6, linestyle="none")
    axes.annotate("robot", (0, 0), textcoords="offset points", xytext=(0, -10), ha="center", fontsize=7)
    axes.set(xlabel="x, forward [m]", ylabel="y, left [m]")
    axes.set_aspect("equal", adjustable="datalim")


def release_map(axes: Axes, landings: Landings, outcomes: Outcomes) -> None:
    """Speed and elevation at release, coloured by the distance at which the ball landed."""
    columns = (landings.speed_mps, landings.elevation_rad, landings.distance_m)
    _coloured(axes, landings, outcomes, columns, "landing distance [m]")
    axes.set(xlabel="release speed [m/s]", ylabel="release elevation [rad]")


def _coloured(
    axes: Axes,
    landings: Landings,
    outcomes: Outcomes,
    columns: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    label: str,
) -> None:
    """Points with one colour scale, and a marker of its own for each outcome."""
    chosen = thinned(len(landings), _MOST_POINTS)
    x, y, colour = (column[chosen] for column in columns)
    code = landings.code[chosen]
    # Matplotlib's area of a marker is in square points.
    area = 14 if len(chosen) <= 300 else 7 if len(chosen) <= 1500 else 2.5
    handles = []
    points = None
    for index, name in enumerate(outcomes.names):
        own = code == index
        if not own.any():
            continue
        style = style_of(name)
        edge: dict[str, Any] = {} if name == LANDED else {"edgecolors": style.colour}
        points = axes.scatter(
            x[own],
            y[own],
            c=colour[own],
            s=area if name == LANDED else 1.5 * area,
            marker=style.marker,
            linewidths=0 if name == LANDED else 0.8 if area > 5 else 0.4,
            zorder=3 if name == LANDED else 2,
            cmap="viridis",
            vmin=colour.min(),
            vmax=colour.max(),
            **edge,
        )
        face = _NEUTRAL if name == LANDED else "none"
        edge_colour = _NEUTRAL if name == LANDED else style.colour
        look: dict[str, Any] = {
            "marker": style.marker,
            "markersize": 4,
            "markerfacecolor": face,
            "markeredgecolor": edge_colour,
        }
        handles.append(Line2D([], [], linestyle="none", label=in_words(name), **look))
    axes.grid(visible=True)
    axes.set_axisbelow(True)
    if points is not None and axes.figure is not None:
        axes.figure.colorbar(points, ax=axes, label=label, pad=0.02).outline.set_visible(False)
    if len(handles) > 1:
        axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, handletextpad=0.2)


def coverage_map(axes: Axes, coverage: Coverage) -> None:
    """Number of throws over the first two axes of the cells, or over the only one."""
    if not coverage.pairs:
        axes.stairs(coverage.counts, coverage.axes[0].edges, fill=True, color="#0072B2")
        axes.set(xlabel=coverage.axes[0].label, ylabel="throws")
        axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
        return
    x, y, counts = coverage.pairs[0]
    look: dict[str, Any] = {
        "cmap": "viridis",
        "vmin": 0,
        "edgecolors": "white",
        "linewidth": 0.4 if counts.size < 2000 else 0,
    }
    mesh = axes.pcolormesh(x.edges, y.edges, np.ma.masked_equal(counts, 0).T, **look)
    bar = axes.figure.colorbar(mesh, ax=axes, label="throws", pad=0.02)
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(integer=True, nbins=6)
    bar.update_ticks()
    axes.set(xlabel=x.label, ylabel=y.label)


def matrix_size(parameters: Sequence[Parameter]) -> tuple[float, float]:
    """Width and height of the matrix of parameters [in]: one column of a paper, or both if there are many."""
    count = min(len(parameters), MOST_KEYS)
    side = 3.5 if count <= 3 else 7.16
    return side, 2.2 if count == 1 else side


def parameter_matrix(figure: Figure, facts: Facts) -> Figure:
    """All pairs of swept keys below the diagonal, and on it how often each value occurs."""
    parameters, outcomes = facts.parameters[:MOST_KEYS], facts.outcomes
    count = len(parameters)
    chosen = thinned(len(outcomes.codes), 2000)
    size = 6 if count <= 5 else 5
    for row, other in enumerate(parameters):
        for column, parameter in enumerate(parameters[: row + 1]):
            axes = figure.add_subplot(count, count, row * count + column + 1)
            if row == column:
                axes.stairs(parameter.counts.sum(axis=1), parameter.edges, fill=True, color="#b8bdc6")
                axes.set_yticks([])
                axes.spines["left"].set_visible(False)
            else:
                for code, name in enumerate(outcomes.names):
                    own = chosen[outcomes.codes[chosen] == code]
                    style: dict[str, Any] = {
                        "s": 1.5,
                        "color": style_of(name).colour,
                        "linewidths": 0,
                        "label": in_words(name),
                    }
                    axes.scatter(parameter.values[own], other.values[own], **style)
                _scale(axes, "y", other)
            _scale(axes, "x", parameter)
            axes.tick_params(labelsize=size, length=2)
            axes.tick_params(labelbottom=row == count - 1, labelleft=column == 0 < row)
            if row == count - 1:
                axes.set_xlabel("\n".join(parameter.short_label), fontsize=size)
            if column == 0 < row:
                axes.set_ylabel("\n".join(other.short_label), fontsize=size)
    if count > 1 and len(outcomes.names) > 1:
        handles = [
            Line2D(
                [], [], linestyle="none", marker="o", markersize=4, color=style_of(name).colour, label=in_words(name)
            )
            for name in outcomes.names
        ]
        figure.legend(handles=handles, loc="upper right")
    return figure


def _scale(axes: Axes, letter: str, parameter: Parameter) -> None:
    """Scale and ticks of an axis that shows a parameter."""
    axis = {"x": axes.xaxis, "y": axes.yaxis}[letter]
    if parameter.logarithmic:
        axes.set(**{f"{letter}scale": "log"})
        axis.set_minor_locator(NullLocator())
        axis.set_ticks(parameter.ticks["tickvals"], parameter.ticks["ticktext"])
    else:
        axis.set_major_locator(MaxNLocator(3))


def outcome_bars(axes: Axes, outcomes: Outcomes) -> None:
    """Number and share of trials of each outcome."""
    counts = outcomes.counts
    names = list(reversed(counts))
    values = [counts[name] for name in names]
    bars = axes.barh([in_words(name) for name in names], values, color=[style_of(name).colour for name in names])
    total = len(outcomes.codes)
    axes.bar_label(bars, [f"{value} ({value / total:.1%})" for value in values], padding=3, fontsize=7)
    axes.set(xlabel="trials", xlim=(0, 1.3 * max(values)))
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.tick_params(axis="y", length=0)


def limit_boxes(axes: Axes, peaks: Mapping[str, Sequence[JointPeaks]]) -> None:
    """Peaks over their limit, by kind and joint."""
    rows = [(f"{kind}: {each.joint}", each) for kind, joints in peaks.items() for each in joints]
    keys = ("whislo", "q1", "med", "q3", "whishi")
    boxes = [dict(zip(keys, each.quartiles, strict=True)) for _, each in rows]
    axes.bxp(
        boxes,
        orientation="horizontal",
        showfliers=False,
        widths=0.55,
        patch_artist=True,
        boxprops={"facecolor": "#9ecae1", "linewidth": 0.7},
        medianprops={"color": "black", "linewidth": 1},
        whiskerprops={"linewidth": 0.7},
        capprops={"linewidth": 0.7},
    )
    axes.set_yticks(range(1, len(rows) + 1), [label for label, _ in rows])
    axes.invert_yaxis()
    axes.axvline(1, color=_LIMIT, linestyle="--", linewidth=1)
    highest = max(each.quartiles[-1] for _, each in rows)
    axes.set(xlabel="peak over limit [-]", xlim=(0, max(1.05, 1.05 * highest)))


def residual_histogram(axes: Axes, residuals: Residuals) -> None:
    """How far flights depart from ballistic motion."""
    powers = np.log10(np.maximum(residuals.finite_m, _FLOOR_M))
    bins = np.arange(np.floor(powers.min()), np.ceil(powers.max()) + 0.5, 0.25).tolist()
    axes.hist(powers, bins=bins, color="#0072B2")
    axes.axvline(np.log10(BALLISTIC_TOLERANCE_M), color=_LIMIT, linestyle="--", linewidth=1)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda power, _: f"1e{power:.0f}"))
    axes.set(xlabel="distance from ballistic motion [m]", ylabel="flights")
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))


def ball_paths(axes: Axes, paths: Sequence[BallPath], landing_height_m: float | None) -> None:
    """Paths of the ball seen from the robot's right."""
    for path in paths:
        x, z = path.positions[:, 0], path.positions[:, 2]
        release = len(x) - 1 if path.release is None else path.release
        colour = style_of(path.outcome).colour
        axes.plot(x[: release + 1], z[: release + 1], color=colour, linestyle=":", linewidth=0.7)
        axes.plot(x[release:], z[release:], color=colour)
        if path.release is not None:
            axes.plot(x[release], z[release], marker="o", markersize=3.5, markerfacecolor="white", color=colour)
    names = dict.fromkeys(path.outcome for path in paths)
    handles = [Line2D([], [], color=style_of(name).colour, label=in_words(name)) for name in names]
    handles.append(Line2D([], [], color=_NEUTRAL, linestyle=":", linewidth=0.7, label="in the spoon"))
    release_look: dict[str, Any] = {"marker": "o", "markersize": 3.5, "markerfacecolor": "white", "color": _NEUTRAL}
    handles.append(Line2D([], [], linestyle="none", label="release", **release_look))
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    if landing_height_m is not None:
        axes.axhline(landing_height_m, color=_NEUTRAL, linewidth=0.6)
    axes.grid(visible=True)
    axes.set_axisbelow(True)
    axes.set(xlabel="x, forward [m]", ylabel="z, up [m]")
    axes.set_aspect("equal", adjustable="datalim")


def joint_lines(figure: Figure, motion: JointMotion) -> Figure:
    """Commanded and measured positions of the moving joints of one throw."""
    rows = figure.subplots(len(motion.joints), sharex=True, squeeze=False)[:, 0]
    for column, (axes, joint) in enumerate(zip(rows, motion.joints, strict=True)):
        axes.plot(motion.times_s, motion.measured[:, column], color="#56B4E9", linewidth=2, label="measured")
        axes.plot(motion.times_s, motion.commanded[:, column], color="#D55E00", linestyle="--", label="commanded")
        if motion.release_s is not None:
            axes.axvline(motion.release_s, color=_NEUTRAL, linestyle=":", linewidth=0.8, label="release")
        axes.set_ylim(motion.span(column))
        axes.yaxis.set_major_locator(MaxNLocator(3))
        axes.set_title(joint, fontsize=7, loc="left", pad=2)
    rows[-1].set_xlabel("time [s]")
    figure.supylabel("position [rad]", fontsize=8)
    handles, labels = rows[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
