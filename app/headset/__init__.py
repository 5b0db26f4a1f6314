"""launch.py vr: the viewer's counterpart in a headset."""
