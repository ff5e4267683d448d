"""What the process that simulations are forked from works out for all of them."""

import subprocess
import sys

import pytest

from throwcollect.config.schema import Config
from throwcollect.sim.live import LiveSimulator

FORK = """
import multiprocessing
from tests.unit.ros.nodes.simulation import test_process
from throwcollect.collect.runtimes.local import begin_imports

begin_imports("throwcollect.engines.ballistic.ballistic_engine", foreseen={foreseen})
process = multiprocessing.get_context("forkserver").Process(target=test_process.print_what_is_read)
process.start()
process.join()
"""
CONFIG = Config.model_validate({"sim": {"engine": "ballistic"}})


def print_what_is_read() -> None:
    """Print which data files a simulation reads when it begins."""
    opened: list[str] = []
    sys.addaudithook(lambda event, arguments: opened.append(str(arguments[0])) if event == "open" else None)
    LiveSimulator(CONFIG, lambda: None)
    print([path for path in opened if path.endswith((".urdf", ".srdf", ".pyc", ".so"))], flush=True)


@pytest.mark.parametrize("foreseen", ["test_process.CONFIG.model_dump_json()", "'nonsense'"])
def test_simulations_of_a_foreseen_configuration_read_nothing_again(foreseen: str) -> None:
    command = [sys.executable, "-c", FORK.format(foreseen=foreseen)]
    printed = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    assert (printed.splitlines()[-1] == "[]") == (foreseen != "'nonsense'")
