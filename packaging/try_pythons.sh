#!/bin/sh
# Tries `make up` with several Pythons: `packaging/try_pythons.sh /path/to/python3.10 /path/to/python3.13 ...`
#
# Each gets a fresh clone of the last commit and an empty HOME, and collects the quickstart. Prints a table for
# docs/installing.md: version, engine, time of everything with downloads, size of the environment, digest of the dataset.
set -eu
sources=$(cd "$(dirname "$0")/.." && pwd)
echo "| Python | engine | make up | environment | digest |"
echo "|---|---|---|---|---|"
for python; do
    place=$(mktemp -d)
    git clone -q "$sources" "$place/clone with a blank"
    mkdir "$place/home"
    began=$(date +%s)
    if (cd "$place/clone with a blank" && HOME="$place/home" make up PYTHON="$python") > "$place/log" 2>&1; then
        took=$(($(date +%s) - began))
        cd "$place/clone with a blank"
        version=$(.venv/bin/python -c 'import platform; print(platform.python_version())')
        digest=$(.venv/bin/throwcollect dataset digest datasets/quick*)
        engine=$(.venv/bin/python -c 'import sys; print("MuJoCo" if sys.version_info >= (3, 12) else "Bullet")')
        echo "| $version | $engine | $took s | $(du -sm .venv | cut -f1) MB | \`$(echo "$digest" | cut -c1-10)\` |"
        cd /
    else
        echo "| $python | | $(tail -n 1 "$place/log") | | |"
    fi
    rm -rf "$place"
done
