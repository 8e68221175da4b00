#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Clippy in place of rustc, for cargo as RUSTC_WORKSPACE_WRAPPER; a warning is an error.
#
# As `cargo clippy -- -D warnings`, whose results no other command of cargo takes. With this, documentation takes
# those of the lints. Cargo knows this file by its name alone: where its flags change, nothing is linted anew.
exec clippy-driver "$@" -D warnings
