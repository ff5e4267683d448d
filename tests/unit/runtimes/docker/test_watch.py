import pytest

from throwcollect.runtimes.docker.docker_nodes import end_in_words
from throwcollect.runtimes.docker.watch import ContainerState


@pytest.mark.parametrize(
    ("state", "memory", "words"),
    [
        (ContainerState("exited", 3), None, "exit code 3"),
        (ContainerState("exited", 137), "512m", "ended by SIGKILL"),
        (ContainerState("exited", 139), None, "ended by SIGSEGV"),
        (ContainerState("exited", 137, out_of_memory=True), "512m", "ran out of memory (limit 512m)"),
        (ContainerState("exited", 137, out_of_memory=True), None, "ran out of memory"),
        # Another process of the container ran out of memory.
        (ContainerState("exited", 5, out_of_memory=True), "512m", "exit code 5"),
        # The exit code of our commands after an interruption.
        (ContainerState("exited", 255), None, "exit code 255"),
        (ContainerState("removed"), None, "its container was removed"),
    ],
)
def test_the_end_of_a_container_is_described_in_words(state: ContainerState, memory: str | None, words: str) -> None:
    assert state.ended
    assert end_in_words(state, memory) == words
