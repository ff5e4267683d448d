"""Trials before they run: samplers draw the swept values, and the plan freezes them in their order.

It has leases and conditions, too: what coordinator and simulation must agree on for a trial. This room never looks at
results, so a plan never grows.
"""
