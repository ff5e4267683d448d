import os
from pathlib import Path

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


def facts(document: Document) -> list[tuple[str, int | None, str]]:
    return [(problem.key, problem.line, problem.message) for problem in document.problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("yes", "yes"),
        ("on", "on"),
        ("true", True),
        ("~", None),
        ("", None),
        ("1e3", 1000.0),
        ("1e-07", 1e-7),
        (".5", 0.5),
        ("-.inf", float("-inf")),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
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


def test_a_merge_key_at_the_top_of_a_file_or_in_an_override_is_refused(read):
    with pytest.raises(ConfigError, match=r"run\.yaml:2: merge keys \(<<\) are not supported; write the keys out"):
        read("a: &a {b: 1}\n<<: *a\n")
    document = read("a: 1\n")
    document.override("ball={<<: {mass_kg: 1}}")
    assert [key for key, _, _ in facts(document)] == ["ball"]


def test_an_anchor_inside_itself_is_a_problem(read):
    assert facts(read("a: &a\n  b: *a\n")) == [("a.b", 1, "an alias cannot be inside its own anchor")]


def test_a_repeated_key_is_a_problem_and_keeps_its_first_value(read):
    document = read("ball:\n  mass_kg: 1\n  radius_m: 2\n  mass_kg: 3\n")
    assert facts(document) == [("ball.mass_kg", 4, "the key is here twice, first in line 2")]
    assert document.values == {"ball": {"mass_kg": 1, "radius_m": 2}}


def test_a_key_that_is_a_list_is_a_problem(read):
    assert facts(read("? [a, b]\n: 1\n")) == [("", 1, "a key should be a word")]


def test_unknown_yaml_tags_are_problems(read):
    document = read("a: !!python/name:os.system x\nb: !units 3\nc: !!set {x}\n")
    assert facts(document) == [
        ("a", 1, "the tag python/name:os.system means nothing here"),
        ("b", 2, "the tag !units means nothing here"),
        ("c", 3, "the tag set means nothing here"),
    ]


def test_a_number_of_thousands_of_digits_is_a_problem(read):
    assert [(key, line) for key, line, _ in facts(read(f"a: 1\nb: {'9' * 5000}\n"))] == [("b", 2)]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("!!bool maybe", "'maybe' is not of the kind bool"),
        ('!!int ""', "'' is not of the kind int"),
        ('!!float ""', "'' is not of the kind float"),
        ("0x" + "f" * 5000, "the number is too large"),
        ("-1" + "0" * 400, "the number is too large"),
    ],
)
def test_a_value_that_does_not_fit_its_tag_or_is_too_large_is_a_problem(read, text, sentence):
    assert facts(read(f"a: 1\nb: {text}\n")) == [("b", 2, sentence)]


@pytest.mark.parametrize("escaped", [r"\UFFFFFFFF", r"\U00110000", r"\ud800"])
def test_escapes_of_characters_that_unicode_lacks_are_invalid_yaml(read, escaped):
    with pytest.raises(
        ConfigError, match=r"run\.yaml:2: not valid YAML: an escaped character does not exist in Unicode"
    ):
        read(f'a: 1\n"{escaped}": 2\n')


def test_the_error_for_a_too_large_override_does_not_name_the_file(read):
    document = read("a: 1\n")
    # A thousand values with 29 aliases: faster to read than 30000 values.
    with pytest.raises(ConfigError, match=r"^b: holds more than 30000 values$"):
        document.override(f"b=[&a [{1000 * '1,'}]{29 * ',*a'}]")


def test_an_override_with_an_index_of_thousands_of_digits_is_a_problem(read):
    document = read("a: [1]\n")
    document.override(f"a.{'9' * 5000}=2")
    assert [problem.message for problem in document.problems] == ["nothing of this name can be set; got '2'"]


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
    assert document.problem(location, "wrong").line == line


def test_problems_in_overridden_values_name_no_file(read):
    document = read("a: {b: 1, c: 2}\n")
    document.override("a.b=3")
    document.override("d.e={f: 1}")
    assert document.values == {"a": {"b": 3, "c": 2}, "d": {"e": {"f": 1}}}
    places = [
        document.problem(location, "wrong").path for location in [("a", "b"), ("d",), ("d", "e", "f"), ("a", "c")]
    ]
    assert [path is None for path in places] == [True, True, True, False]


def test_an_override_of_a_section_removes_the_lines_of_its_old_keys(read):
    document = read("a:\n  b: {c: 1}\n")
    document.override("a.b={d: 2}")
    assert document.problem(("a", "b", "c"), "missing").path is None


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


def test_an_error_in_the_yaml_names_its_line(read):
    with pytest.raises(ConfigError, match=r"run\.yaml:2: not valid YAML: mapping values are not allowed here"):
        read("a: 1\nb: c: d\n")


def chain_aliases(levels: int) -> str:
    """A text that is nested only by its aliases."""
    return "k0: &k0 [1]\n" + "".join(f"k{n}: &k{n} [*k{n - 1}]\n" for n in range(1, levels))


@pytest.mark.parametrize(
    "text",
    [
        "a: " + 100_000 * "[",
        "a: " + 300 * "{a: ",
        "".join(f"{' ' * level}a:\n" for level in range(900)),
        chain_aliases(200),
    ],
)
def test_values_that_are_nested_too_deeply_are_refused(text, read):
    try:
        message = read(text).problems[0].message
    except ConfigError as error:
        message = str(error)
    assert "values are nested too deeply" in message


def test_an_override_that_is_nested_too_deeply_is_a_problem(read):
    document = read("a: 1\n")
    document.override("b." * 5000 + "c=1")
    assert [problem.message for problem in document.problems] == ["the key is nested too deeply"]
    assert document.values == {"a": 1}


@pytest.mark.parametrize(("text", "message"), [("!!set {a, b}\n", "the tag set"), ("!x {a: 1}\n", "the tag !x")])
def test_a_file_with_an_unknown_tag_at_its_top_is_refused(text, message, read):
    with pytest.raises(ConfigError, match=f"run.yaml:1: {message} means nothing here"):
        read(text)


def test_a_file_name_with_a_null_character_is_refused():
    with pytest.raises(ConfigError, match="no file can have this name"):
        Document(Path("a\0b"))


def test_a_pipe_as_configuration_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="pipe: should be a YAML file, got a pipe or a device"):
        Document(tmp_path / "pipe")
