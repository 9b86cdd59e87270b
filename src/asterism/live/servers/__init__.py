"""Servers that speak the vendors' protocols."""
