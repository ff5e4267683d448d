"""The explanations why a target is out of reach."""

import numpy as np
import pytest
from tests.unit.learning.worlds import DRAG, KEYS, learn_with_drag

from throwcollect.learning.aiming import Aim, explain_reach
from throwcollect.learning.learned_map import KeyRole

FAR = "no throw came within 5.00 cm, so predictions there are uncertain"
MISSED = "the best parameters are predicted to miss it by 2.00 cm"
OUTSIDE = f"{DRAG.key} was 0 to 1 in all throws"


@pytest.mark.parametrize(
    ("drag", "predicted_x", "nearest_x", "reason"),
    [
        (0.5, 1.4, 1.349, FAR),
        (0.5, 1.42, 1.36, MISSED),
        (0.5, 1.42, 1.349, f"{FAR}; {MISSED}"),
    ],
)
def test_the_explanation_gives_every_reason_why_a_target_is_out_of_reach(
    drag: float, predicted_x: float, nearest_x: float, reason: str
) -> None:
    predicted, nearest = np.array([predicted_x, -0.2]), np.array([nearest_x, -0.2])
    aim = Aim(np.array([1.4, -0.2, drag]), dict.fromkeys(KEYS, 0.0), predicted, False, nearest)
    assert explain_reach(learn_with_drag(role=KeyRole.CONTEXT), aim) == (
        f"1.400,-0.200,{drag:.3f}; {reason}\n  the nearest throw ends at {nearest_x:.3f},-0.200 "
        f"({(1.4 - nearest_x) * 100:.2f} cm away); predicted end: {predicted_x:.3f},-0.200"
    )


def test_the_explanation_predicts_nothing_outside_of_what_was_collected() -> None:
    away = np.array([-20.0, 30.0])
    aim = Aim(np.array([1.4, -0.2, 1.5]), dict.fromkeys(KEYS, 0.0), away, False, away)
    assert explain_reach(learn_with_drag(role=KeyRole.CONTEXT), aim) == f"1.400,-0.200,1.500; {OUTSIDE}"
