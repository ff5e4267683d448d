"""The way from a target to parameters as one polynomial, and as a file for a robot's controller."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.learning.worlds import KEYS, draw, land, learn, make_dataset

from throwcollect import fit, load_model
from throwcollect.learning.distilling import distil
from throwcollect.learning.learned_map import KeyRole, LearnedMap
from throwcollect.learning.model_card import ONNX_PROGRAM

SHIFT = np.array([0.1, 0.12])


def off(learned: LearnedMap, shift=(0.0, 0.0)) -> np.ndarray:
    """How far throws by the distilled map are off, in a world that is shifted."""
    targets = land(draw(60, seed=5, inside=0.8)) + shift
    values = learned.unscale(KeyRole.PARAMETER, distil(learned).aim(targets, np.zeros((60, 0))))
    return np.linalg.norm(land(values) + shift - targets, axis=1)


def test_a_distilled_polynomial_hits_targets_within_a_centimetre() -> None:
    errors = off(learn())
    assert np.median(errors) < 0.002
    assert errors.max() < 0.01


def test_distilling_an_adapted_map_keeps_its_correction() -> None:
    learned = learn()
    assert np.median(off(learned.correct(replace(learned.correction, offset=SHIFT)), SHIFT)) < 0.002


def test_fewer_throws_give_a_distilled_polynomial_of_lower_degree() -> None:
    for throws, degree in ((30, 4), (20, 3)):
        assert distil(learn(throws)).polynomial.exponents.sum(axis=1).max() == degree


def test_distilled_parameters_stay_within_their_ranges() -> None:
    found = distil(learn()).aim(np.array([[9.0, 0.0], [-3.0, 4.0]]), np.zeros((2, 0)))
    assert np.abs(found).max() == 1.0


def test_the_onnx_file_is_reproducible_and_agrees_with_the_distilled_map(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "data", 150)
    for name in ("one", "two"):
        fit(dataset, given=[KEYS[2]]).distil().save(tmp_path / name)
    load_model(tmp_path / "one").save(tmp_path / "three")
    files = {path.name: path.read_bytes() for path in (tmp_path / "one").iterdir()}
    assert "model.onnx" in files
    for name in ("two", "three"):
        assert {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} == files
    model = load_model(tmp_path / "one")
    assert model.distilled is not None
    context = model.scale(KeyRole.CONTEXT, np.array([[0.1]]))
    scaled = model.distilled.aim(np.array([[1.2, -0.2]]), context)
    wanted = model.unscale(KeyRole.PARAMETER, scaled)[0]
    assert ONNX_PROGRAM.rstrip() in (tmp_path / "one" / "README.md").read_text()
    script = f"target = [1.2, -0.2, 0.1]\n{ONNX_PROGRAM}\nprint(json.dumps(parameters))"
    said = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path / "one", capture_output=True, text=True, check=True
    )
    assert json.loads(said.stdout) == pytest.approx(dict(zip(model.parameters, wanted, strict=True)), abs=1e-5)


def test_adapting_a_distilled_model_distils_it_again(tmp_path: Path) -> None:
    model = fit(make_dataset(tmp_path / "data", 120)).distil()
    point = dict(zip(KEYS, draw(1, 8)[0].tolist(), strict=True))
    adapted = model.adapt([point], [(land(draw(1, 8)) + SHIFT)[0]], method="offset")
    assert adapted.distilled is not None
    assert adapted.distilled.low == pytest.approx(np.add(model.distilled.low, SHIFT), abs=0.05)
    path = tmp_path / "real"
    adapted.save(path)
    assert load_model(path).model_dump_json() == adapted.model_dump_json()
