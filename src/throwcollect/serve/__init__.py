"""One process that serves the page, the REST interface, the state of all runs and rosbridge on one port.

Routes check who asks, call functions of other rooms, and return their values as JSON. This room never begins, scales or
ends a run in a way of its own, and never writes into a dataset.
"""
