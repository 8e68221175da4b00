# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh disable=SC2034
# Who publishes the packages, and where. The publisher replaces both placeholders, then runs `cargo xtask publisher`,
# which writes them into the pages that name them. `make release` rejects placeholders.

maintainer='pkmkins maintainers <maintainers@pkmkins.invalid>'
address='https://packages.pkmkins.invalid'
