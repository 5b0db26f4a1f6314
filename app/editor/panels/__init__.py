"""What ImGui draws over the picture: panel, sections, slider, status line, theme."""
