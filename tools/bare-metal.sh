#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Checks that the core compiles for a microcontroller (Cortex-M4F), where there is neither an operating system nor a
# C library.
#
# Uses the target's library if rustc has it (rustup target add thumbv7em-none-eabihf), otherwise builds it from the
# sources of Debian's rustc-web.
set -eu
cd "$(dirname "$0")/.."
target=thumbv7em-none-eabihf

if [ -d "$(rustc --print target-libdir --target $target)" ]; then
    cargo check --locked --quiet -p kinematics --target $target --target-dir target/bare-metal
else
    . tools/rust-web.sh
    # The library is built from its sources, which a released compiler refuses without RUSTC_BOOTSTRAP.
    RUSTC_BOOTSTRAP=1 cargo check --locked --quiet -p kinematics --target $target -Zbuild-std=core \
        --target-dir target/bare-metal
fi
echo "bare-metal: the core compiles for $target"
