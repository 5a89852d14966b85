"""Instants and durations: epochs in two parts, time scales, calendar text."""
