"""A dataset that clients of a session record: it grows by one episode at a time, and is finished after each.

No plan draws it. Each episode is a trial without swept values, in a file of its own, in which the policy `session`
commands the joints.
"""

from __future__ import annotations

import secrets
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.config.motion import SESSION, PolicyConfig
from throwcollect.config.schema import Config
from throwcollect.config.sweep import SweepConfig
from throwcollect.config.values import with_values
from throwcollect.dataset.carried_robot import carry_robot, config_text
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.creation import refuse_many_files, refuse_taken
from throwcollect.dataset.directory import CONFIG, MANIFEST, PLAN, THROWS, path_of_part, shard_name
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.manifest import read_manifest
from throwcollect.dataset.provenance import Provenance
from throwcollect.dataset.recovery import remove_unfinished
from throwcollect.dataset.shard import Recording
from throwcollect.dataset.slices import read_statistics
from throwcollect.dataset.throws_table import judge_episode, read_throws_table
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import remove, unwritable
from throwcollect.plan.plan import Plan, make_trials
from throwcollect.plan.trials import Points
from throwcollect.robots.description import full_description
from throwcollect.sensing.recorder import SensorRecorder
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of


class SessionDataset:
    """Writes what clients of a simulation do; no other process can write into the directory meanwhile.

    Args:
        directory: New, empty, or a dataset that an earlier session of the same configuration has recorded.
        config: Configuration of the session.
        name: Name of the simulation, for the provenance.
    """

    def __init__(self, directory: Path, config: Config, *, name: str) -> None:
        self.directory, self._name = directory, name
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(directory, error) from error
        with ExitStack() as held:
            held.enter_context(hold_lock(directory))
            begun = (directory / CONFIG).exists()
            if not begun:
                refuse_taken(directory)
            # Trials of other sessions have other seeds, so that they have other digests, and datasets can be merged.
            self._config = _as_recorded(config, read_config(directory).seed if begun else secrets.randbits(32))
            if begun and (directory / CONFIG).read_text(encoding="utf-8") != config_text(self._config.without_run()):
                raise ConfigError(
                    f"{directory}: was not recorded in a session of this configuration", expected="another directory"
                )
            self._channels = Channels(self._config, full_description(self._config))
            self._encoder = ChunkEncoder(self._channels, level=self._config.record.zstd_level)
            self._sensors = SensorRecorder(self._channels)
            self._read()
            self.close = held.pop_all().close

    def append(self, header: EpisodeHeader, samples: Samples) -> tuple[int, Result]:
        """Write a recording as the next trial, whose number and result are returned; if this fails, the next one is."""
        throws, recordings = self._read()
        number = len(recordings)
        refuse_many_files(self._config, number + 1)
        plan = self._plan(number + 1)
        episode = self._encode(number, header, samples)
        result = judge_episode(self._config, episode)
        remove_unfinished(self.directory)
        part = path_of_part(self.directory / shard_name(self._config.name, number))
        remove(part)
        with closing(DatasetWriter(self.directory, plan, channels=self._channels)) as writer:
            for earlier, recording in enumerate(recordings):
                writer.take_shard(earlier, recording, throws.slice(earlier, 1))
            try:
                writer.append(episode, task_of(self._config).columns.write(result))
            except DatasetError:
                # On a full disk, nothing else may free the room that it takes.
                remove(part)
                raise
            carry_robot(self._config, self.directory)
            plan.write(self.directory / PLAN)
            made = Provenance.of_this_machine(simulations=1, wall_s=None, was_open=False, robot=self._channels.robot)
            writer.finish(provenance=replace(made, session=self._name))
        return number, result

    def _plan(self, trials: int) -> Plan:
        return Plan(self._config, make_trials(self._config, Points((), np.zeros((trials, 0)))))

    def _read(self) -> tuple[pa.Table, list[Recording]]:
        """Read the rows and the files of the episodes that are there; those of an append that failed do not count."""
        plan = self._plan(1)
        if not (self.directory / MANIFEST).exists():
            return None, []
        throws = read_throws_table(self.directory / THROWS, plan)
        entries = {entry.path: entry for entry in read_manifest(self.directory)}
        names = [name for name in throws["shard"].to_pylist() if name in entries]
        return throws, [(read_statistics(self.directory / name, entries[name]), entries[name]) for name in names]

    def _encode(self, number: int, header: EpisodeHeader, samples: Samples) -> Episode:
        """Make the episode of a trial, in the slot of simulated time that each trial of a dataset has of its own."""
        shift_ns = self._config.trial_start_ns(number) - header.start_ns
        contacts = tuple(
            Contact(each.body, each.start_ns + shift_ns, None if each.end_ns is None else each.end_ns + shift_ns)
            for each in header.contacts
        )
        header = replace(header, trial=number, start_ns=header.start_ns + shift_ns, contacts=contacts)
        chunk, table = self._encoder.encode(replace(samples, stamps_ns=samples.stamps_ns + shift_ns))
        return Episode(header, chunk, sensors=self._sensors.record(self._config, number, table.samples))


def _as_recorded(config: Config, seed: int) -> Config:
    """Make the configuration of the dataset of a session."""
    policy = PolicyConfig(use=SESSION, rate_hz=config.record.rate_hz, reproducible=False)
    plain = config.model_copy(update={"seed": seed, "sweep": SweepConfig(), "trials": None, "until": None})
    return with_values(plain, {"task.policy": policy, "record.trials_per_shard": 1})
