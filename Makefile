# Two commands do everything on a fresh Debian or Ubuntu machine: make demo, make test.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Files of tests that run at once; each may take a gigabyte and a half.
JOBS ?= 2
STAMP := $(VENV)/.installed

.PHONY: demo test test-slow test-train soak test-portable test-mutants test-planted test-console test-starts test-formats test-scale proof-datasets proof-captures proof-first-run lint bench validation proof-latency board-qemu docs docs-site schemas format system clean

demo: $(STAMP) system
	$(BIN)/flyaround demo -o out/demo --overwrite

test: $(STAMP) system lint
	$(BIN)/pytest -q -m "not slow" -n $(JOBS) --dist loadfile

test-slow: $(STAMP) system
	$(BIN)/pytest -q -m slow

# An hour of frames to a board: memory flat, every frame accounted for.
soak: $(STAMP) system
	FLYAROUND_SOAK_S=3600 $(BIN)/pytest -q -rA tests/hil/host/test_soak.py -k memory

# As on other processors: minutes for each factor; FACTORS="blas-prescott worst" runs some of them.
test-portable: $(STAMP) system
	$(BIN)/python tools/portable.py $(FACTORS)

# What PyTorch trains: the extra 'train' is installed first, some 200 MB; a page of the documents among it.
test-train: $(STAMP) system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[train]'
	$(BIN)/pytest -q tests/hil/train tests/docs/test_own_network.py tests/docs/test_own_estimator.py

# A Ray cluster of local nodes, one of them killed, and an S3 server of the tests' own.
test-scale: $(STAMP) system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[scale-test]'
	$(BIN)/pytest -q tests/simulator/dataset/test_ray_frames.py tests/simulator/dataset/storage

# Labels of IMAGES of every recipe by check and by rays on the exported mesh. Hours; goes on where it was stopped.
IMAGES ?= 400
proof-datasets: $(STAMP) system
	$(BIN)/python -m tools.validation.datasets -n $(IMAGES)

# Every recipe by capture with six formats and two processes, check, and each format read back: CAPTURES images of each.
CAPTURES ?= 40
proof-captures: $(STAMP) system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[formats-test]'
	$(BIN)/python -m tools.validation.captures -n $(CAPTURES)

# Data sets in other formats, read by the libraries that people use.
test-formats: $(STAMP) system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[formats-test]'
	$(BIN)/pytest -q tests/simulator/dataset/formats tests/simulator/dataset/check/test_exports.py

# The console in real windows on a virtual screen: every panel, size and scenario, lost processes, an autopilot. Half an hour.
test-console: $(STAMP) system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[console-test]'
	$(BIN)/pytest -q tests/gui/console tests/gui/test_window.py

test-starts: $(STAMP) system
	$(BIN)/pytest -q tests/gui/test_starts.py

# Small bugs planted one at a time: 200 of a seed, of which the tests must notice four in five. Hours.
test-mutants: $(STAMP) system
	$(BIN)/python -m tools.mutants

# Fifty bugs of physics, labels and messages, chosen by hand, of which the tests must notice 85 %. Half an hour.
test-planted: $(STAMP) system
	$(BIN)/python -m tools.planted

lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(STAMP) system
	$(BIN)/flyaround bench

validation: $(STAMP) system
	$(BIN)/python -m tools.validation.dynamics
	$(BIN)/python -m tools.validation.camera
	$(BIN)/python -m tools.validation.rendering

# The wheel for a user without rights, compiler or room: first commands, their times, the cache. Root, and a Python for all.
FIRST_PYTHON ?= $(PYTHON)
proof-first-run: $(STAMP) system
	$(BIN)/python -m tools.first_run $(FIRST_PYTHON)

# The camera's latency over SECONDS, as docs/validation/hil.md has it; wants a quiet machine.
SECONDS ?= 60
proof-latency: $(STAMP)
	$(BIN)/python -m tools.validation.hil --seconds $(SECONDS)

# The loop to a board of another processor, emulated: docs/hil_boards.md. Half an hour for each line of LINES.
N ?= 60
LINES ?= net uart
board-qemu: $(STAMP) system
	rm -rf out/boards
	$(BIN)/python -m tools.boards prove -n $(N) --lines $(LINES) -o out/boards

docs: $(STAMP) system
	$(BIN)/python -m tools.docs.pictures
	$(BIN)/python -m tools.docs.gallery
	$(BIN)/python -m tools.docs.camera_pictures
	$(BIN)/python -m tools.docs.coco_picture

# The documents as a site, every link checked: out/site/index.html.
docs-site: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

schemas: $(STAMP)
	$(BIN)/python -m flyaround.schemas docs/formats

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The environment, from pinned versions, and the estimator's C for all Linux processors.
NATIVE := $(shell find hil/board/hybrid/native -name '*.[ch]')
$(STAMP): pyproject.toml constraints.txt hatch_build.py $(NATIVE)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Flyaround needs Python >= 3.11, found $$($(PYTHON) --version); set PYTHON=python3.12 or newer"; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null \
	  || { echo "Python's venv is missing; run: sudo apt-get install -y python3-venv"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[gui,logs,dev]'
	$(BIN)/python hatch_build.py
	@touch $@

# OpenGL by EGL, and a virtual screen for the window's tests: installed where that is allowed, else said.
system: $(STAMP)
	@sh .ci/system_packages $(BIN)/python

clean:
	rm -rf $(VENV) out dist build
