#!/bin/sh
# Makes a virtual environment with a Python that the physics engine has wheels for: `environment.sh DIRECTORY [PYTHON]`.
# Looks at PYTHON, or else at what is usual, and then has uv fetch Python 3.11. Without wheels, pip would compile the engine
# for a quarter of an hour, into one that computes other bytes.
set -eu
for python in ${2:-python3.11 python3.10 python3}; do
    if "$python" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 12))' 2> /dev/null; then
        echo "environment: $1, with $("$python" --version)"
        exec "$python" -m venv "$1"
    fi
done
if command -v uv > /dev/null; then
    echo "environment: $1, with Python 3.11 by uv"
    exec uv venv --quiet --seed --python 3.11 "$1"
fi
echo "no Python 3.10 or 3.11 is here (${2:-python3.11, python3.10, python3}), and pybullet has wheels for no other:" \
    "install python3.11-venv or uv, or name one: make PYTHON=/path/to/python3.11" >&2
exit 1
