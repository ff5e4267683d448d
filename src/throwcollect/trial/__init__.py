"""What coordinator and simulation agree on about a trial: its lease, and the conditions of its episode."""
