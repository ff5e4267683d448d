"""Where the nodes of a run live: start them, watch them, restart them, stop them."""
