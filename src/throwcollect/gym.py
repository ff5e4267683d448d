"""Environments for Gymnasium: ``gymnasium.make("throwcollect/Throw-v0", config="throws.yaml")``, one for each task.

Importing this module registers them.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.collect.coordinator.prepare import feasibility_check
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, ConflictError, PlanError, Problem
from throwcollect.extras import explain_missing
from throwcollect.files import StrPath
from throwcollect.members import names_of
from throwcollect.publish.view.throw_pictures import Still
from throwcollect.robots.description import robot_of
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.surroundings import object_of
from throwcollect.sim.policy import Observation, PolicyLoop, shape_observation, shape_pictures
from throwcollect.sim.simulator import Simulator
from throwcollect.simulator import find_refusal, with_policy

with explain_missing():
    import gymnasium
    from gymnasium import spaces

_RANGE_SLACK = 0.1
"""Share of a joint's range by which its measured position may lie outside of it."""
_PLACE = ("target_x_m", "target_y_m")


class _Given:
    """The policy that commands what `ThrowEnv.step` was given."""

    action: NDArray[np.float64]

    def reset(self, seed: int, target: Mapping[str, float]) -> None: ...

    def act(self, _: Observation) -> NDArray[np.float64]:
        return self.action


class ThrowEnv(gymnasium.Env[Any, NDArray[np.float64]]):
    """One trial of a task is an episode; a step is one command, as in `throwcollect.Simulator.roll_out`.

    An action commands the joints of `task.end`, in the order of `Robot.joints`: their positions [rad] in their ranges,
    or their velocities [rad/s] within their limits. An observation has the arrays of `throwcollect.sim.policy`.

    An episode is terminated when the trial ends by the rule of its task, or when all is at rest, and truncated when
    `sim.max_trial_s` is over. The last `info` has ``outcome``, ``reason``, ``is_success`` and the measures of the trial
    by their columns, such as ``release_time_s`` and ``miss_m``; each `info` has ``touching``, the names of what presses
    on the object, and ``clipped``, whether the command was beyond a limit.

    Rewards are 1 for a success and 0 otherwise; with a target for x and y, a trial that ends farther than `hit_m` from
    it is no success. With ``reward="shaped"``, each step adds by how much nearer to the target the object would land if
    it were let go [m], without drag; so all steps add up to the distance at the start minus the one at the end.

    Args:
        config: YAML file of a configuration, or a `Config`; its sweep is not looked at.
        task: The task that the configuration should have; without a configuration, the one that is used.
        overrides: ``key=value`` pairs that win over the file, as ``--set`` takes them.
        rate_hz: Steps per simulated second; divides `sim.physics_hz`.
        command: ``position`` or ``velocity``.
        observation: Arrays to observe; empty for all that there are.
        targets: Least and greatest value of each column of targets; each episode draws one evenly in between.
        reward: ``success`` or ``shaped``.
        hit_m: Largest miss of a success, if there are targets [m].
        render_mode: None or ``rgb_array``.

    Raises:
        ConfigError: If an argument or the configuration is wrong.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 - Gymnasium declares it so

    def __init__(
        self,
        config: StrPath | Config | None = None,
        *,
        task: str = "throw",
        overrides: Sequence[str] = (),
        rate_hz: int = 50,
        command: str = "position",
        observation: Sequence[str] = (),
        targets: Mapping[str, tuple[float, float]] | None = None,
        reward: str = "success",
        hit_m: float = 0.1,
        render_mode: str | None = None,
    ) -> None:
        if config is None:
            config = Config.model_validate({"task": {"name": task}})
        elif not isinstance(config, Config):
            config = load(os.fspath(config), overrides)
        self._targets = dict(targets or {})
        wrong = config.task.find_wrong_targets(self._targets)
        if config.task.name != task:
            wrong = {"task.name": f"should be {task!r}, as the environment is; got {config.task.name!r}"}
        if wrong:
            raise ConfigError([Problem(reason, key=name) for name, reason in wrong.items()])
        self._aims = all(name in self._targets for name in _PLACE)
        flies = self._aims and "landing" in config.task.events
        if reward not in ("success", "shaped") or (reward == "shaped" and not flies):
            expected = f"success, or shaped if what the task throws has targets {' and '.join(_PLACE)}"
            raise ConfigError(f"reward {reward!r}", expected=expected)
        self._ends = {each.name: each.of for each in config.task.target_columns}
        observation = observation or [
            name for name in shape_observation(config) if name in self._targets or not name.startswith("target_")
        ]
        self._given, self.render_mode = _Given(), render_mode
        self.config = with_policy(config, self._given, rate_hz=rate_hz, command=command, observation=observation)
        self.metadata = {**self.metadata, "render_fps": rate_hz}
        self._check = feasibility_check(self.config)
        self._checked: Mapping[str, float] | None = None
        self._simulator = Simulator(self.config, self._given)
        self._shaped, self._hit_m = reward == "shaped", hit_m
        self._picture: Still | None = None
        self._ended = True
        loop = self._loop
        low, high = (loop.lower, loop.upper) if command == "position" else (-loop.speed, loop.speed)
        self.action_space = spaces.Box(low, high, dtype=np.float64)
        sizes, pictures = shape_observation(self.config), shape_pictures(self.config)
        self.observation_space = spaces.Dict(
            {
                name: self._bound(name, sizes[name]) if name in sizes else _bound_picture(pictures[name])
                for name in observation
            }
        )

    @property
    def _loop(self) -> PolicyLoop:
        assert self._simulator.loop is not None  # noqa: S101 - the configuration has a policy
        return self._simulator.loop

    def _bound(self, name: str, size: int) -> spaces.Box:
        """Bound an array of observations, where something keeps it in bounds."""
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        if name == "time_s":
            low[:], high[:] = 0.0, self.config.sim.max_trial_s + 1
        elif name == "joint_position_rad":
            limits = joint_limits(robot_of(self.config))
            slack = _RANGE_SLACK * (limits.upper - limits.lower)
            low, high = limits.lower - slack, limits.upper + slack
        elif name == "command_position_rad":
            low, high = self._loop.lower, self._loop.upper
        elif name in self._targets:
            low[:], high[:] = self._targets[name]
        return spaces.Box(low, high, dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a trial.

        Args:
            seed: Seed of the targets that are drawn.
            options: ``values``: values of the configuration that differ in this trial, by dotted key, as
                `Simulator.throw` takes them; ``target``: its target, instead of one that is drawn.

        Raises:
            ConfigError: If there is no such key or target.
            PlanError: If the robot cannot rest in the start posture.
        """
        super().reset(seed=seed)
        options = options or {}
        if unknown := options.keys() - {"values", "target"}:
            raise ConfigError(f"options: {min(unknown)}", expected="values, target")
        values = dict(options.get("values", {}))
        drawn = {name: float(self.np_random.uniform(*ends)) for name, ends in self._targets.items()}
        target = {**drawn, **options.get("target", {})}
        if unknown := target.keys() - self._targets.keys():
            raise ConfigError(f"target: {min(unknown)}", expected="targets, for which the environment was made")
        if values != self._checked and (reason := find_refusal(self.config, values, self._check)) is not None:
            raise PlanError([Problem(reason)], hint="a collection would leave this trial out, as refused")
        self._checked = values
        self._simulator.begin(0, values, seed=int(self.np_random.integers(2**63)), target=target)
        trial = self._simulator.trial.config
        self._target, self._ended = target, False
        self._gravity = trial.scene.gravity_mps2
        self._plane_m = trial.scene.landing_height_m + object_of(trial).radius_m
        observation = self._loop.observe()
        self._miss_m = self._predict_miss() if self._shaped else 0.0
        return observation, {"touching": tuple(sorted(self._simulator.world.touching)), "clipped": False}

    def step(self, action: NDArray[np.float64]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Command the joints for one period.

        Raises:
            ConflictError: If the episode has ended.
            MemberError: If the action has another shape, or is not finite.
        """
        if self._ended:
            raise ConflictError("this episode has ended", hint="call reset")
        self._given.action = action
        self._simulator.step(self._loop.stride)
        observation, reward = self._loop.observe(), 0.0
        info: dict[str, Any] = {
            "touching": tuple(sorted(self._simulator.world.touching)),
            "clipped": self._loop.clipped,
        }
        if self._shaped:
            before, self._miss_m = self._miss_m, self._predict_miss()
            reward = before - self._miss_m
        end = self._simulator.world.end_reason
        if end is not None:
            self._ended = True
            info |= self._judge()
            reward += float(info["is_success"])
        return observation, reward, end not in (None, "timeout"), end == "timeout", info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw robot and bodies as they are now, from the right, shape ``(400, 640, 3)``; None without a mode."""
        if self.render_mode is None:
            return None
        world = self._simulator.world
        if self._picture is None:
            self._picture = Still(self.config)
        # The last recorded sample is at most one period of the recording old.
        return self._picture.draw(world.samples(world.recorded - 1))

    def close(self) -> None:
        """Free the physics engine."""
        self._simulator.close()

    def _predict_miss(self) -> float:
        """Compute how far from the target the object would land if it flew freely from now on [m]."""
        x, y, z, *_, vx, vy, vz, _, _, _ = self._loop.object.tolist()
        height = max(0.0, z - self._plane_m)
        time_s = (vz + math.sqrt(vz * vz + 2 * self._gravity * height)) / self._gravity
        goal_x, goal_y = (self._target[name] for name in _PLACE)
        return math.hypot(x + vx * time_s - goal_x, y + vy * time_s - goal_y)

    def _judge(self) -> dict[str, Any]:
        """Judge the trial that has ended: outcome, success, and the measures that it has."""
        episode = self._simulator.hand_over()
        self._simulator.pop_results()
        result = json.loads(episode.result) if episode is not None else {}
        success = result["outcome"] == self.config.task.success
        if self._aims:
            # A trial has both or none.
            x, y = (result.get(self._ends[name]) for name in _PLACE)
            if x is not None and y is not None:
                result["miss_m"] = math.hypot(x - self._target[_PLACE[0]], y - self._target[_PLACE[1]])
            success = success and result.get("miss_m", math.inf) <= self._hit_m
        return {name: value for name, value in result.items() if value is not None} | {"is_success": success}


def _bound_picture(shape: tuple[int, int, int]) -> spaces.Box:
    """Bound a picture of colors, or one of depths [m], which has one channel."""
    return spaces.Box(0, 255, shape, np.uint8) if shape[2] > 1 else spaces.Box(0, np.inf, shape, np.float32)


for _task in names_of("tasks"):
    _words = "".join(word.capitalize() for word in _task.split("_"))
    gymnasium.register(f"throwcollect/{_words}-v0", entry_point="throwcollect.gym:ThrowEnv", kwargs={"task": _task})
