from throwcollect.episode.record import Contact
from throwcollect.sim.contacts import ContactLog

NAMES = {(0, -1): "ground", (1, 4): "spoon", (1, 5): "spoon", (1, 2): "head_2_link"}


def intervals(*steps):
    log = ContactLog(NAMES)
    for step, pressing in enumerate(steps):
        log.update(frozenset(pressing), step)
    return log.intervals(lambda step: 10 * step)


def test_an_interval_starts_with_the_first_step_with_force_and_ends_with_the_first_without():
    assert intervals([], [(1, 4)], [(1, 4)], [], []) == (Contact("spoon", 10, 30),)


def test_a_contact_that_lasts_has_no_end():
    assert intervals([(1, 4)], [(1, 4)]) == (Contact("spoon", 0, None),)


def test_surfaces_of_one_body_are_one_contact():
    assert intervals([(1, 4)], [(1, 4), (1, 5)], [(1, 5)], []) == (Contact("spoon", 0, 30),)


def test_contacts_are_ordered_by_start_then_by_name():
    assert intervals([], [(1, 4), (0, -1)], [(0, -1), (1, 2)], [(1, 4), (0, -1)], []) == (
        Contact("ground", 10, 40),
        Contact("spoon", 10, 20),
        Contact("head_2_link", 20, 30),
        Contact("spoon", 30, 40),
    )


def test_the_bodies_that_press_now_are_known():
    log = ContactLog(NAMES)
    log.update(frozenset([(1, 4), (1, 2)]), 1)
    assert sorted(log.bodies) == ["head_2_link", "spoon"]
    log.update(frozenset(), 2)
    assert not log.bodies
