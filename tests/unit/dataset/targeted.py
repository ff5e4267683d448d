"""Small collections whose trials have targets, from a list with target columns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tests.unit.dataset.conftest import Change, Collection, create_and_open

from throwcollect.collect.coordinator.prepare import make_self_contained
from throwcollect.plan.point_file import read_points

LIST = """\
task.duration_s,target_y_m,target_x_m
0.9,-0.1,1.4
1.0,,
1.1,0.2,1.5
1.2,0.1,1.6
"""
WITHOUT_TARGETS = "task.duration_s\n0.9\n1.0\n1.1\n1.2\n"


def plan_targeted(directory: Path, text: str = LIST, *, height_m: float = 0.0) -> Collection:
    """The collection of a list, whose CSV file is written beside the directory."""
    path = directory.with_suffix(".csv")
    path.write_text(text)
    sweep, scene = {"sampler": "list", "file": str(path)}, {"landing_height_m": height_m}
    collection = Collection({"trials": None, "sweep": sweep, "scene": scene})
    collection.plan = replace(collection.plan, config=make_self_contained(collection.config))
    return collection


def collect_targeted(directory: Path, text: str = LIST, *, height_m: float = 0.0, change: Change | None = None) -> Path:
    """Collect a list to a finished dataset."""
    collection = plan_targeted(directory, text, height_m=height_m)
    listed = read_points(directory.with_suffix(".csv"), collection.config)
    writer = create_and_open(directory, collection.plan, listed=listed)
    collection.fill(writer, range(len(collection.plan.trials)), change=change)
    writer.finish(simulations=2)
    writer.close()
    return directory
