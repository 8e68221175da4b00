#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds the page's kinematics: page/core for wasm32, into the file given.
#
# Where rustc has the target's library (rustup target add wasm32-unknown-unknown), with that. Else with
# Debian's rustc-web, whose sources have the library; its packages are unpacked into target/tools and not
# installed.
set -eu
out=$1
cd "$(dirname "$0")/../.."
target=wasm32-unknown-unknown
tools=$PWD/target/tools/rust-web
# Browsers have had wasm's vectors since 2021; the kinematics take two legs at a time.
flags="-C target-feature=+simd128 -C strip=symbols -C opt-level=s --remap-path-prefix=$PWD=."

if [ -d "$(rustc --print target-libdir --target $target)" ]; then
    RUSTFLAGS=$flags cargo rustc --locked -p page-core --crate-type cdylib --release \
        --target $target --target-dir target/page --quiet
else
    if [ ! -d "$tools/usr" ]; then
        std=$(apt-cache depends libstd-rust-web-dev | sed -n 's/.*Depends: \(libstd-rust-web-[0-9].*\)/\1/p' | head -n 1)
        llvm=$(apt-cache depends "$std" | sed -n 's/.*Depends: libllvm\([0-9]*\).*/\1/p' | head -n 1)
        mkdir -p "$tools/packages"
        (cd "$tools/packages" && apt-get download -q \
            rustc-web rust-web-src libstd-rust-web-dev "$std" "libllvm$llvm" "lld-$llvm")
        for package in "$tools"/packages/*.deb; do dpkg -x "$package" "$tools"; done
    fi
    llvm=$(echo "$tools"/usr/lib/llvm-*)
    export RUSTC="$tools/usr/bin/rustc" PATH="$llvm/bin:$PATH"
    export LD_LIBRARY_PATH="$tools/usr/lib/x86_64-linux-gnu:$llvm/lib"
    # The library is built from its sources, which a released compiler does only when it is told so.
    RUSTC_BOOTSTRAP=1 RUSTFLAGS=$flags cargo rustc --locked -p page-core --crate-type cdylib --release \
        --target $target -Zbuild-std=core,compiler_builtins --target-dir target/page --quiet
fi
install -m 644 target/page/$target/release/page_core.wasm "$out"
