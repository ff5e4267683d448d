"""Print the reference of all keys, as `docs/configuration.md` has it, from the models of the configuration.

``python packaging/configuration_reference.py > docs/configuration.md`` writes the page anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.metadata import EntryPoints
from typing import Any

from throwcollect import members

if __name__ == "__main__":
    # The page must not depend on what is installed beside throwcollect, and the imports below make the kinds of keys
    # from all members.
    members.entry_points = lambda **_: EntryPoints(())  # type: ignore[assignment]

from throwcollect.config.loader import value_as_yaml
from throwcollect.config.schema import Config, DynamicMovementPrimitive
from throwcollect.config.section import Section
from throwcollect.config.sensors import CameraConfig, LidarConfig
from throwcollect.config.shape import ValueShape, json_schema, root
from throwcollect.config.values import sweepable_keys
from throwcollect.robots.talos import TALOS

_INTRODUCTION = """\
# Configuration

<!-- Printed by `python packaging/configuration_reference.py`; edit the docstrings in src/throwcollect/config. -->

A configuration is a YAML 1.2 file. Every key has a default, unless it is marked as required. `throwcollect config
FILE` prints all keys with their values, `throwcollect config --schema` the JSON Schema for editors. Units are part of
the names; angles are in radians. Unknown keys and values out of bounds are errors, which are reported together;
contradictions between keys are reported once these are right.

`--set KEY=VALUE` replaces one key, such as `--set task.duration_s=1.1` or `--set 'record.topics=[joint_states,
ball/odometry, clock]'`. The value is YAML; later ones win. An item of a list is named by its index, from 0; a list
that is absent from the file is given as a whole.
"""

_SAMPLERS = """\
### Samplers

| sampler | points |
|---|---|
| `grid` | all combinations, the last key fastest; `trials` takes the first ones |
| `uniform` | independent random points, evenly distributed |
| `sobol` | scrambled Sobol' sequence, the most even one; any number of trials |
| `list` | the rows of `sweep.file`; `trials` takes the first ones |

With more `trials`, the first points stay the same.

The file of the sampler `list` is CSV (UTF-8, commas, a header line) or Parquet; its columns are named with dotted keys.
Each of a set of `values` is drawn equally often. All draws follow from `seed`.

With `until`, a dataset ends with the trial at which enough have succeeded. With `target`,
[`throwcollect cover`](learning.md#evenly-over-where-throws-land) spreads throws evenly over its cells.
"""

_TARGETS = """\
A list may also have the place where each trial should end, in columns that the task names; those of `throw` are
below. The trial does not depend on them: the table of throws has them, and the distance by which each throw missed
([dataset.md](dataset.md#targets)). A row without a target has empty cells there (Parquet: null). `throwcollect aim -o
FILE` writes such lists ([learning.md](learning.md)).
"""

_ANY = {"containers.": "<node>", "sweep.target.": "<target>"}
"""Placeholder for the names of sections that have the same keys, by the prefix of these names."""


def page() -> str:
    """Write the reference of all keys, as Markdown."""
    return "\n".join([_INTRODUCTION, *_write_sections(root(), "", {})])


Written = dict[str, list[str]]
"""What is on the page already: the rows of tables by where they stand, and the sections by their keys."""


def _write_sections(shape: ValueShape, prefix: str, written: Written) -> Iterator[str]:
    yield _write_table(shape, prefix, written.setdefault(prefix, []))
    for name, child in shape.keys.items():
        key = prefix + name
        alternatives = child.alternatives
        section = str(child.node)
        if child.keys or len(alternatives) > 1:
            # Tasks share sections, such as that of the trajectory.
            if section in (sections := written.setdefault(f"sections {key}", [])):
                continue
            sections.append(section)
        if key == "sweep.parameters":
            for parameter in child.child("").alternatives:
                yield f"### `sweep.parameters.<key>`: {_write_sentence(parameter)}\n"
                yield _write_table(parameter, "", [])
            yield f"{_SAMPLERS}\n### Targets in a list\n\n{_list_targets()}"
            yield f"### Keys that may be swept\n\n{_list_sweepable()}\n"
        elif len(alternatives) > 1 and all(each.keys for each in alternatives):
            for each in alternatives:
                yield f"{'###' if prefix else '##'} `{key}` with `{_find_discriminator(each)}`\n"
                yield f"{each.node['description']}\n"
                yield from _write_sections(each, f"{key}.", written)
        elif len(twins := _find_twins(shape, child)) > 1:
            if name == twins[0]:
                yield f"## {', '.join(f'`{prefix}{twin}`' for twin in twins)}\n\n{_find_own_sentence(child)}\n"
                yield from _write_sections(child, f"{prefix}{_ANY[prefix]}.", written)
        elif child.keys:
            yield f"## `{key}`\n\n{child.node['description']}\n"
            yield from _write_sections(child, f"{key}.", written)
        else:
            rows: list[str] = []
            items = [each for part in (0, "") for each in child.child(part).alternatives if each.keys]
            for item in items:
                kind = f" with `{_find_discriminator(item)}`" if len(items) > 1 else ""
                yield f"### Items of `{key}`{kind}\n\n{item.node['description']}\n"
                yield _write_table(item, "", rows)
                for part, section in item.keys.items():
                    if section.keys:
                        table = _write_table(section, f"{part}.", rows)
                        yield f"Its section `{part}`: {_write_sentence(section)}\n\n{table}"


def _find_discriminator(shape: ValueShape) -> str:
    """Find what distinguishes a section from its alternatives: a key that takes one word, or its first required key."""
    words = (f"{name}: {child.node['const']}" for name, child in shape.keys.items() if "const" in child.node)
    return next(words, next(iter(shape.node.get("required", shape.keys))))


def _find_twins(shape: ValueShape, child: ValueShape) -> list[str]:
    """List the sections in `shape` that have the same model as `child`, including `child` itself."""
    title = _find_title(child)
    return [name for name, each in shape.keys.items() if title is not None and _find_title(each) == title]


def _find_title(shape: ValueShape) -> str | None:
    """Find the name of the model of a section, even if the section may be null; None if the shape is no section."""
    return next((each.node.get("title") for each in shape.alternatives if each.keys), None)


def _find_own_sentence(shape: ValueShape) -> str:
    """Find the docstring of a section itself, not of the key that holds it."""
    return str(json_schema(Config)["$defs"][_find_title(shape)]["description"])


def _write_table(shape: ValueShape, prefix: str, written: list[str]) -> str:
    """Write the table of a section; rows that an alternative has already are only named."""
    rows, named = [], []
    for name, child in shape.keys.items():
        if child.keys and "default" in child.node and len(child.alternatives) == 1:
            continue
        cells = [f"`{prefix}{name}`", str(child), _write_default(child, name, shape), _write_sentence(child)]
        row = "| " + " | ".join(cells) + " |"
        (named if row in written else rows).append(row)
    written += rows
    lines = ["| key | holds | default | meaning |", "|---|---|---|---|", *rows] if rows else []
    if named:
        lines += ["", "As above: " + ", ".join(row.split(" | ")[0].removeprefix("| ") for row in named) + "."]
    return "\n".join(lines) + "\n"


def _write_sentence(shape: ValueShape) -> str:
    return re.sub(r"\s+", " ", shape.node["description"])


def _write_default(child: ValueShape, name: str, holder: ValueShape) -> str:
    if any(name in each.node.get("required", []) for each in holder.alternatives):
        return "required"
    if "default" not in child.node:
        return "absent"
    default = child.node["default"]
    if isinstance(default, dict) and len(default) > 1 and any(each.keys for each in child.alternatives):
        first = next(iter(default))
        return f"`{first}: {value_as_yaml(default[first])}`, ..."
    return f"`{value_as_yaml(default)}`"


def _list_targets() -> str:
    """List the columns of targets that lists of the task throw may have."""
    columns = Config().task.target_columns
    rows = [f"| `{each.name}` | {each.description} | {'yes' if each.required else 'no'} |" for each in columns]
    return "\n".join([_TARGETS, "| column | meaning | required |", "|---|---|---|", *rows, ""])


def _list_sweepable() -> str:
    config = Config()
    # By default, no joint has an offset.
    robot = config.robot.model_copy(update={"joint_offsets": dict.fromkeys(config.task.end, 0.0)})
    config = config.model_copy(update={"robot": robot})
    weights = {joint: [0.0] * 2 for joint in config.task.end}
    primitive = DynamicMovementPrimitive(family="dmp", basis_functions=2, weights=weights)
    learned: Section = config.task.model_copy(update={"trajectory": primitive})
    keys = [*sweepable_keys(config), *sweepable_keys(config.model_copy(update={"task": learned}))]
    place: Any = {"position_m": [0.0] * 3, "rpy_rad": [0.0] * 3}
    sensors = CameraConfig(kind="camera", **place), LidarConfig(kind="lidar_2d", **place)
    for sensor in sensors:
        keys += sweepable_keys(config.model_copy(update={"sensors": {"<name>": sensor}}))
    joints = "|".join(TALOS.joints)
    general = dict.fromkeys(re.sub(rf"({joints})(\.\d+)?", _generalise, key) for key in keys)
    where = (
        "A joint must be in `task.end`, one with an offset in `robot.joint_offsets`, too, and a weight in "
        "`task.trajectory.weights`."
    )
    return ", ".join(f"`{key}`" for key in general) + f".\n{where}"


def _generalise(match: re.Match[str]) -> str:
    return "<joint>.<index>" if match[2] else "<joint>"


if __name__ == "__main__":
    print(page(), end="")
