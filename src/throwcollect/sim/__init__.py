"""One trial: a world of an engine, the controllers of its limbs and its clock; `Simulator.run(trial)` gives an episode.

Nodes, replays, scores and environments are loops over it. This room knows neither ROS nor files.
"""
