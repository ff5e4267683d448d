"""Plans whose trials are drawn in this process, and refused by any check or by none."""

from __future__ import annotations

from pathlib import Path

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.plan.plan import Check, Plan, check_some_left, make_trials
from throwcollect.plan.samplers import draw_points


def make_plan(config: Config, *, check: Check | None = None, directory: Path | None = None) -> Plan:
    """Draw all trials of a sweep; `draw_plan` asks the robot, too."""
    trials = make_trials(config, draw_points(config, directory=directory or Path()))
    if check is not None:
        reasons = (check(with_values(config, trial.values)) for trial in trials)
        trials.refused |= {number: reason for number, reason in enumerate(reasons) if reason is not None}
    check_some_left([trial.refused for trial in trials])
    return Plan(config, trials)
