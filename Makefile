# SPDX-License-Identifier: GPL-2.0-or-later
#
# Thin verbs. `make demo` and `make test` install what is missing with apt, and say so.

.DELETE_ON_ERROR:
.PHONY: help demo pictures getting-started calibration-demo test test-programs test-live check-aside fuzz-short ini-cases test-long test-bare check prove counts counts-write bench certify boxes fuzz soak truth truth-live guard screens mutants setup setup-page setup-screen page page-core page-check test-page rust module virtual header install uninstall install-pkm builds-pkm uninstall-pkm clean

# Root is needed for apt, for LinuxCNC's folders, and for nothing else.
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo || echo no-sudo)
APT := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get
# Beside them, a screen in memory with OpenGL, and pictures of it.
SCREEN_PACKAGES := xvfb libgl1-mesa-dri x11-utils imagemagick
PACKAGES := linuxcnc-uspace linuxcnc-uspace-dev ca-certificates gcc g++ libboost-dev tcl python3 iproute2 procps valgrind

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
HAL_FILES := $(wildcard hal/pkmkins*.tcl)
SUBROUTINES := $(wildcard subroutines/*.ngc subroutines/*.inc)
# The model in 3D, the page in browsers, and what the panel needs; they look for their modules there.
VIEWER_BIN := /usr/bin
VIEWERS := viewer/pkmkins-vismach viewer/pkmkins-panel viewer/pkm-live
VIEWER_SHARE := /usr/share/pkmkins
VIEWER_MODULES := $(wildcard viewer/*.py)

# LinuxCNC in virtual time, for pkm: compiled against the headers of the LinuxCNC that is installed.
VIRTUAL := target/virtual/libpkmkins-virtual.so
VIRTUAL_SOURCES := $(wildcard workbench/virtual/*.cc)
LINUXCNC_VERSION = $(shell linuxcnc_var LINUXCNCVERSION)
CXXFLAGS := -std=c++17 -O2 -Wall -Wextra -Wno-ignored-qualifiers

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
	@echo "make calibration-demo  LinuxCNC probes a plate, is calibrated and probes again"
	@echo "make test       every test, in less than 25 minutes"
	@echo "make test-long  the same tests with ten times as many cases"
	@echo "make test-bare  make demo and make test in a Debian with nothing else; SUITE=bookworm"
	@echo "make prove      reads the built module: no panic, no allocation, bounded stack, named symbols"
	@echo "make counts     instructions of every call, typical and at worst, against their bounds"
	@echo "make check      formatting, lints, documentation, generated files"
	@echo "make bench      time and failures beside LinuxCNC's genhexkins"
	@echo "make certify    how often forward is right, refuses and errs, as tables"
	@echo "make boxes      proves the boxes of the shipped machines for the start without a seed"
	@echo "make fuzz       both fuzz targets for MINUTES=10 each"
	@echo "make soak       MINUTES=10 of random moves and tool changes, all machines, ends in a table"
	@echo "make truth      preflight beside LinuxCNC in virtual time: 225 programs, ends in a table"
	@echo "make truth-live virtual time beside LinuxCNC itself, every servo cycle of them"
	@echo "make guard      PROGRAMS=10000 random programs with the guard on, in virtual time"
	@echo "make screens    every configuration in AXIS, with panel and model; pictures in build/screens"
	@echo "make mutants    which changes of the core its tests do not notice; PART=0/1, 0/10 a tenth"
	@echo "make install    module, HAL files and subroutines into LinuxCNC's folders (DESTDIR honoured)"
	@echo "make uninstall  takes exactly these away"
	@echo "make install-pkm  the command pkm, its manual pages and completions into PREFIX=$(PREFIX);"
	@echo "                no root for a place of one's own: make install-pkm PREFIX=~/.local"
	@echo "make uninstall-pkm  takes exactly these away"
	@echo "make page       builds the code of the page of pkm view; make page-core its kinematics"
	@echo "make getting-started  runs the commands of docs/getting-started.md and writes their times there"
	@echo "make pictures   draws the pictures of the documentation again"
	@echo "make clean      removes target/ and build/"

demo:
	@[ -f "configs/$(MACHINE)/$(MACHINE).ini" ] || [ -f "$(MACHINE)" ] || { \
	    echo "pkmkins: no machine $(MACHINE): name an INI file, or one of:" $(notdir $(wildcard configs/*)); exit 2; }
	@$(MAKE) --no-print-directory install
	tests/live/demo.sh "$(MACHINE)" "$(PROGRAM)"

# The component that plays the true machine is for this alone: it goes again at the end.
PLAYER := $(MODULES)/pkmkins_truth.so
calibration-demo: install
	$(HOST_BUILD) --lib --bin pkm
	@root="$(SUDO)"; $$root install -m 644 target/host/libpkmkins_truth.so "$(PLAYER)" || exit 1; \
	tests/live/calibration_demo.py --pkm target/host/pkm --out build/calibration; \
	code=$$?; $$root rm -f "$(PLAYER)"; exit $$code

# Much of this keeps one core busy: linking the module, valgrind, HAL starting again and again.
TWO := $(MAKE) --no-print-directory --jobs=2 --output-sync=line

test: setup
	$(TWO) install prove counts test-programs
	$(CARGO) test --profile host $(LOCKED) --no-fail-fast
	$(TWO) fuzz-short ini-cases
	$(HOST_BUILD) --bin pkm --bin judge
	$(TWO) test-live check-aside
	tests/live/traces_test.py
	tests/live/truth.py --live short
	tests/viewer/scene_test.py target/host/pkm
	$(MAKE) --no-print-directory test-page
	$(MAKE) --no-print-directory setup-screen
	tests/viewer/screens.py --only $(THREE)
	tests/viewer/live_test.py
	tests/virtual/guarded.py --programs 100
	$(HOST_BUILD) --lib --bin pkm
	tests/live/calibration_demo.py --virtual --pkm target/host/pkm --out build/calibration-virtual
	tests/live/probing_test.py --only hexaglide --pkm target/host/pkm --out build/probing

# The page in a browser without a window.
test-page: setup-page page-check
	tests/page/page_test.mjs target/host/pkm --out build/page

# Struts, two mechanisms, an axis that carries the tool, and the cases beside the configurations.
THREE := lab-hexapod,lathe-mirrored,two-turrets,filter,without,shapes
screens: install setup-screen
	$(HOST_BUILD) --bin pkm
	tests/viewer/screens.py --out build/screens

# Writes the table of docs/getting-started.md.
getting-started: install
	$(HOST_BUILD) --bin pkm
	tests/live/live_test.py --only getting_started --out build/getting-started
	tests/live/getting_started.py build/getting-started

test-live:
	tests/live/live_test.py --judge target/host/judge

# Those of the documentation, by the commands that they show.
pictures:
	$(HOST_BUILD) --bin pkm
	docs/pictures/make.sh target/host/pkm

# In the third of two cores that machines live leave, and never before them.
check-aside:
	chrt --idle 0 $(MAKE) --no-print-directory check

test-programs: setup
	$(CARGO) test --profile host $(LOCKED) --no-run --quiet

fuzz-short: setup
	fuzz/run.sh

# With the module that is installed.
ini-cases:
	tests/cases/ini/run.py

# The numbers of cases of the long tier: 10^6 poses for the round trips, every program live, 10^4 random
# programs with the guard on.
test-long: install
	PKMKINS_CASES=10 $(CARGO) test --profile host $(LOCKED) --no-fail-fast
	$(HOST_BUILD) --bin pkm --bin judge
	tests/live/live_test.py --long --judge target/host/judge
	tests/live/instructions.py
	tests/live/truth.py --live all
	tests/virtual/guarded.py --programs 10000
	tests/live/probing_test.py --pkm target/host/pkm --out build/probing
	tests/live/soak.py --minutes 10

# Says how long each took. As root, with debootstrap.
SUITE := bookworm
test-bare:
	tests/bare/run.sh $(SUITE)

# Lints are no tests: where the toolchain has none, as Debian's, they are skipped with a word.
LINT = lint() { \
    if ! $(CARGO) $$1 --version >/dev/null 2>&1; then echo "pkmkins: this Rust has no cargo $$1: skipped"; return; fi; \
    echo "$(CARGO) $$*"; $(CARGO) "$$@"; }; lint

check: setup
	@$(LINT) fmt --all --check
	@cd fuzz && $(LINT) fmt --check
	cd fuzz && $(CARGO) metadata $(LOCKED) --format-version 1 >/dev/null
	@$(LINT) clippy $(LOCKED) --profile host --all-targets -- -D warnings
	@$(LINT) clippy $(LOCKED) --release -p pkmkins --target-dir target/module -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --profile host --no-deps --quiet
	$(MAKE) --no-print-directory header
	git diff --exit-code -- include docs/causes.md docs/pkmkins.9 hal/pkmkins.tcl viewer/pkmkins_causes.py

prove: setup module
	$(HOST_RUN) --bin prove

# Under valgrind; `counts-write` makes what is found now the bounds, with a margin.
counts: setup module
	$(HOST_RUN) --bin counts

counts-write: setup module
	$(HOST_RUN) --bin counts write

# Writes the tables of docs/benchmarks.md: what follows its comment line.
BENCH := docs/benchmarks.md
bench: setup module
	@mkdir -p build
	sed '/^<!-- make bench writes/q' $(BENCH) > build/benchmarks.md
	sed -n 's/^model name[^:]*: */\nMeasured on: /p' /proc/cpuinfo | head -n 2 >> build/benchmarks.md
	echo >> build/benchmarks.md
	$(CARGO) run --release $(LOCKED) --quiet -p abi-tests --bin bench >> build/benchmarks.md
	$(CARGO) bench $(LOCKED) --quiet -p pkm --bench host >> build/benchmarks.md
	@mv build/benchmarks.md $(BENCH) && sed '1,/^<!-- make bench writes/d' $(BENCH)

# With PKMKINS_CASES=10 the 10^7, 10^5 and 10^4 calls of the long tier.
certify: setup module
	$(CARGO) test --profile host $(LOCKED) --quiet -p kinematics --test core certified:: -- \
	    --nocapture --test-threads=1
	$(CARGO) run --release $(LOCKED) --quiet -p abi-tests --bin certify

# A minute on two cores; `make test` proves all but the hexapod's.
boxes:
	$(HOST_BUILD) --bin pkm
	@for ini in configs/*/*.ini; do echo "$$ini"; target/host/pkm boxes "$$ini" || exit 1; done

MINUTES := 10
fuzz: setup
	@cd fuzz && $(LINT) clippy $(LOCKED) --release --all-targets -- -D warnings
	fuzz/run.sh --minutes $(MINUTES)

soak: install
	$(HOST_BUILD) --bin pkm --bin judge
	tests/live/soak.py --minutes $(MINUTES) --out build/soak

TRUTH :=
truth: install
	$(HOST_BUILD) --bin pkm
	tests/live/truth.py $(TRUTH)

truth-live: install
	$(HOST_BUILD) --bin pkm
	tests/live/truth.py --live all $(TRUTH)

PROGRAMS := 10000
# On what is built: nothing is installed.
guard: virtual
	$(HOST_BUILD) --bin pkm
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
setup-page:
	@missing=$$(for c in $(PAGE_COMMANDS); do command -v $${c%:*} >/dev/null || echo $${c#*:}; done); \
	if [ -n "$$missing" ]; then \
	    echo "pkmkins: installing" $$missing "with apt"; \
	    $(APT) update -q && $(APT) install -q -y --no-install-recommends $$missing || exit 1; \
	fi
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

# By an invocation of its own: features of host crates must not reach the module.
module:
	$(CARGO) build --release $(LOCKED) -p pkmkins --target-dir target/module

# Every function of HAL and RTAPI that LinuxCNC's library has gets a substitute: those without one of
# their own end the run by their name, so that nothing reaches the HAL of this computer. The module and its
# HAL files stand beside the library, which takes them before those that are installed.
virtual: setup module
	@mkdir -p $(dir $(VIRTUAL))
	@nm -D --defined-only /usr/lib/liblinuxcnchal.so.0 | \
	    sed -nE 's/^[0-9a-f]+ T ((hal|halpr|rtapi)_[a-z0-9_]+)$$/UNCOVERED(\1)/p' > $(dir $(VIRTUAL))uncovered.inc
	g++ $(CXXFLAGS) -shared -fPIC -fvisibility=hidden -DULAPI -DBUILT_FOR='"$(LINUXCNC_VERSION)"' \
	    -I/usr/include/linuxcnc -I$(dir $(VIRTUAL)) -o $(VIRTUAL).new $(VIRTUAL_SOURCES)
	@mv $(VIRTUAL).new $(VIRTUAL)
	@cp $(SO) $(dir $(VIRTUAL))pkmkins.so && cp $(HAL_FILES) $(dir $(VIRTUAL))

header:
	$(HOST_RUN) --bin header -- .

# A new file that is renamed: a module that is being mapped is never half-written.
install: virtual
	@if [ -z "$(DESTDIR)" ] && { pgrep -x rtapi_app || pgrep -x milltask; } >/dev/null; then \
	    echo "pkmkins: LinuxCNC is running; stop it before installing"; exit 1; fi
	@echo "pkmkins: installing into $(DESTDIR)$(MODULES), $(DESTDIR)$(HALLIB) and $(DESTDIR)$(NGC_LIB)"
	@root="$(SUDO)"; [ -z "$(DESTDIR)" ] || root=""; \
	put() { $$root install -m $${3:-644} "$$1" "$$2.new" && $$root mv "$$2.new" "$$2"; }; \
	$$root mkdir -p "$(DESTDIR)$(MODULES)" "$(DESTDIR)$(HALLIB)" "$(DESTDIR)$(NGC_LIB)" \
	    "$(DESTDIR)$(VIEWER_BIN)" "$(DESTDIR)$(VIEWER_SHARE)" && \
	put $(SO) "$(DESTDIR)$(MODULES)/pkmkins.so" && \
	put $(VIRTUAL) "$(DESTDIR)$(MODULES)/$(notdir $(VIRTUAL))" && \
	for f in $(VIEWERS); do put $$f "$(DESTDIR)$(VIEWER_BIN)/$${f##*/}" 755 || exit 1; done && \
	for f in $(VIEWER_MODULES); do put $$f "$(DESTDIR)$(VIEWER_SHARE)/$${f##*/}" || exit 1; done && \
	for f in $(HAL_FILES); do put $$f "$(DESTDIR)$(HALLIB)/$${f##*/}" || exit 1; done && \
	for f in $(SUBROUTINES); do put $$f "$(DESTDIR)$(NGC_LIB)/$${f##*/}" || exit 1; done

uninstall:
	@if [ -z "$(DESTDIR)" ] && { pgrep -x rtapi_app || pgrep -x milltask; } >/dev/null; then \
	    echo "pkmkins: LinuxCNC is running; stop it before uninstalling"; exit 1; fi
	@root="$(SUDO)"; [ -z "$(DESTDIR)" ] || root=""; \
	$$root rm -f "$(DESTDIR)$(MODULES)/pkmkins.so" "$(DESTDIR)$(MODULES)/$(notdir $(VIRTUAL))" \
	    $(foreach f,$(HAL_FILES),"$(DESTDIR)$(HALLIB)/$(notdir $(f))") \
	    $(foreach f,$(VIEWERS),"$(DESTDIR)$(VIEWER_BIN)/$(notdir $(f))") \
	    $(foreach f,$(VIEWER_MODULES),"$(DESTDIR)$(VIEWER_SHARE)/$(notdir $(f))") \
	    $(foreach f,$(SUBROUTINES),"$(DESTDIR)$(NGC_LIB)/$(notdir $(f))") && \
	for folder in "$(DESTDIR)$(NGC_LIB)" "$(DESTDIR)$(VIEWER_SHARE)"; do \
	    [ ! -d "$$folder" ] || $$root rmdir --ignore-fail-on-non-empty "$$folder"; done

# Apart from `install`: the computer that plans need not be the one that cuts.
install-pkm: builds-pkm
	$(HOST_BUILD) --config profile.host.package.pkm.opt-level=3 --bin pkm
	rm -rf build/pkm && target/host/pkm man build/pkm/man
	@for shell in bash zsh fish; do target/host/pkm completions $$shell > build/pkm/$$shell || exit 1; done
	@$(PKM_ROOT); \
	$$root install -D -m 755 target/host/pkm "$(DESTDIR)$(PREFIX)/bin/pkm" && \
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

clean:
	rm -rf target build
