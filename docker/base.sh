#!/bin/bash
# Makes a base image for machines that reach a Debian mirror, but no registry: `docker/base.sh [TAG]`.
# It holds Python 3.11 and what wheels expect of a system; no apt, no pip. TAG-build has `strip` besides.
# Needs mmdebstrap, and root or user namespaces.
set -euo pipefail
tag=${1:-throwcollect-base:bookworm}
# A machine that runs bookworm knows its mirror; otherwise mmdebstrap knows one.
sources=$(grep -ls bookworm /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list | head -n 1 || true)

container=throwcollect-base-$$
import=(docker import --change 'ENV LANG=C.UTF-8' --change 'CMD ["python3"]' -)
trap 'docker rm "$container" > /dev/null 2>&1 || true' EXIT

# Without the hook, merging /usr would install a whole Perl.
mmdebstrap --quiet --variant=essential --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr \
    --include=usr-is-merged,python3,libgomp1,libstdc++6,binutils --aptopt='Apt::Install-Recommends "false"' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/info/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' \
    --customize-hook='cd "$1" && rm -rf etc/apt/sources.list* etc/resolv.conf etc/hostname var/cache/* var/log/*' \
    bookworm - ${sources:+"$sources"} | "${import[@]}" "$tag-build"
docker run --network none --name "$container" "$tag-build" \
    sh -c "dpkg --purge \$(dpkg-query -W -f '\${Package}\n' | grep -E 'binutils|libctf|libgprofng|libjansson')"
docker export "$container" | "${import[@]}" "$tag"
