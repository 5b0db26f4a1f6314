"""GL passes of debug pictures: overdraw, edges of splats."""
