import math

import pyarrow as pa
import pytest

from throwcollect.dataset.expression import Expression
from throwcollect.errors import ConfigError

TABLE = pa.table(
    {
        "trial": pa.array([0, 1, 2, 3]),
        "task.duration_s": [0.9, 1.0, 1.1, 1.2],
        "task.trajectory.weights.arm_right_4_joint.3": [1.0, -1.0, 2.0, -2.0],
        "outcome": ["landed", "landed", "recaught", "lost"],
        "reason": pa.array([None, None, "touched", "gone"]),
        "landing_x_m": pa.array([1.0, 2.0, 3.0, None]),
        "landing_y_m": pa.array([0.0, -1.5, 4.0, None]),
    }
)


def rows(text: str) -> list[int]:
    return Expression(text, place="where").rows(TABLE)


def test_a_condition_is_a_python_expression_over_columns() -> None:
    assert rows("outcome == 'landed' and landing_x_m > 1.5 and task.duration_s < 1.2") == [1]
    assert rows("task.duration_s <= 0.9 or task.duration_s >= 1.2") == [0, 3]
    assert rows("0.9 < task.duration_s < 1.2") == [1, 2]
    assert rows("not outcome != 'landed'") == [0, 1]
    assert rows("outcome in ('recaught', \"lost\")") == [2, 3]
    assert rows("outcome not in ['recaught', 'lost']") == [0, 1]
    assert rows("task.trajectory.weights.arm_right_4_joint[3] < 0") == [1, 3]
    assert rows("outcome\n  == 'lost'") == [3]
    assert rows("(trial == 1) == (landing_x_m == 2)") == [0, 1, 2]
    assert rows("True") == [0, 1, 2, 3]


def test_an_expression_computes_with_real_numbers() -> None:
    assert rows("hypot(landing_x_m, landing_y_m) == 5") == [2]
    assert rows("(landing_x_m ** 2 + landing_y_m ** 2) ** 0.5 == 2.5") == [1]
    assert rows("sqrt(abs(landing_y_m)) == 2") == [2]
    assert rows("-landing_y_m > +1") == [1]
    assert rows("trial % 2 == 1") == [1, 3]
    assert rows("trial // 2 == 1") == [2, 3]
    assert rows("trial / 2 == 1.5") == [3]
    assert rows("1 / trial > 100") == [0]
    numbers = Expression("landing_x_m - 2 * landing_y_m", place="cells").numbers(TABLE)
    assert numbers == [1.0, 5.0, -5.0, None]
    assert Expression("2", place="cells").numbers(TABLE) == [2.0] * 4


def test_a_null_value_fulfils_only_comparisons_with_none() -> None:
    assert rows("landing_x_m > 0") == [0, 1, 2]
    assert rows("not landing_x_m > 0") == []
    assert rows("landing_x_m > 0 or outcome == 'lost'") == [0, 1, 2, 3]
    assert rows("landing_x_m is None") == rows("landing_x_m == None") == [3]
    assert rows("reason is not None") == rows("reason != None") == [2, 3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("outcome = 'landed'", r"cannot be understood: .* \(character 9\)\n    outcome = 'landed'\n            \^"),
        ("trial >", r"cannot be understood: .* \(character 8\)\n    trial >\n           \^"),
        ("(trial > 1", r"cannot be understood: .* \(character 1\)\n    \(trial > 1\n    \^"),
        ("", "cannot be understood"),
        ("trial > 1\0", "cannot be understood"),
        ("not " * 5000 + "trial > 1", "cannot be understood|nested too deeply"),
        ("+".join(["1"] * 5000) + " > 1", "cannot be understood|nested too deeply"),
        (
            "outcome == landed",
            r"no column 'landed'; a text needs quotes, and docs/dataset.md lists all \(character 12\)",
        ),
        ("trial > 0 and landing_x > 1", r"no column 'landing_x'; did you mean 'landing_x_m'\? \(character 15\)"),
        ("'größe' == outcome and task.duration_m > 1", r"did you mean 'task.duration_s'\? \(character 24\)"),
        ("landing_x_m", "should be a condition, is a number"),
        ("not trial", "should be a condition, is a number"),
        ("outcome > 3", "a number cannot be compared with text"),
        ("outcome + 1 > 2", "should be a number, is text"),
        ("(trial > 1) < (trial > 2)", "conditions can be compared by == and != only"),
        ("outcome is 'landed'", "`is` is for None only"),
        ("trial > None", "None can be compared by"),
        ("outcome in 'landed'", "should be a list"),
        ("outcome in []", "should be a list"),
        ("trial == 1j", "should be a number, a text in quotes"),
        (f"trial == {'9' * 400}", "too large a number"),
        ("trial & 1", "use `and`, `or`, `not`"),
        ("abs(trial, 1) > 0", "abs takes 1 number"),
        ("__import__('os').system('true')", "only comparisons"),
        ("outcome.upper() == 'LANDED'", "only comparisons"),
        ("(lambda: 1)", "only comparisons"),
        ("[1][0] == 1", "should be the name of a column"),
        ("(trial + 1).real == 1", "should be the name of a column"),
    ],
)
def test_a_wrong_expression_gives_one_short_message(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^where: .*(?s:{message})") as caught:
        rows(text)
    assert max(map(len, str(caught.value).splitlines())) < 200


def test_the_square_root_of_a_negative_number_is_nan() -> None:
    found = Expression("sqrt(0 - trial)", place="cells").numbers(TABLE)
    assert [math.isnan(number) for number in found] == [False, True, True, True]
