"""Kalman filter and smoother over many tracks at once."""

from asterism.filter.kalman import States, filter_states, smooth

__all__ = ["States", "filter_states", "smooth"]
