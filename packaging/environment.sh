#!/bin/sh
# Makes a virtual environment for `make`: `environment.sh DIRECTORY [PYTHON]`. One line says with which Python, and why.
#
# It takes PYTHON, or else the first of these that can be had:
# 1. Python 3.11 or 3.10 of this machine. pybullet, the physics engine of all tests and examples, has wheels for no later one;
#    pip would compile it for a quarter of an hour, into an engine that computes other bytes. Of several Pythons 3.11 in PATH,
#    it takes the first one that was compiled with optimisation, which pyenv leaves out: it needs a sixth less time for the tests.
# 2. Python 3.11 that uv finds or fetches. Where uv is missing, pip fetches that first, into build/uv; and where pip is missing,
#    as it is with Debian's Python alone, `fetch_uv.py` does.
# 3. A later Python of this machine, on which MuJoCo simulates. If it cannot make environments, uv makes it.
set -eu
directory=$1
named=${2:-}

# What is left of one that was not finished: uv makes none where one is.
if [ -e "$directory/pyvenv.cfg" ] && ! [ -e "$directory/bin/python" ]; then rm -rf "$directory"; fi

# Whether a Python has a version in a range, and the modules that are named.
suits() {
    "$1" -c "import sys${4:-}; sys.exit(not ($2 <= sys.version_info < $3))" 2> /dev/null
}
MAKES=", ensurepip, venv"

# Whether a Python was compiled with optimisation, and has the headers with which the interfaces of genuine ROS 2 are compiled.
# Pythons in /usr are those of distributions, which optimise without saying so; others have it in the options of their build.
is_fast() {
    "$1" -c "import os, sys, sysconfig
fast = sys.base_prefix == '/usr' or '--enable-optimizations' in (sysconfig.get_config_var('CONFIG_ARGS') or '')
sys.exit(not (fast and os.path.exists(sysconfig.get_path('include') + '/Python.h')))" 2> /dev/null
}

make_with() {
    echo "environment: $directory, with $("$1" --version)$2"
    exec "$1" -m venv "$directory"
}

if [ -n "$named" ]; then
    # Its path may have blanks.
    set -- "$named"
else
    IFS=:
    for place in $PATH; do
        python=$place/python3.11
        [ -x "$python" ] && suits "$python" "(3, 10)" "(3, 12)" "$MAKES" && is_fast "$python" && make_with "$python" " of $place"
    done
    unset IFS
    set -- python3.11 python3.10 python3
fi
for python; do
    suits "$python" "(3, 10)" "(3, 12)" "$MAKES" && make_with "$python" ""
done

fetch_uv() {
    for python in python3 python; do
        "$python" -m pip install --quiet --disable-pip-version-check --target build/uv uv 2> /dev/null && return
        "$python" "${0%/*}/fetch_uv.py" build/uv 2> /dev/null && return
    done
    return 1
}

uv=uv
if ! command -v uv > /dev/null; then
    uv=build/uv/bin/uv
    if [ -z "$named" ] && ! [ -x "$uv" ] && fetch_uv; then
        echo "no Python 3.10 or 3.11 is here that makes environments; uv, which does, is in build/uv"
    fi
fi

if [ -z "$named" ] && command -v "$uv" > /dev/null; then
    if { said=$("$uv" venv --quiet --seed --python 3.11 "$directory" 2>&1 >&3); } 3>&1; then
        echo "environment: $directory, with Python 3.11 by uv"
        exit
    fi
    # Its last line has the cause; the others have addresses.
    echo "uv cannot have Python 3.11: ${said##*cause: }"
fi

because="for which pybullet has no wheel: MuJoCo simulates, whose throws land some millimetres elsewhere (docs/robots.md)"
if [ -z "$named" ]; then set -- python3 python3.12 python3.13 python3.14; fi
for python; do
    suits "$python" "(3, 12)" "(3, 15)" "$MAKES" && make_with "$python" ", $because"
    if command -v "$uv" > /dev/null && suits "$python" "(3, 10)" "(3, 15)"; then
        "$uv" venv --quiet --seed --python "$python" "$directory" || continue
        echo "environment: $directory, with $("$python" --version) by uv$(suits "$python" "(3, 12)" "(3, 15)" && echo ", $because")"
        exit
    fi
done
if [ -n "$named" ] && ! command -v "$named" > /dev/null; then
    echo "there is no $named here: make PYTHON=/path/to/python3.11" >&2
    exit 1
fi
if [ -n "$named" ] && said=$("$named" --version 2> /dev/null) && ! suits "$named" "(3, 10)" "(3, 15)"; then
    echo "$named is $said, and this needs a Python from 3.10 to 3.14: make PYTHON=/path/to/python3.11" >&2
    exit 1
fi
echo "no Python from 3.10 to 3.14 that can make environments is here (${named:-python3.11, python3.10, python3}):" \
    "install python3-venv or uv, or name one: make PYTHON=/path/to/python3.11" >&2
exit 1
