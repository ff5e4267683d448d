import os

import pytest

from throwcollect.config.document import Document
from throwcollect.errors import ConfigError


@pytest.fixture
def read(tmp_path):
    def read(text: str) -> Document:
        path = tmp_path / "run.yaml"
        path.write_text(text, encoding="utf-8")
        return Document(path)

    return read


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("yes", "yes"),
        ("true", True),
        ("", None),
        ("1e3", 1000.0),
        ("1e-07", 1e-7),
        (".5", 0.5),
        ("-.inf", float("-inf")),
        ("010", 10),
        ("0o17", 15),
        ("12:30", "12:30"),
        ("2020-01-31", "2020-01-31"),
        ("'1'", "1"),
        ("[1, [a, {b: 2}]]", [1, ["a", {"b": 2}]]),
    ],
)
def test_values_are_those_of_yaml_1_2(read, text, value):
    found = read(f"key: {text}\n").values["key"]
    assert found == value
    assert type(found) is type(value)


def test_an_alias_has_the_value_of_its_anchor(read):
    assert read("a: &range {min: 1}\nb: *range\n").values == {"a": {"min": 1}, "b": {"min": 1}}


def test_an_override_can_set_a_swept_key_that_is_named_like_a_field(read):
    document = read("a: 1\n")
    document.override("sweep.parameters.min=1")
    assert document.values["sweep"] == {"parameters": {"min": 1}}


def test_a_byte_order_mark_does_not_belong_to_the_first_key(read):
    assert read("\ufeffa: 1\n").values == {"a": 1}


@pytest.mark.parametrize(
    ("location", "line"),
    [
        (("a",), 2),
        (("a", "b"), 3),
        (("a", "b", 1), 5),
        (("a", "b", 1, "c"), 5),
        (("a", "missing"), 2),
        (("missing",), None),
    ],
)
def test_a_problem_has_the_line_of_its_key_or_of_the_section_that_lacks_it(read, location, line):
    document = read("# comment\na:\n  b:\n    - 1\n    - c: 2\n")
    assert document.make_problem(location, "wrong").line == line


def test_an_override_of_a_section_removes_the_lines_of_its_old_keys(read):
    document = read("a:\n  b: {c: 1}\n")
    document.override("a.b={d: 2}")
    assert document.make_problem(("a", "b", "c"), "missing").path is None


def test_overrides_fill_sections_that_are_left_empty(read):
    document = read("ball:\n")
    document.override("ball.mass_kg=1")
    assert document.values == {"ball": {"mass_kg": 1}}


@pytest.mark.parametrize("key", ["sweep.parameters.min.max", "sweep.parameters.a.b.c.scale", "sweep.parameters.a.b.c"])
def test_an_override_does_not_split_the_name_of_a_swept_key_at_its_dots(read, key):
    document = read("a: 1\n")
    document.override(f"{key}=1")
    name, _, field = key.removeprefix("sweep.parameters.").rpartition(".")
    expected = {f"{name}.{field}": 1} if field == "c" else {name: {field: 1}}
    assert document.values["sweep"] == {"parameters": expected}


def test_a_pipe_as_configuration_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="pipe: cannot be read: not a file"):
        Document(tmp_path / "pipe")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: c: d\n", "run.yaml:2: not valid YAML: mapping values are not allowed here"),
        ("a: 1\nb: {c: 1, c: 2}\n", 'run.yaml:2: not valid YAML: found duplicate key "c"'),
        (
            f"a: &a [{200 * '1,'}]\nb: &b [{200 * '*a,'}]\nc: [{200 * '*b,'}]\n",
            "run.yaml: not valid YAML: there are more than 30000 values",
        ),
        ("a: '" + 1_000_000 * "x" + "'", "run.yaml: cannot be read: larger than 1000000 bytes"),
    ],
)
def test_a_text_that_is_no_yaml_or_expands_beyond_reason_is_refused(read, text, message):
    with pytest.raises(ConfigError) as caught:
        read(text)
    (problem,) = caught.value.problems
    assert str(problem).rpartition("/")[2].startswith(message)
