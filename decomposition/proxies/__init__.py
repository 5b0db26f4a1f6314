"""What the physics touches of an object instead of its splats, chosen by silhouettes."""
