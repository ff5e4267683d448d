#!/bin/sh
# Installs packages into the environment of a Python: `install.sh PYTHON REQUIREMENT...`.
#
# uv does it, as it takes a fifth of pip's time. Where pip cannot bring uv, or uv cannot install (pip may be set up for an index
# that uv knows nothing of), pip does it. Neither may compile pybullet: a Bullet of one's own computes other bytes.
set -eu
python=$1
shift
if "$python" -m pip install --quiet --disable-pip-version-check uv; then
    "$python" -m uv pip install --python "$python" --only-binary pybullet "$@" && exit
    echo "uv could not install this; pip tries" >&2
fi
exec "$python" -m pip install --no-compile --disable-pip-version-check --only-binary=pybullet "$@"
