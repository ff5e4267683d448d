"""Keep the records of runs of tests apart from those of the user."""

from collections.abc import Iterator

import pytest

from throwcollect.state_directory import STATE_VARIABLE


@pytest.fixture(scope="session", autouse=True)
def environment(commands: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(tmp_path_factory.mktemp("state")))
        yield
