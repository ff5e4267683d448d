#!/bin/sh
# Makes `.venv-ros`, which has genuine rclpy on top of `.venv`: all that is not ROS is there once, in one version.
set -eu
wheels=build/wheelhouse-ros
.venv/bin/python packaging/ros_wheels.py $wheels
! [ .venv-ros/.ready -nt $wheels/made-from.sha256 ] || exit 0
rm -rf .venv-ros
.venv/bin/uv venv --quiet --python .venv/bin/python .venv-ros
.venv/bin/uv pip install --quiet --python .venv-ros --no-deps $(ls $wheels/*.whl | grep -v /numpy-)
packages='import sysconfig; print(sysconfig.get_path("purelib"))'
echo "import site; site.addsitedir(r'$(.venv/bin/python -c "$packages")')" \
    > "$(.venv-ros/bin/python -c "$packages")/development.pth"
# Without rclpy, tests would be skipped and nobody would notice.
.venv-ros/bin/python -c "import rclpy, control_msgs, simulation_interfaces"
touch .venv-ros/.ready
