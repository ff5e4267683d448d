"""Problems with samplers, targets and `until` are reported by the keys of the file."""

import pytest

from throwcollect.config.loader import dump_yaml, load


@pytest.mark.parametrize(
    ("sweep", "messages"),
    [
        ("sim.physics_hz: {values: [500]}", ["sim.physics_hz: cannot vary from trial to trial"]),
        ("task.duration_s: {min: 2, max: 1}", ["task.duration_s.min: should be at most max, 1.0, got 2.0"]),
        (
            "ball.drag_coefficient: {min: 0, max: 1, scale: log}",
            ["ball.drag_coefficient.min: should be above 0 on a logarithmic scale, got 0.0"],
        ),
        ("ball.friction: {values: [1, 3]}", ["ball.friction.values.1: should be less than or equal to 2, got 3.0"]),
    ],
)
def test_a_wrong_sweep_is_reported_with_its_line_key_and_expectation(problems_of, sweep, messages):
    text = f"trials: 1\nsweep:\n  parameters:\n    {sweep}"
    assert problems_of(text) == [f"run.yaml:4: sweep.parameters.{message}" for message in messages]


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ("{sampler: list}", "sweep.file: missing; the sampler list should have a CSV or Parquet file"),
        ("{file: a.csv}", "sweep.file: should be left out, as the sampler sobol reads no file"),
        (
            "{sampler: list, file: a.csv, parameters: {ball.mass_kg: {values: [1]}}}",
            "sweep.parameters: should be left out, as the sampler list takes keys and values from its file",
        ),
        (
            "{sampler: grid, parameters: {ball.mass_kg: {min: 1, max: 2}}}",
            "sweep.parameters.ball.mass_kg.count: missing; the sampler grid should know how many points to take",
        ),
    ],
)
def test_a_sampler_refuses_missing_and_unneeded_keys(problems_of, sweep, message):
    assert problems_of(f"trials: 1\nsweep: {sweep}") == [f"run.yaml:2: {message}"]


def test_a_sampler_that_draws_needs_a_number_of_trials(problems_of):
    assert problems_of("sweep: {parameters: {ball.mass_kg: {min: 1, max: 2}}}") == [
        "run.yaml: trials: missing; the sampler sobol should know how many trials to draw, or (until) how many "
        "should have landed"
    ]


PARAMETERS = "parameters: {task.duration_s: {min: 1, max: 1.2}}"


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("{}", "distance_m: missing; at least one of distance_m, height_m and hit_angle_rad should be there"),
        ("{distance_m: {min: 2, max: 1, bins: 4}}", "distance_m.min: should be below max, 1.0, got 2.0"),
        (
            "{hit_angle_rad: {min: 1, max: 70, bins: 4}}",
            "hit_angle_rad.max: should be from -1.5708 to 1.5708 rad, got 70.0",
        ),
        (
            "{height_m: {min: 0, max: 1, bins: 4}}",
            "height_m: should be left out, as scene.landing_height_m is not swept",
        ),
        (
            "{distance_m: {min: 1, max: 2, bins: 200}, hit_angle_rad: {min: 1, max: 1.2, bins: 100}}",
            "hit_angle_rad.bins: makes 20000 cells together with the others; there may be 10000",
        ),
    ],
)
def test_a_wrong_target_of_a_sweep_is_reported_with_its_key(problems_of, target, message):
    assert problems_of(f"trials: 9\nsweep: {{{PARAMETERS}, target: {target}}}") == [
        f"run.yaml:2: sweep.target.{message}"
    ]


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
