#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Clippy in place of rustc, for cargo as RUSTC_WORKSPACE_WRAPPER; a warning is an error.
#
# Equivalent to `cargo clippy -- -D warnings`, whose results no other cargo command reuses; `cargo doc` reuses those of
# this wrapper. Cargo does not detect changes in this file: after a change of its flags nothing is linted again.
exec clippy-driver "$@" -D warnings
