"""What the page says about flights and ballistic motion."""

import numpy as np

from throwcollect.report.throw.episodes import Residuals
from throwcollect.report.throw.throw_sections import _show_physics


def test_the_page_says_where_exact_flights_are_drawn():
    """A logarithmic axis has no place for 0, so the page says which bar has the flights that agree to the last bit."""
    section = _show_physics(Residuals(episodes=3, checked=3, distance_m=np.array([0.0, 0.0, 3e-15])))
    assert "2 agree to the last bit (drawn at 1e-17 m)" in str(section.text)
