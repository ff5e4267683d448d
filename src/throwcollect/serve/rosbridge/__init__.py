"""rosbridge v2: web pages and programs without ROS take part in the ROS graph of a run over a WebSocket."""

from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.requests import Requests
from throwcollect.serve.rosbridge.websocket import attend

__all__ = ["Bridge", "Requests", "attend"]
