# The tests in groups that run at the same time (`make test`), because one can compute while another waits.
# `make -f .ci/tests.mk units` runs one group, in the environment that `make .venv/.ready-dev` makes.
#
# Each group begins as soon as it can; those that wait for most come first. Most groups are one process each, because
# several processes of pytest-xdist would each find and import the tests of all groups.
PYTEST := .venv/bin/python -m pytest
ROS_PYTEST := .venv-ros/bin/python -m pytest
DATA := $(addprefix tests/unit/,collect/coordinator dataset)
FACES := $(addprefix tests/unit/,cli collect/runs learning publish serve)
OF_RUNS := $(addprefix tests/docker/,test_component.py test_package_in_image.py test_runtime.py)
OF_IMAGE := $(addprefix tests/docker/,test_compose.py test_image.py)
UNITS := data faces nodes
GROUPS := commands-in-containers runs-in-containers processes $(UNITS) ros ros-in-containers image cluster
.PHONY: all check units $(GROUPS) ros-client lerobot wait-for-image wait-for-cluster
all: check $(GROUPS)
units: $(UNITS)

check:
	$(MAKE) check

# Continuous integration makes the image and the cluster meanwhile, and names the processes that do.
wait-for-image: MAKER = $(MAKES_IMAGE)
wait-for-cluster: MAKER = $(MAKES_CLUSTER)
wait-for-image wait-for-cluster:
	@while [ -n "$(MAKER)" ] && kill -0 $(MAKER) 2> /dev/null; do sleep 1; done

commands-in-containers: wait-for-image
	$(PYTEST) tests/docker $(addprefix --ignore=,$(OF_RUNS) $(OF_IMAGE))
runs-in-containers: wait-for-image
	$(PYTEST) $(OF_RUNS)
image: wait-for-image
	$(PYTEST) $(OF_IMAGE)
# Two files at a time, in their order: files of few long tests come first, so both processes are busy until the end.
processes: wait-for-image
	$(PYTEST) -n 2 --dist loadfile --no-loadscope-reorder tests/e2e tests/integration

data:
	$(PYTEST) $(DATA)
faces:
	$(PYTEST) $(FACES)
nodes:
	$(PYTEST) tests/unit tests/install tests/rclzenoh tests/contract tests/physics $(addprefix --ignore=,$(DATA) $(FACES))

# On Fast DDS, nodes at times do not find each other, so these tests are marked as flaky (tests/fast_dds.py).
ros:
	$(MAKE) ros
	$(ROS_PYTEST) -n 2 --dist loadfile tests/contract tests/ros --ignore=tests/ros/test_containers.py
# After the others, because nodes find each other late where many groups run at once.
ros-in-containers: ros wait-for-image
	$(ROS_PYTEST) tests/ros/test_containers.py

# Slurm with four nodes of this machine, and Apptainer; `.ci/cluster.sh` installs both on Debian.
cluster: wait-for-image wait-for-cluster
	$(PYTEST) tests/cluster

# Not in `make test`: the ROS client alone, for those who change it; and the export to LeRobot, which needs Python 3.12,
# and 7 GB for torch.
ros-client:
	$(PYTEST) -n logical tests/rclzenoh tests/contract tests/unit/ros tests/unit/cli/ros
lerobot:
	.venv/bin/uv venv --quiet --allow-existing --python 3.12 .venv-lerobot
	.venv/bin/uv pip install --quiet --python .venv-lerobot -e '.[collect,export]' 'lerobot[dataset]==0.6.1' \
	    pytest psutil hypothesis
	HF_HUB_OFFLINE=1 .venv-lerobot/bin/python -m pytest tests/unit/publish/export/test_lerobot.py \
	    tests/unit/publish/export/test_exporting_page.py tests/e2e/test_policy_lerobot.py
