"""The section of a report on how far the flights of throws depart from physics."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset
from throwcollect.progress_log import log_progress
from throwcollect.publish.report.contents import Panel, ReportSection
from throwcollect.publish.report.figures import BLUE, LIMIT_LINE, place_bars
from throwcollect.tasks.throw.flight import BALLISTIC_TOLERANCE_M, flight_residual

MOST_RESIDUALS = 2000
"""Most episodes whose flight is computed again, which takes some 15 s; `verify` computes the flights of all."""
FLOOR_M = 1e-17
"""Smaller residuals are drawn as this value, as 0 has no place on a logarithmic axis."""


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
        return ReportSection("physics", title, "No flight was long enough to compare it with ballistic motion.")
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
    return ReportSection("physics", title, text, ((panel,),))


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
