# Everything a fresh machine needs beyond Rust, Python 3.11 and make is set up here, into .venv and target.
#   make demo   set up, simulate an office, map it, and draw the map
#   make test   set up, lint, run every test, and build the documentation

PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PYO3_PYTHON := $(CURDIR)/$(PY)
unexport CONDA_PREFIX

.PHONY: demo test vulkan setup build lint test-rust test-python docs bench bench-instructions bench-peers bench-peers-full bench-backends peers package clean

demo: build
	$(VENV)/bin/pyramap demo -o out

test: vulkan lint test-rust test-python docs

# The environment, with exactly the locked packages. It is made again when the lock changes.
setup: $(VENV)/.locked
$(VENV)/.locked: requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "pyramap needs Python 3.11 or newer; set PYTHON=/path/to/it" >&2; exit 1; }
	@command -v cargo >/dev/null || { echo "pyramap needs Rust: see https://rustup.rs" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	touch $@

# The GPU backend is tested on whatever Vulkan device there is. Where there is none, Mesa's software device is installed
# if that may be done; else its tests are skipped, and say so.
ICD := /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d
vulkan:
	@if [ "$$(uname)" != Linux ] || [ -n "$$(find $(ICD) -name '*.json' 2>/dev/null)" ]; then exit 0; fi; \
	if ! command -v apt-get >/dev/null; then \
		echo "No Vulkan driver: the GPU tests will be skipped. Install Mesa's Vulkan drivers to run them." >&2; exit 0; fi; \
	if [ "$$(id -u)" = 0 ]; then sudo=; elif sudo -n true 2>/dev/null; then sudo="sudo -n"; else \
		echo "No Vulkan driver: the GPU tests will be skipped. To run them: sudo apt-get install mesa-vulkan-drivers" >&2; \
		exit 0; fi; \
	echo "installing mesa-vulkan-drivers, for the GPU tests"; \
	$$sudo apt-get install -qq -y --no-install-recommends mesa-vulkan-drivers >/dev/null 2>&1 \
		|| { $$sudo apt-get update -qq && $$sudo apt-get install -qq -y --no-install-recommends mesa-vulkan-drivers >/dev/null; } \
		|| echo "mesa-vulkan-drivers could not be installed: the GPU tests will be skipped" >&2

# The extension is built anew whenever cargo finds that it must be; that takes seconds when nothing changed.
build: setup
	$(VENV)/bin/maturin develop --release --locked --quiet

lint: build
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	$(PY) -m mypy
	MYPYPATH=python $(PY) -m mypy.stubtest pyramap._core

# Warnings in tests are errors too: clippy has looked at all targets.
test-rust: setup
	cargo test --workspace --locked --quiet
	cargo run --locked --quiet -p embed

test-python: build
	$(PY) -m pytest

# The pages, in .build/docs: all pictures are made, and the examples, the notebook and the first page's commands run.
# Warnings are errors, references that lead nowhere among them. Nothing is fetched.
docs: build
	$(PY) -m sphinx -E -W --keep-going --quiet docs .build/docs

bench: setup
	cargo bench --locked -p pyramap-benches --bench frame --bench stages --bench map

# Instructions of each stage under valgrind, beside those of the run before: for machines too busy to take times on.
# The runner that counts must be of the library's own version, which is asked of cargo.
bench-instructions:
	@command -v valgrind >/dev/null || { echo "bench-instructions needs valgrind: see https://valgrind.org" >&2; exit 1; }
	@set -e; version=$$(cargo pkgid gungraun); version=$${version##*[@#]}; root=$(CURDIR)/.build/gungraun-$$version; \
		test -x $$root/bin/gungraun-runner \
			|| cargo install gungraun-runner --version "=$$version" --locked --root $$root; \
		GUNGRAUN_RUNNER=$$root/bin/gungraun-runner cargo bench --locked -p pyramap-benches --bench instructions -- $(ARGS)

# What users would pick instead, in an environment of its own; ARGS are for the comparison (see benches/peers/README.md).
PEERS := .venv-peers
bench-peers: peers
	PYTHONPATH=benches $(PEERS)/bin/python -m peers $(ARGS)

bench-peers-full: peers
	PYTHONPATH=benches $(PEERS)/bin/python -m peers.full_run $(ARGS)

# Every stage on the CPU and on a GPU (ARGS="--adapter NAME"), in turns.
bench-backends: build
	PYTHONPATH=benches $(PY) -m peers.backends $(ARGS)

peers: setup | $(PEERS)
	rm -rf $(PEERS)/wheels
	$(VENV)/bin/maturin build --release --locked --quiet --out $(PEERS)/wheels
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check -r benches/peers/requirements.txt $(PEERS)/wheels/*
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps $(PEERS)/wheels/*
$(PEERS):
	$(PYTHON) -m venv $@

# What a release is made of, into dist: the source distribution, and a wheel built from it. On Linux zig links it, for
# any system with glibc 2.17. The wheel is then tried as users have it, in an environment of its own, without Rust.
# The crates are packed as they would be published, and compiled from what was packed.
PACKAGING := .build/packaging
package: setup
	rm -rf dist $(PACKAGING)
	$(PYTHON) -m venv $(PACKAGING)/build
	$(PACKAGING)/build/bin/python -m pip install --quiet --disable-pip-version-check \
		"maturin[zig]==$$($(VENV)/bin/maturin --version | cut -d ' ' -f 2)"
	PATH="$(CURDIR)/$(PACKAGING)/build/bin:$$PATH" VIRTUAL_ENV=$(CURDIR)/$(PACKAGING)/build \
		maturin build --release --strip --sdist --out dist $(if $(filter Linux,$(shell uname)),--zig)
	$(PYTHON) -m venv $(PACKAGING)/try
	$(PACKAGING)/try/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	cd $(PACKAGING)/try && env -i PATH=/usr/bin:/bin bin/pyramap demo -o out
	cargo publish --workspace --locked --dry-run

clean:
	rm -rf $(VENV) $(PEERS) .build target dist out docs/generated
