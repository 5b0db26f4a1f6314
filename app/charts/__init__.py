"""What settings save and cost: measured, drawn, and chosen by for a budget."""
