"""Tokens to join a run: each is one word, and is refused where other sources would compute other throws."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from throwcollect import build
from throwcollect.build import build_digest
from throwcollect.collect.runs.joining import JoinToken
from throwcollect.errors import ConfigError

PARTS = ("bullet", "talos", "spoon", "throw", "")


def make(build: str = "") -> JoinToken:
    return JoinToken("many-1234", "tls/10.0.0.1:7447", "0f" * 32, 7, PARTS, build or build_digest(*PARTS))


def test_a_token_is_one_word_and_decodes_to_the_same_values() -> None:
    word = make().encode()
    assert re.fullmatch(r"tc3\.[A-Za-z0-9_-]+", word)
    assert len(word) < 400
    assert JoinToken.decode(f" {word}\n") == make()


@pytest.mark.parametrize("index", [1, 2, 3])
def test_a_token_of_a_run_with_a_part_of_another_package_is_refused_where_that_differs(
    index: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "list_origins", lambda family, name: [f"{family} {name}"])
    parts = (*PARTS[:index], "mine", *PARTS[index + 1 :])
    token = JoinToken.decode(replace(make(), parts=parts, build=build_digest(*parts)).encode())
    token.check_build()
    with pytest.raises(ConfigError, match=r"another build or package of one of .*mine"):
        replace(token, build=build_digest("bullet")).check_build()


def test_a_token_of_a_run_with_other_sources_is_refused() -> None:
    make().check_build()
    with pytest.raises(ConfigError, match="other sources, or another build or package of one of bullet") as refused:
        make("f" * 64).check_build()
    # The image has a slimmed engine, so the same version is not enough.
    assert "or the image on both" in str(refused.value.hint)
