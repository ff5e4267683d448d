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

import throwcollect
from throwcollect.ros.backend import uses_rclpy

EXTRAS = {"plotly", "matplotlib", "h5py"}
for module in pkgutil.walk_packages(throwcollect.__path__, "throwcollect."):
    if not module.name.endswith("__main__") and (uses_rclpy() or module.name != "throwcollect.ros.genuine"):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as missing:
            if (missing.name or "").partition(".")[0] not in EXTRAS:
                raise
PYTHON
throwcollect --help > help
for backend; do
    throwcollect up -n 1 --runtime local --trials 4 --set run.ros="$backend" --output "$backend" "$quickstart"
    throwcollect dataset info "$backend" > info
    throwcollect dataset verify "$backend"
done
