#!/bin/sh
# Fails if something is missing in the image: loads every module, and on each backend that the arguments name makes a plan,
# runs every kind of node, and reads the result.
set -eu
quickstart=$(cd "$(dirname "$0")" && pwd)/quickstart.yaml
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python - <<'PYTHON'
import importlib
import pkgutil

import rclzenoh
import throwcollect
from throwcollect.ros.middleware import uses_rclpy

EXTRAS = {
    *("docker", "plotly", "jinja2", "markupsafe", "h5py"),
    *("fastapi", "starlette", "uvicorn", "websockets", "orjson", "cbor2", "gymnasium"),
}
modules = [module for root in (rclzenoh, throwcollect) for module in pkgutil.walk_packages(root.__path__, f"{root.__name__}.")]
for module in modules:
    if not module.name.endswith("__main__") and (uses_rclpy() or module.name != "throwcollect.ros.genuine"):
        try:
            importlib.import_module(module.name)
        except ImportError as error:
            missing = error.__cause__ or error
            if (getattr(missing, "name", "") or "").partition(".")[0] not in EXTRAS:
                raise
PYTHON
python -c "from throwcollect.engines.mujoco.loop import make_loop; assert make_loop().made == 'compiled', make_loop()"
throwcollect --help > help
throwcollect up -n 1 --runtime inprocess --trials 2 --set sim.engine=mujoco --output mujoco "$quickstart"
for backend; do
    # On Fast DDS, nodes at times do not find each other; the next start goes on with what is there.
    throwcollect up -n 1 --runtime local --trials 4 --set run.ros="$backend" --output "$backend" "$quickstart" \
        || throwcollect resume -n 1 --runtime local --set run.ros="$backend" "$backend"
    throwcollect dataset info "$backend" > info
    throwcollect dataset verify "$backend"
done
