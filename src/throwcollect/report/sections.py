"""The sections of the page, each of what one question calls for."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import numpy as np

from throwcollect.report import figures
from throwcollect.report.coverage import Coverage
from throwcollect.report.dataset_facts import Facts
from throwcollect.report.heading import share
from throwcollect.report.matrix import MOST_KEYS, parameter_matrix, points_of_panel, width_of
from throwcollect.report.outcomes import LANDED, in_words
from throwcollect.report.panels import Panel, Section
from throwcollect.report.thinning import MOST_POINTS as MOST_MAP_POINTS
from throwcollect.tasks.flight import BALLISTIC_TOLERANCE_M

_MOST_FAILURES = 40


def sections(facts: Facts) -> tuple[Section, ...]:
    """All sections, in the order of the page; one that has nothing to show says so."""
    return (
        _landing(facts),
        _parameters(facts),
        _outcomes(facts),
        _release(facts),
        _limits(facts),
        _examples(facts),
        _physics(facts),
        _throughput(facts),
        _provenance(facts),
    )


def _landing(facts: Facts) -> Section:
    title, landings = "Where the balls land", facts.landings
    if not len(landings):
        return Section("landing", "Landings", title, "No ball crossed the landing plane.")
    x, y = landings.x_m, landings.y_m
    plane = "the landing plane"
    if facts.landing_height_m is not None:
        plane += f" at z = {facts.landing_height_m:g} m"
    text = (
        f"{len(landings):,} of {facts.info.trials:,} balls crossed {plane}, {landings.distance_m.min():.2f} to "
        f"{landings.distance_m.max():.2f} m from the robot: x {x.min():.2f} to {x.max():.2f} m, y {y.min():.2f} to "
        f"{y.max():.2f} m."
    )
    above = Panel("map", "Landings from above", figures.landing_map(landings, facts.outcomes), _thinned(len(landings)))
    return Section("landing", "Landings", title, text, ((above, *_targets(facts.coverage)),))


def _targets(coverage: Coverage | None) -> Iterator[Panel]:
    if coverage is None:
        return
    inside = int(coverage.counts.sum())
    text = f"{coverage.hit:,} of {coverage.counts.size:,} cells have a throw that landed as planned, "
    text += f"at most {coverage.counts.max():,}"
    if coverage.asked:
        text += f"; {coverage.throws - inside:,} landed in no cell"
    if len(coverage.axes) == 1:
        yield Panel("cells", "Throws by target", figures.coverage_bars(coverage.axes[0], coverage.counts), f"{text}.")
        return
    for number, (first, second, counts) in enumerate(coverage.pairs):
        names = [axis.label.partition(" [")[0].removesuffix(" below the horizontal") for axis in (first, second)]
        which = "Throws by" if not coverage.asked else "Targets:"
        title = f"{which} {names[0]} and {names[1]}"
        yield Panel(
            f"cells-{number}", title, figures.coverage_map(first, second, counts), f"{text}." if not number else ""
        )


def _parameters(facts: Facts) -> Section:
    title = "How the parameter space is covered"
    if not facts.parameters:
        return Section("parameters", "Parameters", title, "Nothing was swept.")
    shown = facts.parameters[:MOST_KEYS]
    notes = []
    if len(shown) < len(facts.parameters):
        notes.append(f"The first {len(shown)} of {len(facts.parameters)} swept keys.")
    if len(shown) > 1 and facts.info.trials > (most := points_of_panel(shown)):
        notes.append(f"{most:,} of {facts.info.trials:,} trials, chosen at random; the diagonal counts all.")
    rows = "".join(
        f"<tr><td><code>{escape(each.key)}</code></td><td class='number'>{each.values.min():.4g}</td>"
        f"<td class='number'>{each.values.max():.4g}</td><td>{each.unit or '-'}</td></tr>"
        for each in facts.parameters
    )
    table = (
        '<div class="sheet scroll"><table><tr><th>swept key</th><th class="number">lowest</th>'
        f'<th class="number">highest</th><th>unit</th></tr>{rows}</table></div>'
    )
    heading = "Values of all trials" if len(shown) == 1 else "Each pair of keys, and on the diagonal each key alone"
    panel = Panel("pairs", heading, parameter_matrix(shown, facts.outcomes), " ".join(notes), width_of(shown))
    text = f"{len(facts.parameters)} key{'s' if len(facts.parameters) > 1 else ''} varied from trial to trial."
    return Section("parameters", "Parameters", title, text, (panel, table))


def _outcomes(facts: Facts) -> Section:
    title, outcomes = "How throws end, and where failures lie", facts.outcomes
    failed = facts.info.trials - outcomes.landed
    if not failed:
        return Section("outcomes", "Outcomes", title, f"All {facts.info.trials:,} throws landed as planned.")
    text = f"{failed:,} of {facts.info.trials:,} throws ({share(failed, facts.info.trials)}) did not land as planned."
    blocks: list[str | tuple[Panel, ...]] = [_failure_table(facts)] if facts.failures else []
    if len(outcomes.names) > 1 and facts.parameters:
        blocks.append(
            tuple(
                Panel(f"by-{number}", each.key, figures.outcome_shares(each, outcomes), small=True)
                for number, each in enumerate(facts.parameters)
            )
        )
        text += " Below, the share of each outcome over the values of each swept key, in the colours of the bar above."
    return Section("outcomes", "Outcomes", title, text, tuple(blocks))


def _failure_table(facts: Facts) -> str:
    rows = "".join(
        f"<tr><td class='nowrap'>{escape(in_words(each.outcome))}</td><td>{escape(each.pattern)}</td>"
        f"<td class='number'>{each.count:,}</td><td class='nowrap'>{', '.join(map(str, each.examples))}</td></tr>"
        for each in facts.failures[:_MOST_FAILURES]
    )
    if len(facts.failures) > _MOST_FAILURES:
        rest = facts.failures[_MOST_FAILURES:]
        rows += (
            f"<tr><td></td><td>{len(rest):,} more reasons</td><td class='number'>"
            f"{sum(each.count for each in rest):,}</td><td></td></tr>"
        )
    return (
        '<div class="sheet scroll failures"><table><tr><th>outcome</th><th>reason (# is a number)</th>'
        f'<th class="number">trials</th><th>such as trials</th></tr>{rows}</table></div>'
    )


def _release(facts: Facts) -> Section:
    title, landings = "How the balls are released", facts.landings
    if not len(landings):
        return Section("release", "Release", title, "No ball crossed the landing plane.")
    speed, elevation = landings.speed_mps, landings.elevation_rad
    text = (
        f"Of the balls that crossed the landing plane, the median speed is {np.median(speed):.2f} m/s, the median "
        f"elevation {np.median(elevation):.3f} rad above the horizontal."
    )
    panel = Panel(
        "map", "Speed and elevation at release", figures.release_map(landings, facts.outcomes), _thinned(len(landings))
    )
    return Section("release", "Release", title, text, (panel,))


def _limits(facts: Facts) -> Section:
    title = "How close the joints come to their limits"
    panels = tuple(
        Panel(kind, f"{kind.capitalize()} over its limit", figures.limit_boxes(peaks), small=True)
        for kind, peaks in facts.peaks.items()
        if peaks
    )
    if not panels:
        return Section("limits", "Limits", title, "No throw was measured.")
    reached = {kind: sum(each.reached for each in peaks) for kind, peaks in facts.peaks.items()}
    text = (
        "Of each throw, the joint that came closest; 1 is at the limit. Boxes span the quartiles, whiskers all throws. "
        "Throws that reached a limit: " + ", ".join(f"{count:,} of {kind}" for kind, count in reached.items()) + "."
    )
    return Section("limits", "Limits", title, text, (panels,))


def _examples(facts: Facts) -> Section:
    title, motion = "A few throws", facts.motion
    if motion is None:
        return Section("throws", "Throws", title, "No trial has an episode.")
    landed = sum(path.outcome == LANDED for path in facts.paths)
    text = "Dotted while the spoon holds the ball; a ring marks the release."
    if landed > 1:
        text = f"{landed} throws that landed, from the nearest to the farthest. {text}"
    errors = np.abs(motion.measured - motion.commanded).max(axis=0)
    joints = tuple(
        Panel(
            joint,
            joint,
            figures.joint_lines(motion, column),
            f"Largest tracking error: {errors[column]:.2g} rad.",
            small=True,
        )
        for column, joint in enumerate(motion.joints)
    )
    side, above = figures.ball_views(facts.paths, facts.landing_height_m)
    views = (Panel("side", "The ball from the side", side), Panel("above", "The ball from above", above))
    note = f"<p>Joints of trial {motion.trial}: measured (blue) and commanded (orange, dashed)"
    note += "; the vertical line is the release.</p>" if motion.release_s is not None else ".</p>"
    return Section("throws", "Throws", title, text, (views, note, joints))


def _physics(facts: Facts) -> Section:
    title, residuals = "Whether flights obey physics", facts.residuals
    if not len(residuals.finite_m):
        return Section("physics", "Physics", title, "No flight was long enough to compare it with ballistic motion.")
    which = f"{residuals.checked:,}" if residuals.checked < residuals.episodes else "All"
    of = (
        f" of {residuals.episodes:,} episodes, chosen at random,"
        if residuals.checked < residuals.episodes
        else " episodes"
    )
    zeros = int((residuals.distance_m == 0).sum())
    exact = f", {zeros:,} agree to the last bit" if zeros else ""
    above = int((~(residuals.distance_m <= BALLISTIC_TOLERANCE_M)).sum())
    text = (
        f"{which}{of} were compared, sample by sample, with ballistic motion from their release: the largest "
        f"distance is {residuals.finite_m.max():.1e} m{exact}. "
        + (
            f"<b>{above:,} depart by more than the tolerance</b>; <code>throwcollect dataset verify</code> names them."
            if above
            else f"None departs by more than the tolerance of {BALLISTIC_TOLERANCE_M:g} m (dashed)."
        )
    )
    panel = Panel(
        "residuals", "Largest distance of each flight from ballistic motion", figures.residual_histogram(residuals)
    )
    return Section("physics", "Physics", title, text, (panel,))


def _throughput(facts: Facts) -> Section:
    title, found = "How fast it was collected", facts.throughput
    if found is None:
        text = "This dataset has no journal of its collection (<code>logs/journal.jsonl</code>) with throws in it."
        return Section("throughput", "Throughput", title, text)
    wall_s = facts.info.wall_s or found.edges_s[-1]
    mean = found.commits / wall_s
    text = f"{found.commits:,} throws in {wall_s:,.1f} s, {mean:.1f} a second on average, start-up included."
    if found.resumed_s:
        times = f"{len(found.resumed_s)} times" if len(found.resumed_s) > 1 else "once"
        text += f" It was resumed {times} (dotted); the pauses are left out."
    panel = Panel("rate", "Throws a second", figures.throughput_line(found))
    return Section("throughput", "Throughput", title, text, (panel,))


def _provenance(facts: Facts) -> Section:
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td><code>{escape(value)}</code></td></tr>"
        for name, value in facts.provenance.items()
    )
    table = f'<div class="sheet scroll"><table>{rows}</table></div>'
    folded = f"<details><summary>config.yaml</summary><pre>{escape(facts.config_text)}</pre></details>"
    text = "<code>throwcollect dataset verify</code> checks the recordings against the digest of the dataset."
    return Section("provenance", "Provenance", "Where it comes from", text, (table, folded))


def _thinned(count: int) -> str:
    return f"{MOST_MAP_POINTS:,} of {count:,} throws, chosen at random." if count > MOST_MAP_POINTS else ""
