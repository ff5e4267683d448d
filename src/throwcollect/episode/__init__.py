"""The recording of one trial: samples, contacts and results of goals, and the MCAP chunks that hold them."""
