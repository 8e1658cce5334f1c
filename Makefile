# make run and make test need nothing set up beforehand: each installs what it lacks.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Stamps: what running needs is there; what tests need is there as well.
READY_RUN := $(VENV)/.ready-run
READY := $(VENV)/.ready
# What hapticd itself needs comes in the versions that it was tested with, everywhere.
CONSTRAINTS := constraints.txt
PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) --editable

# What tests and examples use besides Python; one list for this file, CI and the README.
PACKAGES := python3-venv gcc g++ pkg-config libzmq3-dev nlohmann-json3-dev systemd-container debootstrap \
    umockdev libumockdev-dev libusb-1.0-0 valgrind iproute2 gcc-avr avr-libc libsimavr-dev clang libclang-rt-dev lld \
    strace bash-completion zsh fish mandoc \
    chromium $(if $(shell command -v npm 2>/dev/null),,npm)

# A run starts hundreds of daemons; without bytecode each would compile its source again.
unexport PYTHONDONTWRITEBYTECODE

# Where `make install` puts the program: a directory of its own, which `make uninstall` removes.
PREFIX ?= /opt/hapticd
DESTDIR ?=
# Where units, rules, completions and the manual lie below: /usr for a package.
SERVICE_PREFIX ?= /usr/local
# What the service can do beyond the core, of little size.
SERVICE_EXTRAS := metrics,dashboard
PLACE = $(DESTDIR)$(PREFIX)

.DEFAULT_GOAL := help
.PHONY: help run test read lint web clients nightly repeat bench packages clean install uninstall own-place deb

help:
	@echo "make run      the daemon on a simulated device, shown live; ends with Ctrl-C"
	@echo "make test     everything that CI checks"
	@echo "make lint     formatting, style, types and import rules only"
	@echo "make web      uPlot for hapticd dashboard, by npm, in the version and with the hash that views/ names"
	@echo "make nightly  the long runs: every shipped configuration, every property on many examples"
	@echo "make repeat   tests that start a daemon, again and again: REPEAT=50, REPEAT_TESTS=files, REPEAT_WORKERS=5"
	@echo "make bench    how long a tick takes on this machine"
	@echo "make install  the daemon as a system service (as root); PREFIX=$(PREFIX), DESTDIR for packages"
	@echo "make uninstall  all of that away again, except configurations and fault records"
	@echo "make deb      a package for this Debian, in dist"
	@echo "make clean    remove the virtual environment and all that tools left"

run: $(READY_RUN)
	$(BIN)/hapticd run --config config/hapticd.toml --watch

# Much of the time is spent waiting for daemons that run in real time, so more workers than the two processors of CI; but
# with four that compute, real-time loops, their supervisors and compilers hold each other up too often: the fourth is
# for files that mostly wait (tests/dealing.py).
test: packages $(READY)
	$(MAKE) --no-print-directory --jobs 2 lint read
	$(BIN)/pytest --numprocesses 4 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

# While mypy is at work on the other processor: then no worker has to make bytecode of the tests.
read: web clients $(READY)
	@$(BIN)/pytest --collect-only -qq --no-header >$(VENV)/read.log || { cat $(VENV)/read.log; exit 1; }

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

# What the page of hapticd dashboard takes from others; served as it is, so that a browser fetches nothing elsewhere.
UPLOT := views/node_modules/uplot
PAGE_VENDOR := views/hapticd_views/dashboard/page/vendor
web: $(PAGE_VENDOR)/uPlot.esm.js

$(PAGE_VENDOR)/uPlot.esm.js: views/package.json views/package-lock.json
	@command -v npm >/dev/null || .ci/packages npm
	npm ci --prefix views --ignore-scripts --no-audit --no-fund
	mkdir -p $(PAGE_VENDOR)
	cp $(UPLOT)/dist/uPlot.min.css $(PAGE_VENDOR)/
	cp $(UPLOT)/LICENSE $(PAGE_VENDOR)/uPlot.LICENSE
	cp $(UPLOT)/dist/uPlot.esm.js $(PAGE_VENDOR)/
	@touch $@

# A program that others wrote for Haply's service, for the tests of hapticd gateway: 3 MB, of which they run one file.
CLIENTS := $(VENV)/clients
clients: $(CLIENTS)/.ready

$(CLIENTS)/.ready: tests/views/gateway/isaaclab.txt | $(BIN)/python
	$(BIN)/python -m pip download --quiet --disable-pip-version-check --no-deps --require-hashes --only-binary :all: \
		--python-version 3.11 --platform manylinux_2_35_x86_64 --dest $(CLIENTS) --requirement $<
	@touch $@

nightly: packages web clients $(READY)
	SEED=$$(date +%Y%m%d) $(BIN)/pytest -m nightly --timeout 3600 --override-ini faulthandler_timeout=3660
	EXAMPLES=30 $(BIN)/pytest -m "hypothesis and not nightly" --timeout 3600 --override-ini faulthandler_timeout=3660
	$(MAKE) repeat

# Every test that starts a daemon, again and again beside a busy processor, five side by side. The whole takes four
# hours of two processors; stopped, it goes on with what has run least, and a run counts until something changes that its
# test depends on (tests/tally.py, tests/content.py). A part of it:
# make repeat REPEAT=10 REPEAT_TESTS=tests/daemon/test_deaths.py
REPEAT ?= 50
REPEAT_WORKERS ?= 5
REPEAT_TESTS ?= tests/daemon tests/client tests/cli tests/drivers tests/faults tests/telemetry tests/views tests/remote \
    tests/doctor tests/driven tests/your_simulator tests/benchmarks tests/service/test_systemd.py tests/test_readme.py \
    tests/test_bridges_page.py tests/test_python_page.py
repeat: web clients $(READY)
	REPEAT=$(REPEAT) $(BIN)/pytest $(REPEAT_TESTS) --numprocesses $(REPEAT_WORKERS) --dist load --maxschedchunk 1 \
		--max-worker-restart 0 --timeout 1800 --override-ini faulthandler_timeout=1860

bench: $(READY)
	$(BIN)/hapticd bench tick

install: own-place
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/packages python3-venv
	umask 022; $(PYTHON) -m venv "$(PLACE)"
	umask 022; "$(PLACE)/bin/python" -P -m pip install --quiet --disable-pip-version-check --root-user-action ignore \
		--constraint $(CONSTRAINTS) '.[$(SERVICE_EXTRAS)]'
	@# Below DESTDIR the environment must not remember where it was built.
	@test -z "$(DESTDIR)" || { \
		grep -rlIZ "$(PLACE)" "$(PLACE)/bin" "$(PLACE)/pyvenv.cfg" | xargs -0 -r sed -i "s|$(PLACE)|$(PREFIX)|g"; \
		"$(PLACE)/bin/python" -m compileall -q -f -s "$(DESTDIR)" -p / "$(PLACE)/lib"; }
	"$(PLACE)/bin/python" -P -m hapticd service install --root "$(DESTDIR)/" --prefix "$(SERVICE_PREFIX)"

# What is not there any more needs no removal.
uninstall: own-place
	test ! -x "$(PLACE)/bin/python" || "$(PLACE)/bin/python" -P -m hapticd service uninstall --root "$(DESTDIR)/" --prefix "$(SERVICE_PREFIX)"
	rm -rf "$(PLACE)"

deb: web
	deb/build

own-place:
	@case "$(PREFIX)" in /*/hapticd) ;; *) echo "PREFIX must be a directory of its own: /.../hapticd"; exit 1;; esac
	@test "$(SERVICE_PREFIX)" = /usr -o ! -e "$(DESTDIR)/usr/lib/systemd/system/hapticd.service" \
		|| { echo "hapticd is here as a package, which owns its files: apt install or apt remove hapticd"; exit 1; }

packages:
	@.ci/packages $(PACKAGES)

$(READY_RUN): pyproject.toml $(CONSTRAINTS) | $(BIN)/python
	$(PIP_INSTALL) .
	@touch $@

$(READY): pyproject.toml $(CONSTRAINTS) | $(BIN)/python
	$(PIP_INSTALL) '.[dev]'
	@touch $(READY_RUN) $@

# Debian splits ensurepip off into python3-venv: without it venv fails, and .ci/packages fetches it or says how.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "hapticd needs Python 3.11 or newer; say which one: make PYTHON=python3.11 ..."; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/packages python3-venv
	$(PYTHON) -m venv $(VENV)

clean:
	rm -rf $(VENV) build dist views/node_modules $(PAGE_VENDOR) .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
