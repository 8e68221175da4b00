#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Compiles the library for virtual time; it needs no LinuxCNC, and one library serves all supported versions.
#
#     build.sh FOLDER
#
# CXX names another compiler, such as aarch64-linux-gnu-g++ for 64-bit ARM.
set -eu
sources=$(dirname "$(realpath "$0")")
library=$1/libpkmkins-virtual.so
mkdir -p "$1"
trap 'rm -f "$library.new"' EXIT
"${CXX:-g++}" -std=c++17 -O2 -Wall -Wextra -shared -s -fPIC -fvisibility=hidden -o "$library.new" "$sources"/*.cc
mv "$library.new" "$library"
