from dataclasses import replace

import pytest

from throwcollect.run_key import Signer
from throwcollect.trial.choice import choose_trials
from throwcollect.trial.lease import Lease

SIGNER = Signer(b"key of the run")
LEASE = Lease("/sim_0", 5, ("arm_right_controller",), {"ball.mass_kg": 0.05, "scene.gravity_mps2": 1.6})


def test_a_lease_is_told_from_every_other_one_by_its_token() -> None:
    token = LEASE.sign(SIGNER)
    assert LEASE.is_signed(token, SIGNER)
    assert LEASE.sign(SIGNER) != token
    assert replace(LEASE, values=dict(reversed(LEASE.values.items()))).is_signed(token, SIGNER)


@pytest.mark.parametrize(
    "change",
    [
        {"simulation": "/sim_1"},
        {"trial": 6},
        {"controllers": ()},
        {"values": {"ball.mass_kg": 0.05}},
        {"values": {"ball.mass_kg": 0.05, "scene.gravity_mps2": 1.7}},
    ],
)
def test_a_token_stands_for_one_lease(change: dict[str, object]) -> None:
    assert not replace(LEASE, **change).is_signed(LEASE.sign(SIGNER), SIGNER)


@pytest.mark.parametrize("token", ["", ".", "x", "a.b", "é.ü"])
def test_what_is_no_signature_is_refused(token: str) -> None:
    assert not LEASE.is_signed(token, SIGNER)


def test_what_was_signed_with_another_key_is_refused() -> None:
    assert not LEASE.is_signed(LEASE.sign(Signer(b"another key")), SIGNER)


def test_a_choice_of_trials_is_the_same_for_the_same_seed() -> None:
    trials = list(range(0, 200, 2))
    few = choose_trials(trials, count=5, seed=7)
    assert few == choose_trials(trials, count=5, seed=7) == sorted(set(few))
    assert len(few) == 5
    assert set(few) < set(trials)
    assert few != choose_trials(trials, count=5, seed=8)
    assert choose_trials(trials, count=100, seed=7) == choose_trials(trials, count=500, seed=7) == trials
    assert choose_trials(trials, count=0, seed=7) == []
