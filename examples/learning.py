"""From a dataset to a throw at a target, and to another robot; in cells, for editors that run them one by one.

Collect first: ``throwcollect up -n 2 configs/quickstart.yaml --trials 1024 --output datasets/many``. Then, from there:
``python examples/learning.py datasets/many configs/quickstart.yaml configs/real.yaml``.
"""

# %% What there is
import sys

import numpy as np

import throwcollect


def main(data: str, nominal: str, real: str) -> None:
    """Learn from the dataset `data` of the configuration `nominal`, aim, throw, and adapt to the robot of `real`."""
    dataset = throwcollect.load(data)
    print(dataset)

    # %% Learn where throws end, and aim at a place amid them
    model = throwcollect.fit(dataset)
    landings = np.array(
        [(throw.row["landing_x_m"], throw.row["landing_y_m"]) for throw in dataset.select("outcome == 'landed'")]
    )
    target = np.median(landings, axis=0)
    aim = model.aim([target])[0]
    print(f"at {target.round(3)}: {aim.parameters}, predicted {aim.predicted.round(3)}")

    # %% Throw there, in the simulation that the dataset is from
    with throwcollect.Simulator(nominal) as simulator:
        print(f"missed by {100 * miss(simulator, aim.parameters, target):.2f} cm")

    # %% Throw with another robot, and learn from where its throws end
    with throwcollect.Simulator(real) as robot:
        print(f"the other robot misses by {100 * miss(robot, aim.parameters, target):.2f} cm")
        points, places = [], []
        for goal in landings[:: len(landings) // 10]:
            parameters = model.aim([goal])[0].parameters
            found = place(robot, parameters)
            if found is None:
                continue
            points.append(parameters)
            places.append(found)
            adapted = model.adapt(points, places, scatter=0.005)
            missed = 100 * miss(robot, adapted.aim([target])[0].parameters, target)
            print(f"after {len(points)}: by {missed:.2f} cm ({adapted.adaptation.method.value})")
            if len(points) == 3:
                break


def place(simulator: throwcollect.Simulator, parameters: dict[str, float]) -> tuple[float, float] | None:
    """Throw, and return where it landed; None if it did not."""
    row = simulator.throw(parameters).row
    return (row["landing_x_m"], row["landing_y_m"]) if row["outcome"] == "landed" else None


def miss(simulator: throwcollect.Simulator, parameters: dict[str, float], target: np.ndarray) -> float:
    """Throw, and return how far from a target it landed [m]; NaN if it did not."""
    return float(np.linalg.norm(np.subtract(place(simulator, parameters) or (np.nan, np.nan), target)))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} DATASET CONFIG REAL_CONFIG\n\n{__doc__}")
    main(*sys.argv[1:])
