"""What C libraries print becomes an error of ours, or is printed afterwards."""

import ctypes
import os

import pytest

from throwcollect.errors import ConfigError
from throwcollect.native_reading import reading_natively

C = ctypes.CDLL(None)


@pytest.mark.parametrize(
    "printed",
    [
        b"b3Warning[examples/Importers/ImportURDFDemo/URDF2Bullet.cpp,130]:\nNo inertial data for link\n",
        b"Error:   Inertial: inertia element must have ixx,ixy,ixz,iyy,iyz,izz attributes\n",
        b"QH6154 Qhull precision error: Initial simplex is flat\n",
    ],
)
def test_a_complaint_of_a_library_is_an_error_with_the_file(printed: bytes, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match="arm.urdf: .*" + printed.decode().split()[-1]), reading_natively("arm.urdf"):
        # It stays in the buffer of C until somebody flushes it.
        C.printf(printed)
    assert capfd.readouterr() == ("", "")


def test_other_output_is_printed_afterwards(capfd: pytest.CaptureFixture[str]) -> None:
    with reading_natively("arm.urdf"):
        os.write(2, b"collected 3 of 9 throws,\n1 error: lost\n")
    assert capfd.readouterr() == ("", "collected 3 of 9 throws,\n1 error: lost\n")


def test_an_error_keeps_what_was_printed_before_it_as_evidence(capfd: pytest.CaptureFixture[str]) -> None:
    def load() -> None:
        with reading_natively("arm.urdf"):
            os.write(1, b"b3Warning[x]: cannot extract anything useful\n")
            raise ConfigError("Bullet cannot load it")

    with pytest.raises(ConfigError) as refused:
        load()
    assert refused.value.evidence == "b3Warning[x]: cannot extract anything useful"
    assert capfd.readouterr() == ("", "")
