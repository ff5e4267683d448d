import numpy as np
import pytest

from throwcollect.episode.record import Contact
from throwcollect.sim.recording import ContactLog, SampleLog, to_samples


def test_a_log_keeps_all_samples_from_a_number_on():
    log = SampleLog((0.0, 0.5))
    log.extend(np.array([(1.0, 1.5), (2.0, 2.5)]))
    assert len(log) == 3
    np.testing.assert_array_equal(log.table(1), [(1.0, 1.5), (2.0, 2.5)])


def test_forgotten_samples_leave_the_numbers_of_later_ones_as_they_are():
    log = SampleLog((0.0, 0.5))
    log.append((1.0, 1.5))
    log.forget()
    log.forget()
    assert log.forgotten == 1
    log.append((2.0, 2.5))
    log.append((3.0, 3.5))
    assert len(log) == 4
    np.testing.assert_array_equal(log.table(log.forgotten), [(1.0, 1.5), (2.0, 2.5), (3.0, 3.5)])
    np.testing.assert_array_equal(log.table(3), [(3.0, 3.5)])


def test_a_table_stays_as_it_is_when_the_log_goes_on():
    log = SampleLog((0.0,))
    table = log.table(0)
    log.append((1.0,))
    np.testing.assert_array_equal(table, [(0.0,)])


def intervals(*steps):
    log = ContactLog()
    for step, bodies in enumerate(steps):
        log.update(frozenset(bodies), step)
    return log.intervals(lambda step: 10 * step)


def test_a_contact_lasts_from_the_first_step_with_force_to_the_first_without():
    assert intervals([], ["spoon"], ["spoon"], [], []) == (Contact("spoon", 10, 30),)


def test_a_contact_that_lasts_has_no_end():
    assert intervals(["spoon"], ["spoon"]) == (Contact("spoon", 0, None),)


def test_contacts_are_ordered_by_start_then_by_name():
    assert intervals([], ["spoon", "ground"], ["ground", "head_2_link"], ["spoon", "ground"], []) == (
        Contact("ground", 10, 40),
        Contact("spoon", 10, 20),
        Contact("head_2_link", 20, 30),
        Contact("spoon", 30, 40),
    )


def test_the_log_knows_the_bodies_that_touch_now():
    log = ContactLog()
    log.update(frozenset(["spoon", "head_2_link"]), 1)
    assert sorted(log.bodies) == ["head_2_link", "spoon"]
    log.update(frozenset(), 2)
    assert not log.bodies


@pytest.mark.parametrize("bodies", [0, 2])
@pytest.mark.parametrize("rows", [0, 3])
def test_samples_have_the_bodies_that_move_even_if_there_are_none(rows: int, bodies: int) -> None:
    joints = ("shoulder", "elbow")
    table = np.arange(rows * (6 + 13 * (bodies + 1)), dtype=np.float64).reshape(rows, -1 if rows else 19 + 13 * bodies)
    samples = to_samples(table, np.arange(rows), joints, joints, {}, np.zeros(2))
    assert samples.bodies.shape == (rows, bodies, 13)
    assert samples.object_position.shape == (rows, 3)
    if rows and bodies:
        assert samples.bodies[0].ravel().tolist() == [*range(6, 6 + 26)]
