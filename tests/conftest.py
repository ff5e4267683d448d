"""What all tests rely on."""

import signal

# Whoever starts the tests in the background may have SIGINT ignored, which all processes that they start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)
