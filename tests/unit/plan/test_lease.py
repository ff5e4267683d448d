from dataclasses import replace

import pytest

from throwcollect.errors import DatasetError
from throwcollect.plan.lease import Lease, leases_from_json, leases_to_json
from throwcollect.plan.trials import choose_trials
from throwcollect.run_key import Signer

SIGNER = Signer(b"key of the run")
VALUES = {"ball.mass_kg": 0.05, "scene.gravity_mps2": 1.6}
LEASE = Lease.make("/sim_0", 5, VALUES, SIGNER)


def test_each_lease_has_a_token_of_its_own() -> None:
    assert LEASE.is_signed(SIGNER)
    assert Lease.make("/sim_0", 5, VALUES, SIGNER).token != LEASE.token
    assert replace(LEASE, values=dict(reversed(VALUES.items()))).is_signed(SIGNER)


@pytest.mark.parametrize(
    "change",
    [
        {"simulation": "/sim_1"},
        {"trial": 6},
        {"values": {"ball.mass_kg": 0.05}},
        {"values": {"ball.mass_kg": 0.05, "scene.gravity_mps2": 1.7}},
        {"nonce": "0"},
        {"signature": ""},
        {"signature": "é"},
    ],
)
def test_a_changed_lease_has_no_valid_signature(change: dict[str, object]) -> None:
    assert not replace(LEASE, **change).is_signed(SIGNER)


def test_a_lease_signed_with_another_key_is_refused() -> None:
    assert not LEASE.is_signed(Signer(b"another key"))


def test_leases_survive_the_way_through_json() -> None:
    leases = (LEASE, Lease.make("/sim_0", 7, {"task.duration_s": 0.1 + 0.2}, SIGNER))
    assert leases_from_json(leases_to_json(leases)) == leases
    assert leases_from_json("[]") == ()


@pytest.mark.parametrize("text", ["", "{}", "[1]", "x", leases_to_json([LEASE]).replace("0.05", '"0.05"')])
def test_a_malformed_list_of_leases_is_refused(text: str) -> None:
    with pytest.raises(DatasetError, match="list of leases: "):
        leases_from_json(text)


def test_a_choice_of_trials_is_the_same_for_the_same_seed() -> None:
    trials = list(range(0, 200, 2))
    few = choose_trials(trials, count=5, seed=7)
    assert few == choose_trials(trials, count=5, seed=7) == sorted(set(few))
    assert len(few) == 5
    assert set(few) < set(trials)
    assert few != choose_trials(trials, count=5, seed=8)
    assert choose_trials(trials, count=100, seed=7) == choose_trials(trials, count=500, seed=7) == trials
    assert choose_trials(trials, count=0, seed=7) == []
