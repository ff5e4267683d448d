# Apptainer and Singularity read this before anything of the image is run. Unlike a container of Docker, theirs shares
# /tmp, the network and the environment with the host, and with all its users.

# Python's variables of the host are about the host's Python. They cannot be taken away, only emptied.
export PYTHONPATH= PYTHONHOME= PYTHONSTARTUP=
# The host is known, and so is the directory of a dataset: paths inside are those of the host.
unset THROWCOLLECT_HOST THROWCOLLECT_DIRECTORY
# A file in /tmp that every node of every user would touch; nobody asks for it where there is no health check.
unset THROWCOLLECT_HEARTBEAT
# Logs of rclpy in a directory of /tmp that belongs to whoever came first.
export ROS_LOG_DIR="/tmp/throwcollect-ros-$(id -u)"
# Whoever is on the machine may join nodes on Fast DDS; the embedded backend asks for the key of the run.
export THROWCOLLECT_ROS=embedded
# Arguments of `run` are not evaluated by a shell once more.
export SINGULARITY_NO_EVAL=1
