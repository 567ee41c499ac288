"""Ctrl-C as in a terminal: a shell ignores it in jobs of the background, and their programs inherit that."""

import signal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
