"""Paints plotly's figures with matplotlib, so that each figure is described once, for the page and for print.

Plotly's own way to pictures starts a browser, which a machine without a desktop rarely has. The painter knows the
traces and the settings of axes that the figures of a report have; a `KeyError` names a trace that it does not know.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import plotly.graph_objects as go
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator

from throwcollect.report.contents import Panel, ReportSection

_COLUMN_IN, _BOTH_COLUMNS_IN = 3.5, 7.16
"""Widths of pictures [in]: one column of a paper in two columns, and both."""
_MOST_PX_IN_COLUMN = 405
"""Panels that need to be wider than this on the page get both columns."""
DPI = 300
"""Pixels per inch, sharp in print."""
_PX_PER_IN = 145
"""At this scale, a column of a paper is as wide as half a page in a browser."""
_FRAME_PX = 100
"""Height of the labels below and the legend above a figure together; a stack of figures has them once."""
_PT = 72 / _PX_PER_IN
"""Printer's points in one pixel."""
_SMALLEST_TEXT_PT = 5
_SHORT = 2
"""Logarithmic axes of fewer powers of ten have ticks between these."""
_COLOURS = "viridis"
_DASHES = {None: "-", "dash": "--", "dot": ":"}
MARKERS = {
    "circle": "o",
    "cross": "P",
    "diamond": "D",
    "hexagon": "h",
    "pentagon": "p",
    "square": "s",
    "star": "*",
    "star-triangle-down": "<",
    "star-triangle-up": "^",
    "triangle-down": "v",
    "triangle-up": "^",
    "x": "X",
}
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlepad": 2,
    "axes.titlesize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handletextpad": 0.4,
    "grid.linewidth": 0.4,
    "grid.color": "#dddddd",
    # This is off because names may have dollar signs, which would begin a formula.
    "text.parse_math": False,
}


def write_pictures(sections: Iterable[ReportSection], directory: Path) -> tuple[Path, ...]:
    """Paint the panels that belong to a picture; each picture becomes a PNG file in the directory."""
    pictures: dict[Path, list[Panel]] = {}
    for section in sections:
        for panel in section.panels:
            if panel.picture:
                pictures.setdefault(directory / f"{panel.picture}.png", []).append(panel)
    for path, panels in pictures.items():
        paint(panels, path)
    return tuple(pictures)


def paint(panels: Sequence[Panel], path: Path) -> None:
    """Paint one panel, or small ones with one pair of axes each below one another, into a PNG file."""
    with mpl.rc_context(_STYLE):
        heights = [panel.figure.layout.height - _FRAME_PX for panel in panels]
        width_in = _BOTH_COLUMNS_IN if panels[0].width_px > _MOST_PX_IN_COLUMN else _COLUMN_IN
        size = width_in, (_FRAME_PX + sum(heights)) / _PX_PER_IN
        painted = Figure(figsize=size, layout="constrained")
        # `pyplot` would make a canvas, too, but keeps every figure in a global list, and may ask for a screen.
        FigureCanvasAgg(painted)
        if panels[0].small:
            _paint_stack(painted, panels, heights)
        else:
            _paint_cells(painted, panels[0].figure)
        _add_legend(painted, panels[0].figure.layout.legend)
        # The version of matplotlib is left out, so that equal figures give equal bytes.
        painted.savefig(path, dpi=DPI, metadata={"Software": None})


def _paint_stack(painted: Figure, panels: Sequence[Panel], heights: Sequence[float]) -> None:
    """Paint figures below one another, which share their x axis; each has its title above."""
    rows = painted.subplots(len(panels), sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        _paint_axes(axes, panel.figure, "x", "y")
        axes.set_title(panel.title)
        axes.label_outer()
    if len({axes.get_ylabel() for axes in rows}) == 1:
        painted.supylabel(rows[0].get_ylabel(), fontsize=mpl.rcParams["axes.labelsize"])
        for axes in rows:
            axes.set_ylabel("")


def _paint_cells(painted: Figure, figure: go.Figure) -> None:
    """Paint a figure with one pair of axes, or with a grid of them by their domains."""
    pairs = dict.fromkeys((trace.xaxis or "x", trace.yaxis or "y") for trace in figure.data)
    starts = (
        [(_axis_of(figure, x).domain or (0,))[0] for x, _ in pairs],
        [(_axis_of(figure, y).domain or (0,))[0] for _, y in pairs],
    )
    # The domains of plotly begin at the lower edge, the rows of a grid at the upper one.
    columns, rows = sorted(set(starts[0])), sorted(set(starts[1]), reverse=True)
    grid = painted.add_gridspec(len(rows), len(columns))
    for (x, y), left, bottom in zip(pairs, *starts, strict=True):
        _paint_axes(painted.add_subplot(grid[rows.index(bottom), columns.index(left)]), figure, x, y)


def _paint_axes(axes: Axes, figure: go.Figure, x: str, y: str) -> None:
    """Paint traces and lines of a figure on one pair of its axes, which have names such as ``x2``."""
    for trace in figure.data:
        if (trace.xaxis or "x", trace.yaxis or "y") == (x, y):
            _PAINTERS[trace.type](axes, trace)
    for shape in figure.layout.shapes:
        look = {"color": shape.line.color, "linewidth": shape.line.width * _PT, "linestyle": _DASHES[shape.line.dash]}
        label = shape.name or "_nolegend_"
        if "domain" in shape.yref:
            axes.axvline(shape.x0, label=label, **look)
        else:
            axes.axhline(shape.y0, label=label, **look)
    _set_axis(axes, "x", _axis_of(figure, x), has_labels=_axis_of(figure, x).anchor in (None, y))
    _set_axis(axes, "y", _axis_of(figure, y), has_labels=_axis_of(figure, y).anchor in (None, x))
    if title := figure.layout.coloraxis.colorbar.title.text:
        _add_colour_bar(axes, ScalarMappable(_colour_scale(figure), _COLOURS), title)


def _axis_of(figure: go.Figure, name: str) -> Any:
    return figure.layout[f"{name[0]}axis{name[1:]}"]


def _colour_scale(figure: go.Figure) -> Normalize:
    """The scale of all markers whose colours are values."""
    values = np.concatenate([trace.marker.color for trace in figure.data if trace.marker.coloraxis])
    finite = values[np.isfinite(values)]
    return Normalize(finite.min(), finite.max()) if len(finite) else Normalize()


def _set_axis(axes: Axes, letter: Literal["x", "y"], axis: Any, *, has_labels: bool) -> None:
    """Give an axis the scale, range, ticks and title that it has in plotly."""
    own = {"x": axes.xaxis, "y": axes.yaxis}[letter]
    if axis.type == "log":
        axes.set(**{f"{letter}scale": "log"})
        low, high = axis.range or np.log10(getattr(axes, f"get_{letter}lim")())
        # Powers of ten alone would leave a short axis with a single tick.
        own.set_major_locator(LogLocator(subs=(1, 2, 5) if high - low < _SHORT else (1,), numticks=6))
        own.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        own.set_minor_locator(NullLocator())
    elif axis.nticks and isinstance(own.get_major_locator(), AutoLocator):
        # plotly limits the number of ticks, but matplotlib limits the number of intervals between ticks.
        own.set_major_locator(MaxNLocator(axis.nticks - 1))
    if axis.tickvals is not None:
        own.set_ticks(axis.tickvals, axis.ticktext)
    if axis.rangemode == "tozero":
        low, high = getattr(axes, f"get_{letter}lim")()
        axes.set(**{f"{letter}lim": (min(low, 0.0), max(high, 0.0))})
    if axis.range is not None:
        axes.set(**{f"{letter}lim": [10**end for end in axis.range] if axis.type == "log" else axis.range})
    if axis.scaleanchor is not None:
        axes.set_aspect("equal", adjustable="datalim")
    if axis.showgrid is False:
        axes.grid(visible=False, axis=letter)
    if axis.showticklabels is False:
        own.set_ticks([])
        axes.spines["left" if letter == "y" else "bottom"].set_visible(False)
    if axis.tickfont.size:
        axes.tick_params(axis=letter, length=2, labelsize=max(axis.tickfont.size * _PT, _SMALLEST_TEXT_PT))
    if not has_labels:
        axes.tick_params(axis=letter, labelbottom=letter != "x", labelleft=letter != "y")
    elif axis.title.text:
        size = {"fontsize": max(axis.title.font.size * _PT, _SMALLEST_TEXT_PT)} if axis.title.font.size else {}
        own.set_label_text(_plain(axis.title.text), **size)


def _paint_scatter(axes: Axes, trace: Any) -> None:
    x, y = (np.asarray(values, dtype=np.float64) for values in (trace.x, trace.y))
    label = _plain(trace.name) if trace.name and trace.showlegend is not False else "_nolegend_"
    if "lines" in trace.mode:
        look = {"color": trace.line.color, "linewidth": trace.line.width * _PT, "linestyle": _DASHES[trace.line.dash]}
        axes.plot(x, y, label=label, **look)
    if "markers" in trace.mode:
        marker = trace.marker
        symbol, is_open = marker.symbol.removesuffix("-open"), marker.symbol.endswith("-open")
        colours: dict[str, Any] = {"color": marker.color, "linewidths": 0}
        if marker.coloraxis:
            colours = {"c": marker.color, "cmap": _COLOURS, "norm": _colour_scale(trace.figure)}
            colours |= {"edgecolors": marker.line.color or "none", "linewidths": (marker.line.width or 0) * _PT}
        elif is_open:
            width = (marker.line.width or 1) * _PT
            colours = {"facecolors": "white", "edgecolors": marker.color, "linewidths": width}
        # matplotlib takes the square of the size, which is in printer's points.
        shape, area = MARKERS[symbol], (marker.size * _PT) ** 2
        # Markers are drawn above lines; by default, matplotlib would draw lines above them.
        axes.scatter(x, y, marker=shape, s=area, alpha=marker.opacity, label=label, zorder=3, **colours)


def _paint_bar(axes: Axes, trace: Any) -> None:
    counts = MaxNLocator(5, integer=True)
    if trace.orientation == "h":
        bars = axes.barh(trace.y, trace.x, color=trace.marker.color)
        axes.bar_label(bars, trace.text, padding=3, fontsize=mpl.rcParams["ytick.labelsize"])
        axes.tick_params(axis="y", length=0)
        axes.xaxis.set_major_locator(counts)
        axes.grid(visible=False, axis="y")
    else:
        axes.bar(trace.x, trace.y, width=trace.width, color=trace.marker.color, alpha=trace.marker.opacity)
        axes.yaxis.set_major_locator(counts)


def _paint_box(axes: Axes, trace: Any) -> None:
    columns: Mapping[str, Sequence[float]] = {
        "whislo": trace.lowerfence,
        "q1": trace.q1,
        "med": trace.median,
        "q3": trace.q3,
        "whishi": trace.upperfence,
    }
    thin = {"linewidth": 0.7}
    axes.bxp(
        [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
        orientation="horizontal",
        showfliers=False,
        widths=0.55,
        patch_artist=True,
        boxprops={"facecolor": "#9ecae1", **thin},
        medianprops={"color": "black", "linewidth": 1},
        whiskerprops=thin,
        capprops=thin,
    )
    axes.set_yticks(range(1, len(trace.y) + 1), [_plain(label) for label in trace.y])
    axes.grid(visible=False, axis="y")


def _paint_heatmap(axes: Axes, trace: Any) -> None:
    counts = np.ma.masked_invalid(trace.z)
    # Lines between cells would hide very small ones.
    gap = trace.xgap * _PT if counts.size < 2000 else 0
    mesh = axes.pcolormesh(trace.x, trace.y, counts, cmap=_COLOURS, vmin=trace.zmin, edgecolors="white", linewidth=gap)
    bar = _add_colour_bar(axes, mesh, trace.colorbar.title.text)
    bar.locator = MaxNLocator(nbins=6, integer=True)


_PAINTERS = {
    "bar": _paint_bar,
    "box": _paint_box,
    "heatmap": _paint_heatmap,
    "scatter": _paint_scatter,
    "scattergl": _paint_scatter,
}


def _add_colour_bar(axes: Axes, colours: Any, title: str) -> Any:
    bar = axes.figure.colorbar(colours, ax=axes, label=title, pad=0.02)
    bar.outline.set_visible(False)
    return bar


def _add_legend(painted: Figure, legend: Any) -> None:
    """Name all lines and markers if there are several: a picture has no text that explains its colours."""
    named: dict[str, Any] = {}
    for axes in painted.axes:
        # If a trace has both a line and markers, its entry in the legend shows them together.
        together: dict[str, tuple[Artist, ...]] = {}
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            together[name] = (*together.get(name, ()), handle)
        named |= together
    if len(named) < 2:
        return
    if legend.x == 1:
        painted.legend(named.values(), named.keys(), loc="upper right", markerscale=2, scatteryoffsets=[0.5])
    else:
        painted.legend(named.values(), named.keys(), loc="outside upper center", ncols=3, scatteryoffsets=[0.5])


def _plain(text: str) -> str:
    return text.replace("<br>", "\n")
