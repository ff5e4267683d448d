"""Problems with samplers, targets and `until` are reported by the keys of the file."""

import pytest

from throwcollect.config.loader import dump_yaml, load


@pytest.mark.parametrize(
    ("sweep", "messages"),
    [
        ("sim.physics_hz: {values: [500]}", ["sim.physics_hz: cannot vary from trial to trial"]),
        (
            "ball.drag_coefficient: {min: 0, max: 1, scale: log}",
            ["ball.drag_coefficient.min: should be above 0 on a logarithmic scale, got 0.0"],
        ),
    ],
)
def test_a_wrong_sweep_is_reported_with_its_line_key_and_expectation(problems_of, sweep, messages):
    text = f"trials: 1\nsweep:\n  parameters:\n    {sweep}"
    assert problems_of(text) == [f"run.yaml:4: sweep.parameters.{message}" for message in messages]


PARAMETERS = "parameters: {task.duration_s: {min: 1, max: 1.2}}"


def test_until_needs_a_positive_number_and_a_sampler_that_can_draw_more(problems_of):
    assert problems_of("until: 5") == ["run.yaml:1: until: should be keys and values, got 5"]
    assert problems_of("until: {landed: 0}") == [
        "run.yaml:1: until.landed: should be greater than or equal to 1, got 0"
    ]
    assert problems_of("until: {landed: 5}\nsweep: {sampler: list, file: a.csv}") == [
        "run.yaml:1: until: should be left out, as the file of the sampler list is not part of the dataset"
    ]


def test_a_sampler_that_draws_needs_no_number_of_trials_beside_until(tmp_path):
    path = tmp_path / "run.yaml"
    path.write_text(f"until: {{landed: 5}}\nsweep: {{{PARAMETERS}}}")
    config = load(path)
    assert config.until is not None
    assert config.until.landed == 5
    path.write_text(dump_yaml(config))
    assert load(path) == config
