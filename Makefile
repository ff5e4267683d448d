# Two commands do everything on a fresh machine: `make up` collects a first dataset, `make test` passes the tests.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
READY_DEV := $(VENV)/.ready-dev
# Bytecode is kept even where the environment forbids it, as that of containers often does: every node is a process, and
# starts twice as fast when its libraries are compiled once.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: up test check bench bench-full clean

up: $(READY)
	$(BIN)/throwcollect up -n 2 configs/quickstart.yaml

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(READY): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -e '.[report,export]'
	touch $@

$(READY_DEV): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -e '.[dev]'
	touch $(READY) $@

# Tests that wait for processes run two files at a time; those with an engine look at all that is on it, so one by one.
test: check
	$(BIN)/python -m pytest -n logical tests/architecture tests/unit tests/physics
	$(BIN)/python -m pytest -n 2 --dist loadfile tests/e2e tests/integration
	$(BIN)/python -m pytest tests/docker tests/ros

# Format, lint, types and the direction of imports.
check: $(READY_DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Throws a second against the raw limit of the same machine, in the same run.
bench: $(READY_DEV)
	$(BIN)/python -m bench

# A database as large as a published one, collected in peace and among crashes: the same files. Takes half an hour.
bench-full: $(READY_DEV)
	$(BIN)/python -m bench.full

clean:
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
