# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh
# Sourced at the root of the repository: makes cargo call Debian's rustc-web, which comes with the sources of its
# library, for targets for which the installed rustc has no library. Its packages are unpacked into target/tools and not
# installed.

rust_web=$PWD/target/tools/rust-web
if [ ! -d "$rust_web/usr" ]; then
    std=$(apt-cache depends libstd-rust-web-dev | sed -n 's/.*Depends: \(libstd-rust-web-[0-9].*\)/\1/p' | head -n 1)
    llvm=$(apt-cache depends "$std" | sed -n 's/.*Depends: libllvm\([0-9]*\).*/\1/p' | head -n 1)
    mkdir -p "$rust_web/packages"
    (cd "$rust_web/packages" && apt-get download -q \
        rustc-web rust-web-src libstd-rust-web-dev "$std" "libllvm$llvm" "lld-$llvm")
    # Unpacked under another name until complete, so that an interrupted run starts again.
    rm -rf "$rust_web/unpacked"
    for package in "$rust_web"/packages/*.deb; do dpkg -x "$package" "$rust_web/unpacked"; done
    mv "$rust_web/unpacked/usr" "$rust_web/usr"
fi
llvm=$(echo "$rust_web"/usr/lib/llvm-*)
export RUSTC="$rust_web/usr/bin/rustc" PATH="$llvm/bin:$PATH"
LD_LIBRARY_PATH=$rust_web/usr/lib/$(uname -m)-linux-gnu:$llvm/lib
export LD_LIBRARY_PATH
