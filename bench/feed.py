"""`python -m bench.feed DATASET`: how many episodes a second a coordinator takes in over the network.

Senders are processes of their own that stand in for simulations. They have signed the episodes of a finished dataset
before, and hand over each trial as soon as it is leased. What counts is the coordinator alone, from a fifth
of the dataset to nine tenths of it, so that neither its start nor its end does.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from bench.intake import sign_episodes
from throwcollect import ros
from throwcollect.collect.coordinator_node.simulation_client import EPISODE_QOS, EPISODE_TOPIC
from throwcollect.dataset.creation import create
from throwcollect.dataset.reader import Dataset
from throwcollect.plan.lease import LEASES, leases_from_json
from throwcollect.ros.msg import UInt8MultiArray
from throwcollect.ros.router import router
from throwcollect.run_key import Signer

_SENDER = "-m", "bench.feed", "--send"


def send(directory: Path, name: str) -> None:
    """Hand over the episodes of a dataset as a simulation of this name, until the process is killed."""
    messages = sign_episodes(Dataset.open(directory), Signer.of_environment())
    ros.init()
    node = ros.Node(name, namespace=f"/{name}")
    publisher = node.create_publisher(UInt8MultiArray, EPISODE_TOPIC, EPISODE_QOS)
    done: set[str] = set()

    def hand_over(parameters: list[ros.Parameter]) -> None:
        for lease in leases_from_json(parameters[0].value or "[]"):
            if lease.token not in done:
                done.add(lease.token)
                publisher.publish(messages[lease.trial])

    node.declare_parameter(LEASES, "")
    node.add_post_set_parameters_callback(hand_over)
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


def measure(directory: Path, senders: int) -> tuple[float, float]:
    """Collect a dataset anew from its own episodes; returns episodes/s and the coordinator's time for each [ms]."""
    plan = Dataset.open(directory).plan
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch, router("tcp/127.0.0.1:0") as endpoint:
        environment = {**os.environ, "ZENOH_CONFIG_OVERRIDE": f'mode="client";connect/endpoints=["{endpoint}"]'}
        feeding = [
            subprocess.Popen([sys.executable, *_SENDER, f"sim_{number}", str(directory)], env=environment)
            for number in range(senders)
        ]
        target = Path(scratch) / "data"
        create(target, plan)
        words = [sys.executable, "-m", "throwcollect", "coordinator", str(target)]
        coordinator = subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL)
        try:
            process, journal = psutil.Process(coordinator.pid), target / "logs" / "journal.jsonl"
            marks = []
            for share in (0.2, 0.9):
                while (count := _count(journal)) < share * len(plan.trials):
                    time.sleep(0.05)
                marks.append((count, time.monotonic(), sum(process.cpu_times()[:2])))
        finally:
            for each in (*feeding, coordinator):
                each.kill()
        (first, since, before), (last, until, after) = marks
        return (last - first) / (until - since), (after - before) / (last - first) * 1e3


def _count(journal: Path) -> int:
    return journal.read_bytes().count(b'"commit"') if journal.exists() else 0


def main() -> None:
    """Measure, or be a sender."""
    parser = argparse.ArgumentParser(prog="python -m bench.feed", description=__doc__)
    parser.add_argument("dataset", type=Path, help="a finished dataset")
    parser.add_argument("--senders", type=int, default=2, help="number of stand-ins for simulations [%(default)s]")
    parser.add_argument("--send", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.send:
        send(arguments.dataset, arguments.send)
    else:
        rate, milliseconds = measure(arguments.dataset, arguments.senders)
        print(f"{rate:.0f} episodes/s; {milliseconds:.3f} ms of processor time of the coordinator for each")


if __name__ == "__main__":
    main()
