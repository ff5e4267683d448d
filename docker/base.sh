#!/bin/bash
# Makes a base image for machines that reach a Debian mirror, but no registry: `docker/base.sh [TAG]`.
# It holds Python 3.11 and what wheels expect of a system; no apt, no pip. Needs mmdebstrap, and root or user namespaces.
set -euo pipefail
tag=${1:-throwcollect-base:bookworm}
archive=$(mktemp --suffix=.tar)
trap 'rm -f "$archive"' EXIT
# A machine that runs bookworm knows its mirror; otherwise mmdebstrap knows one.
sources=$(grep -ls bookworm /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list | head -n 1 || true)

# Without the hook, merging /usr would install a whole Perl.
mmdebstrap --quiet --variant=essential --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr \
    --include=usr-is-merged,python3,libgomp1,libstdc++6 --aptopt='Apt::Install-Recommends "false"' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/info/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' \
    --customize-hook='cd "$1" && rm -rf etc/apt/sources.list* etc/resolv.conf etc/hostname var/cache/* var/log/*' \
    bookworm "$archive" ${sources:+"$sources"}
docker import --change 'ENV LANG=C.UTF-8' --change 'CMD ["python3"]' "$archive" "$tag"
