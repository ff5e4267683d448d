"""One process that serves a page, a REST interface, the state of all runs and rosbridge on one port."""
