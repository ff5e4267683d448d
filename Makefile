# Two commands do everything on a fresh machine: `make up` collects a first dataset, `make test` passes the tests.
# `make up PYTHON=python3.10` takes another Python than the one that packaging/environment.sh finds.
BIN := .venv/bin
# Bytecode is kept even where the environment forbids it: every node is a process that starts twice as fast with it.
export PYTHONDONTWRITEBYTECODE :=
.PHONY: up ros test test-fast check docs bench bench-peers bench-full image sif sif-without-engine dist clean named

# From Python 3.12 on, there is no pybullet.
up: .venv/.ready
	$(BIN)/throwcollect up -n 2 configs/quickstart.yaml \
	    $$($(BIN)/python -c 'import sys; print("--set sim.engine=mujoco" * (sys.version_info >= (3, 12)))')
	@command -v throwcollect > /dev/null \
	    || echo "so that the shell finds throwcollect: export PATH=\"$$PWD/$(BIN):\$$PATH\""

# A Python that is named is compared with that of the environment.
.venv/.ready: pyproject.toml uv.lock $(if $(PYTHON),named)
	@packaging/environment.sh .venv "$(PYTHON)" collect docker report export serve
	@touch $@
.venv/.ready-dev: pyproject.toml uv.lock $(if $(PYTHON),named)
	@packaging/environment.sh .venv "$(PYTHON)" dev
	@touch .venv/.ready $@
ros: .venv/.ready-dev  # genuine rclpy: `.venv-ros/bin/python -m pytest tests/ros`
	packaging/ros_environment.sh
test: .venv/.ready-dev  # `make -f .ci/tests.mk GROUP` runs one of the groups that run at the same time
	$(MAKE) -f .ci/tests.mk --no-print-directory --output-sync=target -j 5
# All but what writes, reads, learns from, serves, draws or simulates whole datasets: less than a minute on two cores.
SLOW := cli collect dataset engines learning publish replay serve sim test_simulator.py wheels
test-fast: .venv/.ready-dev
	$(BIN)/python -m pytest -n logical tests/architecture tests/contract tests/unit $(SLOW:%=--ignore=tests/unit/%)
check: .venv/.ready-dev
	$(BIN)/ruff format --check . && $(BIN)/ruff check . && $(BIN)/mypy && $(BIN)/lint-imports
	$(BIN)/python -m pytest -q tests/architecture
docs: .venv/.ready-dev  # build/site/index.html; a broken link fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
bench: .venv/.ready-dev ros  # `make bench BEFORE=REVISION` measures that commit, too
	$(BIN)/python -m bench $(if $(BEFORE),--before '$(BEFORE)')
	.venv-ros/bin/python -m bench.backends
bench-peers: .venv/.ready-dev  # other packages in environments of their own: 3 GB to download, 7.5 GB on disk
	$(BIN)/python -m bench.peers --figure docs/pictures/peers.svg
bench-full: .venv/.ready-dev
	for engine in bullet mujoco; do $(BIN)/python -m bench.full --engine $$engine || exit; done

# docs/running.md: BUILD has further options, SIF another name. gzip would take four times as long for the same size.
SIF := throwcollect.sif
LABELS = $$($(firstword $(wildcard $(BIN)/python) python3) docker/build_arguments.py)
VERSION = $(shell sed -n 's/^__version__ = "\(.*\)"/\1/p' src/throwcollect/version.py)
APPTAINER := apptainer build --force --mksquashfs-args '-comp zstd -Xcompression-level 3'
image:
	labels=$(LABELS) && \
	    docker build -f docker/Dockerfile --target throwcollect -t throwcollect:$(VERSION) $$labels $(BUILD) .
sif:
	$(APPTAINER) $(BUILD) '$(SIF)' docker-daemon:throwcollect:$(VERSION)
sif-without-engine:
	labels=$(LABELS) && $(APPTAINER) $$labels $(BUILD) '$(SIF)' docker/throwcollect.def
dist: .venv/.ready-dev  # CONTRIBUTING.md
	rm -rf dist
	$(BIN)/uv build && $(BIN)/uvx twine check --strict dist/*
	$(BIN)/uv run --isolated --no-project --with dist/*.whl throwcollect config configs/quickstart.yaml > /dev/null
clean:
	rm -rf .venv .venv-ros .venv-lerobot .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
