#!/bin/sh
# Makes or updates an environment with the versions that `uv.lock` pins: `environment.sh DIRECTORY PYTHON EXTRA...`.
#
# If PYTHON is empty, an environment that is there keeps its Python; a new one gets the first of these that can be had:
# 1. Python 3.11 or 3.10 of this machine: pybullet, the physics engine of the examples, has wheels for no later one.
#    Of several Pythons 3.11 in PATH, it takes the first one compiled with optimisation, which pyenv leaves out:
#    the tests then need a sixth less time.
# 2. Python 3.11 that uv fetches.
# 3. A later Python of this machine, on which MuJoCo simulates.
set -eu
directory=$1
named=$2
# Some shells leave the ~ of `make PYTHON=~/...` as it is.
case $named in "~/"*) named=$HOME/${named#??} ;; esac
shift 2
# Some networks need a certificate that only this machine knows.
[ ! -e /etc/ssl/certs/ca-certificates.crt ] || export UV_SYSTEM_CERTS=1

fail() { echo "$*" >&2; exit 1; }

# Whether a Python has a version in a range.
suits() { "$1" -c "import sys; sys.exit(not ($2 <= sys.version_info < $3))" 2> /dev/null; }

# Whether a Python was compiled with optimisation, and has the headers with which the interfaces of ROS 2 are compiled.
# Distributions, whose Pythons are in /usr, optimise without an option that tells it.
is_fast() {
    suits "$1" "(3, 11)" "(3, 12)" && "$1" -c "import os, sys, sysconfig
fast = sys.base_prefix == '/usr' or '--enable-optimizations' in (sysconfig.get_config_var('CONFIG_ARGS') or '')
sys.exit(not (fast and os.path.exists(sysconfig.get_path('include') + '/Python.h')))"
}

# Prints the first of some Pythons that has a version in a range.
first_of() {
    for python in "$3" "$4" "${5:-}" "${6:-}"; do suits "$python" "$1" "$2" && echo "$python" && return; done
}

find_uv() {
    uv=$(command -v uv) && return
    uv=build/uv/bin/uv
    [ -x $uv ] && return
    # pip may know an index where this machine reaches no other.
    for python in "$named" python3 python; do
        command -v "$python" > /dev/null || continue
        "$python" packaging/fetch_uv.py build/uv 2> /dev/null && return
        "$python" -m pip install --quiet --disable-pip-version-check --target build/uv uv 2> /dev/null && return
    done
    fail "uv, which makes environments, cannot be fetched: install it, or install by pip (docs/installing.md)"
}

choose_python() {
    IFS=:
    for place in $PATH; do is_fast "$place/python3.11" && echo "$place/python3.11" && return; done
    unset IFS
    first_of "(3, 10)" "(3, 12)" python3.11 python3.10 python3 && return
    "$uv" python install --quiet --no-bin 3.11 >&2 && echo 3.11 && return
    first_of "(3, 12)" "(3, 15)" python3 python3.12 python3.13 python3.14
}

if [ -n "$named" ]; then
    command -v "$named" > /dev/null || fail "there is no $named here: make PYTHON=/path/to/python3.11"
    suits "$named" "(3, 10)" "(3, 15)" \
        || fail "$named is $("$named" --version), and this needs a Python from 3.10 to 3.14: make PYTHON=/path/to/it"
fi
find_uv
python=$directory/bin/python
if ! "$python" -c "" 2> /dev/null; then
    [ -n "$named" ] || named=$(choose_python) || fail "no Python from 3.10 to 3.14 is here: make PYTHON=/path/to/it"
    rm -rf "$directory"
    "$uv" venv --quiet --seed --python "$named" "$directory"
    echo "environment: $directory, with $("$python" --version)"
    ! suits "$python" "(3, 12)" "(3, 15)" || echo "pybullet has no wheel for it:" \
        "MuJoCo simulates, whose throws land some millimetres elsewhere (docs/robots.md)"
elif [ -n "$named" ] && [ "$("$named" --version)" != "$("$python" --version)" ]; then
    fail "$directory has $("$python" --version), not that of $named: rm -r $directory, then make PYTHON=$named"
fi
case " $* " in *" dev "*) suits "$python" "(3, 11)" "(3, 12)" \
    || fail "the tests need Python 3.11, the only one with wheels of pybullet and of genuine ROS 2, and" \
        "$directory has another: rm -r $directory, then make PYTHON=/path/to/python3.11 test" ;; esac
# Pinocchio loads this library, and no wheel brings it.
"$python" -c 'import ctypes, sys; sys.platform != "linux" or ctypes.CDLL("libgomp.so.1")' 2> /dev/null \
    || fail "libgomp.so.1 is missing, which simulating needs: sudo apt install libgomp1, then make again"

echo "installing what uv.lock pins for $* into $directory: about 500 MB to download, 2 GB on disk"
extras=$(printf -- '--extra %s ' "$@")
# Without --inexact, it would remove pip, and what somebody has installed besides.
UV_PROJECT_ENVIRONMENT=$directory "$uv" sync --locked --inexact --python "$python" $extras && exit
echo "uv cannot install this; pip tries, from its own index" >&2
mkdir -p build
"$uv" export --quiet --frozen --no-emit-project $extras --output-file build/requirements.txt > /dev/null
"$python" -m pip install --no-compile --disable-pip-version-check --only-binary=:all: -r build/requirements.txt
"$python" -m pip install --no-compile --disable-pip-version-check --no-deps -e .
