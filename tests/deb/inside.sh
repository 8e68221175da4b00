#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The steps that tests/deb/run.sh runs as root in its Debian, with the packages in /srv/deb.
set -u
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
cd /srv/deb || exit
pkm=$(ls pkm_*.deb) pkmkins=$(ls pkmkins_*.deb)
architecture=$(dpkg --print-architecture)
log=/srv/log
passed=0 failed=0 skipped=0

# step NAME COMMAND...: runs a command that must succeed.
step() {
    name=$1
    shift
    begin=$(date +%s)
    if "$@" > "$log" 2>&1; then
        passed=$((passed + 1))
        echo "PASS $name ($(($(date +%s) - begin)) s)"
    else
        failed=$((failed + 1))
        echo "FAIL $name"
        tail -n 30 "$log" | sed 's/^/    /'
    fi
}

# natively NAME COMMAND...: a step that an emulated processor cannot do.
natively() {
    if [ -z "${EMULATED:-}" ]; then
        step "$@"
    else
        skipped=$((skipped + 1))
        echo "SKIP $1: not under an emulated processor"
    fi
}

# refused TEXT COMMAND...: it has to fail, and to say so.
refused() {
    text=$1
    shift
    ! "$@" > "$log.raw" 2>&1 || { echo "not refused: $*"; cat "$log.raw"; return 1; }
    # apt gives dpkg a terminal, which ends lines with CR LF.
    tr -d '\r' < "$log.raw" | tee "$log.refused"
    grep -q -- "$text" "$log.refused"
}

# remade FILE FIELD VALUE OUT: builds the package with another value of a field.
remade() {
    rm -rf /srv/remade
    dpkg-deb --raw-extract "$1" /srv/remade
    sed -i "s/^$2: .*/$2: $3/" /srv/remade/DEBIAN/control
    dpkg-deb --build --root-owner-group /srv/remade "$4"
}

installed() { [ "$(dpkg-query -W -f='${db:Status-Abbrev}' "$1" 2>/dev/null)" = "ii " ]; }
# Returns whether dpkg has left nothing half installed.
orderly() { dpkg --audit && [ -z "$(dpkg --audit)" ]; }
get() { apt-get install -q -y --no-install-recommends "$@"; }

# Lists all files on the disk, except those that programs write while they run.
files() {
    find / -xdev \( -path /srv -o -path /proc -o -path /sys -o -path /dev -o -path /run -o -path /tmp -o -path /var/tmp \
        -o -path /var/log -o -path /var/cache -o -path /home -o -path /var/lib/apt -o -path /var/lib/pkmkins-run \) -prune \
        -o -print | grep -v '^/var/lib/dpkg/.*-old$' | sort
}

as_user() { setpriv --reuid=machinist --regid=machinist --init-groups env HOME=/home/machinist USER=machinist "$@"; }

office_pc() {
    get "./$pkm" &&
        refused "not found" sh -c 'command -v linuxcnc || { echo not found; exit 1; }' &&
        (cd /srv && rm -rf my-hexapod && pkm new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 180 \
            --platform-half-angle 15 --strut 550 850 --lead 5 --hands RLRLRL --tool up --nose 40 --diameter 30 \
            --feed 18000 --accel 4000 --turn 60 my-hexapod && pkm check my-hexapod/my-hexapod.ini) &&
        grep -q 'The machine fits together' "$log" &&
        refused "LinuxCNC" pkm run /srv/my-hexapod/my-hexapod.ini /srv/my-hexapod/programs/first.ngc
}

missing_dependency() {
    refused "depends on linuxcnc-uspace" dpkg --install "./$pkmkins" &&
        ! installed pkmkins && dpkg --purge pkmkins && orderly
}

# Tests that dpkg refuses the module with a LinuxCNC of the next series.
other_series() {
    next=$(dpkg-deb --field "$pkmkins" Depends | sed 's/.*linuxcnc-uspace (<< \([^)]*\)~).*/\1/')
    rm -rf /srv/other && mkdir -p /srv/other/DEBIAN &&
        printf '%s\n' 'Package: linuxcnc-uspace' "Version: $next.0" "Architecture: $architecture" \
            'Maintainer: test <test@localhost>' 'Description: stands for the next LinuxCNC' > /srv/other/DEBIAN/control &&
        dpkg-deb --build /srv/other /srv/other.deb && dpkg --install /srv/other.deb &&
        refused "$next~" dpkg --install "./$pkmkins" && ! installed pkmkins &&
        dpkg --purge pkmkins linuxcnc-uspace && orderly
}

other_architecture() {
    other=arm64
    [ "$architecture" != arm64 ] || other=amd64
    remade "$pkmkins" Architecture $other /srv/other.deb &&
        refused "does not match system" dpkg --install /srv/other.deb && ! installed pkmkins && orderly
}

# Tests that apt refuses to replace files of `make install`, then follows the remedy in the message.
over_a_hand_made_installation() {
    cp -a /srv/by-hand/usr /
    refused "files of .make install. are in the way" get "./$pkmkins" && ! installed pkmkins &&
        grep -q "/usr/lib/linuxcnc/modules/pkmkins.so$" "$log.refused" &&
        sh -c "$(sed -n 's/.*or by: sudo //p' "$log.refused")" &&
        ! find /usr -name '*pkmkins*' | grep . && orderly && get "./$pkmkins" "./$pkm" && installed pkmkins
}

purged() { apt-get purge -q -y pkmkins pkm && orderly; }

nothing_of_ours() { files > /srv/files && ! grep -i 'pkm' /srv/files; }

read_only() {
    mount --bind /usr /usr && mount -o remount,bind,ro /usr || return 1
    refused "Read-only file system" dpkg --install "./$pkmkins"
    code=$?
    umount --lazy /usr
    # dpkg could not clean up on a read-only disk: install the package once more, then purge it.
    [ $code = 0 ] && ! installed pkmkins && dpkg --install "./$pkmkins" && dpkg --purge pkmkins && orderly && nothing_of_ours
}

full_disk() {
    folder=/usr/share/linuxcnc/aux_examples
    mkdir "$folder" && mount -t tmpfs -o size=64k full "$folder" || return 1
    refused "No space left on device" dpkg --install "./$pkmkins"
    code=$?
    umount "$folder"
    rmdir "$folder"
    [ $code = 0 ] && ! installed pkmkins && { dpkg --purge pkmkins || true; } && orderly && nothing_of_ours
}

picked() {
    as_user env HALLIB_DIR=/usr/share/linuxcnc/hallib xvfb-run -a wish /srv/pkmkins/tests/deb/pick.tcl \
        /usr/lib/tcltk/linuxcnc/bin/pickconfig.tcl /usr/share/linuxcnc/aux_examples/pkmkins/hexapod/hexapod.ini > /srv/picked &&
        cat /srv/picked && [ "$(tail -n 1 /srv/picked)" = /home/machinist/linuxcnc/configs/hexapod/hexapod.ini ] &&
        # The text shown, the line written into the copy, and the linked subroutines.
        grep -q 'Novikov, Strutynsky and Kyrychenko' "$log" &&
        grep -q '^PROGRAM_PREFIX = /home/machinist/linuxcnc/nc_files$' /home/machinist/linuxcnc/configs/hexapod/hexapod.ini &&
        [ -e /home/machinist/linuxcnc/nc_files/pkmkins_lib/pkm_circle.ngc ]
}

# Homes the machine and runs a program to its end without a message.
ran() {
    /srv/pkmkins/tests/live/run_live.py --config /home/machinist/linuxcnc/configs/hexapod/hexapod.ini \
        --program five-axis-surface.ngc --out /srv/ran --seconds 600 && grep -q '"ok": true' /srv/ran/result.json
}

virtual_time() {
    ini=/home/machinist/linuxcnc/configs/hexapod/hexapod.ini
    as_user pkm preflight "$ini" /home/machinist/linuxcnc/configs/hexapod/programs/five-axis-surface.ngc --format json > /srv/preflight
    grep -q '"judged"' /srv/preflight || { cat /srv/preflight; return 1; }
}

# Both ways to install, with what is to be downloaded.
downloads() {
    for option in --no-install-recommends --install-recommends; do
        echo "$option: $(apt-get install --assume-no $option "./$pkmkins" "./$pkm" tk |
            grep -E 'newly installed|^Need to get|^After this' | tr '\n' ' ')"
    done > /srv/downloads
    cat /srv/downloads
    [ "$(grep -c 'Need to get' /srv/downloads)" = 2 ]
}

# Every page as text, and all links of the pages for browsers.
documentation() {
    documents=/usr/share/doc/pkm
    for page in "$documents"/docs/[grs]*/*.md; do
        page=${page#"$documents/"}
        if ! pkm help "$page" > /srv/page 2> /srv/places || ! cmp /srv/page "$documents/$page" ||
            [ "$(wc -l < /srv/places)" != 2 ]; then
            echo "pkm help $page"
            cat /srv/places
            return 1
        fi
    done
    python3 /srv/pkmkins/docs/site/links.py "$documents/html" && ! find "$documents" -xtype l | grep . &&
        mv "$documents" /srv/documents && refused "the documentation is not installed" pkm help guide &&
        mv /srv/documents "$documents"
}

# The commands of the installed page, in an empty folder, up to the end of the first program.
getting_started() {
    mkdir -p /srv/pkmkins/docs/guide /srv/pkmkins/target/host &&
        cp /usr/share/doc/pkm/docs/guide/getting-started.md /srv/pkmkins/docs/guide &&
        cp /usr/bin/pkm /srv/pkmkins/target/host &&
        /srv/pkmkins/tests/live/live_test.py --only getting_started --out /srv/started
}

# Every configuration runs as in virtual time in every servo cycle, after `getting_started` has placed pkm.
live_as_virtual() {
    /srv/pkmkins/tests/live/truth.py --live short --alone --out /srv/truth
}

manuals() {
    MANWIDTH=100 man pkmkins | grep -q 'kinematics of parallel machines' && MANWIDTH=100 man pkm-preflight | grep -q preflight &&
        pkm check /usr/share/linuxcnc/aux_examples/pkmkins/hexapod/hexapod.ini
}

# Tests upgrade and removal while LinuxCNC's real-time process runs, started by halrun, which ends with its input.
while_linuxcnc_runs() {
    rm -f /srv/hal && mkfifo /srv/hal
    setpriv --reuid=machinist --regid=machinist --clear-groups env HOME=/home/machinist halrun -s < /srv/hal > /srv/halrun 2>&1 &
    session=$!
    exec 9> /srv/hal
    echo 'loadrt threads name1=t period1=1000000' >&9
    for _ in $(seq 100); do pgrep -x rtapi_app && break; sleep 0.2; done
    refused "LinuxCNC is running" dpkg --install /srv/newer.deb && installed pkmkins &&
        refused "LinuxCNC is running" apt-get remove -q -y pkmkins && installed pkmkins
    code=$?
    exec 9>&-
    wait $session
    [ $code = 0 ] && orderly && dpkg --verify pkmkins
}

edited_is_kept() {
    example=/usr/share/linuxcnc/aux_examples/pkmkins/hexapod/hexapod.ini
    copy=/home/machinist/linuxcnc/configs/hexapod/hexapod.ini
    echo '# mine' >> "$copy" && echo '# mine' >> "$example" && sum=$(md5sum < "$copy") &&
        dpkg --install /srv/newer.deb && [ "$(md5sum < "$copy")" = "$sum" ] &&
        [ "$(tail -n 1 "$example.edited")" = '# mine' ] && ! grep -q '^# mine' "$example" && dpkg --verify pkmkins &&
        rm "$example.edited" && dpkg --install "./$pkmkins" && installed pkmkins && dpkg --verify pkmkins && orderly
}

echo "$(sed -n 's/^PRETTY_NAME="\(.*\)"/\1/p' /etc/os-release), $architecture, $pkmkins, $pkm"
step "apt reads its lists" apt-get update -q
step "pkm alone checks a new machine on a computer without LinuxCNC" office_pc
step "a missing dependency" missing_dependency
step "a LinuxCNC of another interface" other_series
step "the wrong architecture" other_architecture
step "what apt would download" downloads
cat /srv/downloads
step "apt install brings everything" get "./$pkmkins" "./$pkm"
dpkg-query -W -f='${Package} ${Version}: ${Installed-Size} KiB installed\n' linuxcnc-uspace pkmkins pkm
step "no compiler, no Rust" refused none sh -c 'command -v gcc cc g++ cargo rustc || { echo none; exit 1; }'
step "what the tests need beside them" get xvfb xauth tk man-db iproute2
step "purge" purged
step "nothing is left of the packages" nothing_of_ours
step "a user" useradd --create-home machinist
files > /srv/before
step "a read-only /usr" read_only
step "a disk that fills up" full_disk
step "over a hand-made installation" over_a_hand_made_installation
step "manual pages and pkm check" manuals
step "the documentation" documentation
step "LinuxCNC's picker copies the hexapod" picked
natively "the commands of getting started" getting_started
natively "the copy is started, homed, and runs its program" ran
natively "preflight judges its time" virtual_time
natively "every configuration runs as in virtual time" live_as_virtual
remade "$pkmkins" Version 99 /srv/newer.deb > "$log"
natively "while LinuxCNC runs" while_linuxcnc_runs
step "an edited configuration at upgrade and downgrade" edited_is_kept
step "purge at the end" purged
files > /srv/after
step "the files are those of before" diff /srv/before /srv/after
echo "deb: $passed passed, $failed failed, $skipped skipped"
[ $failed = 0 ]
