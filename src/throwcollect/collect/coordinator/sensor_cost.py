"""What the sensors of a plan cost, and what they see first, measured on the first trial that can run."""

from __future__ import annotations

from time import process_time
from typing import NamedTuple

import numpy as np

from throwcollect.dataset.sensors import SensorFrames
from throwcollect.engines.engine import GROUND
from throwcollect.episode.channels import Channels
from throwcollect.episode.sensor_topics import NOTHING
from throwcollect.plan.plan import Plan
from throwcollect.sensing.recorder import SensorRecorder
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import CameraSensor, make_sensor
from throwcollect.sim.simulator import Simulator

_TIMED = 3
_MOST_SHARE = 0.95
"""A camera that sees one body in a larger share of its pixels is inside of it."""


class SensorCost(NamedTuple):
    """What sensors cost: in words, and in throws; their first frames; and bodies that cameras are inside of."""

    words: str
    throws: float
    first: dict[str, SensorFrames]
    inside: dict[str, str]


def measure_sensors(plan: Plan) -> SensorCost:
    """Simulate a trial, and render some frames of each sensor, from the middle of the trial on."""
    trial = next(trial for trial in plan.trials if not trial.refused)
    config, simulator = plan.config_of(trial), Simulator(plan.config)
    simulator.run(trial)
    # Only now everything is loaded.
    began = process_time()
    episode = simulator.run(trial)
    throw_s, samples, scene = process_time() - began, episode.samples(), Scene.of(config)
    simulator.close()
    frames, rendering_s, size = 0, 0.0, 0.0
    seen, inside = {}, {}
    for name, section in config.sensors.items():
        alone, stride = config.model_copy(update={"sensors": {name: section}}), config.record.rate_hz // section.rate_hz
        recorder = SensorRecorder(Channels(alone, simulator.channels.robot))
        first = recorder.record(alone, trial.number, samples[:1])
        seen[name] = SensorFrames(name, alone, episode.header, samples[:1], first)
        some, began = samples[len(samples) // 2 :][: stride * _TIMED], process_time()
        more = recorder.record(alone, trial.number, some)
        count, timed = -(-len(samples) // stride), -(-len(some) // stride)
        frames, rendering_s = frames + count, rendering_s + (process_time() - began) / timed * count
        # Frames are compressed together, so that each but the first takes less than one alone.
        one, several = (sum(chunk.record_size for chunk in chunks) for chunks in (first, more))
        size += one + (count - 1) * (max(several - one, 0) / (timed - 1) if timed > 1 else one)
        sensor = make_sensor(name, alone, scene, trial.number)
        if isinstance(sensor, CameraSensor):
            counts = np.bincount(sensor.see(scene.place_sample(samples, 0)).labels.ravel())
            body = scene.labels[int(counts.argmax())]
            if counts.max() > _MOST_SHARE * counts.sum() and body not in (NOTHING, GROUND):
                inside[name] = body
    trials, throws = len(plan.trials), rendering_s / throw_s
    words = f"{frames} frames a throw, about +{rendering_s * 1e3:.0f} ms ({throws:.1f} throws) and +{size / 1e3:.0f} kB"
    of_all = f"all {trials} trials: +{trials * rendering_s:.0f} s of one core, +{trials * size / 1e6:.1f} MB"
    return SensorCost(f"sensors: {words}; {of_all}", throws, seen, inside)
