from throwcollect.episode.record import Contact
from throwcollect.sim.contact_log import ContactLog


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
