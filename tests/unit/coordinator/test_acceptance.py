"""Which episodes the coordinator takes."""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import zstandard

from throwcollect.config.schema import Config
from throwcollect.coordinator.acceptance import Acceptance
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk, ChunkEncoder
from throwcollect.episode.message import Delivery, Episode
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.replay.throw import Replayer
from throwcollect.robots.description import full_description
from throwcollect.sweep.plan import Plan, make_plan

CONFIG = Config.model_validate(
    {"trials": 2, "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}}}
)
PLAN: Plan = make_plan(CONFIG)
ENCODER = ChunkEncoder(Channels(CONFIG, full_description(CONFIG)), level=1)


@pytest.fixture(scope="module")
def replayer() -> Iterator[Replayer]:
    replayer = Replayer(CONFIG)
    yield replayer
    replayer.close()


@pytest.fixture(scope="module")
def delivery(replayer: Replayer) -> Delivery:
    return replayer.delivery(PLAN.trials[1])


@pytest.fixture(scope="module")
def acceptance() -> Acceptance:
    return Acceptance(CONFIG)


def test_what_a_simulation_hands_over_is_taken(acceptance: Acceptance, delivery: Delivery) -> None:
    prepared = acceptance.prepare(PLAN, PLAN.trials[1])
    assert acceptance.foreign(delivery, prepared, "") is None
    assert unsound(acceptance, delivery.episode) is None


def test_the_episode_of_another_lease_or_trial_is_not(acceptance: Acceptance, delivery: Delivery) -> None:
    prepared = acceptance.prepare(PLAN, PLAN.trials[1])
    assert acceptance.foreign(delivery, prepared, "token") == "it was not simulated for this lease"
    other = acceptance.prepare(PLAN, PLAN.trials[0])
    assert "ball.mass_kg was " in (acceptance.foreign(delivery, other, "") or "")


def test_conditions_that_cannot_be_read_are_a_reason(acceptance: Acceptance, delivery: Delivery) -> None:
    prepared = acceptance.prepare(PLAN, PLAN.trials[1])
    reason = acceptance.foreign(delivery._replace(conditions="{}"), prepared, "")
    assert (reason or "").startswith("conditions of the episode: ")


@pytest.mark.parametrize("column", [field.name for field in fields(Samples) if field.name != "stamps_ns"])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_unsound(
    column: str, number: float, acceptance: Acceptance, delivery: Delivery
) -> None:
    samples = delivery.episode.samples()
    values = getattr(samples, column).copy()
    values[7, 0] = number
    spoilt = encoded(delivery.episode.header, replace(samples, **{column: values}))
    assert "finite" in (unsound(acceptance, spoilt) or "")


def unsound(acceptance: Acceptance, episode: Episode) -> str | None:
    return acceptance.unsound(episode, acceptance.prepare(PLAN, PLAN.trials[1]))


def encoded(header: EpisodeHeader, samples: Samples) -> Episode:
    return Episode(header, ENCODER.encode(samples))


def late(episode: Episode) -> Episode:
    samples = episode.samples()
    return encoded(episode.header, replace(samples, stamps_ns=samples.stamps_ns + 4))


def of_another_robot(episode: Episode) -> Episode:
    contents = episode.state.contents.replace(b"head_1_joint", b"neck_1_joint")
    start_ns, end_ns = episode.chunk.start_ns, episode.chunk.end_ns
    chunk = Chunk.of(contents, zstandard.compress(contents), start_ns=start_ns, end_ns=end_ns)
    return Episode(episode.header, chunk)


def misdated(episode: Episode) -> Episode:
    return Episode(replace(episode.header, start_ns=5), episode.chunk)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (late, "differ|starts at"),
        (misdated, "times differ"),
        (of_another_robot, "joint 29 of the joint states is neck_1_joint"),
    ],
)
def test_what_is_wrong_is_said(
    spoil: Callable[[Episode], Episode],
    said: str,
    acceptance: Acceptance,
    delivery: Delivery,
) -> None:
    problem: Any = unsound(acceptance, spoil(delivery.episode))
    assert any(part in problem for part in said.split("|"))


def test_contacts_that_cannot_be_are_unsound(acceptance: Acceptance, delivery: Delivery) -> None:
    header = delivery.episode.header
    body = Contact("x" * 100, header.start_ns, header.start_ns + 10)
    wrong = Episode(replace(header, contacts=(*header.contacts, body)), delivery.episode.chunk)
    assert unsound(acceptance, wrong) is not None
