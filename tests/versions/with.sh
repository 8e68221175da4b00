#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs a command with another LinuxCNC in place of the installed one, which is not changed. Needs root.
#
#     tests/versions/with.sh FOLDER COMMAND [ARGUMENT...]
#
# FOLDER is LinuxCNC's source, built to run in place. What the command installs beside LinuxCNC goes into FOLDER.
set -euo pipefail

if [ "${1:-}" != --alone ]; then
    exec unshare --mount --propagation private -- "$0" --alone "$@"
fi
folder=$(realpath "$2")
shift 2
upper=$(mktemp -d)
mount -t tmpfs tmpfs "$upper"
mkdir "$upper/new" "$upper/work"
mount -t overlay overlay -o "lowerdir=/usr,upperdir=$upper/new,workdir=$upper/work" /usr

# Only 2.9 has this program.
rm -f /usr/bin/io
# Copies: virtual time may read only what is in the system's folders.
cp -rf "$folder"/bin/* "$folder"/scripts/{linuxcnc,linuxcnc_var,halrun,haltcl,realtime} /usr/bin/
sed -i "s#$folder/lib/hallib#/usr/share/linuxcnc/hallib#" /usr/bin/linuxcnc_var
cp -f "$folder"/lib/*.so* /usr/lib/
python=/usr/lib/python3/dist-packages
rm -rf "$python"/{_hal,linuxcnc,gcode}.*.so
for file in "$folder"/lib/python/*; do rm -rf "${python:?}/${file##*/}"; done
cp -r "$folder"/lib/python/* "$python"
# LinuxCNC has these folders in its own tree.
for pair in lib/linuxcnc/modules=rtlib share/linuxcnc/hallib=lib/hallib share/linuxcnc/ncfiles=nc_files \
    share/doc/linuxcnc/examples/sample-configs=configs include/linuxcnc=include; do
    mount --bind "$folder/${pair#*=}" "/usr/${pair%%=*}"
done
"$@"
