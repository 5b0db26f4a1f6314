"""What is open, chosen, edited and set: no window, no imgui."""
