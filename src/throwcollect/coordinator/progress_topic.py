"""The topic on which the coordinator tells its progress: a std_msgs/String of JSON, for whoever comes, however late."""

from __future__ import annotations

from throwcollect import ros
from throwcollect.ros import DurabilityPolicy

PROGRESS_TOPIC = "/coordinator/progress"
PROGRESS_QOS = ros.QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
