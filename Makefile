# Two commands do everything on a fresh machine: `make up` collects a first dataset, `make test` passes the tests.
# `make up PYTHON=python3.10` takes another Python than the one that is found.
PYTHON ?=
# Some shells leave the ~ of `make PYTHON=~/...` as it is; below, the path is quoted, as it may have blanks.
override PYTHON := $(PYTHON:~/%=$(HOME)/%)
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

# An environment that could not be finished has a Python, and would be taken for one that is ready.
.DELETE_ON_ERROR:

.PHONY: up ros dist test test-fast \
    test-units test-units-of-data test-units-of-faces test-units-of-nodes test-ros test-ros-client test-lerobot wait-for-image wait-for-cluster \
    test-containers test-containers-of-commands test-containers-of-runs test-containers-of-ros test-image test-processes test-cluster image sif \
    sif-without-engine \
    check check-format check-types check-imports check-house docs bench bench-full clean

# Where the Python is too new for pybullet, MuJoCo simulates; `packaging/environment.sh` has said so.
up: $(READY)
	@test -z "$(PYTHON)" || test "$$("$(PYTHON)" -V 2> /dev/null)" = "$$($(BIN)/python -V)" || { echo "$(VENV) has $$($(BIN)/python -V), \
	$$("$(PYTHON)" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 15))' 2> /dev/null && \
	echo "not that of $(PYTHON): rm -r $(VENV), then make up PYTHON=$(PYTHON)" || \
	echo "and $(PYTHON) is no Python from 3.10 to 3.14: make up takes the one that is there")" >&2; exit 1; }
	$(BIN)/throwcollect up -n 2 configs/quickstart.yaml \
	    $$($(BIN)/python -c 'import sys; print("--set sim.engine=mujoco" * (sys.version_info >= (3, 12)))')
	@command -v throwcollect > /dev/null || echo "so that the shell finds throwcollect: export PATH=\"$$PWD/$(BIN):\$$PATH\""

$(VENV)/bin/python:
	@packaging/environment.sh $(VENV) "$(PYTHON)"

# Pinocchio loads this library, and no wheel brings it. Who lacks it hears of it before anything is downloaded.
define find_libgomp
@$(BIN)/python -c 'import ctypes, sys; sys.platform != "linux" or ctypes.CDLL("libgomp.so.1")' 2> /dev/null || \
    { echo "libgomp.so.1 is missing, which simulating needs: sudo apt install libgomp1, then make again" >&2; exit 1; }
endef

INSTALL := packaging/install.sh $(BIN)/python

$(READY): pyproject.toml | $(VENV)/bin/python
	$(find_libgomp)
	@# MuJoCo is smaller than pybullet, in whose place it is installed where the Python is too new for that.
	@$(BIN)/python -c 'import sys; print("installing about 80 packages into $(VENV):", "480 MB to download, 1.7 GB" \
	    if sys.version_info >= (3, 12) else "500 MB to download, 1.8 GB", "with the description of the robot")'
	$(INSTALL) -e '.[collect,docker,report,export,serve]'
	@touch $@

$(READY_DEV): pyproject.toml | $(VENV)/bin/python
	@$(BIN)/python -c 'import sys; sys.version_info[:2] == (3, 11) or sys.exit("the tests need Python 3.11, the only one for which there \
	are wheels of pybullet and of genuine ROS 2, and $(VENV) has another: rm -r $(VENV), then make PYTHON=/path/to/python3.11 test")'
	$(find_libgomp)
	@echo "installing about 140 packages into $(VENV): 600 MB to download, 2 GB with the robot's description"
	$(INSTALL) -e '.[dev]'
	@touch $(READY) $@

# An environment with genuine rclpy on top of the one for development: `.venv-ros/bin/python -m pytest tests/ros`.
ros: $(READY_DEV)
	$(BIN)/python packaging/ros_wheels.py $(ROS_WHEELS)
	@$(MAKE) --no-print-directory $(READY_ROS)

# NumPy and all that is not ROS comes from that other environment, so that it is there once, in one version.
$(READY_ROS): $(ROS_WHEELS)/made-from.sha256 | $(READY_DEV)
	rm -rf $(ROS_VENV)
	$(BIN)/uv venv --quiet --python $(BIN)/python $(ROS_VENV)
	$(BIN)/uv pip install --quiet --python $(ROS_VENV)/bin/python --no-deps $$(ls $(ROS_WHEELS)/*.whl | grep -v /numpy-)
	$(ROS_VENV)/bin/python -c "import os, sysconfig; print('import site; site.addsitedir(' \
	    + repr(sysconfig.get_path('purelib', vars={'base': os.path.abspath('$(VENV)')})) + ')')" > $@.pth
	mv $@.pth "$$($(ROS_VENV)/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/development.pth"
	@# Without rclpy, tests would be skipped and nobody would notice.
	$(ROS_VENV)/bin/python -c "import rclpy, control_msgs, simulation_interfaces"
	touch $@

# What a contributor runs in between, in less than a minute on two cores: the rules of the house, the API of nodes on the embedded
# backend, and all units but those that write, read, learn from, serve, draw or simulate whole datasets.
SLOW := cli coordinator dataset derive engines export learning replay report runs runtimes serve sim test_simulator.py view wheels
test-fast: $(READY_DEV)
	$(BIN)/python -m pytest -n logical tests/architecture tests/contract tests/unit $(addprefix --ignore=tests/unit/,$(SLOW))

# What waits for others is run beside what computes, and each group begins as soon as it can, so that both cores always have something
# to do. Tests of containers wait for most, so they begin as soon as there is an image; next come those of processes, which compute
# most. Continuous integration makes the image and the cluster meanwhile, and names the processes that do.
BESIDE := --no-print-directory --output-sync=target
test: $(READY_DEV)
	$(MAKE) $(BESIDE) -j 2 check
	$(MAKE) $(BESIDE) -j 5 test-containers-of-commands test-containers-of-runs test-processes test-units test-ros test-containers \
	    test-image test-cluster

# The ROS client alone, on the embedded backend: what somebody runs who changes it.
test-ros-client: $(READY_DEV)
	$(BIN)/python -m pytest -n logical tests/rclzenoh tests/contract tests/unit/ros tests/unit/cli/ros

# Each group is one process: several of pytest-xdist would each find and import the tests of all groups. There are three groups, so
# that two cores have something to do while a test waits, for a client that never reads or for a pause.
DATA := $(addprefix tests/unit/,coordinator dataset)
FACES := $(addprefix tests/unit/,cli derive export learning report runs serve view)
test-units: test-units-of-data test-units-of-faces test-units-of-nodes

test-units-of-data:
	$(BIN)/python -m pytest $(DATA)

test-units-of-faces:
	$(BIN)/python -m pytest $(FACES)

test-units-of-nodes:
	$(BIN)/python -m pytest tests/unit tests/install tests/rclzenoh tests/contract tests/physics \
	    $(addprefix --ignore=,$(DATA) $(FACES))

wait-for-image: MAKER = $(MAKES_IMAGE)
wait-for-cluster: MAKER = $(MAKES_CLUSTER)
wait-for-image wait-for-cluster:
	@while [ -n "$(MAKER)" ] && kill -0 $(MAKER) 2> /dev/null; do sleep 1; done

# LeRobot and torch need Python 3.12, and 7 GB; what needs them is skipped elsewhere.
LEROBOT_VENV := .venv-lerobot
test-lerobot: $(LEROBOT_VENV)/.ready
	HF_HUB_OFFLINE=1 $(LEROBOT_VENV)/bin/python -m pytest tests/unit/export/test_lerobot.py \
	    tests/unit/export/test_exporting_page.py tests/e2e/test_policy_lerobot.py

$(LEROBOT_VENV)/.ready: pyproject.toml | $(READY_DEV)
	$(BIN)/uv venv --quiet --python 3.12 $(LEROBOT_VENV)
	$(BIN)/uv pip install --quiet --python $(LEROBOT_VENV)/bin/python -e '.[collect,export]' 'lerobot[dataset]==0.6.1' pytest psutil hypothesis
	touch $@

# These tests of genuine ROS 2 need an engine, too.
WITH_ENGINE := tests/ros/test_containers.py

# On Fast DDS, nodes at times do not find each other, so these tests are marked as flaky (tests/fast_dds.py).
test-ros: ros
	$(ROS_VENV)/bin/python -m pytest -n 2 --dist loadfile tests/contract tests/ros --ignore=$(WITH_ENGINE)

# Three groups that take about as long, as tests of containers wait more than they compute; each looks at its own runs alone.
OF_RUNS := $(addprefix tests/docker/,test_component.py test_package_in_image.py test_runtime.py)
OF_IMAGE := $(addprefix tests/docker/,test_compose.py test_image.py)
test-containers: test-containers-of-commands test-containers-of-runs test-containers-of-ros

test-containers-of-commands: wait-for-image
	$(BIN)/python -m pytest tests/docker $(addprefix --ignore=,$(OF_RUNS) $(OF_IMAGE))

# After the other tests of genuine ROS 2, whose nodes find each other late where many groups run at once.
test-containers-of-ros: test-ros wait-for-image
	$(ROS_VENV)/bin/python -m pytest $(WITH_ENGINE)

test-containers-of-runs: wait-for-image
	$(BIN)/python -m pytest $(OF_RUNS)

test-image: wait-for-image
	$(BIN)/python -m pytest $(OF_IMAGE)

# Two files at a time, in their order: files of few long tests come first, and short ones at the end, so that both processes have
# something to do until then.
test-processes: wait-for-image
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder tests/e2e tests/integration

# Slurm with four nodes of this machine, and Apptainer; `.ci/cluster.sh` installs both on Debian.
test-cluster: wait-for-image wait-for-cluster
	$(BIN)/python -m pytest tests/cluster

# Format, lint, types, the direction of imports, and the rules of the house; its tests build the documentation site, too.
check: check-format check-types check-imports check-house

check-format: $(READY_DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

check-types: $(READY_DEV)
	$(BIN)/mypy

check-imports: $(READY_DEV)
	$(BIN)/lint-imports

check-house: $(READY_DEV)
	$(BIN)/python -m pytest -q tests/architecture

# The image of this clone, labelled with its sources (docs/running.md). BUILD has further options of the program that builds.
BUILD :=
VERSION = $(shell sed -n 's/^__version__ = "\(.*\)"/\1/p' src/throwcollect/version.py)
SIF := throwcollect.sif
# gzip, which is the default, takes four times as long for the same size.
BUILD_SIF := apptainer build --force --mksquashfs-args '-comp zstd -Xcompression-level 3'

image: | $(VENV)/bin/python
	labels=$$($(BIN)/python docker/build_arguments.py) && \
	    docker build -f docker/Dockerfile --target throwcollect -t throwcollect:$(VERSION) $$labels $(BUILD) .

# The same for Apptainer: converted from the image of the engine, or built from the clone where there is no engine.
sif:
	$(BUILD_SIF) $(BUILD) '$(SIF)' docker-daemon:throwcollect:$(VERSION)

sif-without-engine: | $(VENV)/bin/python
	labels=$$($(BIN)/python docker/build_arguments.py) && $(BUILD_SIF) $$labels $(BUILD) '$(SIF)' docker/throwcollect.def

# The documentation site, build/site/index.html; a broken link fails.
docs: $(READY_DEV)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Throws a second against the raw limit of the same machine, in the same run; `make bench BEFORE=REVISION` measures that commit beside it.
bench: $(READY_DEV) ros
	$(BIN)/python -m bench $(if $(BEFORE),--before '$(BEFORE)')
	$(ROS_VENV)/bin/python -m bench.backends

# A database as large as a published one, collected in peace and among crashes, with either engine: the same files. Takes a quarter of an hour.
bench-full: $(READY_DEV)
	$(BIN)/python -m bench.full --engine bullet
	$(BIN)/python -m bench.full --engine mujoco

# What is published (CONTRIBUTING.md): checked, and tried in an environment of its own.
dist: | $(VENV)/bin/python
	rm -rf dist build/release build/tried
	packaging/environment.sh build/release $(BIN)/python
	build/release/bin/python -m pip install --quiet --disable-pip-version-check build twine
	build/release/bin/python -m build
	build/release/bin/twine check --strict dist/*
	packaging/environment.sh build/tried $(BIN)/python
	build/tried/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	build/tried/bin/throwcollect --version
	build/tried/bin/throwcollect config configs/quickstart.yaml > build/tried/config.yaml

clean:
	rm -rf $(VENV) $(ROS_VENV) $(LEROBOT_VENV) .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
