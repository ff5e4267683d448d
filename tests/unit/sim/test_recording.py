import numpy as np

from throwcollect.sim.recording import SampleLog


def test_a_log_keeps_all_samples_from_a_number_on():
    log = SampleLog((0.0, 0.5))
    log.append((1.0, 1.5))
    log.append((2.0, 2.5))
    assert len(log) == 3
    assert log.last == (2.0, 2.5)
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
