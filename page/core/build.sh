#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds the page's kinematics: page/core for wasm32, into the file given, with a checksum of its sources beside it.
#
# Uses rustc if it has the target's library (rustup target add wasm32-unknown-unknown), otherwise
# Debian's rustc-web, whose sources contain the library.
set -eu
out=$1
cd "$(dirname "$0")/../.."
target=wasm32-unknown-unknown
# Browsers have had wasm's vectors since 2021; the kinematics calculate two legs at a time.
flags="-C target-feature=+simd128 -C strip=symbols -C opt-level=s --remap-path-prefix=$PWD=."

if [ -d "$(rustc --print target-libdir --target $target)" ]; then
    RUSTFLAGS=$flags cargo rustc --locked -p page-core --crate-type cdylib --release \
        --target $target --target-dir target/page --quiet
else
    . tools/rust-web.sh
    # The library is built from its sources, which a released compiler does only with RUSTC_BOOTSTRAP; Debian's has
    # the linker under its own name.
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="$flags -C linker=wasm-ld" cargo rustc --locked -p page-core --crate-type cdylib --release \
        --target $target -Zbuild-std=core,compiler_builtins --target-dir target/page --quiet
fi
install -m 644 target/page/$target/release/page_core.wasm "$out"
page/core/sources.sh > "${out%.wasm}.sources"
