"""Tools of the desktop in a hand of the headset: sections, regions, paint, heat and lengths."""
