"""Defects of tables, plan, configuration and metadata that tests plant, and what has to be said of each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
from tests.unit.dataset.damage import SHARD, change_table, flip, replace_text


def measured_landing(directory: Path) -> None:
    change_table(directory / "throws.parquet", "landing_x_m", 2, 1.25)


def outcome(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "timeout")


def row_digest(directory: Path) -> None:
    change_table(directory / "throws.parquet", "digest", 4, "0" * 64)


def row_offset(directory: Path) -> None:
    change_table(directory / "throws.parquet", "chunk_offset", 4, 17)


def row_lost(directory: Path) -> None:
    for column, value in (("outcome", "lost"), ("shard", None)):
        change_table(directory / "throws.parquet", column, 4, value)


def row_invented(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "lost")


def swept_value(directory: Path) -> None:
    change_table(directory / "throws.parquet", "task.duration_s", 6, 0.9)


def refused_row(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 6, "refused")


def row_missing(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def plan_of_another(directory: Path) -> None:
    replace_text(directory / "config.yaml", "seed: 0", "seed: 1")


def config_broken(directory: Path) -> None:
    (directory / "config.yaml").write_text("trials: many\n")


def bag_count(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "message_count: ", "message_count: 1")


def bag_digest(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.digest: ", "throwcollect.digest: 0000")


def bag_qos(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "durability: transient_local", "durability: volatile")


def card_gone(directory: Path) -> None:
    (directory / "README.md").unlink()


def new_file_left(directory: Path) -> None:
    (directory / "throws.parquet.new").write_bytes(b"PAR1")


def row_of_another_trial(directory: Path) -> None:
    path = directory / "throws.parquet"
    table = pq.read_table(path)
    pq.write_table(table.take([0, 1, 2, 3, 5, 5, 6]), path)


def rows_in_another_order(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).take([0, 1, 2, 4, 3, 5, 6]), path)


def a_row_too_many(directory: Path) -> None:
    change_table(directory / "throws.parquet", "trial", 6, 7)


def column_missing(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).drop_columns(["hit_angle_rad"]), path)


def table_damaged(directory: Path) -> None:
    flip(directory / "throws.parquet", 60)


def plan_value(directory: Path) -> None:
    change_table(directory / "plan.parquet", "task.duration_s", 5, 1.0)


def plan_seed(directory: Path) -> None:
    change_table(directory / "plan.parquet", "seed", 5, 42)


def plan_trial_removed(directory: Path) -> None:
    path = directory / "plan.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def plan_damaged(directory: Path) -> None:
    flip(directory / "plan.parquet", 60)


def plan_gone(directory: Path) -> None:
    (directory / "plan.parquet").unlink()


def config_value(directory: Path) -> None:
    replace_text(directory / "config.yaml", "mass_kg: 0.045", "mass_kg: 0.05")


def config_height(directory: Path) -> None:
    """The recordings would be wrong by this configuration, but they are not."""
    replace_text(directory / "config.yaml", "base_height_m: 1.01927", "base_height_m: 1.1")


def bag_no_yaml(directory: Path) -> None:
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: [")


def bag_files(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "- quick_00001.mcap", "- quick_00009.mcap")


def bag_file_count(directory: Path) -> None:
    """In one of the entries, not in the sum."""
    text = (directory / "metadata.yaml").read_text()
    entry = text.index("path: quick_00001.mcap")
    place = text.index("message_count: ", entry) + len("message_count: ")
    (directory / "metadata.yaml").write_text(text[:place] + "9" + text[place:])


def bag_format(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.format: '1'", "throwcollect.format: '7'")


def bag_extra_key(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "  version: 9", "  version: 9\n  colour: red")


TABLE_DEFECTS: dict[Callable[[Path], None], tuple[str, str, str]] = {
    measured_landing: ("quick_00000.mcap", "trial 2", r"landing_x_m = 1\.25, the episode gives"),
    outcome: (SHARD, "trial 4", "outcome = 'timeout', the episode gives 'landed'"),
    row_digest: (SHARD, "trial 4", "digest = '000"),
    row_offset: (SHARD, "trial 4", "chunk_offset = 17"),
    row_lost: (SHARD, "trial 4", "does not place here"),
    row_invented: ("throws.parquet", "trial 4", "is lost with shard"),
    swept_value: ("throws.parquet", "trial 6", r"task\.duration_s = 0\.9, the plan"),
    refused_row: ("throws.parquet", "trial 6", "nothing against it"),
    row_missing: ("throws.parquet", "trial 6", "has no row"),
    plan_of_another: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    config_broken: ("config.yaml", "", "trials"),
    bag_count: ("metadata.yaml", "message_count", "the files give"),
    bag_digest: ("metadata.yaml", "throwcollect.digest", "the episodes give"),
    bag_qos: ("metadata.yaml", "topics_with_message_count", "the files give"),
    card_gone: ("README.md", "", "is missing"),
    new_file_left: ("throws.parquet.new", "", "not written to its end"),
    row_of_another_trial: ("throws.parquet", "trial 5", "more than one row"),
    rows_in_another_order: ("throws.parquet", "", "not in order of trials"),
    a_row_too_many: ("throws.parquet", "trial 7", "not one of the plan"),
    column_missing: ("throws.parquet", "", "hit_angle_rad"),
    table_damaged: ("throws.parquet", "", "is damaged"),
    plan_value: ("plan.parquet", "trial 5", "its values and seed give"),
    plan_seed: ("plan.parquet", "trial 5", "its values and seed give"),
    plan_trial_removed: ("throws.parquet", "trial 6", "not one of the plan"),
    plan_damaged: ("plan.parquet", "", "is damaged"),
    plan_gone: ("plan.parquet", "", "is missing"),
    config_value: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    config_height: ("config.yaml", "", "one of the two was changed"),
    bag_no_yaml: ("metadata.yaml", "line 1", "cannot be read: [^\n]*$"),
    bag_files: ("metadata.yaml", "relative_file_paths", "the files give"),
    bag_file_count: ("metadata.yaml", "files", "the files give"),
    bag_format: ("metadata.yaml", "throwcollect.format", "is '7'"),
    bag_extra_key: ("metadata.yaml", "", "unknown keys: .*colour"),
}
"""File, place and problem that are to be named."""


TABLE_CONSEQUENCES: dict[Callable[[Path], None], tuple[str, ...]] = {
    row_lost: ("metadata.yaml",),
    row_invented: (SHARD,),
    refused_row: ("quick_00002.mcap",),
    a_row_too_many: ("quick_00002.mcap",),
    plan_trial_removed: ("quick_00002.mcap", "plan.parquet"),
}
"""Other files that a defect contradicts."""
