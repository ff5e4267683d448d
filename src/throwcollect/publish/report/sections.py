"""The sections of a report that a dataset of any task has, and the whole report, as one page of HTML."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from throwcollect.dataset.directory import CONFIG, FORMAT, JOURNAL, PROVENANCE
from throwcollect.dataset.inspect import summary
from throwcollect.dataset.journal import read_journal
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import read_text, write_file
from throwcollect.members import explain_failure, load_part
from throwcollect.plan.digest import config_digest
from throwcollect.publish.report import figures
from throwcollect.publish.report.cameras import show_cameras
from throwcollect.publish.report.contents import (
    Listing,
    Panel,
    ReportSection,
    Row,
    Table,
    TaskReport,
    Tile,
    format_duration,
    format_share,
    format_size,
)
from throwcollect.publish.report.measured import (
    KINDS,
    Outcomes,
    SweptKey,
    describe,
    measure_times,
    read_parameters,
    summarise_peaks,
)
from throwcollect.publish.report.targets import show_model, show_targets
from throwcollect.robots.description import robot_of
from throwcollect.tasks.task import task_of
from throwcollect.version import __version__
from throwcollect.wording import blank_numbers

_EXAMPLES = 5


def tabulate_failures(rows: Iterable[tuple[int, str, str | None]]) -> Table | None:
    """Group trial, outcome and reason of each row, most frequent groups first; None if no trial failed.

    A trial without a reason did not fail. Reasons of a group are the same but for numbers, which are `#` where they
    differ.
    """
    groups: dict[tuple[str, str], dict[int, str]] = {}
    for trial, outcome, reason in rows:
        if reason is not None:
            groups.setdefault((outcome, blank_numbers(reason)), {})[trial] = reason
    ordered = sorted(groups.items(), key=lambda group: (-len(group[1]), group[0]))
    cells = []
    for (outcome, pattern), reasons in ordered[:_MOST_FAILURES]:
        reason = pattern if len(set(reasons.values())) > 1 else next(iter(reasons.values()))
        cells.append((describe(outcome), reason, f"{len(reasons):,}", ", ".join(map(str, [*reasons][:_EXAMPLES]))))
    if rest := ordered[_MOST_FAILURES:]:
        cells.append(("", f"{len(rest):,} more reasons", f"{sum(len(reasons) for _, reasons in rest):,}", ""))
    head = ("outcome", "reason (# is a number)", "trials", "such as trials")
    return Table(head=head, rows=tuple(cells), number_columns=(2,)) if cells else None


_MOST_FAILURES = 40
_MOST_CONFIG_BYTES = 10_000_000
_CODE = Markup("<code>{}</code>")


@dataclass(frozen=True)
class Report:
    """A report on a dataset.

    Attributes:
        lead: Sentence on its trials.
        tiles: Key numbers.
        sections: Sections in the order of the page; a section that has nothing to show has a sentence about that.
        noun: Word for a trial.
    """

    name: str
    lead: str
    tiles: tuple[Tile, ...]
    outcomes: Outcomes
    sections: tuple[ReportSection, ...]
    noun: str = "throw"


def report_dataset(dataset: Dataset, *, model: Path | None = None) -> Report:
    """Make the report on a dataset, and on a model that was learned from it, if its directory is given."""
    throws, info = dataset.throws, summary(dataset)
    declared = (dataset.config.task.success, *(each.value for each in task_of(dataset.config).outcomes))
    outcomes = Outcomes.of(throws["outcome"].to_pylist(), declared)
    parameters = read_parameters(dataset.config, throws, outcomes)
    reasons = zip(*(throws[name].to_pylist() for name in ("trial", "outcome", "reason")), strict=True)
    facts = _list_facts(dataset, info)
    task, noun = _report_task(dataset, outcomes), dataset.config.task.noun
    by = robot_of(dataset.config).title
    finished = f", finished on {facts['finished'][:10]}" if "finished" in facts else ""
    return Report(
        name=info.name,
        lead=f"{info.trials:,} simulated {dataset.config.task.subject} by {by}{finished}.",
        tiles=(
            (f"{len(outcomes.codes):,}", f"{noun}s planned"),
            (format_share(outcomes.succeeded, len(outcomes.codes)), describe(outcomes.success)),
            *task.tiles,
            (format_duration(info.duration_s), "of simulated time"),
            (format_size(info.size_bytes), "on disk"),
        ),
        outcomes=outcomes,
        sections=(
            *task.sections,
            *show_targets(dataset),
            *(() if model is None else (show_model(model, dataset),)),
            _show_parameters(parameters, outcomes),
            _show_outcomes(outcomes, parameters, tabulate_failures(reasons), noun),
            _show_limits({kind: summarise_peaks(throws, kind) for kind in KINDS}, noun),
            *show_cameras(dataset),
            _show_throughput(*measure_times(read_journal(dataset.directory / JOURNAL)), info),
            _show_provenance(facts, read_text(dataset.directory / CONFIG, most_bytes=_MOST_CONFIG_BYTES)),
        ),
        noun=noun,
    )


def _list_facts(dataset: Dataset, info: Info) -> dict[str, str]:
    """List facts on the origin of a dataset: digests first, then how it was collected, if that is known."""
    collected = read_provenance(dataset.directory)
    return {
        "dataset digest": info.digest,
        "configuration digest": config_digest(dataset.config),
        "layout": FORMAT,
        "sampler": f"{dataset.config.sweep.sampler}, seed {dataset.config.seed}",
        **(collected.facts() if collected else {"collected": f"unknown: it has no readable {PROVENANCE}"}),
    }


def _report_task(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of the task; an empty one for a task without."""
    name = dataset.config.task.name
    if not (path := task_of(dataset.config).report):
        return TaskReport()
    report = load_part("tasks", name, path)
    with explain_failure("tasks", name, "report its trials"):
        added: TaskReport = report(dataset, outcomes)
    return added


def _show_parameters(parameters: tuple[SweptKey, ...], outcomes: Outcomes) -> ReportSection:
    title, trials = "How the parameter space is covered", len(outcomes.codes)
    if not parameters:
        return ReportSection("parameters", title, "Nothing was swept.")
    shown = parameters[: figures.MOST_KEYS]
    notes = []
    if len(shown) < len(parameters):
        notes.append(f"The first {len(shown)} of {len(parameters)} swept keys.")
    if trials > (most := figures.count_matrix_points(shown)):
        notes.append(f"{most:,} of {trials:,} trials, chosen at random.")
    matrix, width_px = figures.draw_parameter_matrix(shown, outcomes), 90 + 105 * len(shown)
    panel = Panel("pairs", "Each pair of keys", matrix, " ".join(notes), width_px)
    table = Table(
        head=("swept key", "lowest", "highest", "unit"),
        rows=tuple(
            (_CODE.format(each.key), f"{each.values.min():.4g}", f"{each.values.max():.4g}", each.unit or "-")
            for each in parameters
        ),
        number_columns=(1, 2),
    )
    text = f"{len(parameters)} key{'s' if len(parameters) > 1 else ''} varied from trial to trial."
    return ReportSection("parameters", title, text, (*([(panel,)] if len(shown) > 1 else []), table))


def _show_outcomes(
    outcomes: Outcomes, parameters: tuple[SweptKey, ...], failures: Table | None, noun: str
) -> ReportSection:
    title, trials = f"How {noun}s end, and where failures lie", len(outcomes.codes)
    blocks: list[Row | Table] = []
    failed = trials - outcomes.succeeded
    text = f"All {trials:,} {noun}s {outcomes.verbs[1]}."
    if failed:
        text = f"{failed:,} of {trials:,} {noun}s ({format_share(failed, trials)}) did not {outcomes.verbs[0]}."
    if failures is not None:
        blocks.append(failures)
    if failed and len(outcomes.names) > 1 and parameters:
        text += " Below, the share of each outcome over the values of each swept key, in the colours of the bar above."
        blocks.append(
            tuple(
                Panel(f"by-{number}", each.key, figures.draw_outcome_shares(each, outcomes), small=True)
                for number, each in enumerate(parameters)
            )
        )
    return ReportSection("outcomes", title, text, tuple(blocks))


def _show_limits(peaks: dict[str, dict[str, NDArray[np.float64]]], noun: str) -> ReportSection:
    title = "How close the joints come to their limits"
    panels = tuple(
        Panel(
            key=kind,
            title=f"{kind.capitalize()} over its limit",
            figure=figures.draw_limit_boxes(joints),
            small=True,
        )
        for kind, joints in peaks.items()
        if joints
    )
    if not panels:
        return ReportSection("limits", title, f"No {noun} was measured.")
    reached = (
        f"{sum(int((each >= 1).sum()) for each in joints.values()):,} of {kind}" for kind, joints in peaks.items()
    )
    text = (
        f"Of each {noun}, the joint that came closest; 1 is at the limit. Boxes span the quartiles, whiskers all "
        f"{noun}s. {noun.capitalize()}s that reached a limit: {', '.join(reached)}."
    )
    return ReportSection("limits", title, text, (panels,))


def _show_throughput(times: dict[str, list[float]], total_s: float, info: Info) -> ReportSection:
    title, commits = "How fast it was collected", len(times["commit"])
    if not commits or total_s <= 0:
        no_journal = Markup(
            "This dataset has no journal of its collection (<code>logs/journal.jsonl</code>) with {}s in it."
        ).format(info.noun)
        return ReportSection("throughput", title, no_journal)
    wall_s = info.wall_s or total_s
    text = (
        f"{commits:,} {info.noun}s in {wall_s:,.1f} s, start of the nodes included; "
        f"{commits / wall_s:.1f} a second on average."
    )
    if (resumed := len(times["opened"]) - 1) > 0:
        text += f" It was resumed {f'{resumed} times' if resumed > 1 else 'once'} (dotted); the pauses are left out."
    panel = Panel("rate", f"{info.noun.capitalize()}s a second", figures.draw_throughput(times, total_s, info.noun))
    return ReportSection("throughput", title, text, ((panel,),))


def _show_provenance(facts: dict[str, str], config: str) -> ReportSection:
    text = Markup("<code>throwcollect dataset verify</code> checks the recordings against the digest of the dataset.")
    table = Table(tuple((name, _CODE.format(value)) for name, value in facts.items()))
    return ReportSection("provenance", "Where it comes from", text, (table, Listing(CONFIG, config)))


def write_report(directory: Path, page: Path, *, model: Path | None = None) -> None:
    """Write a report on a dataset, and on a model that was learned from it, into an HTML file that is new."""
    require("jinja2", "plotly", "PIL")
    if page.exists():
        raise ConfigError(
            f"{page}: exists", expected="a file that is new", hint="choose another --output, or remove it"
        )
    write_file(page, render_page(report_dataset(Dataset.open(directory), model=model)).encode())


def render_page(report: Report) -> str:
    """HTML of a report; equal reports give equal pages."""
    # All texts of a dataset are escaped; only `Markup` is HTML.
    templates = Environment(
        loader=PackageLoader("throwcollect.publish.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Apart from numbers, texts and dictionaries, plotly leaves only sequences in a figure.
    templates.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False, "default": list}
    templates.filters |= {"specify": _specify, "describe": describe, "share": format_share}
    page = templates.get_template("page.html")
    return page.render(report=report, version=__version__, plotly=get_plotlyjs())


def _specify(figure: go.Figure) -> dict[str, Any]:
    """A figure as plotly's JavaScript reads it, without a theme: that of the page follows the reader's settings."""
    specification: dict[str, Any] = figure.to_dict()
    specification["layout"].pop("template", None)
    return specification
