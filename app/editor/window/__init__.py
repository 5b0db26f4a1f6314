"""The window of the editor: its events, what is drawn into it, the loop."""
