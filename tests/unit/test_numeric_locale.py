"""With a decimal comma in the locale of the process, throws are the same."""

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from throwcollect import Simulator
from throwcollect.engines.native_reading import reading_natively


def read_in_c(text: bytes) -> float:
    atof = ctypes.CDLL(None).atof
    atof.restype = ctypes.c_double
    return float(atof(text))


def test_a_block_changes_how_c_reads_numbers_for_its_own_thread_alone(use_decimal_comma: Callable[[], str]) -> None:
    assert read_in_c(b"0.5") == 0.5
    use_decimal_comma()
    assert (read_in_c(b"0.5"), read_in_c(b"0,5")) == (0.0, 0.5)
    with ThreadPoolExecutor(1) as pool, reading_natively():
        assert read_in_c(b"0.5") == 0.5
        assert pool.submit(read_in_c, b"0,5").result() == 0.5
    assert read_in_c(b"0,5") == 0.5


@pytest.mark.parametrize("name", ["bullet", "mujoco"])
def test_a_throw_in_a_thread_has_the_same_bits_with_a_decimal_comma(
    name: str, use_decimal_comma: Callable[[], str]
) -> None:
    def throw() -> str:
        with Simulator("configs/quickstart.yaml", overrides=[f"sim.engine={name}"]) as simulator:
            return str(simulator.throw().row)

    usual = throw()
    use_decimal_comma()
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(throw).result() == usual
