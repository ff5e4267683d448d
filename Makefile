# Two commands do everything on a fresh machine: `make up` collects a first dataset, `make test` passes the tests.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
READY_DEV := $(VENV)/.ready-dev
# Genuine ROS 2 has an environment of its own: where rclpy is, nodes run on it.
ROS_VENV := .venv-ros
ROS_WHEELS := build/wheelhouse-ros
READY_ROS := $(ROS_VENV)/.ready
# Bytecode is kept even where the environment forbids it, as that of containers often does: every node is a process, and
# starts twice as fast when its libraries are compiled once.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: up ros test test-containers test-processes check bench bench-full clean

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

# An environment with genuine rclpy on top of the one for development: `.venv-ros/bin/python -m pytest tests/ros`.
ros: $(READY_DEV)
	$(BIN)/python packaging/ros_wheels.py $(ROS_WHEELS)
	@$(MAKE) --no-print-directory $(READY_ROS)

# NumPy and all that is not ROS comes from that other environment, so that it is there once, in one version.
$(READY_ROS): $(ROS_WHEELS)/made-from.sha256 | $(READY_DEV)
	$(BIN)/python -m venv --clear $(ROS_VENV)
	$(ROS_VENV)/bin/python -m pip install --quiet --no-compile --disable-pip-version-check --no-deps \
	    $$(ls $(ROS_WHEELS)/*.whl | grep -v /numpy-)
	$(ROS_VENV)/bin/python -c "import sysconfig; print('import site; site.addsitedir(\'' \
	    + sysconfig.get_path('purelib', vars={'base': '$(CURDIR)/$(VENV)'}) + '\')')" > $@.pth
	mv $@.pth "$$($(ROS_VENV)/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/development.pth"
	touch $@

# On Fast DDS, nodes at times do not find each other on a busy machine. A run starts them again; so do its tests.
ROS_TESTS := $(ROS_VENV)/bin/python -m pytest -n 2 --dist loadfile tests/contract tests/ros

# Continuous integration makes the image meanwhile, and names the process that does.
test: check
	$(BIN)/python -m pytest -n logical tests/architecture tests/unit tests/contract tests/physics
	@while [ -n "$(MAKES_IMAGE)" ] && kill -0 $(MAKES_IMAGE) 2> /dev/null; do sleep 1; done
	$(MAKE) --no-print-directory ros
	$(ROS_TESTS) || $(ROS_TESTS) --last-failed --last-failed-no-failures none
	$(MAKE) --no-print-directory -j 2 --output-sync=target test-containers test-processes

# Both wait most of the time, so they run side by side. Tests with an engine look at all that is on it, so one by one.
test-containers:
	$(BIN)/python -m pytest tests/docker

# Two files at a time.
test-processes:
	$(BIN)/python -m pytest -n 2 --dist loadfile tests/e2e tests/integration

# Format, lint, types and the direction of imports.
check: $(READY_DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Throws a second against the raw limit of the same machine, in the same run.
bench: $(READY_DEV) ros
	$(BIN)/python -m bench
	$(ROS_VENV)/bin/python -m bench.backends

# A database as large as a published one, collected in peace and among crashes: the same files. Takes half an hour.
bench-full: $(READY_DEV)
	$(BIN)/python -m bench.full

clean:
	rm -rf $(VENV) $(ROS_VENV) .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
