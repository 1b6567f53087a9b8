"""What all tests ask of the process that runs them."""

from __future__ import annotations

import signal

# Interrupts are tested by sending them. A shell without job control starts what it puts in the background with SIGINT
# ignored, and children inherit that; a handler is not inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)
