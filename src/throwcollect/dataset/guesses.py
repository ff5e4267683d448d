"""Names the attribute that a program most likely means when it takes one that does not exist."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

DATASET: Mapping[str, str] = {
    "columns": "throws.column_names",
    "data": "throws",
    "dataframe": "to_pandas()",
    "df": "to_pandas()",
    "filter": "select(...)",
    "head": "to_pandas()",
    "landing": "landings",
    "params": "parameters",
    "query": "select(...)",
    "rows": "throws",
    "table": "throws",
    "to_df": "to_pandas()",
    "to_table": "throws",
    "trials": "throws",
    "where": "select(...)",
}
"""Attributes of a dataset that people try, and the ones that they look for."""

THROW: Mapping[str, str] = {
    "apex": "events.apex",
    "contacts": "events.contacts",
    "df": "to_pandas()",
    "joint_positions": "joints.position",
    "landing": "events.landing",
    "names": "joints.names",
    "params": "parameters",
    "position": "ball.position or joints.position",
    "q": "joints.position",
    "qd": "joints.velocity",
    "release": "events.release",
    "robot": "joints",
    "time": "ball.time_s",
    "time_s": "ball.time_s",
    "times": "ball.time_s",
    "to_df": "to_pandas()",
    "torque": "joints.effort",
    "trajectory": "ball, joints or to_pandas()",
    "velocity": "ball.velocity or joints.velocity",
}
"""Attributes of a throw that people try, and the ones that they look for."""


def refuse_attribute(owner: object, name: str, guesses: Mapping[str, str]) -> AttributeError:
    """Make the error for an attribute that `owner` lacks; it names the attribute that was probably meant, if any."""
    public = [each for each in dir(type(owner)) if not each.startswith("_")]
    meant = guesses.get(name) or next(iter(get_close_matches(name, public, 1)), None)
    hint = f"; try .{meant}" if meant and not name.startswith("_") else ""
    return AttributeError(f"a {type(owner).__name__} has no {name!r}{hint}")
