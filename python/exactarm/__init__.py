"""exactarm: calibration, diagnosis and offline planning for serial industrial robots."""

__version__ = "0.1.0"
