"""Physics engines: one world each, stepped by commands of joints; values come in, and numbers go out.

`engine` defines what an engine is; Bullet, MuJoCo and a ballistic one come with the product. This room knows nothing of
configurations, robots or the rules of a trial.
"""
