# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh
# Read with `.` at the root of the repository: makes the rustc of Debian's browsers, with the sources of its library,
# the one that cargo calls. For targets that the rustc at hand has no library for. Its packages are
# unpacked into target/tools and not installed.

rust_web=$PWD/target/tools/rust-web
if [ ! -d "$rust_web/usr" ]; then
    std=$(apt-cache depends libstd-rust-web-dev | sed -n 's/.*Depends: \(libstd-rust-web-[0-9].*\)/\1/p' | head -n 1)
    llvm=$(apt-cache depends "$std" | sed -n 's/.*Depends: libllvm\([0-9]*\).*/\1/p' | head -n 1)
    mkdir -p "$rust_web/packages"
    (cd "$rust_web/packages" && apt-get download -q \
        rustc-web rust-web-src libstd-rust-web-dev "$std" "libllvm$llvm" "lld-$llvm")
    # Under another name until all is there: what was broken off is begun anew.
    rm -rf "$rust_web/unpacked"
    for package in "$rust_web"/packages/*.deb; do dpkg -x "$package" "$rust_web/unpacked"; done
    mv "$rust_web/unpacked/usr" "$rust_web/usr"
fi
llvm=$(echo "$rust_web"/usr/lib/llvm-*)
export RUSTC="$rust_web/usr/bin/rustc" PATH="$llvm/bin:$PATH"
LD_LIBRARY_PATH=$rust_web/usr/lib/$(uname -m)-linux-gnu:$llvm/lib
export LD_LIBRARY_PATH
