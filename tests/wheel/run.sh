#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs the wheel of build/wheel with Debian's Python in a minimal Debian, and tests it there.
#
#     tests/wheel/run.sh [SUITE]     trixie
#
# debootstrap recreates the system in build/wheel/SUITE each time, without Rust or a compiler, so every library in
# requirements.txt needs a wheel for that Python. Needs root, debootstrap and 3 GB.
set -eu
cd "$(dirname "$0")/../.."
. tests/bare/debian.sh
alone wheel tests/wheel/run.sh "$@"

suite=${1:-trixie}
root=$PWD/build/wheel/$suite
ls build/wheel/pkmkins-*.whl >/dev/null || { echo "wheel: none in build/wheel: cargo xtask wheel" >&2; exit 2; }
[ -x target/host/pkm ] || { echo "wheel: no target/host/pkm: make generated" >&2; exit 2; }

debian "$suite" "$root" python3-venv,ca-certificates
mkdir -p "$root/srv/pkmkins"
cp -a --parents build/wheel/pkmkins-*.whl target/host/pkm configs docs/studies/examples python/requirements.txt python/tests \
    python/notebooks "$root/srv/pkmkins"
inside "$root" env PIP_CERT=/etc/ssl/certs/ca-certificates.crt sh -c '
    set -eu
    cd /srv/pkmkins
    update-ca-certificates >/dev/null 2>&1
    python3 -m venv env
    env/bin/pip install --quiet --only-binary :all: --require-hashes -r python/requirements.txt
    env/bin/pip install --quiet --no-deps build/wheel/pkmkins-*.whl
    echo "$(sed -n "s/^PRETTY_NAME=\"\(.*\)\"/\1/p" /etc/os-release), $(env/bin/python --version)"
    PKM=/srv/pkmkins/target/host/pkm env/bin/python -m pytest -q -p no:cacheprovider python/tests'
