"""How long a cluster takes for a database, and what limits it: a model of events, with constants that were measured.

A task waits for a free slot and for the scheduler, which starts so many a second; it starts its nodes, collects at the
speed of its cores, and hands its slice to a file system that all tasks share. A node may die under it; then it waits to
be queued again and goes on with what it had recorded. At last the slices are joined.

`python -m bench.cluster_model --trials 1000000 --cores 1000` prints what that takes; every constant is an option.
"""

from __future__ import annotations

import argparse
import heapq
import random
from dataclasses import dataclass, fields

_HOUR_S = 3600.0


@dataclass(frozen=True)
class Cluster:
    """Constants of the model; those of the product were measured on the machine that its benchmarks name.

    Attributes:
        trials: Number of throws.
        cores: Cores that the tasks have together.
        cores_per_task: Cores of a task.
        tasks: Number of tasks; 0 for one for each slot.
        throws_per_s: Throws a second and core.
        start_s: Time from the start of a task to its first throw [s].
        plan_s: Time to check one trial on one core [s].
        plan_cores: Cores of the machine that makes the plan.
        join_s: Time to join one trial [s].
        throw_bytes: Size of a throw on disk [bytes].
        disk_bytes_per_s: Speed of the shared file system [bytes/s].
        starts_per_s: Tasks that the scheduler starts a second.
        death_hours: Mean time between deaths of the node under a task [h]; 0 for none.
        requeue_s: Time until a task whose node died is started again [s].
        seed: Of all chance.
    """

    trials: int = 1_000_000
    cores: int = 1000
    cores_per_task: int = 4
    tasks: int = 0
    throws_per_s: float = 16.0
    start_s: float = 4.0
    plan_s: float = 3.4e-3
    plan_cores: int = 16
    join_s: float = 42e-6
    throw_bytes: float = 89e3
    disk_bytes_per_s: float = 1e9
    starts_per_s: float = 20.0
    death_hours: float = 1000.0
    requeue_s: float = 150.0
    seed: int = 0

    @property
    def slots(self) -> int:
        """Tasks that run at the same time."""
        return self.cores // self.cores_per_task

    @property
    def all_tasks(self) -> int:
        """Number of tasks."""
        return self.tasks or self.slots


@dataclass
class Found:
    """What the model says.

    Attributes:
        plan_s: Time for the plan [s].
        collect_s: Time from submission to the end of the last task [s].
        join_s: Time for joining [s].
        busy: Share of the slots' time in which throws were simulated.
        disk: Share of the time in which the file system was busy.
        deaths: Tasks whose node died.
    """

    plan_s: float
    collect_s: float
    join_s: float
    busy: float
    disk: float
    deaths: int

    @property
    def total_s(self) -> float:
        """Time for all [s]."""
        return self.plan_s + self.collect_s + self.join_s


def simulate(cluster: Cluster) -> Found:
    """Run the model.

    Args:
        cluster: Its constants.
    """
    chance = random.Random(cluster.seed)
    count = cluster.all_tasks
    work_s = cluster.trials / count / (cluster.throws_per_s * cluster.cores_per_task)
    write_s = cluster.trials / count * cluster.throw_bytes / cluster.disk_bytes_per_s
    # What is left to collect of each task that waits, by the time from which it may start.
    waiting = [(0.0, number, work_s) for number in range(count)]
    free = [0.0] * min(cluster.slots, count)
    heapq.heapify(waiting)
    scheduler_s = disk_s = disk_busy_s = collected_s = end_s = 0.0
    deaths = 0
    while waiting:
        ready, number, left = heapq.heappop(waiting)
        begin = max(ready, heapq.heappop(free), scheduler_s)
        scheduler_s = begin + 1 / cluster.starts_per_s
        lives = chance.expovariate(1 / (cluster.death_hours * _HOUR_S)) if cluster.death_hours else float("inf")
        if lives < cluster.start_s + left:
            deaths += 1
            done = max(0.0, lives - cluster.start_s)
            collected_s += done
            heapq.heappush(waiting, (begin + lives + cluster.requeue_s, number, left - done))
            heapq.heappush(free, begin + lives)
            continue
        collected_s += left
        # The file system writes one after the other, which takes all together as long as side by side.
        disk_s = max(disk_s, begin + cluster.start_s + left) + write_s
        disk_busy_s += write_s
        end_s = max(end_s, disk_s)
        heapq.heappush(free, disk_s)
    plan_s = cluster.trials * cluster.plan_s / cluster.plan_cores
    slots = min(cluster.slots, count)
    busy, disk = collected_s / (slots * end_s), disk_busy_s / end_s
    return Found(plan_s, end_s, cluster.trials * cluster.join_s, busy, disk, deaths)


def main() -> None:
    """Print what the model says, and what comes of twice as much of each thing."""
    parser = argparse.ArgumentParser(prog="python -m bench.cluster_model", description=__doc__)
    for each in fields(Cluster):
        option = f"--{each.name.replace('_', '-')}"
        parser.add_argument(option, type=type(each.default), default=each.default, help="[%(default)s]")
    arguments = vars(parser.parse_args())
    cluster = Cluster(**arguments)
    print("| | plan [s] | collecting [s] | joining [s] | all [min] | cores busy | disk busy | nodes that died |")
    print("|---|---|---|---|---|---|---|---|")
    changed: dict[str, dict[str, float]] = {"as given": {}, "twice the cores": {"cores": 2 * cluster.cores}}
    changed |= {
        f"twice the {words}": {name: 2 * getattr(cluster, name)}
        for name, words in {
            "throws_per_s": "speed of a core",
            "plan_cores": "cores for the plan",
            "disk_bytes_per_s": "speed of the disk",
            "starts_per_s": "starts of the scheduler",
        }.items()
    }
    changed |= {"four times the tasks": {"tasks": 4 * cluster.all_tasks}, "no deaths": {"death_hours": 0.0}}
    for what, change in changed.items():
        found = simulate(Cluster(**{**arguments, **change}))
        print(
            f"| {what} | {found.plan_s:.0f} | {found.collect_s:.0f} | {found.join_s:.0f} | {found.total_s / 60:.1f} "
            f"| {found.busy:.0%} | {found.disk:.0%} | {found.deaths} |"
        )


if __name__ == "__main__":
    main()
