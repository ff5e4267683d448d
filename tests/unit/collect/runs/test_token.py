"""Tokens to join a run: each is one word, and is refused where other sources would compute other throws."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from throwcollect import build
from throwcollect.build import build_digest
from throwcollect.collect.runs.joining import JoinToken
from throwcollect.errors import ConfigError


def make(build: str = "") -> JoinToken:
    return JoinToken("many-1234", "tls/10.0.0.1:7447", "0f" * 32, 7, "bullet", build or build_digest("bullet"))


def test_a_token_is_one_word_and_decodes_to_the_same_values() -> None:
    word = make().encode()
    assert re.fullmatch(r"tc2\.[A-Za-z0-9_-]+", word)
    assert len(word) < 400
    assert JoinToken.decode(f" {word}\n") == make()


@pytest.mark.parametrize("part", ["robot", "tool", "task"])
def test_a_token_of_a_run_with_a_part_of_another_package_is_refused_where_that_differs(
    part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "list_origins", lambda family, name: [f"{family} {name}"])
    digest = build_digest("bullet", **{part: "mine"})
    token = JoinToken.decode(replace(make(digest), **{part: "mine"}).encode())
    token.check_build()
    with pytest.raises(ConfigError, match=f"another package of .*the {part} mine"):
        replace(token, build=build_digest("bullet")).check_build()


def test_a_token_of_a_run_with_other_sources_is_refused() -> None:
    make().check_build()
    with pytest.raises(ConfigError, match="other sources, another build of the engine bullet") as refused:
        make("f" * 64).check_build()
    # The image has a slimmed engine, so the same version is not enough.
    assert "or the image on both" in str(refused.value.hint)
