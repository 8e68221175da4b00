#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Draws the pictures of the documentation with the commands that the pages show; `cargo xtask pictures` calls it.
#
#     docs/pictures/make.sh PKM
set -eu

pkm=$(realpath "$1")
cd "$(dirname "$0")/../.."
hexapod=configs/hexapod/hexapod.ini
surface=configs/hexapod/programs/five-axis-surface.ngc
drawn=$(mktemp -d)
trap 'rm -rf "$drawn"' EXIT

# draw COMMAND... -- PICTURE...: runs a command and keeps these of its pictures, NAME or NAME=NEW-NAME.
draw() {
    words=
    while [ "$1" != -- ]; do words="$words $1"; shift; done
    shift
    echo "pkm$words"
    # shellcheck disable=SC2086  # words of commands have no spaces
    "$pkm" $words --plots "$drawn" > "$drawn/answer" 2>&1 || { cat "$drawn/answer" >&2; exit 1; }
    for picture; do cp "$drawn/${picture%%=*}.svg" "docs/pictures/${picture#*=}.svg"; done
    rm -rf "${drawn:?}"/*
}

draw workspace $hexapod --bands 36 --grid 8 --plane xz -- workspace slice-xz
draw workspace configs/linear-delta/linear-delta.ini --bands 36 --grid 8 -- workspace=workspace-linear-delta
draw workspace configs/rotary-delta/rotary-delta.ini --bands 36 --grid 8 -- workspace=workspace-rotary-delta
draw replay $hexapod $surface --period 0.05 -- struts tool-path-3d
draw sensitivity $hexapod --study docs/studies/examples/paper-001.toml --law --draws 100 --rays 50 -- sensitivity-position
draw stiffness $hexapod --study configs/hexapod/cutting.toml --pose 0 0 300 10 0 0 --tool 0 0 80 --grid 31 -- \
    ellipsoid-translation stiffness-translation-xz
draw dynamics $hexapod --study configs/hexapod/dynamics.toml --shake noise -- spectrum
draw stability pose $hexapod --study configs/hexapod/cutting.toml --pose -80 60 350 10 -20 0 --feed 1 0 0 --speeds 2500 7000 -- stable-depths
draw stability lag --study docs/studies/examples/paper-002.toml --overhang 150 -- overhang-150-partition-link=partition
draw path configs/hexaglide/hexaglide.ini configs/hexaglide/paths/dome.toml -o "$drawn/dome.ngc" -- families-net

# Draws frames and signs of every shipped machine, and of the hexapod in docs/guide/getting-started.md.
for folder in configs/*/; do
    machine=$(basename "$folder")
    echo "pkm frames $machine"
    "$pkm" frames "$folder$machine.ini" --output "docs/pictures/frames-$machine.svg" 2> "$drawn/answer" ||
        { cat "$drawn/answer" >&2; exit 1; }
done
made=$(sed -e ':line' -e '/\\$/{N;s/\\\n *//;b line' -e '}' docs/guide/getting-started.md | sed -n 's/^    pkm \(new hexapod .*\) my-hexapod$/\1/p')
# shellcheck disable=SC2086  # words of commands have no spaces
"$pkm" $made --out "$drawn/my-hexapod" > "$drawn/answer"
"$pkm" frames "$drawn/my-hexapod/my-hexapod.ini" --output docs/pictures/frames-my-hexapod.svg

# Draws the pages of pkm view: every shipped machine halfway through its first program. Needs a browser.
for folder in configs/*/; do
    machine=$(basename "$folder")
    set -- "$folder"programs/*.ngc
    echo "pkm view $machine"
    "$pkm" view "$folder$machine.ini" "$1" --picture "docs/pictures/machine-$machine.png" --size 640 400
done
sed -n 's/^    pkm \(new .*\)$/\1/p' docs/reference/machines.md | while read -r made; do
    kind=${made#new }
    kind=${kind%% *}
    echo "pkm view $kind"
    # shellcheck disable=SC2086  # words of commands have no spaces
    "$pkm" $made --out "$drawn/$kind" > "$drawn/answer"
    "$pkm" view "$drawn/$kind/$kind.ini" "$drawn/$kind/programs/first.ngc" --picture "docs/pictures/machine-$kind.png" --size 640 400
done
echo "pkm view hexapod"
"$pkm" view $hexapod $surface --picture docs/pictures/view-hexapod.png --size 1200 700
