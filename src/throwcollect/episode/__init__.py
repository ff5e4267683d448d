"""The recording of one trial: samples, contacts and results of goals, and the MCAP chunks of CDR messages with them.

It defines topics, channels, frames and signatures. This room never opens a file.
"""
