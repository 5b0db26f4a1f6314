"""What stood behind and under a thing that is taken away: filled, and verified against photos."""
