"""Defects of tables, plan, configuration and metadata that tests plant, and the finding that each must give."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
from tests.unit.dataset.damage import SHARD, change_table, flip, replace_text


def change_landing(directory: Path) -> None:
    change_table(directory / "throws.parquet", "landing_x_m", 2, 1.25)


def change_outcome(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "timeout")


def change_row_digest(directory: Path) -> None:
    change_table(directory / "throws.parquet", "digest", 4, "0" * 64)


def change_row_offset(directory: Path) -> None:
    change_table(directory / "throws.parquet", "chunk_offset", 4, 17)


def lose_row(directory: Path) -> None:
    for column, value in (("outcome", "lost"), ("shard", None)):
        change_table(directory / "throws.parquet", column, 4, value)


def invent_loss(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "lost")


def change_swept_value(directory: Path) -> None:
    change_table(directory / "throws.parquet", "task_duration_s", 6, 0.9)


def refuse_row(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 6, "refused")


def remove_row(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def change_seed(directory: Path) -> None:
    replace_text(directory / "config.yaml", "seed: 0", "seed: 1")


def break_config(directory: Path) -> None:
    (directory / "config.yaml").write_text("trials: many\n")


def change_bag_count(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "message_count: ", "message_count: 1")


def change_bag_digest(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.digest: ", "throwcollect.digest: 0000")


def change_bag_qos(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "durability: transient_local", "durability: volatile")


def delete_card(directory: Path) -> None:
    (directory / "README.md").unlink()


def spoil_card(directory: Path) -> None:
    (directory / "README.md").write_text("garbage")


def spoil_bytes_of_card(directory: Path) -> None:
    (directory / "README.md").write_bytes(b"---\n\xff\xfe")


def spoil_provenance(directory: Path) -> None:
    (directory / "provenance.json").write_text("garbage")


def spoil_value_of_provenance(directory: Path) -> None:
    replace_text(directory / "provenance.json", '"was_open": ', '"was_open": 7')


def link_provenance(directory: Path) -> None:
    (directory / "provenance.json").rename(directory.with_name("elsewhere.json"))
    (directory / "provenance.json").symlink_to(directory.with_name("elsewhere.json"))


def leave_new_file(directory: Path) -> None:
    (directory / "throws.parquet.new").write_bytes(b"PAR1")


def repeat_row(directory: Path) -> None:
    path = directory / "throws.parquet"
    table = pq.read_table(path)
    pq.write_table(table.take([0, 1, 2, 3, 5, 5, 6]), path)


def reorder_rows(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).take([0, 1, 2, 4, 3, 5, 6]), path)


def change_trial_of_row(directory: Path) -> None:
    change_table(directory / "throws.parquet", "trial", 6, 7)


def remove_column(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).drop_columns(["hit_angle_rad"]), path)


def damage_table(directory: Path) -> None:
    flip(directory / "throws.parquet", 60)


def change_plan_value(directory: Path) -> None:
    change_table(directory / "plan.parquet", "task.duration_s", 5, 1.0)


def change_plan_seed(directory: Path) -> None:
    change_table(directory / "plan.parquet", "seed", 5, 42)


def remove_plan_trial(directory: Path) -> None:
    path = directory / "plan.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def damage_plan(directory: Path) -> None:
    flip(directory / "plan.parquet", 60)


def delete_plan(directory: Path) -> None:
    (directory / "plan.parquet").unlink()


def change_config_value(directory: Path) -> None:
    replace_text(directory / "config.yaml", "mass_kg: 0.045", "mass_kg: 0.05")


def change_config_height(directory: Path) -> None:
    """With this configuration the recordings would look wrong, but they are sound."""
    replace_text(directory / "config.yaml", "base_height_m: 1.01927", "base_height_m: 1.1")


def break_bag_yaml(directory: Path) -> None:
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: [")


def change_bag_files(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "- quick_00001.mcap", "- quick_00009.mcap")


def change_bag_file_count(directory: Path) -> None:
    """The count is wrong in one of the entries, not in the sum."""
    text = (directory / "metadata.yaml").read_text()
    entry = text.index("path: quick_00001.mcap")
    place = text.index("message_count: ", entry) + len("message_count: ")
    (directory / "metadata.yaml").write_text(text[:place] + "9" + text[place:])


def change_bag_format(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.format: '2'", "throwcollect.format: '7'")


def add_bag_key(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "  version: 9", "  version: 9\n  colour: red")


def change_bag_number_type(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "  version: 9", "  version: 9.0")


def change_bag_file_number_type(directory: Path) -> None:
    path = directory / "metadata.yaml"
    before, files, after = path.read_text().partition("  files:")
    path.write_text(before + files + re.sub(r"message_count: (\d+)", r"message_count: \1.0", after, count=1))


def change_unit(directory: Path) -> None:
    table = pq.read_table(directory / "throws.parquet")
    index = table.schema.get_field_index("task_duration_s")
    field = table.schema.field(index)
    other = field.with_metadata({**field.metadata, b"unit": b"ms"})
    pq.write_table(table.set_column(index, other, table.column(index)), directory / "throws.parquet")


def nudge_landing(directory: Path) -> None:
    table = pq.read_table(directory / "throws.parquet")
    change_table(directory / "throws.parquet", "landing_x_m", 2, table["landing_x_m"][2].as_py() + 1e-8)


def add_bag_section(directory: Path) -> None:
    path = directory / "metadata.yaml"
    path.write_text(path.read_text() + "colours: 3\n")


TABLE_DEFECTS: dict[Callable[[Path], None], tuple[str, str, str]] = {
    change_landing: ("quick_00000.mcap", "trial 2", r"landing_x_m = 1\.25, the episode gives"),
    change_outcome: (SHARD, "trial 4", "outcome = 'timeout', the episode gives 'landed'"),
    change_row_digest: (SHARD, "trial 4", "digest = '000"),
    change_row_offset: (SHARD, "trial 4", "chunk_offset = 17"),
    lose_row: (SHARD, "trial 4", "does not place here"),
    invent_loss: ("throws.parquet", "trial 4", "is lost with shard"),
    change_swept_value: ("throws.parquet", "trial 6", r"task_duration_s = 0\.9, the plan"),
    refuse_row: ("throws.parquet", "trial 6", "nothing against it"),
    remove_row: ("throws.parquet", "trial 6", "has no row"),
    change_seed: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    break_config: ("config.yaml", "", "trials"),
    change_bag_count: ("metadata.yaml", "message_count", "the files give"),
    change_bag_digest: ("metadata.yaml", "throwcollect.digest", "the episodes give"),
    change_bag_qos: ("metadata.yaml", "topics_with_message_count", "the files give"),
    delete_card: ("README.md", "", "is missing"),
    spoil_card: ("README.md", "", "has no YAML header"),
    spoil_bytes_of_card: ("README.md", "", "no UTF-8 text"),
    spoil_provenance: ("provenance.json", "", "is damaged: Invalid JSON"),
    spoil_value_of_provenance: ("provenance.json", "", "is damaged"),
    link_provenance: ("provenance.json", "", "a symbolic link leads elsewhere"),
    leave_new_file: ("throws.parquet.new", "", "not written to its end"),
    repeat_row: ("throws.parquet", "trial 5", "more than one row"),
    reorder_rows: ("throws.parquet", "", "not in order of trials"),
    change_trial_of_row: ("throws.parquet", "trial 7", "not one of the plan"),
    remove_column: ("throws.parquet", "", "hit_angle_rad"),
    damage_table: ("throws.parquet", "", "is damaged"),
    change_plan_value: ("plan.parquet", "trial 5", "its values and seed give"),
    change_plan_seed: ("plan.parquet", "trial 5", "its values and seed give"),
    remove_plan_trial: ("throws.parquet", "trial 6", "not one of the plan"),
    damage_plan: ("plan.parquet", "", "is damaged"),
    delete_plan: ("plan.parquet", "", "is missing"),
    change_config_value: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    change_config_height: ("config.yaml", "", "one of the two was changed"),
    break_bag_yaml: ("metadata.yaml", "line 1", "cannot be read: [^\n]*$"),
    change_bag_files: ("metadata.yaml", "relative_file_paths", "the files give"),
    change_bag_file_count: ("metadata.yaml", "files", "the files give"),
    change_bag_format: ("metadata.yaml", "throwcollect.format", "is '7'"),
    add_bag_key: ("metadata.yaml", "", "unknown keys: .*colour"),
    change_unit: ("throws.parquet", "task_duration_s", "has the unit b'ms', should be b's'"),
    nudge_landing: ("quick_00000.mcap", "trial 2", "throws.parquet has landing_x_m"),
    add_bag_section: ("metadata.yaml", "", "unknown sections: .*colours"),
    change_bag_number_type: ("metadata.yaml", "version", "is 9.0, the files give 9"),
    change_bag_file_number_type: ("metadata.yaml", "files", r"is \[.*\d\.0, .*the files give"),
}
"""File, place and problem of the finding that each defect must give."""


TABLE_CONSEQUENCES: dict[Callable[[Path], None], tuple[str, ...]] = {
    lose_row: ("metadata.yaml",),
    invent_loss: (SHARD,),
    refuse_row: ("quick_00002.mcap",),
    change_trial_of_row: ("quick_00002.mcap",),
    remove_plan_trial: ("quick_00002.mcap", "plan.parquet"),
}
"""Other files in which a defect gives findings too."""
