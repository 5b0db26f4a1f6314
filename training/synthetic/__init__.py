"""Captures that we make ourselves: a small ray tracer and the places it photographs."""
