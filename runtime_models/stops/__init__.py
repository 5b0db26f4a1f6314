"""Stops put into finished models, and taken out, without moving the others."""
