"""What a session in a headset is opened with, goes on in, and leaves behind."""
