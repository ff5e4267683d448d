import pyarrow as pa
import pytest

from throwcollect.dataset.selection import find_rows
from throwcollect.errors import ConfigError

TABLE = pa.table(
    {
        "trial": pa.array([0, 1, 2, 3]),
        "task_duration_s": [0.9, 1.0, 1.1, 1.2],
        "task_trajectory_weights_arm_right_4_joint_3": [1.0, -1.0, 2.0, -2.0],
        "outcome": ["landed", "landed", "recaught", "lost"],
        "reason": pa.array([None, None, "touched", "gone"]),
        "landing_x_m": pa.array([1.0, 2.0, 3.0, None]),
        "landing_y_m": pa.array([0.0, -1.5, 4.0, None]),
    }
)


def rows(text: str) -> list[int]:
    return [row for row, holds in enumerate(find_rows(text, TABLE, "where").to_pylist()) if holds]


def test_a_condition_is_a_python_expression_over_columns() -> None:
    assert rows("outcome == 'landed' and landing_x_m > 1.5 and task_duration_s < 1.2") == [1]
    assert rows("task_duration_s <= 0.9 or task_duration_s >= 1.2") == [0, 3]
    assert rows("0.9 < task_duration_s < 1.2") == [1, 2]
    assert rows("not outcome != 'landed'") == [0, 1]
    assert rows("outcome in ('recaught', \"lost\")") == [2, 3]
    assert rows("outcome not in ['recaught', 'lost']") == [0, 1]
    assert rows("task_trajectory_weights_arm_right_4_joint_3 < 0") == [1, 3]
    assert rows("outcome\n  == 'lost'") == [3]
    assert rows("(trial == 1) == (landing_x_m == 2)") == [0, 1, 2]
    assert rows("True") == [0, 1, 2, 3]


def test_an_expression_computes_with_real_numbers() -> None:
    assert rows("hypot(landing_x_m, landing_y_m) == 5") == [2]
    assert rows("(landing_x_m ** 2 + landing_y_m ** 2) ** 0.5 == 2.5") == [1]
    assert rows("sqrt(abs(landing_y_m)) == 2") == [2]
    assert rows("-landing_y_m > 1") == [1]
    assert rows("trial % 2 == 1") == [1, 3]
    assert rows("trial // 2 == 1") == [2, 3]
    assert rows("trial / 2 == 1.5") == [3]
    assert rows("1 / trial > 100") == [0]
    assert rows("landing_x_m - 2 * landing_y_m == 5") == [1]


def test_a_null_value_fulfils_only_comparisons_with_none() -> None:
    assert rows("landing_x_m > 0") == [0, 1, 2]
    assert rows("not landing_x_m > 0") == []
    assert rows("landing_x_m > 0 or outcome == 'lost'") == [0, 1, 2, 3]
    assert rows("landing_x_m is None") == rows("landing_x_m == None") == [3]
    assert rows("reason is not None") == rows("reason != None") == [2, 3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("outcome = 'landed'", "invalid syntax"),
        ("outcome == landed", "no column landed; docs/dataset.md lists all"),
        ("landing_x_m", "is no condition"),
        ("outcome is 'landed'", "`is` is for None alone"),
        ("__import__('os').system('true')", "is none of: column"),
    ],
)
def test_a_wrong_expression_is_refused_with_the_argument(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^where: .*{message}"):
        rows(text)
