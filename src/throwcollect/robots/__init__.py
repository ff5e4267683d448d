"""Robots and the tools in their hands: joints, controllers, limits, shapes, and what a robot can do.

It has the only reader of URDF, imports robots from it, and checks motions against limits and obstacles. This room never
steps a world.
"""
