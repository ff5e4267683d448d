import pytest

from throwcollect.wording import counted


@pytest.mark.parametrize(("number", "said"), [(0, "0 trials"), (1, "1 trial"), (2, "2 trials")])
def test_one_alone_is_singular(number: int, said: str) -> None:
    assert counted(number, "trial") == said
