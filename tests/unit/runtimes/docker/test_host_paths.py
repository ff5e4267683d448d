import pytest

from throwcollect.runtimes.docker.host_paths import is_allowed_device, refusal


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/etc", "/etc belongs to the system"),
        ("/proc/1", "/proc belongs to the system"),
        ("/var/lib/docker/x", "/var/lib belongs to the system"),
        ("/var", "/var/backups belongs to the system"),
        ("/", "/bin belongs to the system"),
        ("/root", "a home directory holds secrets"),
        ("/home/me/.ssh/id", ".ssh may hold secrets of programs"),
        ("/tmp", "all users of the machine share /tmp"),
    ],
)
def test_directories_that_hold_no_data_are_refused(path: str, reason: str) -> None:
    assert refusal(path) == f"is refused, as {reason}; mounts are for data"


@pytest.mark.parametrize("path", ["/srv/models", "/home/me/data", "/var/tmp/x", "/tmpdata"])
def test_directories_of_data_are_accepted(path: str) -> None:
    assert refusal(path) is None


def test_only_devices_of_graphics_processors_are_allowed() -> None:
    devices = ("/dev/dri", "/dev/dri/renderD128", "/dev/nvidia0", "/dev/vda", "/dev/mem")
    assert [is_allowed_device(each) for each in devices] == [True, True, True, False, False]
